// Neural Cone Radiosity as a whole against its definition in double: radiance, loss, and the gradient that training
// hands to the optimiser against central differences. (field_gradient_test.cc says how that gradient is read.)
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>

#include "octrad/encoding/prefiltered_grid_math.h"
#include "octrad/model/field_switches_test_helper.h"

namespace octrad {
namespace {

using testing::FieldKeys;
using testing::MlpReference;
using testing::TrainingBatch;

// One point at a time, in double; every number that training changes is in `parameters`.
class NcrReference {
 public:
  enum Part { kGrid, kDecoder, kConeGrid, kCone, kMerge, kParts };
  static constexpr const char* kNames[kParts] = {"ncr.grid", "ncr.mlp", "ncr.cone.grid", "ncr.cone.mlp",
                                                 "ncr.merge.mlp"};

  NcrReference(const Config& config, NcrField& field)
      : config_(config),
        scale_(static_cast<double>(field.target_scale())),
        origin_(field.origin()),
        size_(field.size()),
        grid_(field.grid().view()),
        cone_grid_(field.cone_grid().view()),
        decoder_{field.decoder().mlp().shape()},
        cone_{field.cone_mlp().shape()},
        merge_{field.merge_mlp().shape()} {
    const auto copy = [](std::span<const float> from) { return std::vector<double>(from.begin(), from.end()); };
    parameters[kGrid] = copy(field.grid().table());
    parameters[kDecoder] = copy(field.decoder().mlp().weights());
    parameters[kConeGrid] = copy(field.cone_grid().table());
    parameters[kCone] = copy(field.cone_mlp().weights());
    parameters[kMerge] = copy(field.merge_mlp().weights());
  }

  std::array<std::vector<double>, kParts> parameters;

  Vec3d radiance(const SurfacePoint& p) {
    const Vec3d x(p.x), w(reflect(p.wo, p.n)), origin(origin_), size(size_);
    const double extent = std::max({size.x, size.y, size.z});
    const Vec3d inside = (x - origin) / size;
    const bool world = config_.decoder_position == DecoderPosition::world;
    const auto position = [&](Vec3d at) {
      if (world) return at;
      Vec3d unit = (at - origin) / size * 2.0 - Vec3d(1.0);
      for (int a = 0; a < 3; ++a) {
        const double far = std::abs(unit[a]);
        if (far > 1.0) unit[a] = std::copysign(2.0 - 1.0 / far, unit[a]);
      }
      return unit;
    };
    std::vector<double> in;
    for (int l = 0; l < grid_.levels; ++l) add_features(grid_, l, inside, 1.0, parameters[kGrid], in, true);
    append(in, position(x));
    append(in, w);
    append(in, Vec3d(p.n));
    append(in, Vec3d(p.albedo));
    in.push_back(static_cast<double>(p.alpha));
    const std::vector<double> linear = decoder_.forward(in, parameters[kDecoder]);
    const auto output = [&](double v) { return activate(config_.ncr_output, v).value; };
    Vec3d diffuse(output(linear[0]), output(linear[1]), output(linear[2]));
    if (static_cast<double>(p.alpha) >= config_.lookup_rough_threshold) {
      const bool demodulate =
          config_.target_demodulate == TargetDemodulation::albedo && config_.target_emission == TargetEmission::outside;
      return diffuse * scale_ * (demodulate ? Vec3d(p.albedo) : Vec3d(1.0));
    }
    Vec3d glossy;
    for (int k = 0; k < config_.ncr_clusters; ++k) {
      const double t = static_cast<double>(p.lobe[k].distance), s = static_cast<double>(p.lobe[k].deviation),
                   share = static_cast<double>(p.lobe[k].share);
      if (share == 0.0) continue;
      const double r = (t * lobe_tangent_exact(static_cast<double>(p.alpha), config_.ncr_lobe_share) + s) / 2 / extent;
      const Vec3d end = x + w * t;
      // Two levels by bracketing, in double.
      std::vector<double> features(static_cast<std::size_t>(cone_grid_.features));
      const auto footprint = [&](int l) { return 2.0 / (config_.ncr_cone_base * std::pow(config_.ncr_cone_scale, l)); };
      for (int l = 0; l < cone_grid_.levels; ++l) {
        const bool first = l == 0, last = l + 1 == cone_grid_.levels;
        double weight = r >= footprint(l) ? (first ? 1.0 : (footprint(l - 1) - r) / (footprint(l - 1) - footprint(l)))
                                          : (last ? 1.0 : (r - footprint(l + 1)) / (footprint(l) - footprint(l + 1)));
        if (weight > 0.0)
          add_features(cone_grid_, l, (end - origin) / extent, weight, parameters[kConeGrid], features, false);
      }
      append(features, position(end));
      append(features, w * -1.0);
      features.push_back(r);
      const std::vector<double> color = cone_.forward(features, parameters[kCone]);
      glossy += Vec3d(output(color[0]), output(color[1]), output(color[2])) * share;
    }
    std::vector<double> merge;
    append(merge, diffuse);
    append(merge, glossy);
    merge.push_back(static_cast<double>(p.alpha));
    append(merge, Vec3d(p.albedo));
    const std::vector<double> merged = merge_.forward(merge, parameters[kMerge]);
    const auto plus = [](double v) { return std::log1p(std::exp(v)); };
    return Vec3d(plus(merged[0]), plus(merged[1]), plus(merged[2])) * scale_;
  }

  // Denominators of the relative loss are constants to the gradient.
  std::vector<Vec3d> denominators(const TrainingBatch& batch) {
    std::vector<Vec3d> result;
    for (std::size_t i = 0; i < batch.points.size(); ++i) {
      const Vec3d l = radiance(batch.points[i]);
      const bool symmetric = config_.loss_normalizer == LossNormalizer::symmetric;
      result.push_back((symmetric ? (l + Vec3d(batch.targets[i])) * 0.5 : l) + Vec3d(batch.epsilon));
    }
    return result;
  }
  double loss(const TrainingBatch& batch, const std::vector<Vec3d>& denominators) {
    double sum = 0.0;
    for (std::size_t i = 0; i < batch.points.size(); ++i) {
      const Vec3d l = radiance(batch.points[i]), t(batch.targets[i]);
      for (int c = 0; c < 3; ++c) {
        const double relative = (t[c] - l[c]) / denominators[i][c],
                     chroma = l[c] / (length(l) + batch.epsilon) - t[c] / (length(t) + batch.epsilon);
        sum += relative * relative + config_.ncr_chroma * chroma * chroma;
      }
    }
    return sum / (3.0 * static_cast<double>(batch.points.size()));
  }

 private:
  static void append(std::vector<double>& to, Vec3d v) { to.insert(to.end(), {v.x, v.y, v.z}); }
  static void add_features(const HashGridView& grid, int level, Vec3d p, double weight,
                           const std::vector<double>& table, std::vector<double>& out, bool new_ones) {
    const auto width = static_cast<std::size_t>(grid.features);
    if (new_ones) out.resize(out.size() + width);
    double* to = out.data() + out.size() - width;
    std::uint32_t entry[8];
    double taps[8];
    hash_grid_taps(grid.level[level], p, entry, taps);
    for (int k = 0; k < 8; ++k) {
      for (std::size_t f = 0; f < width; ++f) to[f] += weight * taps[k] * table[entry[k] * width + f];
    }
  }

  Config config_;
  double scale_;
  Vec3f origin_, size_;
  HashGridView grid_, cone_grid_;
  MlpReference decoder_, cone_, merge_;
};

struct NcrCase {
  Config config;
  std::unique_ptr<RadianceField> field;
  NcrField& ncr;
  NcrReference reference;

  explicit NcrCase(const FieldKeys& keys)
      : config(testing::config_of({"ncr", keys})),
        field(testing::field_of(config)),
        ncr(dynamic_cast<NcrField&>(*field)),
        reference(config, ncr) {}
};

TrainingBatch batch(std::size_t n) {
  TrainingBatch result;
  result.points = testing::box_points(n, 7);
  Rng rng(8, RngPurpose::test, 1);
  for (std::size_t i = 0; i < n; ++i)
    result.targets.push_back(Vec3f(rng.uniform(), rng.uniform(), rng.uniform()) * 2.0f);
  return result;
}

const std::vector<FieldKeys> kSwitches = {{},
                                          {{"ncr.output", "squareplus"}},
                                          {{"ncr.chroma", "3"}},
                                          {{"ncr.clusters", "2"}},
                                          {{"ncr.cone.features", "4"}, {"ncr.cone.scale", "1.5"}},
                                          {{"ncr.features", "2"}, {"ncr.merge.hidden", "2"}},
                                          {{"ncr.lobe_share", "0.5"}},
                                          {{"decoder.position", "world"}},
                                          {{"target.demodulate", "none"}},
                                          {{"target.emission", "inside"}},
                                          {{"loss.normalizer", "symmetric"}},
                                          {{"lookup.rough_threshold", "1.5"}},
                                          {{"lookup.rough_threshold", "0"}}};

TEST(NcrField, RadianceIsThatOfTheDefinition) {
  for (const FieldKeys& keys : kSwitches) {
    NcrCase c(keys);
    const TrainingBatch b = batch(150);
    std::vector<Vec3f> out(b.points.size());
    c.field->radiance(b.points, out);
    double worst = 0.0;
    for (std::size_t i = 0; i < out.size(); ++i) {
      const Vec3d expected = c.reference.radiance(b.points[i]);
      for (int k = 0; k < 3; ++k)
        worst = std::max(worst, std::abs(static_cast<double>(out[i][k]) - expected[k]) / (0.1 + expected[k]));
    }
    // What is left is the table of lobe angles, and floats.
    EXPECT_LT(worst, 1e-3) << testing::name_of({"ncr", keys});
    RecordProperty(testing::name_of({"ncr", keys}), std::to_string(worst));
  }
}

TEST(NcrField, GradientsAreTheDerivativesOfTheLoss) {
  for (const FieldKeys& keys : kSwitches) {
    SCOPED_TRACE(testing::name_of({"ncr", keys}));
    NcrCase c(keys);
    const TrainingBatch b = batch(140);  // two groups
    const std::vector<Vec3d> denominators = c.reference.denominators(b);
    const double loss = c.reference.loss(b, denominators);
    const FieldStep step = c.field->train(b.points, b.targets, b.epsilon, 1.0);
    EXPECT_NEAR(step.loss, loss, 1e-4 * loss);
    EXPECT_EQ(step.non_finite, 0);
    const auto tensors = testing::tensors_of(*c.field);
    for (int part = 0; part < NcrReference::kParts; ++part) {
      SCOPED_TRACE(NcrReference::kNames[part]);
      const bool table = part == NcrReference::kGrid || part == NcrReference::kConeGrid;
      const testing::SavedTensor& t =
          tensors.at(std::string("optimizer.") + NcrReference::kNames[part] + (table ? ".moments" : ".m"));
      std::vector<double> gradient;
      const auto width = table ? static_cast<std::size_t>(t.shape[2]) : t.values.size();
      for (std::size_t at = 0; at < t.values.size(); at += (table ? 2 : 1) * width)
        gradient.insert(gradient.end(), t.values.data() + at, t.values.data() + at + width);
      std::vector<double>& parameters = c.reference.parameters[part];
      ASSERT_EQ(gradient.size(), parameters.size());
      double square = 0.0, count = 0.0;
      for (const double g : gradient) {
        square += g * g;
        count += g != 0.0 ? 1.0 : 0.0;
      }
      const bool glossy_only = part >= NcrReference::kConeGrid;
      if (glossy_only && c.config.lookup_rough_threshold == 0.0) {
        EXPECT_EQ(square, 0.0);
        continue;
      }
      ASSERT_GT(square, 0.0);
      // Along random signs of all parameters, relative to the gradient's length, and of single ones.
      Rng rng(9, RngPurpose::test, static_cast<std::uint64_t>(part));
      const auto check = [&](const std::function<double(std::size_t)>& direction, double unit,
                             const std::string& what) {
        constexpr double kStep = 1e-6;
        const std::vector<double> before = parameters;
        double expected = 0.0, got = 0.0;
        for (const double sign : {1.0, -1.0}) {
          for (std::size_t i = 0; i < parameters.size(); ++i) parameters[i] = before[i] + sign * kStep * direction(i);
          expected += sign * c.reference.loss(b, denominators) / (2 * kStep);
        }
        parameters = before;
        for (std::size_t i = 0; i < parameters.size(); ++i) got += gradient[i] * direction(i);
        EXPECT_NEAR(got, expected, 3e-4 * unit) << what;
      };
      for (int d = 0; d < 2; ++d) {
        std::vector<double> signs;
        for (std::size_t i = 0; i < parameters.size(); ++i) signs.push_back(rng.uniform() < 0.5f ? -1.0 : 1.0);
        check([&](std::size_t i) { return signs[i]; }, std::sqrt(square), "direction " + std::to_string(d));
      }
      for (int single = 0; single < 4; ++single) {
        std::size_t at = rng.below(static_cast<std::uint32_t>(gradient.size()));
        while (single < 3 && gradient[at] == 0.0) at = (at + 1) % gradient.size();
        check([&](std::size_t i) { return i == at ? 1.0 : 0.0; }, std::sqrt(square / count),
              "number " + std::to_string(at));
      }
    }
  }
}

TEST(NcrField, SaysWhatItNeedsTraced) {
  Config config = preset("default");
  config.field = "ncr";
  const QueryRays train = query_rays(config, true), render = query_rays(config);
  EXPECT_EQ(train.lobe_rays(0.1f), 128);
  EXPECT_EQ(train.iterations, 10);
  EXPECT_EQ(render.lobe_rays(0.1f), 32);
  EXPECT_EQ(render.iterations, 3);
  EXPECT_EQ(render.clusters, 4);
  EXPECT_EQ(render.count(0.5f), 0);
  EXPECT_FALSE(render.offset.traced);
  config.field = "nr";
  config.lookup_offset = LookupOffset::traced;  // a key of another field
  EXPECT_EQ(query_rays(config).count(0.0f), 0);
  config.field = "octaoctree";
  EXPECT_EQ(query_rays(config).count(0.0f), 1);
}

}  // namespace
}  // namespace octrad
