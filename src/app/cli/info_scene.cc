#include "app/cli/info_scene.h"

#include <fmt/format.h>

#include <algorithm>

#include "app/cli/open_scene.h"
#include "app/report/vector_json.h"
#include "octrad/base/bytes.h"
#include "octrad/base/error.h"
#include "octrad/base/log.h"
#include "octrad/encoding/octaoctree.h"
#include "octrad/model/field_registry.h"
#include "octrad/model/model_file.h"
#include "octrad/render/highlights.h"
#include "octrad/scene/camera.h"
#include "octrad/scene/load.h"
#include "octrad/scene/plugins.h"
#include "octrad/train/domain.h"

namespace octrad::cli {
namespace {

// The levels of the octree that training would build (paper table 2): only the cells are found, nothing
// is allocated for features.
struct OctreeLevels {
  nlohmann::json levels = nlohmann::json::array();
  std::string table;
  std::vector<long long> cells;
  std::int64_t entries = 0;
};

OctreeLevels count_levels(const Scene& scene, const Domain& domain, const Config& config, bool count_sampled) {
  const int levels = octree_levels(config);
  const auto conservative = occupied_cells(scene, domain, levels);
  std::vector<std::vector<Vec3i>> sampled;
  if (count_sampled || config.octree_occupancy == OctreeOccupancy::sampled) {
    sampled = sampled_cells(scene, domain, levels, static_cast<std::uint64_t>(std::max(0LL, config.seed)));
  }
  const auto& cells = config.octree_occupancy == OctreeOccupancy::sampled ? sampled : conservative;

  OctreeLevels out;
  std::vector<std::vector<std::string>> table = {{"level", "cells/axis", "octahedral", "cells", "entries", "features"}};
  if (!sampled.empty()) table[0].insert(table[0].end(), {"conservative", "sampled"});
  std::int64_t total_cells = 0;
  const auto bytes_of = [&](std::int64_t entries) {
    return entries * config.octree_features * static_cast<std::int64_t>(sizeof(float));
  };
  for (int level = 1; level <= levels; ++level) {
    const auto index = static_cast<std::size_t>(level - 1);
    const auto count = static_cast<std::int64_t>(cells[index].size());
    const std::int64_t entries = octree_entries(config.octree_levels, level, count);
    total_cells += count;
    out.cells.push_back(count);
    out.entries += entries;
    out.levels.push_back({{"level", level},
                          {"spatial_resolution", spatial_resolution(level)},
                          {"octahedral_resolution", octahedral_resolution(config.octree_levels, level)},
                          {"cells", count},
                          {"entries", entries},
                          {"bytes", bytes_of(entries)},
                          {"cells_conservative", conservative[index].size()}});
    table.push_back({std::to_string(level), std::to_string(spatial_resolution(level)),
                     std::to_string(octahedral_resolution(config.octree_levels, level)), format_count(count),
                     format_count(entries), format_bytes(static_cast<double>(bytes_of(entries)))});
    if (!sampled.empty()) {
      out.levels.back()["cells_sampled"] = sampled[index].size();
      table.back().insert(table.back().end(), {format_count(static_cast<long long>(conservative[index].size())),
                                               format_count(static_cast<long long>(sampled[index].size()))});
    }
  }
  table.push_back({"total", "", "", format_count(total_cells), format_count(out.entries),
                   format_bytes(static_cast<double>(bytes_of(out.entries)))});
  out.table = format_table(table);
  return out;
}

// A sensor with what its type has, and its film's filter.
nlohmann::json camera_json(const Camera& c, const Film& film) {
  const auto pair = [](Vec2f v) { return nlohmann::json::array({v.x, v.y}); };
  nlohmann::json filter = {{"type", rfilter_types().at(static_cast<std::size_t>(film.filter))}};
  switch (film.filter) {
    case Film::Filter::gaussian: filter["stddev"] = film.filter_stddev; break;
    case Film::Filter::mitchell: filter["B"] = film.filter_b, filter["C"] = film.filter_c; break;
    case Film::Filter::tent: filter["radius"] = film.filter_radius; break;
    case Film::Filter::lanczos: filter["lobes"] = film.filter_radius; break;
    case Film::Filter::box:
    case Film::Filter::catmullrom: break;
  }
  nlohmann::json out = {{"type", camera_kind_names().at(static_cast<std::size_t>(c.kind))},
                        {"origin", vector_json(c.origin)},
                        {"forward", vector_json(c.forward)},
                        {"up", vector_json(c.up)},
                        {"mirrored", c.mirrored()},
                        {"fov", c.fov_degrees},
                        {"width", c.film_width},
                        {"height", c.film_height},
                        {"near_clip", c.near_clip},
                        {"far_clip", c.far_clip},
                        {"crop_offset", pair(c.crop_offset)},
                        {"crop_size", pair(c.crop_size)},
                        {"filter", filter}};
  if (c.kind == CameraKind::orthographic) {
    out["half_size"] = pair(c.half_size);
    return out;
  }
  out["fov_axis"] = fov_axis_name(c.fov_axis);
  out["principal_point_offset"] = pair(c.principal_point_offset);
  if (c.kind == CameraKind::thinlens) {
    out["aperture_radius"] = c.aperture_radius;
    out["focus_distance"] = c.focus_distance;
  }
  return out;
}

}  // namespace

void info_scene(const CommonOptions& common, const std::string& file, const ConfigOptions& given, bool sampled) {
  Config config = given.resolve();
  set_seed(config, common);
  const FieldEntry& field = field_entry(config.field);
  const bool octree = field.cell_levels(config) > 0;
  if (sampled && !octree)
    throw UsageError(fmt::format("--sampled: the field {} has no octree whose cells could be counted", field.name));
  const PreparedScene prepared(open_scene(file, given.scene_definitions(), common.permissive));
  const Scene& scene = prepared.scene();
  warn_of_ignored_keys(given, config);
  const DomainFit fit = fit_domain(
      prepared, config, config.train_cameras.empty() ? std::vector<Camera>{} : read_cameras(config.train_cameras));
  const Domain& domain = fit.box;
  std::vector<std::string> warnings = scene.warnings;
  if (const std::string coarse = domain_warning(fit); !coarse.empty()) {
    log_warning(coarse);
    warnings.push_back(coarse);
  }
  const OctreeLevels levels = octree ? count_levels(scene, domain, config, sampled) : OctreeLevels{};
  const ModelFileSize size = estimate_model_file_size(config, levels.cells);
  const std::uint64_t training_memory = total_bytes(estimate_memory(config, levels.cells, true)),
                      rendering_memory = total_bytes(estimate_memory(config, levels.cells, false));

  const double small_lamps =
      small_lamp_share(prepared, static_cast<float>(config.render_bounce_below), rhs_rules(config).follow_below);
  const std::size_t lights = scene.area_lights.size() + scene.delta_lights.size() + scene.environments.size();
  if (common.json) {
    nlohmann::json cameras = nlohmann::json::array();
    for (std::size_t i = 0; i < scene.cameras.size(); ++i)
      cameras.push_back(camera_json(scene.cameras[i], scene.film_of(i)));
    print_json({{"file", scene.file},
                {"fingerprint", scene.fingerprint},
                {"triangles", scene.triangle_count()},
                {"spheres", scene.spheres.size()},
                {"shapes", scene.shapes.size()},
                {"materials", scene.materials.size()},
                {"textures", scene.textures.size()},
                {"lights", lights},
                {"area_lights", scene.area_lights.size()},
                {"delta_lights", scene.delta_lights.size()},
                {"environments", scene.environments.size()},
                {"small_lamps", small_lamps},
                {"cameras", cameras},
                {"bounds", {{"lower", vector_json(scene.bounds.lower)}, {"upper", vector_json(scene.bounds.upper)}}},
                {"domain",
                 {{"origin", vector_json(domain.origin)},
                  {"size", vector_json(domain.size)},
                  {"scene_size", fit.whole},
                  {"outside", fit.outside},
                  {"finest_cell", fit.cell > 0.0 ? nlohmann::json(fit.cell) : nlohmann::json(nullptr)},
                  {"seen_distance", fit.distance},
                  {"seen_pixel", fit.pixel}}},
                {"max_depth", scene.max_depth},
                {"hide_emitters", scene.hide_emitters},
                {"film", {{"width", scene.film.width}, {"height", scene.film.height}}},
                {"field", field.name},
                {"levels", levels.levels},
                {"entries", levels.entries},
                {"bytes", levels.entries * config.octree_features * static_cast<std::int64_t>(sizeof(float))},
                {"features", config.octree_features},
                {"model_file",
                 {{"features", size.features},
                  {"with_optimizer", size.total},
                  {"without_optimizer", size.total - size.optimizer}}},
                {"memory", {{"training", training_memory}, {"rendering", rendering_memory}}},
                {"warnings", warnings},
                {"assumed", scene.assumed},
                {"refused", issues_json(scene.refused)}});
    return;
  }
  const auto point = [](Vec3f v) { return fmt::format("({:.4g}, {:.4g}, {:.4g})", v.x, v.y, v.z); };
  std::string out = fmt::format("{} (fingerprint {})\n", scene.file, scene.fingerprint);
  out += fmt::format("geometry   {} triangles, {} spheres in {} shapes\n",
                     format_count(static_cast<long long>(scene.triangle_count())), scene.spheres.size(),
                     scene.shapes.size());
  out += fmt::format("surfaces   {} materials, {} textures\n", scene.materials.size(), scene.textures.size());
  out += fmt::format("lights     {}: {} area, {} without extent, {} environment{}\n", lights, scene.area_lights.size(),
                     scene.delta_lights.size(), scene.environments.size(),
                     scene.hide_emitters ? "; hidden from cameras" : "");
  out += fmt::format("highlights {:.0f} % of the light on surfaces of roughness below {} is from small lamps: lhs {}\n",
                     100.0 * small_lamps, config.render_bounce_below,
                     bounce_below(prepared, config) > 0.0f ? "takes a bounce there" : "asks the cache there too");
  out += fmt::format("bounds     {} to {}\n", point(scene.bounds.lower), point(scene.bounds.upper));
  for (const Camera& c : scene.cameras) {
    const bool orthographic = c.kind == CameraKind::orthographic;
    out += fmt::format("sensor     at {} looking along {}, {:.4g} {}, {} x {}\n", point(c.origin), point(c.forward),
                       orthographic ? 2.0f * c.half_size.x : c.fov_degrees, orthographic ? "wide" : "degrees",
                       c.film_width, c.film_height);
  }
  out += fmt::format("depth      {}\n\n{} with preset {}, {}",
                     scene.max_depth < 0 ? std::string("unlimited") : std::to_string(scene.max_depth), field.title,
                     config.preset, domain_text(fit));
  if (octree) {
    out +=
        fmt::format(", {} levels, {} features, box {}, occupancy {}:\n{}", octree_levels(config),
                    config.octree_features, get(config, "octree.box"), get(config, "octree.occupancy"), levels.table);
  } else {
    out += ":\n";
  }
  out +=
      fmt::format("model file about {} with what --resume needs, about {} with --no-optimizer, of which features {}\n",
                  format_bytes(size.total), format_bytes(size.total - size.optimizer), format_bytes(size.features));
  out += fmt::format("memory     about {} to train it on the CPU, {} to render with it, beside the scene\n",
                     format_bytes(static_cast<double>(training_memory)),
                     format_bytes(static_cast<double>(rendering_memory)));
  print_text(out);
}

void info_check(const CommonOptions& common, const std::string& file, const ConfigOptions& given) {
  LoadOptions load;
  load.definitions = given.scene_definitions();
  const SceneCheck check = check_scene_file(file, load);
  const bool loads = check.refused.empty();
  if (common.json) {
    print_json({{"loads", loads}, {"refused", issues_json(check.refused)}, {"assumed", check.assumed}});
  } else {
    std::string out = fmt::format("{} {}\n", file, loads ? "loads" : "does not load");
    for (const SceneIssue& issue : check.refused) out += fmt::format("refused  {}: {}\n", issue.where, issue.what);
    for (const std::string& text : check.assumed) out += fmt::format("assumed  {}\n", text);
    print_text(out);
  }
  if (!loads) throw InputError(fmt::format("{}: {} things cannot be used", file, check.refused.size()));
}

}  // namespace octrad::cli
