#include "octrad/base/huge_pages.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

namespace octrad {
namespace {

TEST(HugePages, WhatIsInMemoryStays) {
  // Pieces of many sizes, some of them freed again, so that the heap has gaps.
  std::vector<std::vector<std::uint32_t>> pieces;
  for (std::uint32_t i = 0; i < 2000; ++i) pieces.emplace_back(1 + i * 7 % 3000, i);
  for (std::size_t i = 0; i < pieces.size(); i += 3) pieces[i] = {};
  use_huge_pages();
  use_huge_pages();
  for (std::uint32_t i = 0; i < 2000; ++i) {
    ASSERT_EQ(pieces[i].size(), i % 3 == 0 ? 0 : 1 + i * 7 % 3000);
    for (const std::uint32_t value : pieces[i]) ASSERT_EQ(value, i);
  }
}

}  // namespace
}  // namespace octrad
