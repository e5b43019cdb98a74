#include "octrad/shading/environment_map.h"

#include <algorithm>
#include <cassert>
#include <cmath>

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

EnvironmentMap::EnvironmentMap(const Environment& environment) {
  view_.pixels = environment.pixels.data();
  view_.width = environment.width;
  view_.height = environment.height;
  std::copy(std::begin(environment.to_world), std::end(environment.to_world), view_.to_world_rows);
  set_inverse(environment.to_world, view_);
  // A single row (or a constant) is the same at every latitude: handled as two equal rows of weight sin(theta) would be
  // zero everywhere, so such maps are sampled uniformly.
  if (view_.height < 2) return;
  const std::size_t w = static_cast<std::size_t>(view_.width), h = static_cast<std::size_t>(view_.height);
  ask_memory(h * w * sizeof(AliasEntry), "the environment map's table");
  sines_.resize(h);
  for (std::size_t y = 0; y < h; ++y) {
    sines_[y] = std::max(0.0f, static_cast<float>(std::sin(3.14159265358979323846 * static_cast<double>(y) /
                                                           static_cast<double>(h - 1))));
  }
  rows_.resize(h - 1);
  cells_.resize((h - 1) * w);
  view_.sines = sines_.data();
  view_.rows = rows_.data();
  view_.cells = cells_.data();
  factors_.fill(1.0f);
  view_.factors = factors_.data();
  view_.part_columns = static_cast<float>(kEnvironmentColumns) / static_cast<float>(w);
  view_.part_rows = static_cast<float>(kEnvironmentRows) / static_cast<float>(h);
  build_tables();
}

void EnvironmentMap::set_factors(std::span<const float> factors) {
  assert(factors.size() == factors_.size());
  if (view_.height < 2) return;
  std::copy(factors.begin(), factors.end(), factors_.begin());
  build_tables();
}

void EnvironmentMap::build_tables() {
  const std::size_t w = static_cast<std::size_t>(view_.width), h = static_cast<std::size_t>(view_.height);
  std::vector<double> row_weights(h - 1);
  parallel_for(h - 1, [&](std::size_t y) {
    std::vector<double> weights(w);
    const int iy = static_cast<int>(y);
    for (std::size_t x = 0; x < w; ++x) {
      const int ix = static_cast<int>(x), n = x + 1 == w ? 0 : ix + 1;
      const auto weight = [this](int column, int row) { return static_cast<double>(view_.weight(column, row)); };
      weights[x] = 0.25 * (weight(ix, iy) + weight(n, iy) + weight(ix, iy + 1) + weight(n, iy + 1));
      row_weights[y] += weights[x];
    }
    build_alias(weights.data(), view_.width, cells_.data() + y * w);
  });
  build_alias(row_weights.data(), view_.height - 1, rows_.data());
  double total = 0.0;
  for (const double r : row_weights) total += r;
  if (total > 0.0) view_.inv_integral = static_cast<float>(static_cast<double>((h - 1) * w) / total);
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

void EnvironmentMap::prefetch_table(Vec2f u) const {
  if (view_.height < 2) return;
  const int y = pick_alias(rows_.data(), view_.height - 1, u.y);
  const int x = std::min(static_cast<int>(u.x * static_cast<float>(view_.width)), view_.width - 1);
  prefetch_line(cells_.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(view_.width) + x);
}

void EnvironmentMap::prefetch_pixels(Vec2f u) const {
  if (view_.height < 2) return;
  const std::size_t y = static_cast<std::size_t>(pick_alias(rows_.data(), view_.height - 1, u.y)),
                    w = static_cast<std::size_t>(view_.width);
  const std::size_t x = static_cast<std::size_t>(pick_alias(cells_.data() + y * w, view_.width, u.x));
  for (const std::size_t row : {y * w, (y + 1) * w}) {  // two pixels each, which may lie in two lines
    prefetch_line(view_.pixels + row + x);
    prefetch_line(&view_.pixels[row + (x + 1 == w ? 0 : x + 1)].z);
  }
}

}  // namespace octrad
