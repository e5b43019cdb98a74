// octrad info: the program, a scene, a model or a picture.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "app/cli/common.h"
#include "app/cli/info_plugins.h"
#include "app/cli/open_scene.h"
#include "app/report/vector_json.h"
#include "octrad/base/bytes.h"
#include "octrad/base/cpu_info.h"
#include "octrad/base/error.h"
#include "octrad/base/input_file.h"
#include "octrad/base/join.h"
#include "octrad/base/log.h"
#include "octrad/base/lower_case.h"
#include "octrad/base/threads.h"
#include "octrad/base/version.h"
#include "octrad/device/choose.h"
#include "octrad/encoding/octaoctree.h"
#include "octrad/image/io.h"
#include "octrad/model/field_registry.h"
#include "octrad/model/model_file.h"
#include "octrad/model/safetensors.h"
#include "octrad/network/mlp_simd.h"
#include "octrad/render/highlights.h"
#include "octrad/scene/camera.h"
#include "octrad/scene/load.h"
#include "octrad/scene/plugins.h"
#include "octrad/train/domain.h"

namespace octrad::cli {
namespace {

struct InfoOptions {
  std::string file;
  bool keys = false;
  bool sampled = false;
  bool check = false;
  std::string plugins;  // which of them to list; empty: --plugins was not given
  ConfigOptions config;
};

// What the machine has for --device, and what the verbs that can use it get without one.
nlohmann::json devices_json(const DeviceSurvey& survey, const DeviceChoice& choice,
                            const std::set<std::string>& verbs) {
  nlohmann::json devices = nlohmann::json::array();
  for (const DeviceInfo& d : survey.devices) {
    devices.push_back({{"device", fmt::format("cuda:{}", d.index)},
                       {"name", d.name},
                       {"compute_capability", fmt::format("{}.{}", d.major, d.minor)},
                       {"multiprocessors", d.multiprocessors},
                       {"memory", d.total_bytes},
                       {"l2", d.l2_bytes},
                       {"shared_memory", d.shared_bytes},
                       {"usable", runs_on(survey.architectures, d.major, d.minor)}});
  }
  const auto known = [](const std::string& text) {
    return text.empty() ? nlohmann::json(nullptr) : nlohmann::json(text);
  };
  return {{"built_with_cuda", built_with_cuda()},
          {"architectures", known(survey.architectures)},
          {"runtime", known(survey.runtime)},
          {"driver", known(survey.driver)},
          {"devices", devices},
          {"why_none", known(survey.why_none)},
          {"device_verbs", verbs},
          {"auto", {{"device", choice.name}, {"why", choice.why}}}};
}

std::string devices_text(const DeviceSurvey& survey, const DeviceChoice& choice, const std::set<std::string>& verbs) {
  std::string out = "CUDA       ";
  if (built_with_cuda()) {
    out += fmt::format("runtime {}, built for {}; driver {}\n", survey.runtime, survey.architectures,
                       survey.driver.empty() ? "none" : "for " + survey.driver);
  } else {
    out += "not built in\n";
  }
  for (const DeviceInfo& d : survey.devices) {
    out += fmt::format("cuda:{:<5} {}, compute capability {}.{}, {} multiprocessors, {}\n", d.index, d.name, d.major,
                       d.minor, d.multiprocessors, format_bytes(static_cast<double>(d.total_bytes)));
  }
  return out +
         fmt::format("--device   auto is {} ({}); verbs with a GPU path: {}\n", choice.name, choice.why, join(verbs));
}

void info_program(const CommonOptions& common, std::set<std::string> device_verbs) {
  device_verbs.erase("info");  // it only looks
  const CpuInfo cpu = cpu_info();
  const std::uint64_t memory = usable_memory();
  const DeviceSurvey survey = survey_devices();
  const DeviceChoice choice = choose_device(parse_device(common.device), common.support, survey);
  if (common.json) {
    nlohmann::json report = {{"version", kVersion},          {"isa", cpu.level},
                             {"simd", network_simd_name()},  {"cpu", cpu.model},
                             {"cpu_features", cpu.features}, {"cores", cpu.logical_cores},
                             {"threads", thread_count()},    {"memory", memory}};
    report.update(devices_json(survey, choice, device_verbs));
    print_json(report);
    return;
  }
  std::string features;
  for (const std::string& f : cpu.features) features += (features.empty() ? "" : " ") + f;
  print_text(
      fmt::format(
          "octrad {}\nprocessor  {} ({} cores, using {} threads)\nISA        {} ({})\nSIMD       {} (the kernels in use)\nmemory     {} usable\n",
          kVersion, cpu.model, cpu.logical_cores, thread_count(), cpu.level, features, network_simd_name(),
          format_bytes(static_cast<double>(memory))) +
      devices_text(survey, choice, device_verbs));
}

void info_keys(const CommonOptions& common, const Config& config) {
  const std::vector<ConfigKey> keys = describe(config);
  if (common.json) {
    nlohmann::json list = nlohmann::json::array();
    for (const ConfigKey& k : keys)
      list.push_back({{"key", k.key}, {"value", k.value}, {"accepted", k.accepted}, {"help", k.help}});
    print_json({{"preset", config.preset}, {"config", to_json(config)}, {"keys", list}});
    return;
  }
  std::string out;
  for (const ConfigKey& k : keys) out += fmt::format("{} = {}\n    {}\n    {}\n", k.key, k.value, k.help, k.accepted);
  print_text(out);
}

void info_image(const CommonOptions& common, const std::string& file) {
  const Image image = read_image(file);
  nlohmann::json channels = nlohmann::json::array();
  std::vector<std::vector<std::string>> table = {{"channel", "min", "mean", "max", "not finite"}};
  for (int c = 0; c < image.channel_count(); ++c) {
    double low = INFINITY, high = -INFINITY, sum = 0.0;
    long long finite = 0, other = 0;
    for (std::size_t i = static_cast<std::size_t>(c); i < image.data.size(); i += image.channels.size()) {
      const double v = image.data[i];
      if (!std::isfinite(v)) {
        ++other;
        continue;
      }
      low = std::min(low, v);
      high = std::max(high, v);
      sum += v;
      ++finite;
    }
    const double mean = finite > 0 ? sum / static_cast<double>(finite) : NAN;
    const std::string& name = image.channels[static_cast<std::size_t>(c)];
    channels.push_back({{"name", name}, {"min", low}, {"mean", mean}, {"max", high}, {"non_finite", other}});
    table.push_back({name, fmt::format("{:.5g}", low), fmt::format("{:.5g}", mean), fmt::format("{:.5g}", high),
                     format_count(other)});
  }
  if (common.json) {
    print_json({{"file", file},
                {"width", image.width},
                {"height", image.height},
                {"channels", channels},
                {"metadata", image.metadata}});
    return;
  }
  std::string out = fmt::format("{}: {} x {}\n{}", file, image.width, image.height, format_table(table));
  for (const auto& [key, value] : image.metadata) out += fmt::format("{}: {}\n", key, value);
  print_text(out);
}

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

// Counts, bounds, lights, and the size of the cache that training would make.
void info_scene(const CommonOptions& common, const InfoOptions& options) {
  Config config = options.config.resolve();
  set_seed(config, common);
  const FieldEntry& field = field_entry(config.field);
  const bool octree = field.cell_levels(config) > 0;
  if (options.sampled && !octree)
    throw UsageError(fmt::format("--sampled: the field {} has no octree whose cells could be counted", field.name));
  const PreparedScene prepared(open_scene(options.file, options.config.scene_definitions(), common.permissive));
  const Scene& scene = prepared.scene();
  warn_of_ignored_keys(options.config, config);
  const DomainFit fit = fit_domain(
      prepared, config, config.train_cameras.empty() ? std::vector<Camera>{} : read_cameras(config.train_cameras));
  const Domain& domain = fit.box;
  std::vector<std::string> warnings = scene.warnings;
  if (const std::string coarse = domain_warning(fit); !coarse.empty()) {
    log_warning(coarse);
    warnings.push_back(coarse);
  }
  const OctreeLevels levels = octree ? count_levels(scene, domain, config, options.sampled) : OctreeLevels{};
  const ModelFileSize size = estimate_model_file_size(config, levels.cells);

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
  print_text(out);
}

// Everything that stands in the way of a scene.
void info_check(const CommonOptions& common, const InfoOptions& options) {
  LoadOptions load;
  load.definitions = options.config.scene_definitions();
  const SceneCheck check = check_scene_file(options.file, load);
  const bool loads = check.refused.empty();
  if (common.json) {
    print_json({{"loads", loads}, {"refused", issues_json(check.refused)}, {"assumed", check.assumed}});
  } else {
    std::string out = fmt::format("{} {}\n", options.file, loads ? "loads" : "does not load");
    for (const SceneIssue& issue : check.refused) out += fmt::format("refused  {}: {}\n", issue.where, issue.what);
    for (const std::string& text : check.assumed) out += fmt::format("assumed  {}\n", text);
    print_text(out);
  }
  if (!loads) throw InputError(fmt::format("{}: {} things cannot be used", options.file, check.refused.size()));
}

const char* dtype_name(DType type) {
  switch (type) {
    case DType::f32: return "f32";
    case DType::f16: return "f16";
    case DType::i32: return "i32";
    case DType::i64: return "i64";
    case DType::u8: return "u8";
    case DType::u16: return "u16";
    case DType::u32: return "u32";
    case DType::u64: return "u64";
    case DType::f64: return "f64";
  }
  return "?";
}

void info_model(const CommonOptions& common, const std::string& file) {
  const TensorReader reader(file);
  const auto& metadata = reader.metadata();
  if (const auto it = metadata.find("format"); it == metadata.end() || it->second != "octrad") {
    throw InputError(
        fmt::format("{} is a safetensors file but no octrad model (its metadata lacks format = octrad)", file));
  }
  nlohmann::json texts = nlohmann::json::object();
  for (const auto& [key, value] : metadata) {
    // Some are JSON in a string, or a number in one.
    constexpr const char* kParsed[] = {"config", "octrad.checksums", "scene", "seed", "step"};
    nlohmann::json parsed = parse_json_or_discard(value);
    const bool is_json = std::ranges::find(kParsed, key) != std::end(kParsed) && !parsed.is_discarded();
    texts[key] = is_json ? parsed : nlohmann::json(value);
  }
  nlohmann::json tensors = nlohmann::json::array();
  std::vector<std::vector<std::string>> table = {{"tensor", "type", "shape", "bytes"}};
  for (const std::string& name : reader.names()) {
    const TensorReader::Tensor tensor = reader.get(name);
    std::string shape;
    for (const std::int64_t d : tensor.shape) shape += (shape.empty() ? "" : " x ") + std::to_string(d);
    tensors.push_back(
        {{"name", name}, {"dtype", dtype_name(tensor.type)}, {"shape", tensor.shape}, {"bytes", tensor.bytes}});
    table.push_back({name, dtype_name(tensor.type), shape, format_count(static_cast<long long>(tensor.bytes))});
  }
  const ModelFileSize size = model_file_size(reader);
  if (common.json) {
    nlohmann::json out = {{"file", file},
                          {"metadata", texts},
                          {"tensors", tensors},
                          {"bytes", static_cast<std::uint64_t>(size.total)},
                          {"feature_bytes", static_cast<std::uint64_t>(size.features)},
                          {"optimizer_bytes", static_cast<std::uint64_t>(size.optimizer)}};
    print_json(out);
    return;
  }
  std::string out = fmt::format("{}: {}: features {}, what --resume needs {}, networks and cells {}\n", file,
                                format_bytes(size.total), format_bytes(size.features), format_bytes(size.optimizer),
                                format_bytes(size.total - size.features - size.optimizer));
  for (const auto& [key, value] : texts.items()) {
    if (key != "config" && key != "octrad.checksums")
      out += fmt::format("{}: {}\n", key, value.is_string() ? value.get<std::string>() : value.dump());
  }
  out += "\n" + format_table(table);
  if (texts.contains("config")) out += "\nconfig " + texts["config"].dump(2) + "\n";
  print_text(out);
}

void info_verb(const CommonOptions& common, const InfoOptions& options, const std::set<std::string>& device_verbs) {
  options.config.refuse_tuning();
  if (!options.plugins.empty()) {
    if (!options.file.empty() || options.keys || options.check || options.sampled || common.permissive ||
        options.config.given())
      throw UsageError("--plugins lists what scenes may hold, of one NAME or all, and takes nothing else");
    return info_plugins(common, options.plugins);
  }
  if (options.keys && !options.file.empty()) throw UsageError("--keys lists the configuration and takes no FILE");
  for (const auto& [given, name] :
       {std::pair(options.sampled, "--sampled"), {options.check, "--check"}, {common.permissive, "--permissive"}}) {
    if (options.keys && given) throw UsageError(fmt::format("{} belongs to a scene", name));
  }
  if (options.keys && !options.config.scene_definitions().empty())
    throw UsageError(fmt::format("-D {}: no such configuration key; --keys without it lists them",
                                 options.config.scene_definitions().begin()->first));
  if (options.keys) {
    Config config = options.config.resolve();
    set_seed(config, common);
    return info_keys(common, config);
  }
  const std::string extension = ending_of(options.file);
  const bool scene = extension == ".xml" || extension == ".gltf" || extension == ".glb" || extension == ".pbrt";
  if (options.check && !scene) throw UsageError("--check belongs to a scene (.xml, .gltf, .glb, .pbrt)");
  if (options.check && common.permissive)
    throw UsageError("--check lists what --permissive would replace; give one of them");
  if (options.check) {
    if (options.sampled || !options.config.preset.empty() || !options.config.file.empty())
      throw UsageError("--check looks at the scene alone: --preset, --config and --sampled have no meaning");
    options.config.refuse_config_definitions("--check looks at the scene alone");
    return info_check(common, options);
  }
  if (scene) return info_scene(common, options);
  if (common.permissive) throw UsageError("--permissive belongs to a scene");
  if (options.sampled) throw UsageError("--sampled belongs to a scene");
  if (options.config.given()) throw UsageError("--preset, --config and -D belong to a scene or to --keys");
  if (options.file.empty()) return info_program(common, device_verbs);
  if (extension == ".octrad") return info_model(common, options.file);
  if (is_picture_name(options.file)) return info_image(common, options.file);
  InputFile(options.file);  // throws where it cannot be opened
  throw UsageError(fmt::format(
      "cannot tell what {} is: its ending is none of a scene (.xml, .gltf, .glb, .pbrt), a model (.octrad) or a picture (.exr, .hdr, .pfm, .png, "
      ".jpg, .webp, .bmp, .tga)",
      options.file));
}

}  // namespace

void add_info(Program& program) {
  auto options = std::make_shared<InfoOptions>();
  CLI::App* verb = add_verb(program, "info", "Describe the program, a scene, a model or a picture.",
                            "octrad info scene.xml --preset default -D octree.levels=6", Devices::cuda);
  verb->add_option("file", options->file,
                   "scene (.xml, .gltf, .glb, .pbrt), model (.octrad) or picture; none: the program itself")
      ->type_name("FILE");
  verb->add_flag("--keys", options->keys, "list every configuration key with its value and what it accepts");
  verb->add_flag("--sampled", options->sampled, "scene: also count the cells that hold one of 2^26 surface samples");
  verb->add_flag("--check", options->check,
                 "scene: list everything that is refused or assumed; exit code 2 where it does not load");
  verb->add_option(
          "--plugins", options->plugins,
          "list the shapes, bsdfs, textures ... that scenes may hold, with parameters and defaults: all, one kind "
          "(bsdf) or one type (roughplastic)")
      ->expected(0, 1)
      ->default_str(kAllPlugins)
      ->option_text("[NAME]");
  add_permissive_option(*verb, program.common);
  options->config.add_to(*verb);
  verb->callback([&program, options] {
    program.run = [&program, options] { info_verb(program.common, *options, program.device_verbs()); };
  });
}

}  // namespace octrad::cli
