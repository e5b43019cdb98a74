// octrad info: the program, a scene, a model or a picture.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "app/cli/common.h"
#include "app/cli/info_plugins.h"
#include "app/cli/info_scene.h"
#include "octrad/base/bytes.h"
#include "octrad/base/cpu_info.h"
#include "octrad/base/error.h"
#include "octrad/base/input_file.h"
#include "octrad/base/join.h"
#include "octrad/base/lower_case.h"
#include "octrad/base/threads.h"
#include "octrad/base/version.h"
#include "octrad/device/choose.h"
#include "octrad/image/io.h"
#include "octrad/model/model_file.h"
#include "octrad/model/safetensors.h"
#include "octrad/network/mlp_simd.h"

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
    const std::string type = lower_case(type_name(tensor.type));
    std::string shape;
    for (const std::int64_t d : tensor.shape) shape += (shape.empty() ? "" : " x ") + std::to_string(d);
    tensors.push_back({{"name", name}, {"dtype", type}, {"shape", tensor.shape}, {"bytes", tensor.bytes}});
    table.push_back({name, type, shape, format_count(static_cast<long long>(tensor.bytes))});
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
    return info_check(common, options.file, options.config);
  }
  if (scene) return info_scene(common, options.file, options.config, options.sampled);
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
