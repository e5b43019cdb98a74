#include "octrad/model/config.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "octrad/base/error.h"

namespace octrad {
namespace {

std::string message(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(Config, PresetsSayWhatTheyStandFor) {
  const Config paper = preset("paper");
  EXPECT_EQ(paper.octree_levels, 8);
  EXPECT_EQ(paper.train_steps, 20000);
  EXPECT_EQ(paper.train_points * paper.train_directions, 1 << 21);
  EXPECT_EQ(paper.loss_normalizer, LossNormalizer::symmetric);
  EXPECT_EQ(paper.adam_decay_start, 1.0);
  EXPECT_FALSE(paper.disparity_direction);
  EXPECT_EQ(paper.target_emission, TargetEmission::inside);
  const Config full = preset("default");
  EXPECT_EQ(full.octree_levels, 8);
  EXPECT_EQ(paper.train_first_points, 0);
  EXPECT_TRUE(paper.train_quarters);
  EXPECT_EQ(full.train_first_points, 8192);
  EXPECT_FALSE(full.train_quarters);
  EXPECT_EQ(full.loss_normalizer, LossNormalizer::prediction);
  EXPECT_EQ(full.decoder_output, Activation::exp);
  const Config cpu = preset("cpu");
  EXPECT_EQ(cpu.octree_levels, 6);
  EXPECT_EQ(cpu.train_points, 512);
  EXPECT_EQ(cpu.train_directions, 8);
  for (const char* name : {"paper", "default", "cpu"}) EXPECT_EQ(preset(name).preset, name);
  EXPECT_NE(message([] { preset("papper"); }).find("did you mean \"paper\""), std::string::npos);
}

TEST(Config, LevelsAreThoseOfMapsAndFineOnes) {
  Config config = preset("cpu");
  EXPECT_EQ(octree_levels(config), 6);
  config.octree_levels = 8;
  config.octree_fine = 1;
  EXPECT_EQ(octree_levels(config), 9);
  config.octree_fine = 2;
  EXPECT_THROW(octree_levels(config), UsageError);
  EXPECT_NE(message([&] { octree_levels(config); }).find("octree.levels = 8 and octree.fine = 2 are 10 levels"),
            std::string::npos);
}

TEST(Config, ValuesOfTheStructAreThePresetCpu) {
  EXPECT_EQ(to_json(Config{}), to_json(preset("cpu")));
  EXPECT_TRUE(Config{} == preset("cpu"));
}

// Every value of every choice: set by its name, read back by it, and different from the others.
TEST(Config, ChoicesAreTheirNames) {
  for (const ConfigKey& key : describe(preset("cpu"))) {
    if (key.key == "preset" || key.accepted.find(" | ") == std::string::npos) continue;
    std::vector<Config> seen;
    std::istringstream names(key.accepted);
    for (std::string name, bar; names >> name; names >> bar) {
      Config config = preset("cpu");
      set(config, key.key, name);
      EXPECT_EQ(get(config, key.key), name) << key.key;
      for (const Config& other : seen) EXPECT_FALSE(config == other) << key.key << " = " << name;
      seen.push_back(config);
    }
    EXPECT_GE(seen.size(), 2u) << key.key;
  }
  EXPECT_THROW(get(preset("cpu"), "octree.boxes"), UsageError);
}

TEST(Config, BoundsAreABoxOrAName) {
  Config config = preset("cpu");
  EXPECT_EQ(config.octree_bounds, "auto");
  EXPECT_EQ(preset("paper").octree_bounds, "scene");
  EXPECT_FALSE(given_bounds(config).has_value());
  set(config, "octree.bounds", "-1,0,-2.5,1e1,2,3");
  const std::optional<Bounds3f> box = given_bounds(config);
  ASSERT_TRUE(box.has_value());
  EXPECT_EQ(box->lower, Vec3f(-1, 0, -2.5f));
  EXPECT_EQ(box->upper, Vec3f(10, 2, 3));
  for (const char* bad : {"", "all", "1,2,3", "0,0,0,1,1,0", "0,0,0,1,1,1,1", "0,0,0,1,1,1,", "0,0,0,1,1,x",
                          "0,0,,1,1,1", "0,0,0,1e30,1e30,1e39", "nan,0,0,1,1,1"})
    EXPECT_THROW(set(config, "octree.bounds", bad), UsageError) << bad;
}

TEST(Config, EveryKeySetsAndReadsBack) {
  for (const char* name : {"paper", "default", "cpu"}) {
    const Config config = preset(name);
    for (const ConfigKey& key : describe(config)) {
      EXPECT_FALSE(key.help.empty()) << key.key;
      EXPECT_FALSE(key.accepted.empty()) << key.key;
      if (key.key == "preset" || (key.key == "train.time" && config.train_steps > 0)) continue;
      Config copy = config;
      ASSERT_NO_THROW(set(copy, key.key, key.value)) << key.key << " = " << key.value;
      EXPECT_EQ(to_json(copy), to_json(config)) << key.key;
      // Another value that it accepts changes this key and no other.
      std::istringstream words(key.accepted + " 3 5 .5 1.5 77s -1,-2,-3,1,2,3");
      for (std::string word; get(copy, key.key) == key.value && words >> word;) {
        try {
          set(copy, key.key, word);
        } catch (const UsageError&) {
        }
      }
      const std::string changed = get(copy, key.key);
      EXPECT_NE(changed, key.value) << key.key;
      for (const ConfigKey& other : describe(copy)) {
        if (other.key == key.key || (key.key == "train.time" && other.key == "train.steps")) continue;
        EXPECT_EQ(other.value, get(config, other.key)) << "after " << key.key << " = " << changed;
      }
      Config again = config;
      set(again, key.key, changed);
      EXPECT_EQ(to_json(again), to_json(copy)) << key.key << " = " << changed;
    }
  }
}

TEST(Config, JsonRoundTripIsExact) {
  for (const char* name : {"paper", "default", "cpu"}) {
    Config config = preset(name);
    set(config, "octree.levels", "6");
    set(config, "adam.rate.features", "0.123456789012345678");
    set(config, "train.cameras", "a \"b\".json");
    set(config, "seed", "123456789012345");
    const nlohmann::json json = nlohmann::json::parse(to_json(config).dump());
    Config other = preset("cpu");
    apply(other, json, "test");
    EXPECT_EQ(to_json(other), to_json(config));
    EXPECT_EQ(other.adam_rate_features, config.adam_rate_features);
  }
}

TEST(Config, TheLastBudgetDecides) {
  Config config = preset("paper");
  set(config, "train.time", "90s");
  EXPECT_EQ(config.train_steps, 0);
  EXPECT_EQ(config.train_seconds, 90.0);
  set(config, "train.steps", "500");
  EXPECT_EQ(config.train_steps, 500);
  Config from_file = preset("paper");
  apply(from_file, {{"train", {{"time", "5m"}}}}, "f");
  EXPECT_EQ(from_file.train_steps, 0);
  EXPECT_EQ(from_file.train_seconds, 300.0);
}

TEST(Config, AcceptsNestedAndDottedJson) {
  Config config = preset("cpu");
  apply(
      config,
      nlohmann::json::parse(
          R"({"preset": "paper", "octree": {"levels": 6}, "adam.rate": {"features": 0.5}, "disparity.direction": true, "checkpoint.every": "3s"})"),
      "f");
  EXPECT_EQ(config.preset, "paper");
  EXPECT_EQ(config.train_steps, 20000);
  EXPECT_EQ(config.octree_levels, 6);
  EXPECT_EQ(config.adam_rate_features, 0.5);
  EXPECT_TRUE(config.disparity_direction);
  EXPECT_EQ(config.checkpoint_seconds, 3.0);
}

TEST(Config, RefusesWithAdvice) {
  Config config = preset("cpu");
  const auto text = [&](const char* key, const char* value) { return message([&] { set(config, key, value); }); };
  EXPECT_NE(text("octree.level", "5").find("did you mean \"octree.levels\""), std::string::npos);
  EXPECT_NE(text("adam.rate_features", "5").find("did you mean \"adam.rate.features\""), std::string::npos);
  EXPECT_NE(text("levels", "5").find("did you mean"), std::string::npos);
  EXPECT_NE(text("octree.levels", "12").find("1 … 9"), std::string::npos);
  EXPECT_NE(text("octree.box", "cubes").find("did you mean \"cube\""), std::string::npos);
  EXPECT_NE(text("preset", "paper").find("--preset"), std::string::npos);
  for (const auto& [key, value] : std::vector<std::pair<const char*, const char*>>{{"octree.levels", "0"},
                                                                                   {"octree.levels", "5.5"},
                                                                                   {"octree.levels", ""},
                                                                                   {"octree.levels", "five"},
                                                                                   {"octree.levels", "5 "},
                                                                                   {"octree.features", "3"},
                                                                                   {"adam.rate.features", "nan"},
                                                                                   {"adam.rate.features", "inf"},
                                                                                   {"adam.rate.features", "-1"},
                                                                                   {"adam.rate.features", "1e400"},
                                                                                   {"adam.epsilon", "0"},
                                                                                   {"checkpoint.every", "0"},
                                                                                   {"checkpoint.every", "soon"},
                                                                                   {"disparity.direction", "maybe"},
                                                                                   {"train.walks", "1.1"},
                                                                                   {"seed", "0x10"}}) {
    EXPECT_THROW(set(config, key, value), UsageError) << key << " = " << value;
  }
  EXPECT_EQ(to_json(config), to_json(preset("cpu"))) << "a refused value must change nothing";
}

TEST(Config, BrokenFilesNameThemselves) {
  Config config = preset("cpu");
  for (const char* bad :
       {"[1]", "3", R"({"octree": {"level": 5}})", R"({"octree": {"levels": [5]}})", R"({"octree": {"levels": null}})",
        R"({"octree": {"levels": "x"}})", R"({"octree": {"levels": 5}, "octree.levels": 6})", R"({"octree": 5})",
        R"({"preset": 7})", R"({"a":{"a":{"a":{"a":{"a":{"a":{"a":{"a":{"a":{"a":{"a":1}}}}}}}}}}})"}) {
    const std::string text = message([&] { apply(config, nlohmann::json::parse(bad), "my.json"); });
    EXPECT_EQ(text.rfind("my.json: ", 0), 0u) << bad << ": " << text;
    EXPECT_THROW(apply(config, nlohmann::json::parse(bad), "my.json"), InputError) << bad;
  }
}

}  // namespace
}  // namespace octrad
