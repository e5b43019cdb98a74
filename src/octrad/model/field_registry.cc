#include "octrad/base/error.h"
#include "octrad/model/nr_field.h"
#include "octrad/model/octaoctree_field.h"
#include "octrad/model/radiance_field.h"

namespace octrad {
namespace {

template <typename Field>
std::unique_ptr<RadianceField> make(const Config& config, const FieldDomain& domain) {
  return std::make_unique<Field>(config, domain);
}

// Every field, by the name that `--field` and the model file use.
struct Entry {
  const char* name;
  std::unique_ptr<RadianceField> (*make)(const Config&, const FieldDomain&);
};
constexpr Entry kFields[] = {
    {"octaoctree", make<OctaOctreeField>},
    {"nr", make<NrField>},
};

double entries_of(const HashGridOptions& options) { return static_cast<double>(hash_grid_entries(options)); }

}  // namespace

std::vector<std::string> field_names() {
  std::vector<std::string> names;
  for (const Entry& e : kFields) names.emplace_back(e.name);
  return names;
}

std::unique_ptr<RadianceField> make_field(const Config& config, const FieldDomain& domain) {
  std::string known;
  for (const Entry& e : kFields) {
    if (config.field == e.name) return e.make(config, domain);
    known += std::string(known.empty() ? "" : ", ") + e.name;
  }
  throw UsageError("unknown field \"" + config.field + "\"" + did_you_mean(config.field, field_names()) +
                   "; known fields: " + known);
}

std::vector<MemoryPart> estimate_memory(const Config& config, const std::vector<long long>& cells_per_level,
                                        bool training) {
  // Floats an entry: the value, and for training two moments and a step count (dense Adam is the same state).
  std::vector<MemoryPart> items;
  const auto add = [&](const std::string& name, double bytes) {
    items.push_back({name, static_cast<std::uint64_t>(bytes)});
  };
  const auto table = [&](const std::string& what, double entries, int features) {
    add(what + " features", entries * features * 4.0);
    if (training) add(what + " optimiser state", entries * (features * 8.0 + 2.0));
  };
  if (config.field == "octaoctree") {
    double entries = 0.0;
    for (std::size_t l = 0; l < cells_per_level.size(); ++l) {
      entries += static_cast<double>(octree_entries(config.octree_levels, static_cast<int>(l) + 1, cells_per_level[l]));
    }
    table("octree", entries, config.octree_features);
    table("disparity grid", entries_of(disparity_grid_options(config)), config.disparity_features);
  } else {
    table("hash grid", entries_of(nr_grid_options(config)), config.nr_features);
  }
  double cells = 0.0;
  for (const long long n : cells_per_level) cells += static_cast<double>(n);
  if (cells > 0.0) add("octree cells and index", cells * 28.0);
  if (training) {
    // A shaded point with its target, its contributions to the tables (about 40 of 64 cells of a query hold surfaces)
    // and upstream gradients.
    const double taps = config.field == "octaoctree"
                            ? config.octree_levels * 24.0 * 0.65 + config.disparity_levels * 8.0
                            : config.nr_levels * 8.0;
    add("batch", config.train_points * (600.0 + taps * 36.0));
  }
  return items;
}

}  // namespace octrad
