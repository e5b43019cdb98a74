#include "octrad/shading/environment_map.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>
#include <numeric>

#include "octrad/base/memory_limit.h"
#include "octrad/base/prefetch.h"
#include "octrad/base/threads.h"

namespace octrad {
namespace {

// Of a rotation the transpose, to the bit.
void set_inverse(const float* m, EnvironmentView& view) {
  const auto column = [m](int i) { return Vec3d(m[i], m[3 + i], m[6 + i]); };
  for (int i = 0; i < 3; ++i) {
    view.rotates = view.rotates && std::fabs(dot(column(i), column(i)) - 1.0) < 2e-3 &&
                   std::fabs(dot(column(i), column((i + 1) % 3))) < 2e-3;
  }
  const double determinant = dot(column(0), cross(column(1), column(2)));
  if (!view.rotates) view.determinant = static_cast<float>(1.0 / std::fabs(determinant));
  for (int i = 0; i < 3; ++i) {
    const Vec3d row = view.rotates ? column(i) : cross(column((i + 1) % 3), column((i + 2) % 3)) / determinant;
    for (int k = 0; k < 3; ++k) view.to_map_rows[3 * i + k] = static_cast<float>(row[k]);
  }
}

}  // namespace

EnvironmentMap::EnvironmentMap(const Environment& environment, const std::string& of) {
  view_.pixels = environment.pixels.data();
  view_.width = environment.width;
  view_.height = environment.height;
  std::copy(std::begin(environment.to_world), std::end(environment.to_world), view_.to_world_rows);
  set_inverse(environment.to_world, view_);
  // A single row (or a constant) is the same at every latitude: handled as two equal rows of weight sin(theta) would be
  // zero everywhere, so such maps are sampled uniformly.
  if (view_.height < 2) return;
  const std::size_t w = static_cast<std::size_t>(view_.width), h = static_cast<std::size_t>(view_.height);
  ask_memory(h * w * sizeof(AliasEntry), (of.empty() ? of : of + ": ") + "the environment map's table");
  sines_.resize(h);
  for (std::size_t y = 0; y < h; ++y) {
    sines_[y] = std::max(
        0.0f, static_cast<float>(std::sin(std::numbers::pi * static_cast<double>(y) / static_cast<double>(h - 1))));
  }
  rows_.resize((h - 1) * kEnvironmentColumns);
  cells_.resize((h - 1) * w);
  view_.sines = sines_.data();
  view_.rows = rows_.data();
  view_.cells = cells_.data();
  // Sums of weights over the cells of a row in each column of parts.
  std::vector<double> sums((h - 1) * kEnvironmentColumns, 0.0);
  parallel_for(h - 1, [&](std::size_t y) {
    std::vector<double> weights(w);
    const int iy = static_cast<int>(y);
    for (std::size_t x = 0; x < w; ++x) {
      const int ix = static_cast<int>(x), n = x + 1 == w ? 0 : ix + 1;
      const auto weight = [this](int column, int row) { return static_cast<double>(view_.weight(column, row)); };
      weights[x] = 0.25 * (weight(ix, iy) + weight(n, iy) + weight(ix, iy + 1) + weight(n, iy + 1));
    }
    for (int c = 0; c < kEnvironmentColumns; ++c) {
      const int first = view_.first_column(c), end = view_.first_column(c + 1);
      for (int x = first; x < end; ++x)
        sums[y * kEnvironmentColumns + static_cast<std::size_t>(c)] += weights[static_cast<std::size_t>(x)];
      build_alias(weights.data() + first, end - first, cells_.data() + y * w + first);
    }
  });
  integrals_.resize(kEnvironmentParts);
  for (int r = 0; r < kEnvironmentRows; ++r) {
    const int first = view_.first_row(r), rows = view_.first_row(r + 1) - first;
    for (int c = 0; c < kEnvironmentColumns; ++c) {
      std::vector<double> weights;
      double total = 0.0;
      for (int y = first; y < first + rows; ++y) {
        weights.push_back(sums[static_cast<std::size_t>(y * kEnvironmentColumns + c)]);
        total += weights.back();
      }
      build_alias(weights.data(), rows, rows_.data() + first * kEnvironmentColumns + c * rows);
      const auto part = static_cast<std::size_t>(r * kEnvironmentColumns + c);
      integrals_[part] = static_cast<float>(total / static_cast<double>((h - 1) * w));
    }
  }
  set_places({{}, integrals_});
}

void EnvironmentMap::set_places(const EnvironmentPlaces& places) {
  if (view_.height < 2) return;
  const auto count = static_cast<std::size_t>(places.grid.count());
  assert(places.shares.size() == count * kEnvironmentParts);
  densities_.assign(places.shares.size(), 0.0f);
  parts_.resize(places.shares.size());
  view_.places = places.grid;
  view_.densities = densities_.data();
  view_.parts = nullptr;
  std::vector<double> weights(kEnvironmentParts);
  const auto weigh = [&](const float* shares) {
    for (std::size_t p = 0; p < weights.size(); ++p)
      weights[p] = integrals_[p] > 0.0f ? static_cast<double>(shares[p]) : 0.0;
    return std::accumulate(weights.begin(), weights.end(), 0.0);
  };
  for (std::size_t i = 0; i < count; ++i) {
    double total = weigh(places.shares.data() + i * kEnvironmentParts);
    if (!(total > 0.0)) total = weigh(integrals_.data());
    if (!(total > 0.0)) return;  // black
    for (std::size_t p = 0; p < weights.size(); ++p) {
      if (weights[p] > 0.0)
        densities_[i * kEnvironmentParts + p] =
            static_cast<float>(weights[p] / total / static_cast<double>(integrals_[p]));
    }
    build_alias(weights.data(), kEnvironmentParts, parts_.data() + i * kEnvironmentParts);
  }
  view_.parts = parts_.data();
}

void EnvironmentMap::build_alias(const double* weights, int count, AliasEntry* out) {
  double total = 0.0;
  for (int i = 0; i < count; ++i) total += weights[i];
  std::vector<double> scaled(static_cast<std::size_t>(count));
  std::vector<int> small, large;
  for (int i = 0; i < count; ++i) {
    const double s = total > 0.0 ? weights[i] * count / total : 1.0;
    scaled[static_cast<std::size_t>(i)] = s;
    (s < 1.0 ? small : large).push_back(i);
  }
  while (!small.empty() && !large.empty()) {
    const int s = small.back(), l = large.back();
    small.pop_back();
    out[s] = {static_cast<float>(scaled[static_cast<std::size_t>(s)]), l};
    double& rest = scaled[static_cast<std::size_t>(l)];
    rest -= 1.0 - scaled[static_cast<std::size_t>(s)];
    if (rest < 1.0) {
      large.pop_back();
      small.push_back(l);
    }
  }
  for (const std::vector<int>* rest : {&small, &large}) {
    for (const int i : *rest) out[i] = {1.0f, i};
  }
}

void EnvironmentMap::prefetch_table(const EnvironmentPick& pick) const {
  const int x = pick.x + static_cast<int>(pick.u.x * static_cast<float>(pick.columns));
  prefetch_line(cells_.data() + static_cast<std::size_t>(pick.y) * static_cast<std::size_t>(view_.width) + x);
}

void EnvironmentMap::prefetch_pixels(const EnvironmentPick& pick) const {
  const std::size_t x = static_cast<std::size_t>(pick.x), y = static_cast<std::size_t>(pick.y),
                    w = static_cast<std::size_t>(view_.width);
  for (const std::size_t row : {y * w, (y + 1) * w}) {  // two pixels each, which may lie in two lines
    prefetch_line(view_.pixels + row + x);
    prefetch_line(&view_.pixels[row + (x + 1 == w ? 0 : x + 1)].z);
  }
}

}  // namespace octrad
