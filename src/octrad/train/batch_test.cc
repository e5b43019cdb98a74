#include "octrad/train/batch.h"

#include <gtest/gtest.h>

#include <map>
#include <string>

namespace octrad {
namespace {

std::map<std::string, double> values(const Config& config) {
  const LhsOptions o = lhs_options(config);
  return {{"walks", o.walks},
          {"view", o.view},
          {"stop_probability", o.stop_probability},
          {"max_walk", o.max_walk},
          {"keep_direction", o.keep_direction},
          {"uniform_glossy", o.uniform_glossy},
          {"glossy_boost", o.glossy_boost},
          {"rough_threshold", o.rough_threshold},
          {"follow_below", o.follow_below},
          {"split_coats", o.split_coats},
          {"poses", o.poses},
          {"seed", static_cast<double>(o.seed)},
          {"max_chain", first_hit_rules(config).max_chain},
          {"max_chain of targets", rhs_rules(config).max_chain}};
}

// Every key arrives in its option and in no other.
TEST(LhsOptions, AreWhatTheKeysSay) {
  struct Case {
    const char *key, *value;
    std::map<std::string, double> changed;
  };
  Config config = preset("cpu");
  config.train_sampler = TrainSampler::mixture;
  config.train_walks = 0.5;
  config.render_delta = DeltaSurfaces::trace;
  config.target_emission = TargetEmission::outside;
  const auto before = values(config);
  for (const Case& c :
       {Case{"train.walks", "0.25", {{"walks", 0.25}}},
        Case{"train.view_share", "0.75", {{"view", 0.75}, {"walks", 0.125}}},
        Case{"train.sampler", "walks", {{"walks", 1}}}, Case{"train.sampler", "area", {{"walks", 0}}},
        Case{"train.stop_probability", "0.625", {{"stop_probability", 0.625}}},
        Case{"train.max_walk", "7", {{"max_walk", 7}}},
        Case{"train.keep_direction", "0.375", {{"keep_direction", 0.375}}},
        Case{"train.fresh_direction", "cosine", {{"uniform_glossy", 0}}},
        Case{"train.glossy_boost", "5", {{"glossy_boost", 5}}}, Case{"train.poses", "33", {{"poses", 33}}},
        Case{"train.max_chain", "3", {{"max_chain", 3}, {"max_chain of targets", 3}}},
        Case{"lookup.rough_threshold", "0.125", {{"rough_threshold", 0.125}}},
        Case{"lookup.coats", "joined", {{"split_coats", 0}}},
        Case{"render.trace_below", "0.25", {{"follow_below", 0.25}}}, Case{"seed", "123", {{"seed", 123}}}}) {
    Config other = config;
    set(other, c.key, c.value);
    auto expected = before;
    for (const auto& [name, value] : c.changed) {
      EXPECT_NE(before.at(name), value) << c.key << " = " << c.value << " is the value it had";
      expected[name] = value;
    }
    EXPECT_EQ(values(other), expected) << c.key << " = " << c.value;
  }
}

}  // namespace
}  // namespace octrad
