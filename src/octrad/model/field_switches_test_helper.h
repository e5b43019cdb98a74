// Small fields under every switch that changes how a field is evaluated, and the gradient that training hands to the
// optimiser. Not part of the library.
#pragma once

#include <cctype>
#include <cmath>
#include <memory>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "octrad/model/field_reference_test_helper.h"

namespace octrad::testing {

using FieldKeys = std::vector<std::pair<std::string, std::string>>;

struct FieldCase {
  std::string field;
  FieldKeys keys;
};

inline std::string name_of(const FieldCase& c) {
  std::string name = c.field;
  if (c.keys.size() > 5) return name + "_as_in_the_paper";
  for (const auto& [key, value] : c.keys) name.append("_").append(key).append("_").append(value);
  for (char& letter : name) letter = std::isalnum(static_cast<unsigned char>(letter)) ? letter : '_';
  return name;
}

inline void PrintTo(const FieldCase& c, std::ostream* out) { *out << name_of(c); }

inline std::vector<FieldCase> field_cases() {
  std::vector<FieldCase> result;
  const auto add = [&](const std::string& field, const std::vector<FieldKeys>& switches) {
    for (const FieldKeys& keys : switches) result.push_back({field, keys});
  };
  add("octaoctree", {{},
                     {{"lookup.offset", "none"}},
                     {{"lookup.offset", "traced"}},
                     {{"lookup.offset", "traced"}, {"lookup.reflected", "none"}},
                     {{"lookup.offset", "traced"}, {"octree.features", "2"}, {"decoder.position", "world"}},
                     {{"lookup.offset", "traced"}, {"lookup.rough_threshold", "0.2"}, {"adam.mode", "dense"}},
                     {{"lookup.rough_offset", "true"}},
                     {{"lookup.offset", "traced"}, {"lookup.rough_offset", "true"}},
                     {{"lookup.direction", "outgoing"}},
                     {{"lookup.rough_direction", "mirror"}},
                     {{"octree.interpolation", "nearest"}},
                     {{"octa.interpolation", "nearest"}},
                     {{"octree.features", "2"}},
                     {{"octree.features", "8"}},
                     {{"disparity.features", "4"}},
                     {{"disparity.direction", "false"}},
                     {{"disparity.unit", "world"}},
                     {{"decoder.output", "squareplus"}},
                     {{"decoder.position", "world"}},
                     {{"target.demodulate", "none"}},
                     {{"lookup.coats", "joined"}},
                     {{"target.emission", "inside"}},
                     {{"loss.normalizer", "symmetric"}},
                     {{"adam.mode", "dense"}},
                     {{"lookup.rough_threshold", "1.5"}, {"octree.levels", "4"}},
                     {{"octree.fine", "1"}},
                     {{"octree.fine", "2"}, {"octree.levels", "2"}, {"lookup.offset", "traced"}},
                     // The paper's preset.
                     {{"disparity.direction", "false"},
                      {"disparity.unit", "world"},
                      {"decoder.output", "squareplus"},
                      {"decoder.position", "world"},
                      {"target.emission", "inside"},
                      {"target.demodulate", "none"},
                      {"loss.normalizer", "symmetric"},
                      {"adam.mode", "dense"}}});
  add("nr", {{},
             {{"nr.output", "abs"}},
             {{"nr.output", "squareplus"}},
             {{"nr.features", "2"}},
             {{"nr.features", "4"}},
             {{"decoder.position", "world"}},
             {{"target.demodulate", "none"}},
             {{"lookup.coats", "joined"}},
             {{"target.emission", "inside"}},
             {{"loss.normalizer", "symmetric"}},
             {{"adam.mode", "dense"}}});
  return result;
}

inline Config config_of(const FieldCase& c) {
  Config config = preset("cpu");
  set(config, "field", c.field);
  const FieldKeys small = {{"octree.levels", "3"},   {"disparity.levels", "3"},
                           {"disparity.base", "4"},  {"disparity.width", "24"},
                           {"decoder.width", "32"},  {"decoder.hidden", "2"},
                           {"nr.levels", "3"},       {"nr.base", "4"},
                           {"nr.width", "40"},       {"nr.hidden", "2"},
                           {"nr.log2_table", "10"},  {"disparity.log2_table", "10"},
                           {"ncr.levels", "3"},      {"ncr.base", "4"},
                           {"ncr.width", "40"},      {"ncr.hidden", "2"},
                           {"ncr.log2_table", "10"}, {"ncr.cone.levels", "4"},
                           {"ncr.cone.width", "24"}, {"ncr.cone.log2_table", "10"},
                           {"adam.beta1", "0"},      {"lookup.offset", "predicted"}};
  for (const FieldKeys& keys : {small, c.keys}) {
    for (const auto& [key, value] : keys) set(config, key, value);
  }
  return config;
}

inline std::unique_ptr<RadianceField> field_of(const Config& config) {
  auto field = make_field(config, box_domain(octree_levels(config)));
  fill_tables(*field);
  field->set_target_scale(1.7f);
  return field;
}

// What Adam's first moments hold, by part: after the first step with adam.beta1 = 0 that is the step's gradient.
inline FieldReference::Numbers first_moments(RadianceField& field) {
  const bool octree = field.name() == "octaoctree";
  const std::string prefix = field.name();
  const std::string names[FieldReference::kParts] = {
      octree ? "octree.moments" : prefix + ".cone.grid.moments", octree ? "disparity.mlp.m" : prefix + ".cone.mlp.m",
      octree ? "disparity.grid.moments" : prefix + ".grid.moments", octree ? "decoder.mlp.m" : prefix + ".mlp.m"};
  FieldReference::Numbers result;
  const auto tensors = tensors_of(field);
  for (int part = 0; part < FieldReference::kParts; ++part) {
    const auto found = tensors.find("optimizer." + names[part]);
    if (found == tensors.end()) continue;  // a part that the field has not
    const SavedTensor& t = found->second;
    const bool table = t.shape.size() == 3;  // [entry][first, second][feature]
    const auto width = table ? static_cast<std::size_t>(t.shape[2]) : t.values.size();
    for (std::size_t at = 0; at < t.values.size(); at += (table ? 2 : 1) * width)
      result[part].insert(result[part].end(), t.values.data() + at, t.values.data() + at + width);
  }
  return result;
}

// Largest difference between two arrays, relative to the root mean square of those numbers of `expected` that are not
// 0.
inline double largest_difference(const std::vector<double>& got, const std::vector<double>& expected) {
  if (got.size() != expected.size()) return HUGE_VAL;
  double square = 0.0, count = 0.0, largest = 0.0;
  for (std::size_t i = 0; i < got.size(); ++i) {
    square += expected[i] * expected[i];
    count += expected[i] != 0.0 ? 1.0 : 0.0;
    const double difference = std::abs(got[i] - expected[i]);
    if (!(difference <= largest)) largest = difference;
  }
  return largest == 0.0 ? 0.0 : largest / std::sqrt(square / count);
}

}  // namespace octrad::testing
