#include "octrad/model/model_file.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <list>
#include <nlohmann/json.hpp>
#include <set>

#include "octrad/base/error.h"
#include "octrad/model/field_test_helper.h"

namespace octrad {
namespace {

using Tensors = std::list<std::vector<char>>;  // their bytes, until they are written

void copy_tensor(const TensorReader& in, const std::string& name, Tensors& tensors, TensorWriter& out) {
  const auto t = in.get(name);
  in.read(t, tensors.emplace_back(t.bytes).data());
  out.add(name, t.type, t.shape, tensors.back().data());
}

TEST(ModelFile, RefusesBrokenFiles) {
  const std::filesystem::path folder = std::filesystem::temp_directory_path();
  const std::string name_of_run = "octrad_" + std::to_string(::getpid());
  const std::string file = (folder / (name_of_run + "_broken.octrad")).string();
  EXPECT_THROW(load_model(file), IoError);
  std::ofstream(file) << "no model";
  EXPECT_THROW(load_model(file), InputError);
  TensorWriter other;
  other.metadata("format", "something else");
  other.write(file);
  EXPECT_THROW(load_model(file), InputError);

  // A sound model, but with cells outside the grid, or with a tensor missing.
  ModelInfo info;
  info.config.octree_levels = 2;
  info.config.octree_fine = 1;
  info.config.lookup_offset = LookupOffset::predicted;
  info.config.disparity_log2_table = 10;
  const auto field = make_field(info.config, testing::shell(3));
  save_model(file, *field, info, false);
  const TensorReader in(file);
  for (const std::string broken :
       {"octree.level2.cells", "decoder.mlp.1.weight", "octree.origin", "disparity.grid.table"}) {
    TensorWriter out;
    Tensors tensors;
    for (const auto& [key, value] : in.metadata()) out.metadata(key, value);
    const std::vector<std::int32_t> outside(static_cast<std::size_t>(in.get("octree.level2.cells").count), 1000);
    for (const std::string& name : in.names()) {
      const auto t = in.get(name);
      if (name != broken) copy_tensor(in, name, tensors, out);
      else if (name == "octree.level2.cells") out.add(name, t.type, t.shape, outside.data());
    }
    const std::string copy = (folder / (name_of_run + "_copy.octrad")).string();
    out.write(copy);
    try {
      load_model(copy);
      ADD_FAILURE() << broken << " was accepted";
    } catch (const InputError& e) {
      EXPECT_NE(std::string(e.what()).find(broken), std::string::npos) << e.what();
    }
    std::filesystem::remove(copy);
  }
  std::filesystem::remove(file);
}

// Models of version 0.1.0 say nothing of what was not there.
TEST(ModelFile, OlderModelsKeepTheirMeaning) {
  const std::filesystem::path folder = std::filesystem::temp_directory_path();
  const std::string file = (folder / ("octrad_" + std::to_string(::getpid()) + "_older.octrad")).string();
  ModelInfo info;
  info.config.octree_levels = 3;
  info.config.disparity_log2_table = 10;
  info.config.target_scale = 1.0;
  const auto field = make_field(info.config, testing::shell(3));
  save_model(file, *field, info, false);
  EXPECT_EQ(load_model(file).info.config, info.config);
  EXPECT_TRUE(load_model(file).info.state.newer_keys.empty());
  // Scenes may be in any unit of radiance.
  for (const float exposure : {3e-25f, 3e7f, 1e25f}) {
    field->set_target_scale(exposure);
    save_model(file + ".unit", *field, info, false);
    EXPECT_EQ(load_model(file + ".unit").field->target_scale(), exposure);
  }
  std::filesystem::remove(file + ".unit");
  info.config.lookup_coats = Coats::joined;
  info.config.lookup_rough_offset = true;
  info.config.train_average = 0.0;
  info.config.adam_rate_budget = 0;
  info.config.train_far_ends = 0.0;
  info.config.train_area_falls = false;
  info.config.loss_power = 2.0;
  info.config.render_trace_below = 0.0;
  for (const char* preset_name : {"cpu", "default", "paper"}) {
    const TensorReader in(file);
    TensorWriter out;
    Tensors tensors;
    for (const auto& [key, value] : in.metadata()) {
      std::string text = value;
      if (key == "config") {
        nlohmann::json config = nlohmann::json::parse(value);
        config["preset"] = info.config.preset = preset_name;
        for (const char* newer : {"offset_spread", "trace_below", "coat_samples", "metal_samples"})
          EXPECT_EQ(config["render"].erase(newer), 1u);
        EXPECT_EQ(config["loss"].erase("power") + config["octree"].erase("fine"), 2u);
        EXPECT_EQ(config["lookup"].erase("coats") + config["lookup"].erase("rough_offset"), 2u);
        for (const char* newer : {"average", "far_ends", "area_falls", "first_points"})
          EXPECT_EQ(config["train"].erase(newer), 1u);
        EXPECT_EQ(config["adam"]["rate"].erase("budget"), 1u);
        text = config.dump();
      }
      out.metadata(key, text);
    }
    for (const std::string& name : in.names()) copy_tensor(in, name, tensors, out);
    out.write(file + ".older");
    info.config.render_offset_spread = preset(preset_name).render_offset_spread;
    info.config.render_coat_samples = preset(preset_name).render_coat_samples;
    info.config.render_metal_samples = preset(preset_name).render_metal_samples;
    const ModelInfo older = load_model(file + ".older").info;
    EXPECT_EQ(older.config, info.config);
    EXPECT_EQ(std::set<std::string>(older.state.newer_keys.begin(), older.state.newer_keys.end()),
              (std::set<std::string>{"adam.rate.budget", "lookup.coats", "lookup.rough_offset", "loss.power",
                                     "octree.fine", "render.coat_samples", "render.metal_samples",
                                     "render.offset_spread", "render.trace_below", "train.area_falls", "train.average",
                                     "train.far_ends", "train.first_points"}));
    std::filesystem::remove(file + ".older");
  }
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace octrad
