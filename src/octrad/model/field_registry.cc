#include "octrad/model/field_registry.h"

#include <algorithm>

#include "octrad/base/error.h"
#include "octrad/base/join.h"
#include "octrad/model/ncr_field.h"
#include "octrad/model/nr_field.h"
#include "octrad/model/octaoctree_field.h"

namespace octrad {
namespace {

constexpr const FieldEntry* kFields[] = {
    &kOctaOctreeField,
    &kNrField,
    &kNcrField,
};

bool owns(const FieldEntry& field, const std::string& key) {
  return std::any_of(field.own_keys.begin(), field.own_keys.end(),
                     [&](std::string_view begin) { return key.rfind(begin, 0) == 0; });
}

}  // namespace

std::span<const FieldEntry* const> field_entries() { return kFields; }

std::vector<std::string> field_names() {
  std::vector<std::string> names;
  for (const FieldEntry* e : kFields) names.emplace_back(e->name);
  return names;
}

const FieldEntry& field_entry(const std::string& name) {
  for (const FieldEntry* e : kFields) {
    if (name == e->name) return *e;
  }
  throw UsageError("unknown field \"" + name + "\"" + did_you_mean(name, field_names()) +
                   "; known fields: " + join(field_names()));
}

bool ignores_key(const FieldEntry& field, const std::string& key) {
  return !owns(field, key) &&
         std::any_of(std::begin(kFields), std::end(kFields), [&](const FieldEntry* e) { return owns(*e, key); });
}

std::unique_ptr<RadianceField> make_field(const Config& config, const FieldDomain& domain) {
  return field_entry(config.field).make(config, domain);
}

QueryRays query_rays(const Config& config, bool training) {
  const FieldEntry& field = field_entry(config.field);
  return field.rays == nullptr ? QueryRays{} : field.rays(config, training);
}

QueryRays picture_rays(const Config& config) {
  QueryRays rays = query_rays(config);
  rays.offset.spread = static_cast<float>(config.render_offset_spread);
  return rays;
}

std::vector<MemoryPart> estimate_memory(const Config& config, const std::vector<long long>& cells_per_level,
                                        bool training) {
  return field_entry(config.field).memory(config, cells_per_level, training);
}

std::unique_ptr<DeviceField> make_device_field(Stream& stream, RadianceField& field, const Config& config,
                                               const DeviceFieldOptions& options) {
  if (options.max_points == 0) throw InputError("a device field needs room for at least one point");
  for (const FieldEntry* e : kFields) {
    if (field.name() == e->name && e->make_device != nullptr) return e->make_device(stream, field, config, options);
  }
  throw InputError("the field \"" + field.name() + "\" does not run on a device");
}

std::vector<MemoryPart> estimate_device_memory(const Config& config, const std::vector<long long>& cells_per_level,
                                               const DeviceFieldOptions& options) {
  const FieldEntry& field = field_entry(config.field);
  if (field.device_memory == nullptr) throw InputError("the field \"" + config.field + "\" does not run on a device");
  return field.device_memory(config, cells_per_level, options);
}

}  // namespace octrad
