#include "app/paper/published.h"

#include <array>

namespace octrad::paper {
namespace {

constexpr std::array kCells = {
    PublishedCell{"octaoctree", "bathroom", 0.091, 0.084, 14},
    PublishedCell{"octaoctree", "cornell-box", 0.059, 0.023, 11},
    PublishedCell{"octaoctree", "kitchen", 0.067, 0.079, 20},
    PublishedCell{"octaoctree", "living-room", 0.088, 0.100, 11},
    PublishedCell{"octaoctree", "veach-ajar", 0.092, 0.080, 10},
    PublishedCell{"ncr", "bathroom", 0.099, 0.095, 62},
    PublishedCell{"ncr", "cornell-box", 0.058, 0.042, 42},
    PublishedCell{"ncr", "kitchen", 0.075, 0.083, 73},
    PublishedCell{"ncr", "living-room", 0.136, 0.123, 59},
    PublishedCell{"ncr", "veach-ajar", 0.112, 0.086, 39},
    PublishedCell{"nr", "bathroom", 0.131, 0.088, 28},
    PublishedCell{"nr", "cornell-box", 0.074, 0.048, 20},
    PublishedCell{"nr", "kitchen", 0.087, 0.087, 44},
    PublishedCell{"nr", "living-room", 0.124, 0.111, 23},
    PublishedCell{"nr", "veach-ajar", 0.141, 0.104, 20},
    PublishedCell{"oidn", "bathroom", 0.125, 0.106, 71},
    PublishedCell{"oidn", "cornell-box", 0.076, 0.034, 38},
    PublishedCell{"oidn", "kitchen", 0.090, 0.052, 104},
    PublishedCell{"oidn", "living-room", 0.124, 0.083, 47},
    PublishedCell{"oidn", "veach-ajar", 0.117, 0.113, 40},
    PublishedCell{"nr-rhs", "bathroom", 0.378, 0.699, 229},
    PublishedCell{"nr-rhs", "cornell-box", 0.279, 0.632, 125},
    PublishedCell{"nr-rhs", "kitchen", 0.347, 0.691, 475},
    PublishedCell{"nr-rhs", "living-room", 0.561, 0.754, 173},
    PublishedCell{"nr-rhs", "veach-ajar", 0.514, 0.762, 145},
};

constexpr std::array kSwitches = {
    PublishedSwitch{"levels", "5", 0.178, 0.106, 734275},
    PublishedSwitch{"levels", "6", 0.149, 0.096, 3526245},
    PublishedSwitch{"levels", "7", 0.125, 0.092, 16957768},
    PublishedSwitch{"levels", "8", 0.091, 0.084, 79375000},
    PublishedSwitch{"directions", "full", 0.058, 0.026, 0},
    PublishedSwitch{"directions", "outgoing", 0.067, 0.051, 0},
    PublishedSwitch{"directions", "no-offset", 0.058, 0.039, 0},
    PublishedSwitch{"directions", "traced", 0.053, 0.038, 0},
    PublishedSwitch{"interpolation", "full", 0.060, 0.079, 0},
    PublishedSwitch{"interpolation", "no-octahedral", 0.090, 0.137, 0},
    PublishedSwitch{"interpolation", "no-octree", 0.143, 0.230, 0},
};

}  // namespace

std::span<const PublishedCell> published_cells() { return kCells; }
std::span<const PublishedSwitch> published_switches() { return kSwitches; }

}  // namespace octrad::paper
