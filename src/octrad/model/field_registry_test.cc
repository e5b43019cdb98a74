#include <gtest/gtest.h>

#include <algorithm>

#include "octrad/base/error.h"
#include "octrad/model/field_registry.h"
#include "octrad/model/field_test_helper.h"

namespace octrad {
namespace {

using testing::shell;

TEST(Registry, OwnKeysAreKeys) {
  for (const FieldEntry* field : field_entries()) {
    for (const std::string_view begin : field->own_keys) {
      const std::vector<ConfigKey> keys = describe(Config{});
      EXPECT_TRUE(std::any_of(keys.begin(), keys.end(), [&](const ConfigKey& k) { return k.key.rfind(begin, 0) == 0; }))
          << field->name << ": " << begin;
    }
  }
  EXPECT_TRUE(ignores_key(field_entry("nr"), "octree.levels"));
  EXPECT_FALSE(ignores_key(field_entry("octaoctree"), "octree.levels"));
  EXPECT_FALSE(ignores_key(field_entry("nr"), "train.points"));
}

TEST(Registry, UnknownFieldIsRefusedWithASuggestion) {
  Config config;
  config.field = "octaoctre";
  try {
    make_field(config, shell(1));
    FAIL();
  } catch (const UsageError& e) {
    EXPECT_NE(std::string(e.what()).find("octaoctree"), std::string::npos);
  }
}

}  // namespace
}  // namespace octrad
