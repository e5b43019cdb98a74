// Fields as a whole: gradients of every trainable part, saving and loading, determinism, learning something easy.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "octrad/base/error.h"
#include "octrad/base/threads.h"
#include "octrad/encoding/octaoctree.h"
#include "octrad/encoding/octaoctree_math.h"
#include "octrad/model/field_registry.h"
#include "octrad/model/field_test_helper.h"
#include "octrad/model/model_file.h"

namespace octrad {
namespace {

using testing::pattern;
using testing::random_points;
using testing::shell;

Config small_config(const std::string& field) {
  Config config = preset("cpu");
  config.lookup_offset = LookupOffset::predicted;  // every part learns
  config.field = field;
  config.octree_levels = 2;
  config.octree_fine = 1;
  config.disparity_log2_table = 10;
  config.nr_log2_table = 12;
  config.nr_width = 64;
  config.ncr_log2_table = 12;
  config.ncr_cone_log2_table = 12;
  config.ncr_cone_levels = 5;
  config.train_guide = 0.0;  // files of these tests have none
  return config;
}

std::string temporary(const std::string& name) {
  return (std::filesystem::temp_directory_path() / ("octrad_" + std::to_string(::getpid()) + "_" + name)).string();
}

double train_steps(RadianceField& field, int steps, int first = 0) {
  double loss = 0.0;
  for (int s = first; s < first + steps; ++s) {
    const auto points = random_points(512, 100 + static_cast<unsigned long long>(s));
    std::vector<Vec3f> targets;
    for (const SurfacePoint& p : points) targets.push_back(pattern(p));
    loss = field.train(points, targets, 0.05, 1.0).loss;
  }
  return loss;
}

std::vector<Vec3f> evaluate(const RadianceField& field, std::span<const SurfacePoint> points) {
  std::vector<Vec3f> out(points.size());
  field.radiance(points, out);
  return out;
}

// Mean of |a - b| over that of b.
double mean_difference(std::span<const Vec3f> a, std::span<const Vec3f> b) {
  double sum = 0.0, size = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      sum += std::abs(static_cast<double>(a[i][c]) - static_cast<double>(b[i][c]));
      size += std::abs(static_cast<double>(b[i][c]));
    }
  }
  return sum / size;
}

class AllFields : public ::testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Registry, AllFields, ::testing::ValuesIn(field_names()),
                         [](const auto& field) { return field.param; });

TEST_P(AllFields, LearnsAPattern) {
  const auto field = make_field(small_config(GetParam()), shell(3));
  const double first = train_steps(*field, 1);
  const double last = train_steps(*field, 250, 1);
  EXPECT_LT(last, 0.05 * first);
}

TEST_P(AllFields, SaveThenLoadGivesTheSamePicturesAndTheSameNextStep) {
  Config config = small_config(GetParam());
  config.train_average = 0.0;
  const auto field = make_field(config, shell(3));
  field->set_target_scale(1.7f);
  train_steps(*field, 20);
  const std::string file = temporary("model.octrad");
  ModelInfo info;
  info.config = config;
  info.scene_file = "scene.xml";
  info.scene_fingerprint = "0123456789abcdef";
  info.state.step = 20;
  save_model(file, *field, info, true);
  Model loaded = load_model(file, true);
  EXPECT_TRUE(loaded.has_optimizer);
  EXPECT_EQ(loaded.info.state.step, 20);
  EXPECT_EQ(loaded.info.config.field, GetParam());
  const auto points = random_points(300, 1);
  EXPECT_TRUE(evaluate(*field, points) == evaluate(*loaded.field, points));
  train_steps(*field, 5, 20);
  train_steps(*loaded.field, 5, 20);
  EXPECT_TRUE(evaluate(*field, points) == evaluate(*loaded.field, points));

  save_model(file, *field, info, false);
  Model small = load_model(file, true);
  EXPECT_FALSE(small.has_optimizer);
  EXPECT_TRUE(evaluate(*field, points) == evaluate(*small.field, points));
  EXPECT_NO_THROW(check_scene(file, small.info, "scene.xml", "0123456789abcdef", false));
  EXPECT_THROW(check_scene(file, small.info, "other.xml", "fedcba9876543210", false), InputError);
  EXPECT_NO_THROW(check_scene(file, small.info, "other.xml", "fedcba9876543210", true));
  std::filesystem::remove(file);
}

// What is reflected is looked up where the ray led, if that was not the look-up direction.
TEST(OctaOctreeField, LooksUpWhereTheRayLed) {
  Config config = small_config("octaoctree");
  config.lookup_offset = LookupOffset::traced;
  const auto field = make_field(config, shell(3));
  train_steps(*field, 10);
  std::vector<SurfacePoint> points = random_points(200, 1);
  for (SurfacePoint& p : points) p.reflected.w = Vec3f(0.0f);
  const auto along = evaluate(*field, points);
  for (SurfacePoint& p : points) p.reflected.w = reflect(p.wo, p.n);
  EXPECT_TRUE(evaluate(*field, points) == along);
  for (SurfacePoint& p : points) p.reflected.w = p.n;
  const auto elsewhere = evaluate(*field, points);
  int changed = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool looks = points[i].alpha < 0.5f && points[i].reflected.met > 0.0f && points[i].disparity > 0.0f;
    changed += elsewhere[i] != along[i];
    EXPECT_EQ(elsewhere[i] != along[i], looks) << i;
  }
  EXPECT_GT(changed, 50);
}

TEST_P(AllFields, ApproachMovesEveryWeight) {
  const Config config = small_config(GetParam());
  const auto points = random_points(300, 1);
  const auto field = make_field(config, shell(3)), to = make_field(config, shell(3));
  train_steps(*field, 10);
  for (const WeightArray& array : to->weights()) {
    for (std::size_t i = 0; i < array.values.size(); i += 3) array.values[i] += 0.1f;
  }
  to->weights_changed();
  train_steps(*to, 10, 10);
  const auto before = testing::tensors_of(*field), target = testing::tensors_of(*to);
  approach(*field, *to, 0.25f);
  // Tensors are what a file holds: what weights() leaves out would not move.
  int moved = 0;
  for (const auto& [name, tensor] : testing::tensors_of(*field)) {
    const std::vector<double>&a = before.at(name).values, &b = target.at(name).values;
    if (name.starts_with("optimizer.")) {
      EXPECT_EQ(tensor.values, a) << name;
      continue;
    }
    moved += a != b;
    for (std::size_t i = 0; i < a.size(); ++i)
      ASSERT_NEAR(tensor.values[i], a[i] + 0.25 * (b[i] - a[i]), 1e-6 * (std::abs(a[i]) + std::abs(b[i])))
          << name << ' ' << i;
  }
  EXPECT_EQ(moved, static_cast<int>(std::count_if(before.begin(), before.end(), [](const auto& tensor) {
              const std::string& name = tensor.first;
              return !name.starts_with("optimizer.") &&
                     (name.ends_with(".weight") || name.ends_with(".table") || name.ends_with(".features"));
            })));
  // What is asked follows the weights.
  const testing::SavedField saved(*field);
  const auto loaded = make_field(config, shell(3));
  loaded->load(saved.reader());
  EXPECT_TRUE(evaluate(*field, points) == evaluate(*loaded, points));
  EXPECT_FALSE(evaluate(*field, points) == evaluate(*to, points));
  approach(*field, *to, 1.0f);
  EXPECT_TRUE(evaluate(*field, points) == evaluate(*to, points));
}

TEST_P(AllFields, FilesHoldAveragesAndTheWeightsThatStepsMove) {
  Config config = small_config(GetParam());
  config.train_average = 0.1;
  config.target_scale = 1.7;
  const auto averages = make_field(config, shell(3)), trained = make_field(config, shell(3));
  for (RadianceField* field : {averages.get(), trained.get()}) field->set_target_scale(1.7f);
  train_steps(*averages, 8);
  train_steps(*trained, 20);
  ModelInfo info;
  info.config = config;
  const std::string file = temporary("averages.octrad");
  const auto points = random_points(300, 1);
  save_model(file, *averages, info, true, trained.get());
  EXPECT_EQ(load_model(file).trained, nullptr);
  EXPECT_TRUE(evaluate(*load_model(file).field, points) == evaluate(*averages, points));
  Model loaded = load_model(file, true);
  ASSERT_NE(loaded.trained, nullptr);
  EXPECT_TRUE(evaluate(*loaded.field, points) == evaluate(*averages, points));
  EXPECT_TRUE(evaluate(*loaded.trained, points) == evaluate(*trained, points));
  train_steps(*trained, 5, 20);
  train_steps(*loaded.trained, 5, 20);
  EXPECT_TRUE(evaluate(*loaded.trained, points) == evaluate(*trained, points));

  // Without the optimiser's state there are only the averages to begin with.
  save_model(file, *averages, info, false, trained.get());
  loaded = load_model(file, true);
  EXPECT_FALSE(loaded.has_optimizer);
  ASSERT_NE(loaded.trained, nullptr);
  EXPECT_TRUE(evaluate(*loaded.trained, points) == evaluate(*averages, points));

  // A file that says so and does not have them, and one whose weights are not numbers.
  EXPECT_THROW(save_model(file, *averages, info, true), InputError);
  info.config.train_average = 0.0;
  save_model(file, *averages, info, true);
  EXPECT_EQ(load_model(file, true).trained, nullptr);
  // The same file with the key's value changed in place, and without the checksums that would tell of it.
  {
    std::ifstream in(file, std::ios::binary);
    std::string bytes((std::istreambuf_iterator<char>(in)), {});
    const std::size_t at = bytes.find("average\\\":0.0");
    ASSERT_NE(at, std::string::npos);
    bytes[at + 12] = '1';
    bytes.replace(bytes.find("checksums"), 9, "unchecked");
    std::ofstream(file, std::ios::binary) << bytes;
  }
  info.config.train_average = 0.1;
  try {
    load_model(file, true);
    ADD_FAILURE() << "weights were missing";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("optimizer.trained."), std::string::npos) << error.what();
  }
  trained->weights().back().values[3] = std::nanf("");
  save_model(file, *averages, info, true, trained.get());
  EXPECT_THROW(load_model(file, true), InputError);
  EXPECT_NO_THROW(load_model(file));
  std::filesystem::remove(file);
}

TEST_P(AllFields, SameBitsAtAnyThreadCount) {
  std::vector<std::vector<Vec3f>> results;
  for (const int threads : {1, 2, 3}) {
    set_thread_count(threads);
    const auto field = make_field(small_config(GetParam()), shell(3));
    train_steps(*field, 10);
    results.push_back(evaluate(*field, random_points(200, 2)));
  }
  set_thread_count(0);
  EXPECT_TRUE(results[0] == results[1]);
  EXPECT_TRUE(results[0] == results[2]);
}

TEST_P(AllFields, TrainingDoesNotDependOnWhereTheBatchIsEvaluated) {
  // A point's radiance must be the same alone and inside a batch.
  const auto field = make_field(small_config(GetParam()), shell(3));
  train_steps(*field, 3);
  const auto points = random_points(261, 3);
  const auto together = evaluate(*field, points);
  for (const std::size_t i : {std::size_t{0}, std::size_t{127}, std::size_t{128}, std::size_t{260}}) {
    EXPECT_TRUE(evaluate(*field, std::span(points).subspan(i, 1))[0] == together[i]);
  }
}

TEST_P(AllFields, NonFiniteTargetsAreDroppedAndCounted) {
  const auto field = make_field(small_config(GetParam()), shell(3)),
             clean = make_field(small_config(GetParam()), shell(3));
  const auto points = random_points(128, 4);
  std::vector<Vec3f> targets(points.size(), Vec3f(1.0f));
  const FieldStep all = clean->train(points, targets, 0.1, 1.0);
  targets[5].x = std::nanf("");
  targets[9] = Vec3f(INFINITY);
  const FieldStep step = field->train(points, targets, 0.1, 1.0);
  EXPECT_EQ(all.non_finite, 0);
  EXPECT_EQ(step.non_finite, 4);
  // Without 4 of 384 terms, which may be larger than others.
  const double loss = std::abs(step.loss - all.loss) / all.loss,
               radiance = mean_difference(evaluate(*field, points), evaluate(*clean, points));
  RecordProperty("loss", std::to_string(loss));
  RecordProperty("radiance", std::to_string(radiance));
  EXPECT_LT(loss, 3.0 * 4.0 / 384.0);  // 1.1e-3; ncr 4.1e-3; other points, as clang draws them: 1.1e-2; ncr 1.5e-2
  EXPECT_LT(radiance, 3e-3);           // 1.8e-4; ncr 1.1e-3
}

TEST_P(AllFields, EveryRateMovesItsOwnParts) {
  testing::check_rates(small_config(GetParam()), shell(3),
                       [](RadianceField& field, const Config&) { train_steps(field, 1); });
}

// A rough coat over red: it reflects green too, and depends on the view. Only diffuse surfaces are divided by their
// albedo and looked up along the normal.
TEST(OctaOctreeField, OnlyDiffuseSurfacesAreDemodulatedAndSeenFromNowhere) {
  EXPECT_EQ(preset("paper").lookup_rough_threshold, 0.5);
  auto points = random_points(64, 5);
  std::vector<Vec3f> targets;
  for (SurfacePoint& p : points) {
    p.albedo = {0.8f, 0.0f, 0.0f};
    p.alpha = 0.7f;
    targets.emplace_back(1.0f, 0.2f, 0.2f);
  }
  const auto green = [&](const char* threshold, float alpha, bool& sees) {
    Config config = small_config("octaoctree");
    set(config, "lookup.coats", "joined");
    if (threshold != nullptr) set(config, "lookup.rough_threshold", threshold);
    const auto field = make_field(config, shell(3));
    for (int i = 0; i < 60; ++i) field->train(points, targets, 0.1, 1.0);
    auto asked = points;
    for (SurfacePoint& p : asked) p.alpha = alpha;
    const std::vector<Vec3f> before = evaluate(*field, asked);
    for (SurfacePoint& p : asked) p.wo = normalize(p.wo + p.n * 0.5f);
    const std::vector<Vec3f> after = evaluate(*field, asked);
    sees = false;
    float least = 1e9f;
    for (std::size_t i = 0; i < asked.size(); ++i) {
      sees = sees || before[i].x != after[i].x;
      least = std::min(least, before[i].y);
    }
    return least;
  };
  bool sees = false;
  EXPECT_GT(green(nullptr, 0.7f, sees), 0.05f);
  EXPECT_TRUE(sees);
  EXPECT_GT(green(nullptr, 0.999f, sees), 0.01f);
  EXPECT_TRUE(sees);
  EXPECT_EQ(green(nullptr, 1.0f, sees), 0.0f);  // diffuse: nothing is green
  EXPECT_FALSE(sees);
  EXPECT_EQ(green("0.5", 0.7f, sees), 0.0f);
  EXPECT_FALSE(sees);
}

// Where no cell is, features are 0: counted once a level, whoever asks, and by queries of training too.
TEST(OctaOctreeField, EmptyLookupsAreCounted) {
  Config config = small_config("octaoctree");
  const auto field = make_field(config, shell(3));
  auto points = random_points(64, 5);
  std::vector<Vec3f> out(points.size());
  field->radiance(points, out);
  EXPECT_EQ(field->take_empty_lookups(), 0);
  for (std::size_t i = 0; i < 10; ++i) points[i].x = Vec3f(0.5f);  // far from the shell; level 1 is that coarse
  const auto& octree = dynamic_cast<OctaOctreeField&>(*field).octree();
  std::vector<float> values(static_cast<std::size_t>(field->feature_count())), slopes(values);
  const int levels = lookup_query(octree.view(), Vec3f(0.5f), points[0].wo, 0.1f, values.data(), slopes.data());
  ASSERT_GT(levels, 0);
  for (const int threads : {1, 3}) {
    set_thread_count(threads);
    parallel_blocks(points.size(), 4, [&](std::size_t begin, std::size_t end) {
      field->radiance(std::span(points).subspan(begin, end - begin), std::span(out).subspan(begin, end - begin));
    });
    EXPECT_EQ(field->take_empty_lookups(), 10 * levels);
    field->train(points, std::vector<Vec3f>(points.size(), Vec3f(1.0f)), 0.1, 1.0);
    EXPECT_EQ(field->take_empty_lookups(), 10 * levels);
  }
  set_thread_count(0);
  EXPECT_EQ(field->take_empty_lookups(), 0);
}

// Switches of the method that must train and that must change the result.
TEST(OctaOctreeField, EverySwitchTrainsAndMatters) {
  const std::vector<std::pair<std::string, std::string>> switches = {{"lookup.offset", "none"},
                                                                     {"lookup.offset", "traced"},
                                                                     {"lookup.direction", "outgoing"},
                                                                     {"octree.interpolation", "nearest"},
                                                                     {"octa.interpolation", "nearest"},
                                                                     {"octree.features", "2"},
                                                                     {"octree.features", "8"},
                                                                     {"decoder.output", "squareplus"},
                                                                     {"disparity.direction", "false"},
                                                                     {"lookup.rough_direction", "mirror"},
                                                                     {"adam.mode", "dense"},
                                                                     {"loss.normalizer", "symmetric"},
                                                                     {"target.demodulate", "none"},
                                                                     {"decoder.position", "world"}};
  constexpr int kSteps = 25;
  const auto points = random_points(128, 5);
  const auto base = make_field(small_config("octaoctree"), shell(3));
  train_steps(*base, kSteps);
  const auto expected = evaluate(*base, points);
  std::vector<std::pair<std::string, std::vector<Vec3f>>> seen;
  for (const auto& [key, value] : switches) {
    Config config = small_config("octaoctree");
    set(config, key, value);
    const auto field = make_field(config, shell(3));
    const double first = train_steps(*field, 1), learnt = train_steps(*field, kSteps - 1, 1) / first,
                 changed = mean_difference(evaluate(*field, points), expected);
    RecordProperty(key + "." + value, std::to_string(learnt) + " " + std::to_string(changed));
    EXPECT_LT(learnt, 0.8) << key << "=" << value;  // 0.71 for directions without reflection, 0.54 and less for others
    EXPECT_GT(changed, 5e-4) << key << "=" << value << " changes nothing";  // 1.1e-3 and more
    for (const auto& [other, picture] : seen)
      EXPECT_GT(mean_difference(evaluate(*field, points), picture), 1e-5) << key << "=" << value << " is " << other;
    seen.emplace_back(key + "=" + value, evaluate(*field, points));
  }
}

// Every key that the field is said to ignore is set to another value; training must not notice.
TEST_P(AllFields, KeysOfOtherFieldsChangeNothing) {
  const Config config = small_config(GetParam());
  const auto points = random_points(64, 4);
  const auto trained = [&](const Config& c) {
    const auto field = make_field(c, shell(3));
    train_steps(*field, 2);
    return evaluate(*field, points);
  };
  const std::vector<Vec3f> expected = trained(config);
  for (const ConfigKey& key : describe(config)) {
    Config changed = config;
    std::istringstream words(key.accepted + " 11 17 2.5");
    for (std::string word; get(changed, key.key) == key.value && words >> word;) {
      try {
        set(changed, key.key, word);
      } catch (const UsageError&) {
      }
    }
    if (key.key == "field" || key.key == "preset") continue;
    if (ignores_key(field_entry(GetParam()), key.key)) {
      EXPECT_NE(get(changed, key.key), key.value) << key.key;
      EXPECT_TRUE(trained(changed) == expected) << key.key;
    }
  }
}

}  // namespace
}  // namespace octrad
