#include "app/selftest/selftest.h"

namespace octrad::selftest {
namespace {

constexpr Stage kStages[] = {
    {"short training", nullptr, "training has no device path yet"},
    {"frame", nullptr, "rendering has no device path yet"},
};

}  // namespace

std::span<const Stage> stages() { return kStages; }

}  // namespace octrad::selftest
