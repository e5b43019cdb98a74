#include <gtest/gtest.h>

#include <algorithm>

#include "octrad/scene/plugin_help.h"
#include "octrad/scene/plugins.h"

namespace octrad {
namespace {

TEST(PluginHelp, HasEveryTypeOnce) {
  const auto plugins = plugin_types();
  const std::vector<PluginKindHelp>& help = plugin_help();
  ASSERT_EQ(help.size(), plugins.size());
  for (std::size_t i = 0; i < help.size(); ++i) {
    EXPECT_EQ(help[i].tag, plugins[i].first);
    std::vector<std::string> helped, known = plugins[i].second;
    for (const PluginHelp& entry : help[i].entries) helped.insert(helped.end(), entry.types.begin(), entry.types.end());
    std::ranges::sort(helped);
    std::ranges::sort(known);
    EXPECT_EQ(helped, known) << help[i].tag;
  }
}

// As docs/scenes.md says "the same" there.
TEST(PluginHelp, AnEntryGoesOnFromTheOneBefore) {
  int count = 0;
  for (const PluginKindHelp& kind : plugin_help()) {
    const PluginHelp* before = nullptr;
    for (const PluginHelp& entry : kind.entries) {
      if (!entry.as.empty()) {
        ++count;
        ASSERT_NE(before, nullptr);
        EXPECT_NE(std::ranges::find(before->types, entry.as), before->types.end()) << entry.types.front();
      }
      before = &entry;
    }
  }
  EXPECT_GT(count, 0);
}

TEST(PluginHelp, TextsAreOneLine) {
  for (const PluginKindHelp& kind : plugin_help()) {
    for (const PluginHelp& entry : kind.entries) {
      EXPECT_FALSE(entry.text.empty()) << entry.types.front();
      EXPECT_EQ(entry.text.find_first_of("\n|"), std::string::npos) << entry.types.front();
      EXPECT_EQ(std::ranges::count(entry.text, '`') % 2, 0) << entry.types.front();
    }
  }
}

}  // namespace
}  // namespace octrad
