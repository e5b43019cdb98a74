// Figures that the paper prints (arXiv 2606.08469), to stand beside measured ones.
#pragma once

#include <span>

namespace octrad::paper {

// How they were obtained.
inline constexpr const char* kPublishedHow =
    "published (arXiv 2606.08469): NVIDIA RTX 3090, 20,000 steps in about one hour, references of 102,400 samples a pixel";

// Table 1: method and scene by the names used here.
struct PublishedCell {
  const char* method;
  const char* scene;
  double mape, lpips, ms;
};
std::span<const PublishedCell> published_cells();

// Table 2 (levels, on Bathroom) and the ablations of section 4.4 (scene not named): by matrix and switch.
struct PublishedSwitch {
  const char* matrix;
  const char* name;
  double mape, lpips;
  long long entries;  // of the table; 0 where none are given
};
std::span<const PublishedSwitch> published_switches();

}  // namespace octrad::paper
