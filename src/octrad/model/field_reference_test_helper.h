// Radiance fields evaluated from their definition in double, point by point, with loss and gradient: what fields of the
// CPU and of devices are tested against. Fixed inputs of a query (direction, the point's own inputs) and the weights of
// look-ups come from the _math.h definitions; switches are read from the configuration by their names. Not part of the
// library.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "octrad/base/lookup_rule.h"
#include "octrad/encoding/hash_grid_math.h"
#include "octrad/encoding/octaoctree_math.h"
#include "octrad/encoding/spherical_harmonics_math.h"
#include "octrad/model/field_test_helper.h"
#include "octrad/model/reflected_math.h"
#include "octrad/network/mlp_reference_test_helper.h"

namespace octrad::testing {

class FieldReference {
 public:
  // What training changes. Field nr has the last two parts: its hash grid and its network.
  enum Part { kOctree, kDisparity, kGrid, kDecoder, kParts };
  static constexpr const char* kNames[kParts] = {"octree", "disparity", "grid", "decoder"};
  using Numbers = std::array<std::vector<double>, kParts>;

  // Where a field on a device has halves. Both false: nothing is rounded.
  struct Halves {
    bool networks = false;  // inputs, weights and activations of networks, and gradients in them
    bool tables = false;    // feature tables as look-ups read them
  };

  FieldReference(const Config& config, RadianceField& field, Halves halves)
      : halves_(halves),
        octaoctree_(dynamic_cast<OctaOctreeField*>(&field)),
        nr_(dynamic_cast<NrField*>(&field)),
        scale_(static_cast<double>(field.target_scale())) {
    const auto is = [&](const std::string& key, const std::string& value) { return get(config, key) == value; };
    const auto copy = [](std::span<const float> from, auto&& round) {
      std::vector<double> to;
      for (const float v : from) to.push_back(round(static_cast<double>(v)));
      return to;
    };
    const auto table = [&](double v) { return halves_.tables ? as_half(v) : v; };
    if (octaoctree_ != nullptr) {
      parameters[kOctree] = copy(octaoctree_->octree().features(), table);
      if (DisparityPredictor* predictor = octaoctree_->predictor()) {
        parameters[kGrid] = copy(predictor->grid.table(), table);
        disparity_ = {predictor->network.shape(), halves_.networks};
        parameters[kDisparity] = disparity_.given_weights(predictor->network.weights());
        grid_ = predictor->grid.view();
      }
      octree_ = octaoctree_->octree().view();
    } else {
      parameters[kGrid] = copy(nr_->grid().table(), table);
      grid_ = nr_->grid().view();
    }
    auto& base = dynamic_cast<FieldBase&>(field);
    origin_ = base.origin();
    size_ = base.size();
    const DecoderHead& head = base.decoder();
    decoder_ = {head.mlp().shape(), halves_.networks};
    decoder_.map = head.input_map(decoder_.shape.inputs - kPointInputs);
    parameters[kDecoder] = decoder_.given_weights(head.mlp().weights());
    predicted_ = octaoctree_ != nullptr && is("lookup.offset", "predicted");
    traced_ = octaoctree_ != nullptr && is("lookup.offset", "traced");
    reflects_ = traced_ && is("lookup.reflected", "features");
    mirror_ = nr_ != nullptr || is("lookup.direction", "mirror");
    rough_normal_ = octaoctree_ != nullptr && is("lookup.rough_direction", "normal");
    rough_offset_ = is("lookup.rough_offset", "true");
    harmonics_ = is("disparity.direction", "true");
    unit_ = is("disparity.unit", "extent") ? 1.0 / static_cast<double>(max_component(size_)) : 1.0;
    normalized_ = is("decoder.position", "normalized");
    demodulate_ = is("target.demodulate", "albedo") && is("target.emission", "outside");
    split_coats_ = is("lookup.coats", "split");
    normalizer_ = is("loss.normalizer", "symmetric") ? LossNormalizer::symmetric : LossNormalizer::prediction;
    power_ = config.loss_power;
    const std::string output = octaoctree_ != nullptr ? "decoder.output" : "nr.output";
    activation_ = is(output, "exp")          ? Activation::exp
                  : is(output, "squareplus") ? Activation::squareplus
                                             : Activation::abs;
    rough_threshold_ = static_cast<float>(config.lookup_rough_threshold);
  }

  Numbers parameters;

  // Intermediate values of one point.
  struct Query {
    Vec3d w, radiance;
    double disparity = 0.0, disparity_linear = 0.0;
    std::vector<double> features, linear;
    Vec3d reflected_x, reflected_w;  // look-up at the reflected surface, where there is one
    bool reflects = false;
    std::uint64_t lookup_piece = 0;  // names the entries that the look-ups read
    std::uint64_t piece = 0;         // names those, the neurons that are on and the signs of outputs
    double margin = 1.0;             // distance from the edges of that piece that networks make, relative
  };
  Query evaluate(const SurfacePoint& point) { return evaluate(point, Vec3d(point.x), direction(point), 0.0); }

  // Whether the piece stays the same when what floats round moves by more than that.
  bool far_from_edges(const SurfacePoint& point) {
    const Vec3d x(point.x), w = direction(point);
    const Query here = evaluate(point, x, w, 0.0);
    if (here.margin < kMargin) return false;
    for (const double sign : {-kMargin, kMargin}) {
      if (evaluate(point, x, w, sign * (1.0 + here.disparity)).lookup_piece != here.lookup_piece) return false;
      for (int a = 0; a < 3; ++a) {
        Vec3d shift;
        shift[a] = sign;
        if (evaluate(point, x, w + shift, 0.0).lookup_piece != here.lookup_piece) return false;
        if (evaluate(point, x + shift * 0.1, w, 0.0).lookup_piece != here.lookup_piece) return false;
      }
    }
    return true;
  }

  // The loss's denominators, whose squares it divides by, at the present parameters: constants to the gradient, as the
  // targets are.
  std::vector<double> denominators(const TrainingBatch& batch) {
    std::vector<double> result;
    for (std::size_t i = 0; i < batch.points.size(); ++i) {
      const Vec3d radiance = evaluate(batch.points[i]).radiance;
      for (int c = 0; c < 3; ++c) {
        const double target = static_cast<double>(batch.targets[i][c]);
        const double d =
            (normalizer_ == LossNormalizer::symmetric ? (target + radiance[c]) / 2 : radiance[c]) + batch.epsilon;
        result.push_back(d * std::pow(d / scale_, power_ / 2 - 1));  // its square is d^power, in units of the scale
      }
    }
    return result;
  }

  struct Loss {
    double value = 0.0;       // mean over points and channels
    std::uint64_t piece = 0;  // of all points together
  };
  Loss loss(const TrainingBatch& batch, const std::vector<double>& denominators) {
    Loss loss;
    for (std::size_t i = 0; i < batch.points.size(); ++i) {
      const Query query = evaluate(batch.points[i]);
      loss.piece = join(loss.piece, query.piece);
      for (int c = 0; c < 3; ++c) {
        const double relative = (static_cast<double>(batch.targets[i][c]) - query.radiance[c]) /
                                denominators[3 * i + static_cast<std::size_t>(c)];
        loss.value += relative * relative / (3.0 * static_cast<double>(batch.points.size()));
      }
    }
    return loss;
  }

  // Backpropagation from the definition, with the roundings of halves.
  Numbers gradient(const TrainingBatch& batch) {
    Numbers g;
    for (int part = 0; part < kParts; ++part) g[part].assign(parameters[part].size(), 0.0);
    const double norm = 1.0 / (3.0 * static_cast<double>(batch.points.size()));
    struct Row {
      std::vector<double> d_linear;
      double d_disparity_linear = 0.0;
    };
    std::vector<Row> rows(batch.points.size());
    double largest = 0.0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const Query query = evaluate(batch.points[i]);
      const Vec3d factor = this->factor(batch.points[i]);
      for (int c = 0; c < 3; ++c) {
        const Activated<double> output = activate(activation_, query.linear[static_cast<std::size_t>(c)]);
        const LossTerm<double> term =
            relative_squared_loss(factor[c] * output.value, static_cast<double>(batch.targets[i][c]), batch.epsilon,
                                  normalizer_, {static_cast<float>(power_), static_cast<float>(scale_)});
        rows[i].d_linear.push_back(term.gradient * factor[c] * output.derivative * norm);
        largest = std::max(largest, std::abs(rows[i].d_linear.back()));
      }
    }
    const double decoder_scale = power_of_two(largest);
    largest = 0.0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const SurfacePoint& point = batch.points[i];
      const Query query = evaluate(point);
      const std::vector<double> up =
          decoder_.backward(rows[i].d_linear, parameters[kDecoder], g[kDecoder], decoder_scale);
      if (nr_ != nullptr) {
        add_grid(point, up, g[kGrid]);
        continue;
      }
      double by_disparity = 0.0;
      visit_octree(Vec3d(point.x), query.w, query.disparity,
                   [&](int level, std::size_t entry, double weight, double dweight) {
                     const auto width = static_cast<std::size_t>(octree_.features);
                     for (std::size_t c = 0; c < width; ++c) {
                       const double u = up[static_cast<std::size_t>(level) * width + c];
                       g[kOctree][entry * width + c] += weight * u;
                       by_disparity += dweight * parameters[kOctree][entry * width + c] * u;
                     }
                   });
      if (query.reflects) {
        visit_octree(query.reflected_x, query.reflected_w, 0.0,
                     [&](int level, std::size_t entry, double weight, double) {
                       const auto width = static_cast<std::size_t>(octree_.features);
                       const std::size_t first = static_cast<std::size_t>(octree_.levels + level) * width;
                       for (std::size_t c = 0; c < width; ++c) g[kOctree][entry * width + c] += weight * up[first + c];
                     });
      }
      if (predicted_ && has_offset(point))
        rows[i].d_disparity_linear = by_disparity * squareplus(query.disparity_linear).derivative * unit_;
      largest = std::max(largest, std::abs(rows[i].d_disparity_linear));
    }
    if (!predicted_) return g;
    const double disparity_scale = power_of_two(largest);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      evaluate(batch.points[i]);
      const std::vector<double> up =
          disparity_.backward({rows[i].d_disparity_linear}, parameters[kDisparity], g[kDisparity], disparity_scale);
      add_grid(batch.points[i], up, g[kGrid]);
    }
    return g;
  }

  // Points of box_points() that are far from edges, with targets.
  TrainingBatch batch(std::size_t n, unsigned long long stream, int* left_out = nullptr) {
    TrainingBatch result;
    for (const SurfacePoint& p : box_points(n + n / 4, stream)) {
      if (result.points.size() == n) break;
      if (!far_from_edges(p)) {
        if (left_out != nullptr) ++*left_out;
        continue;
      }
      Rng rng(stream, RngPurpose::test, 2'000'000 + result.points.size());
      result.points.push_back(p);
      result.targets.push_back(Vec3f(rng.uniform(), rng.uniform(), rng.uniform()) * 2.0f);
    }
    EXPECT_EQ(result.points.size(), n) << "too many points lie near edges";
    return result;
  }

 private:
  static constexpr double kMargin = 1e-5;

  static std::uint64_t join(std::uint64_t a, std::uint64_t b) { return mix64(a * 0x9e3779b97f4a7c15ull + b); }
  // Brings the largest gradient to 16 .. 32, as a field on a device does before it rounds gradients to halves.
  static double power_of_two(double largest) {
    return largest > 0.0 ? std::ldexp(1.0, 4 - std::ilogb(static_cast<float>(largest))) : 1.0;
  }

  Vec3d direction(const SurfacePoint& point) const {
    if (rough_normal_ && point.alpha >= rough_threshold_) return Vec3d(point.n);
    return Vec3d(mirror_ ? reflect(point.wo, point.n) : point.wo);
  }
  bool has_offset(const SurfacePoint& point) const { return rough_offset_ || point.alpha < rough_threshold_; }
  Vec3d factor(const SurfacePoint& point) const {
    return demodulate_ && (split_coats_ || point.alpha >= rough_threshold_) ? Vec3d(point.albedo) * scale_
                                                                            : Vec3d(scale_);
  }
  Vec3d normalized(Vec3d x) const { return (x - Vec3d(origin_)) / Vec3d(size_); }
  // Where tables are looked up: a point outside at the nearest place of the domain.
  Vec3d inside(Vec3d x) const { return min(max(normalized(x), Vec3d(0.0)), Vec3d(1.0)); }
  // Beyond [-1, 1]: drawn into (-2, 2).
  static double contracted(double x) {
    return std::abs(x) <= 1.0 ? x : (x < 0.0 ? -1.0 : 1.0) * (2.0 - 1.0 / std::abs(x));
  }

  static Vec3d contracted(Vec3d p) { return {contracted(p.x), contracted(p.y), contracted(p.z)}; }

  // visit(level, entry, weight, derivative of the weight by the disparity).
  template <typename Visitor>
  void visit_octree(Vec3d x, Vec3d w, double d, Visitor&& visit) const {
    for (int l = 0; l < octree_.levels; ++l) {
      visit_level(octree_, octree_.level[l], inside(x), w, d, [&](std::uint32_t entry, double weight, double dweight) {
        visit(l, std::size_t{entry}, weight, dweight);
      });
    }
  }
  void octree_features(Vec3d x, Vec3d w, double d, std::uint64_t& piece, double* features) const {
    const auto width = static_cast<std::size_t>(octree_.features);
    visit_octree(x, w, d, [&](int level, std::size_t entry, double weight, double) {
      piece = join(piece, entry);
      for (std::size_t c = 0; c < width; ++c)
        features[static_cast<std::size_t>(level) * width + c] += weight * parameters[kOctree][entry * width + c];
    });
  }
  // visit(level, entry, weight).
  template <typename Visitor>
  void visit_grid(Vec3d x, Visitor&& visit) const {
    for (int l = 0; l < grid_.levels; ++l) {
      std::uint32_t entry[8];
      double weight[8];
      hash_grid_taps(grid_.level[l], inside(x), entry, weight);
      for (int k = 0; k < 8; ++k) visit(l, std::size_t{entry[k]}, weight[k]);
    }
  }
  std::vector<double> grid_features(Vec3d x, std::uint64_t& piece) const {
    const auto width = static_cast<std::size_t>(grid_.features);
    std::vector<double> features(static_cast<std::size_t>(grid_.levels) * width);
    visit_grid(x, [&](int level, std::size_t entry, double weight) {
      piece = join(piece, entry);
      for (std::size_t c = 0; c < width; ++c)
        features[static_cast<std::size_t>(level) * width + c] += weight * parameters[kGrid][entry * width + c];
    });
    return features;
  }
  void add_grid(const SurfacePoint& point, const std::vector<double>& up, std::vector<double>& g) const {
    const auto width = static_cast<std::size_t>(grid_.features);
    visit_grid(Vec3d(point.x), [&](int level, std::size_t entry, double weight) {
      for (std::size_t c = 0; c < width; ++c)
        g[entry * width + c] += weight * up[static_cast<std::size_t>(level) * width + c];
    });
  }

  // Features of what is reflected, found like those of a point there, and its attributes.
  void add_reflected(const SurfacePoint& point, Vec3d x, Vec3d w, Query& q, std::vector<double>& in) const {
    const LookupRule& rule = octaoctree_->lookup_rule();
    const std::size_t first = in.size();
    in.resize(2 * first, 0.0);
    q.reflects = has_reflected(rule, point, static_cast<float>(q.disparity));
    if (length(point.reflected.w) > 0.0f) w = Vec3d(point.reflected.w);
    if (q.reflects) {
      q.reflected_x = x + w * (1.0 / q.disparity);
      q.reflected_w = Vec3d(reflected_direction(rule, point.reflected, Vec3f(w)));
      octree_features(q.reflected_x, q.reflected_w, 0.0, q.piece, &in[first]);
    }
    float attributes[kReflectedInputs];
    reflected_inputs(rule, point, static_cast<float>(q.disparity),
                     Vec3f(contracted(normalized(q.reflected_x) * 2.0 - Vec3d(1.0))), static_cast<float>(scale_),
                     attributes);
    in.insert(in.end(), attributes, attributes + kReflectedInputs);
  }

  Query evaluate(const SurfacePoint& point, Vec3d x, Vec3d w, double disparity_shift) {
    Query q;
    q.w = w;
    if (octaoctree_ != nullptr) {
      if (predicted_) {
        std::vector<double> in = grid_features(x, q.piece);
        if (harmonics_) {
          double values[kSphericalHarmonics];
          spherical_harmonics(w, values);
          in.insert(in.end(), values, values + kSphericalHarmonics);
        }
        q.disparity_linear = disparity_.forward(disparity_.given(in), parameters[kDisparity])[0];
        q.margin = disparity_.margin;
        q.disparity = squareplus(q.disparity_linear).value * unit_;
      } else if (traced_) {
        q.disparity = static_cast<double>(point.disparity);
      }
      if (!has_offset(point)) q.disparity = 0.0;
      q.features.assign(static_cast<std::size_t>(octree_.levels * octree_.features), 0.0);
      octree_features(x, w, q.disparity + disparity_shift, q.piece, q.features.data());
    } else {
      q.features = grid_features(x, q.piece);
    }
    std::vector<double> in = q.features;
    if (reflects_) add_reflected(point, x, w, q, in);
    q.lookup_piece = q.piece;
    Vec3d p = normalized_ ? normalized(x) * 2.0 - Vec3d(1.0) : x;
    const Vec3d n(point.n), a(point.albedo);
    if (normalized_) p = contracted(p);
    for (const Vec3d& v : {p, w, n, a}) in.insert(in.end(), {v.x, v.y, v.z});
    in.push_back(static_cast<double>(point.alpha));
    q.linear = decoder_.forward(decoder_.given(in), parameters[kDecoder]);
    q.margin = std::min(q.margin, decoder_.margin);
    for (const MlpReference* mlp : {&disparity_, &decoder_}) {
      for (std::size_t l = 1; l + 1 < mlp->activations.size(); ++l) {
        for (const double v : mlp->activations[l]) q.piece = join(q.piece, v > 0.0 ? 1 : 2);
      }
    }
    const Vec3d f = factor(point);
    for (int c = 0; c < 3; ++c) {
      const double linear = q.linear[static_cast<std::size_t>(c)];
      q.radiance[c] = f[c] * activate(activation_, linear).value;
      if (activation_ != Activation::abs) continue;
      q.piece = join(q.piece, linear < 0.0 ? 1 : 2);
      q.margin = std::min(q.margin, std::abs(linear));
    }
    return q;
  }

  Halves halves_;
  OctaOctreeField* octaoctree_;
  NrField* nr_;
  double scale_;
  MlpReference disparity_, decoder_;
  OctaOctreeView octree_;
  HashGridView grid_;
  Vec3f origin_, size_;
  bool predicted_ = false, traced_ = false, reflects_ = false, mirror_ = false, rough_normal_ = false,
       rough_offset_ = false, harmonics_ = false, normalized_ = false, demodulate_ = false, split_coats_ = false;
  double unit_ = 1.0;
  float rough_threshold_ = 0.5f;
  LossNormalizer normalizer_ = LossNormalizer::prediction;
  double power_ = 2.0;  // loss.power
  Activation activation_ = Activation::exp;
};

}  // namespace octrad::testing
