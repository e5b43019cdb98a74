// Facts of a field besides its classes: names, makers, keys, memory. Each field defines one entry in a file of its own;
// the list of them is in field_registry.cc. Nothing else depends on which fields there are.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "octrad/base/query_rays.h"
#include "octrad/model/device_field.h"

namespace octrad {

struct FieldEntry {
  const char* name;   // the value of the key "field", also in model files
  const char* title;  // in messages
  // Beginnings of the keys that no other field reads.
  std::span<const std::string_view> own_keys;
  // Levels of occupied cells that FieldDomain must have; 0: the field needs none.
  int (*cell_levels)(const Config&);
  // Cells along an axis of its finest level, whose size is compared with what is seen. Null: not known.
  double (*finest_cells)(const Config&) = nullptr;
  // What is traced from points that it is asked at, and from those that a step of training learns at. Null: nothing.
  QueryRays (*rays)(const Config&, bool training) = nullptr;
  std::unique_ptr<RadianceField> (*make)(const Config&, const FieldDomain&);
  std::vector<MemoryPart> (*memory)(const Config&, const std::vector<long long>& cells_per_level, bool training);
  // On a device; null for a field that runs on the CPU only.
  std::unique_ptr<DeviceField> (*make_device)(Stream&, RadianceField&, const Config&, const DeviceFieldOptions&);
  std::vector<MemoryPart> (*device_memory)(const Config&, const std::vector<long long>& cells_per_level,
                                           const DeviceFieldOptions&);
  // Changes of one key, as set() takes them, that make the field smaller.
  std::vector<std::pair<std::string, std::string>> (*smaller)(const Config&);
};

// Throws UsageError with the list of known fields.
const FieldEntry& field_entry(const std::string& name);
std::span<const FieldEntry* const> field_entries();

// Whether `key` is another field's own.
bool ignores_key(const FieldEntry& field, const std::string& key);

}  // namespace octrad
