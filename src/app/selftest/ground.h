// The scene of checks and stages that trace light, and what several of them share.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "app/selftest/selftest.h"
#include "octrad/transport/queue_math.h"

namespace octrad::selftest {

// The scene that the user gave, else the one that `make` makes. The CPU walks the tree that devices walk: rays are
// compared by checks of their own.
struct Ground {
  std::optional<PreparedScene> own;
  const PreparedScene& use;
  TransportContext context;

  Ground(const Context& c, PreparedScene make());
  Ground(const Ground&) = delete;
  Ground& operator=(const Ground&) = delete;
};

// The first `numbers` of planes in a stream's memory, on the host.
class HostPlanes {
 public:
  HostPlanes(Stream& stream, const float* data, std::size_t stride, int numbers)
      : values_(stride * static_cast<std::size_t>(numbers)),
        stride_(stride) {
    stream.download(values_.data(), data, values_.size() * sizeof(float));
  }
  FloatPlanes planes() { return {values_.data(), stride_}; }

 private:
  std::vector<float> values_;
  std::size_t stride_;
};

template <typename T>
std::vector<T> fetch(Stream& stream, const T* data, std::size_t count) {
  std::vector<T> values(count);
  if (count > 0) stream.download(values.data(), data, count * sizeof(T));
  return values;
}

// Results that hang on decisions by chance: where rounding decides one differently, an item goes its own way. A small
// share may, and no mean may be off because of them.
class Estimates {
 public:
  void add(Vec3f found, Vec3f expected);
  // What of `items` were counted on both sides: rays, queries.
  void add_counts(unsigned long long found, unsigned long long expected) {
    counts_.emplace_back(static_cast<double>(found), static_cast<double>(expected));
  }
  // On the host all agree to within rounding; there it runs the CPU's own code.
  CheckResult result(const Context& c, std::string what, double tolerance, double allowed_share);

 private:
  Errors errors_;
  std::size_t items_ = 0;
  double sum_ = 0.0, square_ = 0.0, size_ = 0.0;
  std::vector<std::pair<double, double>> counts_;
};

}  // namespace octrad::selftest
