// The table of configuration keys: one line a switch, with its range and one line of help. Everything else here
// (parsing, JSON, the manual's table) is derived from it.
#include "octrad/model/config.h"
#include "octrad/base/hit_cluster.h"
#include "octrad/base/lookup_rule.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <variant>

#include "octrad/base/duration.h"
#include "octrad/base/error.h"
#include "octrad/base/escape.h"
#include "octrad/base/join.h"
#include "octrad/model/field_registry.h"

namespace octrad {
namespace {

// A key with a list of names: get() gives one of them, set() takes its index.
struct Choice {
  std::vector<std::string> names;
  std::function<std::string(const Config&)> get;
  std::function<void(Config&, std::size_t)> set;
};

using Member =
    std::variant<int Config::*, long long Config::*, double Config::*, bool Config::*, std::string Config::*, Choice>;

std::string field_titles() {
  std::vector<std::string> titles;
  for (const FieldEntry* field : field_entries()) titles.emplace_back(field->title);
  return join(titles, " or ");
}

struct Range {
  double low, high;
  bool open_low = false;
  bool power_of_2 = false;
};
constexpr double kAny = 1e300;
constexpr Range kFeatureCounts = {2, 8, false, true};  // that look-ups have code for

struct Key {
  std::string name;
  Member member;
  Range range;
  bool duration;
  std::string help;
  const char* form = nullptr;  // of a text: what is accepted, and whether one is
  bool (*valid)(const std::string&) = nullptr;
};

Key number(const char* name, Member member, Range range, const char* help) {
  return {name, std::move(member), range, false, help};
}
template <typename Enum>
Key choice(const char* name, Enum Config::*member,
           std::vector<std::pair<const char*, std::type_identity_t<Enum>>> values, const char* help) {
  Choice c;
  for (const auto& [text, value] : values) c.names.emplace_back(text);
  c.get = [=](const Config& config) -> std::string {
    for (const auto& [text, value] : values) {
      if (config.*member == value) return text;
    }
    throw UsageError(fmt::format("{} has a value without a name", name));
  };
  c.set = [=](Config& config, std::size_t i) { config.*member = values[i].second; };
  return {name, std::move(c), {}, false, help};
}
// A choice that is known by its name only.
Key name_of(const char* name, std::string Config::*member, const std::vector<std::string>& names, std::string help) {
  return {name,
          Choice{names, [=](const Config& config) { return config.*member; },
                 [=](Config& config, std::size_t i) { config.*member = names[i]; }},
          {},
          false,
          std::move(help)};
}
Key flag(const char* name, bool Config::*member, const char* help) { return {name, member, {}, false, help}; }
Key duration(const char* name, double Config::*member, Range range, const char* help) {
  return {name, member, range, true, help};
}

// "xmin,ymin,zmin,xmax,ymax,zmax", each minimum below its maximum.
std::optional<Bounds3f> parse_box(const std::string& text) {
  float v[6];
  const char* at = text.c_str();
  if (text.find_first_not_of("+-.0123456789eE,") != std::string::npos) return std::nullopt;
  for (int i = 0; i < 6; ++i) {
    char* end = nullptr;
    v[i] = std::strtof(at, &end);
    if (end == at || !std::isfinite(v[i]) || *end != (i < 5 ? ',' : '\0')) return std::nullopt;
    at = end + 1;
  }
  const Bounds3f box{{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
  if (!(min_component(box.extent()) > 0.0f) || !is_finite(box.extent())) return std::nullopt;
  return box;
}
Key bounds(const char* name, std::string Config::*member, const char* help) {
  return {name,
          member,
          {},
          false,
          help,
          "auto, scene, or six numbers: xmin,ymin,zmin,xmax,ymax,zmax",
          [](const std::string& text) { return text == "auto" || text == "scene" || parse_box(text).has_value(); }};
}

const std::vector<Key>& keys() {
  using C = Config;
  static const std::vector<Key> table = {
      name_of("preset", &C::preset, preset_names(), "the preset that the other keys started from"),
      name_of("field", &C::field, field_names(), "what is trained: " + field_titles()),

      number("octree.levels", &C::octree_levels, {1, 9},
             "K; the finest level has 2^(K+1) cells per axis; memory grows about 4.5 x a level"),
      number("octree.fine", &C::octree_fine, {0, 3},
             "finer levels beyond K, whose cells hold one feature vector for all directions; K + fine is at most 9"),
      number("octree.features", &C::octree_features, kFeatureCounts, "C, features per level and vertex: 2, 4 or 8"),
      choice("octree.box", &C::octree_box, {{"axis", OctreeBox::axis}, {"cube", OctreeBox::cube}},
             "domain: the box of octree.bounds, padded, normalised per axis, or its enclosing cube"),
      bounds(
          "octree.bounds", &C::octree_bounds,
          "the scene's bounding box, a given one, or a smaller one where most of what is seen fits into it; all fields"),
      choice("octree.occupancy", &C::octree_occupancy,
             {{"conservative", OctreeOccupancy::conservative}, {"sampled", OctreeOccupancy::sampled}},
             "cells kept: every cell that a surface overlaps, or those hit by 2^26 surface samples"),
      choice("octree.interpolation", &C::octree_interpolation,
             {{"trilinear", OctreeInterpolation::trilinear}, {"nearest", OctreeInterpolation::nearest}},
             "between the cells of a level"),
      choice("octa.interpolation", &C::octa_interpolation,
             {{"barycentric", OctaInterpolation::barycentric}, {"nearest", OctaInterpolation::nearest}},
             "between the vertices of a cell's octahedral map"),
      choice("lookup.direction", &C::lookup_direction,
             {{"mirror", LookupDirection::mirror}, {"outgoing", LookupDirection::outgoing}},
             "direction of the query on glossy surfaces: mirror direction or wo"),
      choice(
          "lookup.coats", &C::lookup_coats, {{"joined", Coats::joined}, {"split", Coats::split}},
          "coated surfaces: one response, or one for the base and one for the coat (needs target.emission = outside)"),
      choice("lookup.offset", &C::lookup_offset,
             {{"predicted", LookupOffset::predicted}, {"none", LookupOffset::none}, {"traced", LookupOffset::traced}},
             "disparity of the query: learned, 0, or 1/distance of a traced ray"),
      choice(
          "lookup.reflected", &C::lookup_reflected, {{"none", Reflected::none}, {"features", Reflected::features}},
          "what the decoder is given of the surface that the traced ray of lookup.offset meets; nothing without one"),
      choice("lookup.rough_direction", &C::lookup_rough_direction,
             {{"normal", RoughDirection::normal}, {"mirror", RoughDirection::mirror}},
             "direction of the query where alpha is at least lookup.rough_threshold"),
      number("lookup.rough_threshold", &C::lookup_rough_threshold, {0, 2},
             "roughness from which a surface counts as rough; 1: diffuse ones alone"),
      flag("lookup.rough_offset", &C::lookup_rough_offset,
           "rough surfaces have a disparity too; otherwise it is 0 there"),

      number("disparity.levels", &C::disparity_levels, {1, 16},
             "levels of the disparity predictor's hash grid; disparity.* needs lookup.offset = predicted"),
      number("disparity.features", &C::disparity_features, kFeatureCounts, "features per level: 2, 4 or 8"),
      number("disparity.log2_table", &C::disparity_log2_table, {10, 24}, "log2 of the entries a level may have"),
      number("disparity.base", &C::disparity_base, {2, 512}, "resolution of the coarsest level"),
      number("disparity.scale", &C::disparity_scale, {1, 4}, "growth of the resolution from level to level"),
      flag("disparity.direction", &C::disparity_direction,
           "also give the predictor spherical harmonics of the query direction"),
      number("disparity.width", &C::disparity_width, {16, 256}, "neurons a hidden layer"),
      number("disparity.hidden", &C::disparity_hidden, {1, 8}, "hidden layers"),
      choice("disparity.unit", &C::disparity_unit, {{"extent", DisparityUnit::extent}, {"world", DisparityUnit::world}},
             "output in 1/(largest side of the domain) or in 1/world unit"),

      number("decoder.width", &C::decoder_width, {16, 256}, "neurons a hidden layer"),
      number("decoder.hidden", &C::decoder_hidden, {1, 8}, "hidden layers"),
      choice("decoder.output", &C::decoder_output, {{"squareplus", Activation::squareplus}, {"exp", Activation::exp}},
             "output activation; exp is continued linearly above 4"),
      choice("decoder.position", &C::decoder_position,
             {{"normalized", DecoderPosition::normalized}, {"world", DecoderPosition::world}},
             "position input: in [-1, 1] or in world units"),

      number("nr.levels", &C::nr_levels, {1, 16}, "field nr: levels of the hash grid"),
      number("nr.features", &C::nr_features, kFeatureCounts, "field nr: features per level: 2, 4 or 8"),
      number("nr.log2_table", &C::nr_log2_table, {10, 24}, "field nr: log2 of the entries a level may have"),
      number("nr.base", &C::nr_base, {2, 512}, "field nr: resolution of the coarsest level"),
      number("nr.scale", &C::nr_scale, {1, 4}, "field nr: growth of the resolution from level to level"),
      number("nr.width", &C::nr_width, {16, 256}, "field nr: neurons a hidden layer"),
      number("nr.hidden", &C::nr_hidden, {1, 8}, "field nr: hidden layers"),
      choice("nr.output", &C::nr_output,
             {{"abs", Activation::abs}, {"squareplus", Activation::squareplus}, {"exp", Activation::exp}},
             "field nr: output activation"),

      number("ncr.levels", &C::ncr_levels, {1, 16}, "field ncr: levels of the diffuse branch's hash grid"),
      number("ncr.features", &C::ncr_features, kFeatureCounts, "field ncr: its features per level: 2, 4 or 8"),
      number("ncr.log2_table", &C::ncr_log2_table, {10, 24}, "field ncr: log2 of the entries a level of it may have"),
      number("ncr.base", &C::ncr_base, {2, 512}, "field ncr: resolution of its coarsest level"),
      number("ncr.scale", &C::ncr_scale, {1, 4}, "field ncr: growth of its resolution from level to level"),
      number("ncr.width", &C::ncr_width, {16, 256}, "field ncr: neurons a hidden layer of the diffuse branch"),
      number("ncr.hidden", &C::ncr_hidden, {1, 8}, "field ncr: hidden layers of the diffuse branch"),
      choice("ncr.output", &C::ncr_output, {{"squareplus", Activation::squareplus}, {"exp", Activation::exp}},
             "field ncr: output activation of the diffuse branch and of cones"),
      number("ncr.cone.levels", &C::ncr_cone_levels, {1, 16}, "field ncr: levels of the grid that cones end in"),
      number("ncr.cone.features", &C::ncr_cone_features, kFeatureCounts, "field ncr: its features: 2, 4 or 8"),
      number("ncr.cone.log2_table", &C::ncr_cone_log2_table, {10, 24},
             "field ncr: log2 of the entries a level of it may have"),
      number("ncr.cone.base", &C::ncr_cone_base, {2, 512}, "field ncr: resolution of its coarsest level"),
      number("ncr.cone.scale", &C::ncr_cone_scale, {1, 4}, "field ncr: growth of its resolution from level to level"),
      number("ncr.cone.width", &C::ncr_cone_width, {16, 256},
             "field ncr: neurons a hidden layer of the cones' network"),
      number("ncr.cone.hidden", &C::ncr_cone_hidden, {1, 8}, "field ncr: hidden layers of the cones' network"),
      number("ncr.merge.width", &C::ncr_merge_width, {16, 256},
             "field ncr: neurons a hidden layer of the network that joins diffuse branch and cones"),
      number("ncr.merge.hidden", &C::ncr_merge_hidden, {1, 8}, "field ncr: hidden layers of that network"),
      number("ncr.rays.train", &C::ncr_rays_train, {1, kMostLobeRays},
             "field ncr: rays traced from each glossy point that a training step learns at"),
      number("ncr.rays.render", &C::ncr_rays_render, {1, kMostLobeRays},
             "field ncr: rays traced from every other glossy point: of targets, validation and pictures"),
      number("ncr.clusters", &C::ncr_clusters, {1, kHitClusters}, "field ncr: cones of a point, one a cluster of hits"),
      number("ncr.iterations.train", &C::ncr_iterations_train, {1, 100},
             "field ncr: iterations of k-means over the distances of hits, as ncr.rays.train"),
      number("ncr.iterations.render", &C::ncr_iterations_render, {1, 100}, "field ncr: the same, as ncr.rays.render"),
      number("ncr.lobe_share", &C::ncr_lobe_share, {0.1, 0.9999},
             "field ncr: share of the distribution of normals that a cone's half-angle holds"),
      number("ncr.chroma", &C::ncr_chroma, {0, 100}, "field ncr: weight of the loss of colours without brightness"),

      choice("target.emission", &C::target_emission,
             {{"outside", TargetEmission::outside}, {"inside", TargetEmission::inside}},
             "own emission added outside the network, or learned"),
      choice(
          "target.demodulate", &C::target_demodulate,
          {{"none", TargetDemodulation::none}, {"albedo", TargetDemodulation::albedo}},
          "albedo: the network predicts radiance / albedo on rough surfaces, with lookup.coats = split on all; needs target.emission = outside"),
      number("target.scale", &C::target_scale, {0, 1e30},
             "exposure of the network's output; 0: chosen from the first batches and stored"),

      duration("train.time", &C::train_seconds, {0, kAny, true},
               "train for this long; setting it sets train.steps to 0 (of both in one file the steps count)"),
      number("train.steps", &C::train_steps, {0, 100000000}, "train this many steps; 0: until train.time is over"),
      number("train.points", &C::train_points, {64, 1 << 20}, "N, left-hand-side points a step"),
      number(
          "train.first_points", &C::train_first_points, {0, 1 << 20},
          "at most so many points a step in the first quarter of the budget, twice as many in each next; 0: no limit"),
      number("train.directions", &C::train_directions, {1, 4096}, "M, right-hand-side directions a point"),
      number(
          "train.guide", &C::train_guide, {0, 0.95},
          "share of these directions, at roughness 0.3 and more, that are drawn by what arrived before; 0: by the BSDF alone"),
      flag("train.quarters", &C::train_quarters, "halve N, down to 64, and double M after every quarter of the budget"),
      number("train.walks", &C::train_walks, {0, 1},
             "of train.sampler = mixture: share of points from camera walks; the rest is uniform by area"),
      flag("train.area_falls", &C::train_area_falls,
           "of train.sampler = mixture: points by area become walks as rates fall, as their cube (adam.decay)"),
      number("train.far_ends", &C::train_far_ends, {0, 1},
             "share of points where rays of the last step ended, drawn by what the cache's response contributed; falls "
             "as the cube of the rates (adam.decay)"),
      number("train.view_share", &C::train_view_share, {0, 1},
             "share of points on the primary hits of the scene's view (for a fixed camera)"),
      number("train.keep_direction", &C::train_keep_direction, {0, 1},
             "share of walk vertices that keep the direction they were reached from"),
      choice("train.fresh_direction", &C::train_fresh_direction,
             {{"cosine", FreshDirection::cosine}, {"uniform", FreshDirection::uniform}},
             "density of the directions that glossy points are seen from"),
      number("train.glossy_boost", &C::train_glossy_boost, {1, 100},
             "how much likelier a glossy point is taken than a rough one"),
      number("train.stop_probability", &C::train_stop_probability, {0, 1, true},
             "probability of stopping a walk at a vertex, divided by train.glossy_boost on rough surfaces"),
      number("train.max_walk", &C::train_max_walk, {1, 64}, "longest walk"),
      number(
          "train.poses", &C::train_poses, {0, 100000},
          "camera poses drawn once for all walks (the sensors count); 0: a fresh one for every walk. Not used with train.cameras"),
      {"train.cameras", &C::train_cameras, {}, false, "JSON file with more camera poses"},
      choice("train.sampler", &C::train_sampler,
             {{"walks", TrainSampler::walks}, {"area", TrainSampler::area}, {"mixture", TrainSampler::mixture}},
             "left-hand-side points: camera walks, by area, or both (train.walks)"),
      number("train.max_chain", &C::train_max_chain, {1, 64},
             "perfectly and almost specular surfaces that a ray passes at most, in pictures as well, beside 256 masks"),
      number(
          "train.average", &C::train_average, {0, 0.5},
          "shown and saved are means of the weights over this share of the steps, less as rates fall; 0: the weights"),

      choice("loss.normalizer", &C::loss_normalizer,
             {{"symmetric", LossNormalizer::symmetric}, {"prediction", LossNormalizer::prediction}},
             "denominator: mean of target and prediction (dark-biased) or the prediction"),
      number("loss.power", &C::loss_power, {1, 2},
             "power of the denominator: 2, the relative error; less is less easily too bright"),
      number("loss.epsilon.first", &C::loss_epsilon_first, {0, 100, true},
             "epsilon of the denominator at the start, in units of the exposure"),
      number("loss.epsilon.last", &C::loss_epsilon_last, {0, 100, true},
             "epsilon of the denominator at the end, in units of the exposure"),
      choice("adam.mode", &C::adam_mode, {{"touched", AdamMode::touched}, {"dense", AdamMode::dense}},
             "feature tables: update entries with a gradient (own step counts), or all (the textbook)"),
      number("adam.beta1", &C::adam_beta1, {0, 0.999999}, "decay of the first moment"),
      number("adam.beta2", &C::adam_beta2, {0, 0.9999}, "decay of the second moment"),
      number("adam.epsilon", &C::adam_epsilon, {1e-30, 1}, "added to the root of the second moment"),
      number("adam.rate.features", &C::adam_rate_features, {0, 10}, "learning rate of the OctaOctree features"),
      number("adam.rate.networks", &C::adam_rate_networks, {0, 10}, "learning rate of the MLPs"),
      number("adam.rate.grids", &C::adam_rate_grids, {0, 10},
             "learning rate of the hash grids (disparity predictor, fields nr and ncr)"),
      number("adam.rate.budget", &C::adam_rate_budget, {0, 100000000},
             "the rate of the OctaOctree's MLPs times (1 + n / this)^-1/2, where the budget has n steps; 0: as it is"),
      number("adam.warmup", &C::adam_warmup, {0, 1000000}, "steps over which the rates rise from 0"),
      number("adam.decay.start", &C::adam_decay_start, {0, 1},
             "share of the budget from which the rates decay; 1: constant"),
      number("adam.decay.to", &C::adam_decay_to, {0, 1}, "cosine decay to this share of the rates"),
      number("adam.max_non_finite", &C::adam_max_non_finite, {0, 1e15}, "dropped gradients after which training stops"),

      duration("checkpoint.every", &C::checkpoint_seconds, {0, kAny, true}, "time between checkpoints"),
      choice("render.delta", &C::render_delta, {{"cache", DeltaSurfaces::cache}, {"trace", DeltaSurfaces::trace}},
             "perfect mirrors and glass: from the cache, or followed to the next rough surface"),
      number(
          "render.trace_below", &C::render_trace_below, {0, 1},
          "roughness below which metals and glass are followed like mirrors; needs render.delta = trace and target.emission = outside"),
      number(
          "render.coat_samples", &C::render_coat_samples, {0, 1e6},
          "coats of roughness alpha are followed like mirrors from this times alpha^2 samples of a pixel on; 0: never; needs render.delta = "
          "trace and lookup.coats = split"),
      number(
          "render.metal_samples", &C::render_metal_samples, {0, 1e6},
          "metals and rough glass of roughness alpha are followed like mirrors by lhs from this times alpha^2 samples of a pixel on; 0: never; "
          "needs render.delta = trace and lookup.coats = split"),
      choice(
          "render.highlights", &C::render_highlights,
          {{"auto", Highlights::automatic}, {"cache", Highlights::cache}, {"bounce", Highlights::bounce}},
          "lhs on surfaces of roughness below render.bounce_below: ask the cache, trace one bounce, or auto: bounce if small lamps light such surfaces"),
      number("render.bounce_below", &C::render_bounce_below, {0, 2},
             "roughness below which render.highlights may take one bounce; perfect mirrors: render.delta"),
      number(
          "render.offset_spread", &C::render_offset_spread, {0, 2},
          "pictures: random tilt of the normal for the ray that finds what a glossy surface reflects; tan(tilt) is at most this times alpha; 0: none; needs lookup.offset = traced and lookup.reflected = features"),
      number("seed", &C::seed, {0, 9e15}, "of every random number"),
  };
  return table;
}

const Key& find(const std::string& name) {
  for (const Key& key : keys()) {
    if (key.name == name) return key;
  }
  std::vector<std::string> names;
  for (const Key& key : keys()) names.push_back(key.name);
  throw UsageError(fmt::format("unknown configuration key \"{}\"{}; octrad info --keys lists all keys", name,
                               did_you_mean(name, names)));
}

std::string accepted(const Key& key) {
  if (const auto* choice = std::get_if<Choice>(&key.member)) return join(choice->names, " | ");
  if (key.range.power_of_2) {
    std::vector<std::string> values;
    for (double v = key.range.low; v <= key.range.high; v *= 2) values.push_back(fmt::format("{:.10g}", v));
    return join(values, " | ");
  }
  if (key.duration) return "a duration above 0: 90, 30s, 2m, 1h";
  if (std::holds_alternative<bool Config::*>(key.member)) return "true | false";
  if (key.form != nullptr) return key.form;
  if (std::holds_alternative<std::string Config::*>(key.member)) return "text";
  const char* kind = std::holds_alternative<double Config::*>(key.member) ? "number" : "whole number";
  return fmt::format("{} {} {} … {:.10g}", kind, key.range.open_low ? "above" : "in", key.range.low, key.range.high);
}

[[noreturn]] void refuse(const Key& key, const std::string& value) {
  const auto* choice = std::get_if<Choice>(&key.member);
  throw UsageError(fmt::format("{} = \"{}\" is not accepted: expected {}{}", key.name, value, accepted(key),
                               choice != nullptr ? did_you_mean(value, choice->names) : ""));
}

void check_range(const Key& key, double value, const std::string& text) {
  if (!std::isfinite(value) || value < key.range.low || value > key.range.high ||
      (key.range.open_low && value <= key.range.low))
    refuse(key, text);
  if (key.range.power_of_2 && std::log2(value) != std::floor(std::log2(value))) refuse(key, text);
}

// Whole text as a number, decimal only.
double parse_number(const Key& key, const std::string& text) {
  if (text.empty() || text.find_first_not_of("+-.0123456789eE") != std::string::npos) refuse(key, text);
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (*end != '\0') refuse(key, text);
  return value;
}

// Calls `f` with the member of a key that is no choice.
template <typename C, typename F>
void visit_value(C& config, const Key& key, const F& f) {
  std::visit(
      [&](const auto& member) {
        if constexpr (!std::is_same_v<std::remove_cvref_t<decltype(member)>, Choice>) f(config.*member);
      },
      key.member);
}

// Assigns without the side effects of set().
void assign(Config& config, const Key& key, const std::string& text) {
  if (const auto* choice = std::get_if<Choice>(&key.member)) {
    const auto at = std::find(choice->names.begin(), choice->names.end(), text);
    if (at == choice->names.end()) refuse(key, text);
    choice->set(config, static_cast<std::size_t>(at - choice->names.begin()));
    return;
  }
  visit_value(config, key, [&](auto& value) {
    using T = std::remove_reference_t<decltype(value)>;
    if constexpr (std::is_same_v<T, bool>) {
      if (text == "true" || text == "1" || text == "yes" || text == "on") value = true;
      else if (text == "false" || text == "0" || text == "no" || text == "off") value = false;
      else refuse(key, text);
    } else if constexpr (std::is_same_v<T, std::string>) {
      if (key.valid != nullptr && !key.valid(text)) refuse(key, text);
      value = text;
    } else {
      const double number = key.duration ? parse_duration(text) : parse_number(key, text);
      check_range(key, number, text);
      if (!std::is_same_v<T, double> && number != std::floor(number)) refuse(key, text);
      value = static_cast<T>(number);
    }
  });
}

// Nested or dotted JSON -> dotted key, value.
void flatten(const nlohmann::json& object, const std::string& prefix, std::map<std::string, nlohmann::json>& out,
             int depth) {
  if (depth > 8) throw UsageError("objects nested too deeply");
  for (const auto& [name, value] : object.items()) {
    const std::string key = prefix.empty() ? name : prefix + "." + name;
    if (value.is_object()) {
      flatten(value, key, out, depth + 1);
    } else if (!out.emplace(key, value).second) {
      throw UsageError(fmt::format("{} is given twice (nested and dotted)", key));
    }
  }
}

std::string text_of(const Config& config, const Key& key) {
  if (const auto* choice = std::get_if<Choice>(&key.member)) return choice->get(config);
  std::string text;
  visit_value(config, key, [&](const auto& value) {
    if constexpr (std::is_same_v<std::remove_cvref_t<decltype(value)>, bool>) text = value ? "true" : "false";
    else text = fmt::format("{}", value);
  });
  return key.duration ? text + "s" : text;
}

std::string text_of(const nlohmann::json& value, const std::string& key) {
  if (value.is_string()) return unescape_bytes(value.get_ref<const std::string&>());
  if (value.is_boolean() || value.is_number()) return value.dump();
  throw UsageError(fmt::format("{} must be a number, a text or true/false, not {}", key, value.type_name()));
}

// In the nested object of a configuration.
nlohmann::json::json_pointer place_of(const Key& key) {
  std::string path = "/" + key.name;
  std::replace(path.begin(), path.end(), '.', '/');
  return nlohmann::json::json_pointer(path);
}

}  // namespace

std::optional<Bounds3f> given_bounds(const Config& config) { return parse_box(config.octree_bounds); }

void set(Config& config, const std::string& name, const std::string& value) {
  const Key& key = find(name);
  if (name == "preset")
    throw UsageError("the preset is chosen with --preset or in a configuration file, before other keys");
  assign(config, key, value);
  if (name == "train.time") config.train_steps = 0;  // the last of train.time and train.steps decides
}

void apply(Config& config, const nlohmann::json& object, const std::string& where) {
  try {
    if (!object.is_object()) throw UsageError("a configuration is a JSON object");
    std::map<std::string, nlohmann::json> values;
    flatten(object, "", values, 0);
    for (const auto& [name, value] : values) find(name);
    if (const auto it = values.find("preset"); it != values.end()) config = preset(text_of(it->second, "preset"));
    for (const Key& key : keys()) {
      if (key.name == "preset") continue;
      if (const auto it = values.find(key.name); it != values.end())
        set(config, key.name, text_of(it->second, key.name));
    }
  } catch (const UsageError& error) {
    throw InputError(where + ": " + error.what());
  }
}

std::string get(const Config& config, const std::string& name) { return text_of(config, find(name)); }

nlohmann::json to_json(const Config& config) {
  nlohmann::json out = nlohmann::json::object();
  for (const Key& key : keys()) {
    nlohmann::json& place = out[place_of(key)];
    if (const auto* choice = std::get_if<Choice>(&key.member)) place = choice->get(config);
    else visit_value(config, key, [&](const auto& value) { place = value; });
  }
  return out;
}

std::string unmet_condition(const Config& c, const std::string& key) {
  const bool outside = c.target_emission == TargetEmission::outside;
  if ((key == "train.walks" || key == "train.area_falls") && c.train_sampler != TrainSampler::mixture)
    return "train.sampler = mixture";
  if (key == "train.poses" && c.train_sampler == TrainSampler::area) return "a train.sampler with walks";
  if (key == "train.poses" && !c.train_cameras.empty()) return "train.cameras to be empty";
  if ((key == "target.demodulate" || key == "lookup.coats") && !outside) return "target.emission = outside";
  if (key == "render.trace_below" && (!outside || c.render_delta != DeltaSurfaces::trace))
    return "render.delta = trace and target.emission = outside";
  if ((key == "render.coat_samples" || key == "render.metal_samples") &&
      (!split_coats(c) || c.render_delta != DeltaSurfaces::trace))
    return "render.delta = trace, lookup.coats = split and target.emission = outside";
  if (key == "render.offset_spread" && !looks_up_reflected(c))
    return "lookup.offset = traced and lookup.reflected = features";
  if (key == "lookup.reflected" && c.lookup_offset != LookupOffset::traced) return "lookup.offset = traced";
  if (key.starts_with("disparity.") && c.lookup_offset != LookupOffset::predicted) return "lookup.offset = predicted";
  if (key == "render.bounce_below" && c.render_highlights == Highlights::cache)
    return "render.highlights = auto or bounce";
  return "";
}

std::vector<std::string> keys_missing_in(const nlohmann::json& object) {
  std::vector<std::string> missing;
  for (const Key& key : keys()) {
    if (!object.contains(place_of(key))) missing.push_back(key.name);
  }
  return missing;
}

std::vector<ConfigKey> describe(const Config& config) {
  std::vector<ConfigKey> out;
  for (const Key& key : keys()) out.push_back({key.name, text_of(config, key), accepted(key), key.help});
  return out;
}

}  // namespace octrad
