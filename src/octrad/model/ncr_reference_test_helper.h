// Neural Cone Radiosity evaluated from its definition in double, point by point, with loss and gradient: what the field
// of the CPU and that of a device are tested against. Not part of the library.
#pragma once

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "octrad/encoding/prefiltered_grid_math.h"
#include "octrad/model/field_switches_test_helper.h"

namespace octrad::testing {

// Every number that training changes is in `parameters`.
class NcrReference {
 public:
  enum Part { kGrid, kDecoder, kConeGrid, kCone, kMerge, kParts };
  static constexpr const char* kNames[kParts] = {"ncr.grid", "ncr.mlp", "ncr.cone.grid", "ncr.cone.mlp",
                                                 "ncr.merge.mlp"};
  using Numbers = std::array<std::vector<double>, kParts>;

  // halves: rounded as on a device, where also the table of lobe angles is read; else its exact values.
  NcrReference(const Config& config, NcrField& field, FieldReference::Halves halves = {})
      : config_(config),
        halves_(halves),
        scale_(static_cast<double>(field.target_scale())),
        origin_(field.origin()),
        size_(field.size()),
        lobe_(field.lobe()),
        grid_(field.grid().view()),
        cone_grid_(field.cone_grid().view()),
        decoder_{field.decoder().mlp().shape(), halves.networks},
        cone_{field.cone_mlp().shape(), halves.networks},
        merge_{field.merge_mlp().shape(), halves.networks} {
    const auto copy = [](std::span<const float> from, bool round) {
      std::vector<double> to(from.begin(), from.end());
      for (double& v : to) v = round ? as_half(v) : v;
      return to;
    };
    parameters[kGrid] = copy(field.grid().table(), halves.tables);
    decoder_.map = field.decoder().input_map(decoder_.shape.inputs - kPointInputs);
    cone_.map = field.decoder().input_map(cone_grid_.features);
    parameters[kDecoder] = decoder_.given_weights(field.decoder().mlp().weights());
    parameters[kConeGrid] = copy(field.cone_grid().table(), halves.tables);
    parameters[kCone] = cone_.given_weights(field.cone_mlp().weights());
    parameters[kMerge] = merge_.given_weights(field.merge_mlp().weights());
  }

  Numbers parameters;

  // A point's intermediate values.
  struct Cone {
    Vec3d p;
    double r, share;
    MlpReference network;  // with its activations
  };
  struct Query {
    bool glossy = false;
    Vec3d diffuse, radiance;
    MlpReference decoder, merge;
    std::vector<Cone> cones;
    double margin = 1.0;  // distance of a neuron from the edge of ReLU, relative
  };

  Query evaluate(const SurfacePoint& p) {
    Query q;
    const Vec3d x(p.x), w(reflect(p.wo, p.n)), origin(origin_), size(size_);
    const double extent = std::max({size.x, size.y, size.z});
    const Vec3d unit = (x - origin) / size;
    const bool world = config_.decoder_position == DecoderPosition::world;
    const auto position = [&](Vec3d at) {
      if (world) return at;
      Vec3d inside = (at - origin) / size * 2.0 - Vec3d(1.0);
      for (int a = 0; a < 3; ++a) {  // beyond [-1, 1]: drawn into (-2, 2)
        const double far = std::abs(inside[a]);
        if (far > 1.0) inside[a] = std::copysign(2.0 - 1.0 / far, inside[a]);
      }
      return inside;
    };
    std::vector<double> in;
    for (int l = 0; l < grid_.levels; ++l) add_features(grid_, l, unit, 1.0, parameters[kGrid], in, true);
    append(in, position(x));
    append(in, w);
    append(in, Vec3d(p.n));
    append(in, Vec3d(p.albedo));
    in.push_back(static_cast<double>(p.alpha));
    q.decoder = decoder_;
    const std::vector<double> linear = q.decoder.forward(q.decoder.given(in), parameters[kDecoder]);
    q.margin = q.decoder.margin;
    for (int c = 0; c < 3; ++c) q.diffuse[c] = output(linear[static_cast<std::size_t>(c)]).value;
    q.glossy = static_cast<double>(p.alpha) < config_.lookup_rough_threshold;
    if (!q.glossy) {
      q.radiance = q.diffuse * factor(p);
      return q;
    }
    Vec3d glossy;
    for (int k = 0; k < config_.ncr_clusters; ++k) {
      const double t = static_cast<double>(p.lobe[k].distance), s = static_cast<double>(p.lobe[k].deviation),
                   share = static_cast<double>(p.lobe[k].share);
      if (share == 0.0) continue;
      const double tangent = halves_.networks
                                 ? static_cast<double>(lobe_(p.alpha))
                                 : lobe_tangent_exact(static_cast<double>(p.alpha), config_.ncr_lobe_share);
      const double r = (t * tangent + s) / 2 / extent;
      const Vec3d end = x + w * t;
      std::vector<double> features(static_cast<std::size_t>(cone_grid_.features));
      const Cone cone{(end - origin) / extent, r, share, cone_};
      visit_cone_levels(r, [&](int level, double weight) {
        add_features(cone_grid_, level, cone.p, weight, parameters[kConeGrid], features, false);
      });
      append(features, position(end));
      append(features, w * -1.0);
      features.push_back(r);
      q.cones.push_back(cone);
      const std::vector<double> color = q.cones.back().network.forward(cone_.given(features), parameters[kCone]);
      q.margin = std::min(q.margin, q.cones.back().network.margin);
      for (int c = 0; c < 3; ++c) glossy[c] += output(color[static_cast<std::size_t>(c)]).value * share;
    }
    std::vector<double> merge;
    append(merge, q.diffuse);
    append(merge, glossy);
    merge.push_back(static_cast<double>(p.alpha));
    append(merge, Vec3d(p.albedo));
    q.merge = merge_;
    const std::vector<double> merged = q.merge.forward(q.merge.given(merge), parameters[kMerge]);
    q.margin = std::min(q.margin, q.merge.margin);
    for (int c = 0; c < 3; ++c)
      q.radiance[c] = std::log1p(std::exp(merged[static_cast<std::size_t>(c)])) * factor(p)[c];
    return q;
  }
  Vec3d radiance(const SurfacePoint& p) { return evaluate(p).radiance; }

  // Denominators of the relative loss are constants to the gradient.
  std::vector<Vec3d> denominators(const TrainingBatch& batch) {
    std::vector<Vec3d> result;
    for (std::size_t i = 0; i < batch.points.size(); ++i) {
      const Vec3d l = radiance(batch.points[i]);
      const bool symmetric = config_.loss_normalizer == LossNormalizer::symmetric;
      Vec3d d = (symmetric ? (l + Vec3d(batch.targets[i])) * 0.5 : l) + Vec3d(batch.epsilon);
      for (int c = 0; c < 3; ++c) d[c] *= std::pow(d[c] / scale_, config_.loss_power / 2 - 1);
      result.push_back(d);
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

  // Backpropagation from the definition, with the roundings of halves.
  Numbers gradient(const TrainingBatch& batch) {
    Numbers g;
    for (int part = 0; part < kParts; ++part) g[part].assign(parameters[part].size(), 0.0);
    const std::size_t n = batch.points.size();
    const double norm = 1.0 / (3.0 * static_cast<double>(n));
    std::vector<Query> queries;
    std::vector<std::vector<double>> d(n);  // at the outputs that show, then at those of the diffuse branch
    const std::vector<Vec3d> denominators = this->denominators(batch);
    double largest = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      queries.push_back(evaluate(batch.points[i]));
      const Query& q = queries.back();
      const Vec3d t(batch.targets[i]), l = q.radiance;
      const ChromaTerm<double> chroma = chroma_loss(l, t, batch.epsilon);
      const Vec3d f = factor(batch.points[i]);
      for (std::size_t c = 0; c < 3; ++c) {
        const int k = static_cast<int>(c);
        const double linear = (q.glossy ? q.merge : q.decoder).activations.back()[c],
                     slope = q.glossy ? softplus(linear).derivative : output(linear).derivative,
                     relative = -2.0 * (t[k] - l[k]) / (denominators[i][k] * denominators[i][k]);
        d[i].push_back((relative + config_.ncr_chroma * chroma.gradient[k]) * f[k] * slope * norm);
        if (q.glossy) largest = std::max(largest, std::abs(d[i].back()));
      }
    }
    const double merge_scale = power_of_two(largest);
    double largest_cone = 0.0, largest_diffuse = 0.0;
    std::vector<std::vector<std::vector<double>>> d_cones(n);
    for (std::size_t i = 0; i < n; ++i) {
      Query& q = queries[i];
      if (q.glossy) {
        const std::vector<double> up = q.merge.backward(d[i], parameters[kMerge], g[kMerge], merge_scale);
        for (std::size_t c = 0; c < 3; ++c) d[i][c] = up[c] * output(q.decoder.activations.back()[c]).derivative;
        for (const Cone& cone : q.cones) {
          d_cones[i].emplace_back();
          for (std::size_t c = 0; c < 3; ++c) {
            const double linear = cone.network.activations.back()[c];
            d_cones[i].back().push_back(up[3 + c] * cone.share * output(linear).derivative);
            largest_cone = std::max(largest_cone, std::abs(d_cones[i].back().back()));
          }
        }
      }
      for (const double v : d[i]) largest_diffuse = std::max(largest_diffuse, std::abs(v));
    }
    const double cone_scale = power_of_two(largest_cone), decoder_scale = power_of_two(largest_diffuse);
    const auto width = static_cast<std::size_t>(grid_.features);
    for (std::size_t i = 0; i < n; ++i) {
      Query& q = queries[i];
      for (std::size_t k = 0; k < q.cones.size(); ++k) {
        const Cone& cone = q.cones[k];
        const std::vector<double> up = cone.network.backward(d_cones[i][k], parameters[kCone], g[kCone], cone_scale);
        visit_cone_levels(cone.r, [&](int level, double weight) {
          add_gradient(cone_grid_, level, cone.p, weight, up.data(), g[kConeGrid]);
        });
      }
      const std::vector<double> up = q.decoder.backward(d[i], parameters[kDecoder], g[kDecoder], decoder_scale);
      const Vec3d unit = (Vec3d(batch.points[i].x) - Vec3d(origin_)) / Vec3d(size_);
      for (int l = 0; l < grid_.levels; ++l)
        add_gradient(grid_, l, unit, 1.0, up.data() + static_cast<std::size_t>(l) * width, g[kGrid]);
    }
    return g;
  }

 private:
  static void append(std::vector<double>& to, Vec3d v) { to.insert(to.end(), {v.x, v.y, v.z}); }
  // As a field on a device: brings the largest gradient to 16 .. 32.
  static double power_of_two(double largest) {
    return largest > 0.0 ? std::ldexp(1.0, 4 - std::ilogb(static_cast<float>(largest))) : 1.0;
  }
  Activated<double> output(double v) const { return activate(config_.ncr_output, v); }
  Vec3d factor(const SurfacePoint& p) const {
    const bool demodulate =
        config_.target_demodulate == TargetDemodulation::albedo && config_.target_emission == TargetEmission::outside &&
        (config_.lookup_coats == Coats::split || static_cast<double>(p.alpha) >= config_.lookup_rough_threshold);
    return (demodulate ? Vec3d(p.albedo) : Vec3d(1.0)) * scale_;
  }
  // visit(level, weight): two levels by bracketing, in double.
  template <typename Visitor>
  void visit_cone_levels(double r, Visitor&& visit) const {
    const auto footprint = [&](int l) { return 2.0 / (config_.ncr_cone_base * std::pow(config_.ncr_cone_scale, l)); };
    for (int l = 0; l < cone_grid_.levels; ++l) {
      const bool first = l == 0, last = l + 1 == cone_grid_.levels;
      const double weight = r >= footprint(l)
                                ? (first ? 1.0 : (footprint(l - 1) - r) / (footprint(l - 1) - footprint(l)))
                                : (last ? 1.0 : (r - footprint(l + 1)) / (footprint(l) - footprint(l + 1)));
      if (weight > 0.0) visit(l, weight);
    }
  }
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
  static void add_gradient(const HashGridView& grid, int level, Vec3d p, double weight, const double* up,
                           std::vector<double>& to) {
    const auto width = static_cast<std::size_t>(grid.features);
    std::uint32_t entry[8];
    double taps[8];
    hash_grid_taps(grid.level[level], p, entry, taps);
    for (int k = 0; k < 8; ++k) {
      for (std::size_t f = 0; f < width; ++f) to[entry[k] * width + f] += weight * taps[k] * up[f];
    }
  }

  Config config_;
  FieldReference::Halves halves_;
  double scale_;
  Vec3f origin_, size_;
  LobeTable lobe_;
  HashGridView grid_, cone_grid_;
  MlpReference decoder_, cone_, merge_;
};

// What Adam's first moments hold, by part (first_moments()).
inline NcrReference::Numbers ncr_first_moments(RadianceField& field) {
  NcrReference::Numbers result;
  const auto tensors = tensors_of(field);
  for (int part = 0; part < NcrReference::kParts; ++part) {
    const bool table = part == NcrReference::kGrid || part == NcrReference::kConeGrid;
    const SavedTensor& t =
        tensors.at(std::string("optimizer.") + NcrReference::kNames[part] + (table ? ".moments" : ".m"));
    const auto width = table ? static_cast<std::size_t>(t.shape[2]) : t.values.size();
    for (std::size_t at = 0; at < t.values.size(); at += (table ? 2 : 1) * width)
      result[part].insert(result[part].end(), t.values.data() + at, t.values.data() + at + width);
  }
  return result;
}

inline const std::vector<FieldKeys> kNcrSwitches = {{},
                                                    {{"ncr.output", "squareplus"}},
                                                    {{"ncr.chroma", "3"}},
                                                    {{"ncr.clusters", "2"}},
                                                    {{"ncr.cone.features", "4"}, {"ncr.cone.scale", "1.5"}},
                                                    {{"ncr.features", "2"}, {"ncr.merge.hidden", "2"}},
                                                    {{"ncr.lobe_share", "0.5"}},
                                                    {{"decoder.position", "world"}},
                                                    {{"target.demodulate", "none"}},
                                                    {{"lookup.coats", "joined"}},
                                                    {{"target.emission", "inside"}},
                                                    {{"loss.normalizer", "symmetric"}},
                                                    {{"lookup.rough_threshold", "1.5"}},
                                                    {{"lookup.rough_threshold", "0"}}};

}  // namespace octrad::testing
