// The list of integrators: the only place that knows their names.
#include "octrad/render/integrators.h"

#include <array>

#include "octrad/base/error.h"
#include "octrad/base/join.h"
#include "octrad/model/radiance_field.h"

namespace octrad {
namespace {

using Bounce = FirstHitOptions::Bounce;

constexpr IntegratorInfo path_info() {
  IntegratorInfo info{"path", "path tracing: the reference", 64};
  info.uses_depth = true;
  info.make = make_path_integrator;
  info.make_device = make_device_path_integrator;
  info.device_bytes = device_path_integrator_bytes;
  return info;
}

constexpr IntegratorInfo denoised_info() {
  IntegratorInfo info = path_info();
  info.name = "denoised";
  info.summary = "few paths, then a denoiser";
  info.default_spp = 4;
  info.denoised = true;
  return info;
}

template <Bounce kBounce>
constexpr IntegratorInfo cache_info(const char* name, const char* summary, int default_spp) {
  IntegratorInfo info{name, summary, default_spp};
  info.needs_model = true;
  info.make = [](const IntegratorInput& input) { return make_cache_integrator(input, kBounce); };
  info.make_device = [](const IntegratorInput& input, Stream& stream, const DeviceWorld& world, DeviceField* field,
                        std::size_t capacity) {
    return make_device_cache_integrator(input, stream, world, field, capacity, kBounce);
  };
  info.device_bytes = [](const IntegratorInput& input, std::size_t capacity) {
    return device_cache_integrator_bytes(input, capacity, kBounce);
  };
  return info;
}

template <FieldView kView>
constexpr IntegratorInfo view_info(const char* name, const char* summary) {
  IntegratorInfo info{name, summary, 4};
  info.needs_model = true;
  info.per_level = kView == FieldView::features || kView == FieldView::occupancy;
  info.needs_disparity = kView == FieldView::disparity;
  info.one_sample = kView == FieldView::features;
  info.recordable = false;
  info.make = [](const IntegratorInput& input) { return make_view_integrator(input, kView); };
  info.make_device = [](const IntegratorInput& input, Stream& stream, const DeviceWorld& world, DeviceField* field,
                        std::size_t capacity) {
    return make_device_view_integrator(input, stream, world, field, capacity, kView);
  };
  info.device_bytes = [](const IntegratorInput& input, std::size_t capacity) {
    return device_view_integrator_bytes(input, capacity, kView);
  };
  return info;
}

constexpr std::array kIntegrators = {
    path_info(),
    denoised_info(),
    cache_info<Bounce::none>("lhs", "one query at the first hit", 4),
    cache_info<Bounce::all>("rhs", "one bounce from the first hit, a query where it ends", 16),
    cache_info<Bounce::glossy>("deferred", "rhs on glossy surfaces, lhs elsewhere", 16),
    view_info<FieldView::disparity>("disparity", "disparity of the look-ups"),
    view_info<FieldView::traced>("traced", "1 / distance along the look-up direction"),
    view_info<FieldView::features>("features", "a level's features, first three principal components"),
    view_info<FieldView::occupancy>("occupancy", "a level's cells that hold surfaces"),
};

}  // namespace

std::span<const IntegratorInfo> integrators() { return kIntegrators; }

std::vector<std::string> integrator_names(const RadianceField* field) {
  std::vector<std::string> names;
  for (const IntegratorInfo& info : kIntegrators) {
    if (field && info.needs_disparity && !field->uses_disparity()) continue;
    if (!info.per_level) names.emplace_back(info.name);
    for (int l = 1; info.per_level && l <= (field ? field->levels() : 1); ++l)
      names.push_back(info.name + std::to_string(l));
  }
  return names;
}

IntegratorChoice find_integrator(const std::string& name, const RadianceField* field) {
  for (const IntegratorInfo& info : kIntegrators) {
    const std::string family = info.name;
    if (!info.per_level) {
      if (name != family) continue;
      if (field && info.needs_disparity && !field->uses_disparity())
        throw UsageError("integrator " + name + ": a model of the field " + field->name() + " predicts none");
      return {&info, 0};
    }
    if (name.rfind(family, 0) != 0 || name.size() == family.size() || name.size() > family.size() + 3 ||
        name.find_first_not_of("0123456789", family.size()) != std::string::npos)
      continue;
    const int level = std::stoi(name.substr(family.size()));
    if (level >= 1 && (!field || level <= field->levels())) return {&info, level};
  }
  const std::vector<std::string> known = integrator_names(field);
  throw UsageError("unknown integrator \"" + name + "\"" + did_you_mean(name, known) + "; there are " + join(known) +
                   (field ? "" : ", ..."));
}

}  // namespace octrad
