// Without libFuzzer, in the ordinary tests: every file of tests/fuzz/found once through the reader that it broke, and
// what a few thousand blind changes make of it. Where OCTRAD_FUZZ_SEEDS names what make_seeds.py made, each of those
// too.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "octrad/base/rng.h"
#include "targets.h"

namespace octrad::fuzz {
namespace {

namespace fs = std::filesystem;

// Sorted.
std::vector<fs::path> files_of(const fs::path& folder) {
  std::vector<fs::path> files;
  if (fs::is_directory(folder)) {
    for (const auto& entry : fs::directory_iterator(folder)) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::string content(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

class Replay : public ::testing::TestWithParam<Target> {
 protected:
  static void SetUpTestSuite() { prepare(); }
};

TEST_P(Replay, WhatWasFoundIsRead) {
  for (const fs::path& file : files_of(fs::path(OCTRAD_FUZZ_FILES) / GetParam().name)) {
    SCOPED_TRACE(file.string());
    const std::string bytes = content(file);
    EXPECT_NO_THROW(GetParam().run(bytes));
    for (std::size_t i = 0; i < 200 && !bytes.empty(); ++i) {
      Rng rng(1, RngPurpose::test, i);
      std::string changed = bytes;
      changed[rng.below(static_cast<std::uint32_t>(bytes.size()))] = static_cast<char>(rng.below(256));
      EXPECT_NO_THROW(GetParam().run(changed));
    }
  }
}

TEST_P(Replay, SeedsAreRead) {
  const char* seeds = std::getenv("OCTRAD_FUZZ_SEEDS");
  if (seeds == nullptr) GTEST_SKIP() << "OCTRAD_FUZZ_SEEDS is not set";
  const std::vector<fs::path> files = files_of(fs::path(seeds) / GetParam().name);
  EXPECT_FALSE(files.empty());
  for (const fs::path& file : files) EXPECT_NO_THROW(GetParam().run(content(file))) << file;
}

TEST_P(Replay, NothingAndOneByte) {
  EXPECT_NO_THROW(GetParam().run(""));
  for (int c = 0; c < 256; ++c) EXPECT_NO_THROW(GetParam().run(std::string(1, static_cast<char>(c))));
}

INSTANTIATE_TEST_SUITE_P(Readers, Replay, ::testing::ValuesIn(targets().begin(), targets().end()),
                         [](const auto& of) { return std::string(of.param.name); });

TEST(Targets, UnknownNamesAreListed) { EXPECT_THROW(find_target("x"), std::runtime_error); }

}  // namespace
}  // namespace octrad::fuzz
