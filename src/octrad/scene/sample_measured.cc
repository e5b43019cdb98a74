#include "octrad/scene/sample_measured.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

#include "octrad/base/vec.h"

namespace octrad::testing {
namespace {

struct SampleTensor {
  std::string name;
  std::vector<std::uint64_t> shape;
  std::vector<double> values;  // floats in the file, or with `bytes` bytes
  bool bytes = false;
};

template <typename T>
void append(std::string& to, T value) {
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  to.append(bytes, sizeof value);
}

std::string tensor_file(const std::vector<SampleTensor>& tensors) {
  std::string head("tensor_file\0\1\0", 14), data;
  append(head, static_cast<std::uint32_t>(tensors.size()));
  std::size_t begin = head.size();
  for (const SampleTensor& t : tensors) begin += 2 + t.name.size() + 2 + 1 + 8 + 8 * t.shape.size();
  for (const SampleTensor& t : tensors) {
    append(head, static_cast<std::uint16_t>(t.name.size()));
    head += t.name;
    append(head, static_cast<std::uint16_t>(t.shape.size()));
    append(head, static_cast<std::uint8_t>(t.bytes ? 1 : 10));
    append(head, static_cast<std::uint64_t>(begin + data.size()));
    for (const std::uint64_t n : t.shape) append(head, n);
    for (const double v : t.values) {
      if (t.bytes) append(data, static_cast<std::uint8_t>(v));
      else append(data, static_cast<float>(v));
    }
  }
  return head + data;
}

Vec3d direction(double theta, double phi) {
  return {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
}

}  // namespace

std::string measured_sample_file(int part, bool spectra) {
  constexpr double pi = 3.14159265358979323846;
  constexpr int kTheta = 5, kWidth = 16, kHeight = 9, kSide = 8;
  const bool isotropic = part == 0 || part == 8;
  const double ax = isotropic ? 0.5 : 0.25, ay = isotropic ? 0.5 : 0.6;
  SampleTensor phi{"phi_i", {}, {}}, theta{"theta_i", {kTheta}, {}}, ndf{"ndf", {kHeight, kWidth}, {}},
      sigma{"sigma", {kHeight, kWidth}, {}};
  if (part == 0) phi.values = {0.0};
  if (part == 8) phi.values = {-pi, pi};
  for (int i = 0; !isotropic && i < 5; ++i) phi.values.push_back(-pi + 2.0 * pi / part * i / 4.0);
  phi.shape = {phi.values.size()};
  for (int i = 0; i < kTheta; ++i) theta.values.push_back(0.35 * i);
  const auto density = [&](Vec3d m) {
    const double q = m.x * m.x / (ax * ax) + m.y * m.y / (ay * ay) + m.z * m.z;
    return 1.0 / (pi * ax * ay * q * q);
  };
  const auto normal = [&](int x, int y) {
    const double u = static_cast<double>(x) / (kWidth - 1), v = static_cast<double>(y) / (kHeight - 1);
    return std::pair(0.5 * pi * u * u, (2.0 * v - 1.0) * pi);
  };
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const auto [t, p] = normal(x, y);
      const Vec3d m = direction(t, p);
      ndf.values.push_back(density(m));
      sigma.values.push_back(0.5 * (m.z + std::sqrt(m.z * m.z + ax * ax * m.x * m.x + ay * ay * m.y * m.y)));
    }
  }
  const std::uint64_t nodes = phi.shape[0];
  SampleTensor vndf{"vndf", {nodes, kTheta, kHeight, kWidth}, {}},
      luminance{"luminance", {nodes, kTheta, kSide, kSide}, {}}, rgb{"rgb", {nodes, kTheta, 3, kSide, kSide}, {}};
  if (spectra) rgb = {"spectra", {nodes, kTheta, 4, kSide, kSide}, {}};
  const double tint[] = {0.8, 0.6, 0.4};
  for (const double p_o : phi.values) {
    for (int j = 0; j < kTheta; ++j) {
      const Vec3d view = direction(theta.values[static_cast<std::size_t>(j)], isotropic ? 0.0 : p_o);
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          const auto [t, p] = normal(x, y);
          const Vec3d m = direction(t, p);
          const double u = static_cast<double>(x) / (kWidth - 1);
          vndf.values.push_back(std::max(0.0, dot(view, m)) * density(m) * u * std::sin(t) + 1e-3);
        }
      }
      const auto bright = [&](int x, int y) { return 1.0 + 0.5 * x / (kSide - 1) + 0.25 * y / (kSide - 1) + 0.1 * j; };
      for (int y = 0; y < kSide; ++y) {
        for (int x = 0; x < kSide; ++x) luminance.values.push_back(bright(x, y));
      }
      for (const double share : {0.2, 0.4, 0.8, 0.6}) {
        for (int i = 0; spectra && i < kSide * kSide; ++i) rgb.values.push_back(share * bright(i % kSide, i / kSide));
      }
      for (int c = 0; c < 3 && !spectra; ++c) {
        for (int y = 0; y < kSide; ++y) {
          for (int x = 0; x < kSide; ++x) {
            const double color = tint[c] * (1.0 + 0.2 * (c - 1) * x / (kSide - 1));
            rgb.values.push_back((part == 8 ? 0.1 : 1.0) * color * bright(x, y) / (1.375 + 0.1 * j));
          }
        }
      }
    }
  }
  std::vector<SampleTensor> tensors = {{"description", {1}, {'-'}, true},
                                       {"jacobian", {1}, {part == 8 ? 0.0 : 1.0}, true},
                                       phi,
                                       theta,
                                       ndf,
                                       sigma,
                                       vndf,
                                       luminance,
                                       rgb};
  if (spectra) tensors.push_back({"wavelengths", {4}, {400.0, 500.0, 600.0, 700.0}});
  return tensor_file(tensors);
}

}  // namespace octrad::testing
