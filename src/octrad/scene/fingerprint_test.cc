// What a fingerprint covers is tested in load_test.cc.
#include "octrad/scene/fingerprint.h"

#include <gtest/gtest.h>

#include <set>
#include <vector>

namespace octrad {
namespace {

TEST(Fingerprint, EveryByteCounts) {
  // Lengths around the block sizes, zeros included: each single-bit change gives another hash.
  std::set<std::uint64_t> seen;
  std::size_t count = 0;
  for (const std::size_t bytes : {0, 1, 4, 8, 16, 31, 32, 33, 64, 70}) {
    std::vector<unsigned char> data(bytes, 0);
    for (const std::uint64_t seed : {0ull, 1ull, 0xa0761d6478bd642full}) {
      seen.insert(hash_bytes(data.data(), bytes, seed));
      ++count;
      for (std::size_t bit = 0; bit < 8 * bytes; ++bit) {
        data[bit / 8] = static_cast<unsigned char>(1u << (bit % 8));
        seen.insert(hash_bytes(data.data(), bytes, seed));
        ++count;
        data[bit / 8] = 0;
      }
    }
  }
  EXPECT_EQ(seen.size(), count);
}

}  // namespace
}  // namespace octrad
