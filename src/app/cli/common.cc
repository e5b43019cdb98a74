#include "app/cli/common.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <map>
#include <optional>
#include <utility>

#include "app/report/picture_origin.h"
#include "octrad/base/bytes.h"
#include "octrad/base/error.h"
#include "octrad/base/escape.h"
#include "octrad/base/join.h"
#include "octrad/base/json_file.h"
#include "octrad/base/log.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/threads.h"
#include "octrad/device/tuning_keys.h"
#include "octrad/model/field_registry.h"

namespace octrad::cli {
namespace {

// "key=value" -> both parts.
std::pair<std::string, std::string> split_definition(const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0) {
    throw UsageError(fmt::format("-D {}: expected key=value", text));
  }
  return {text.substr(0, equals), text.substr(equals + 1)};
}

bool is_config_key(const std::string& name) {
  if (name.find('.') != std::string::npos)
    return true;  // with a dot it cannot be a scene parameter: set() knows or suggests
  const std::vector<ConfigKey> keys = describe(Config{});
  return std::any_of(keys.begin(), keys.end(), [&](const ConfigKey& key) { return key.key == name; });
}

// Columns on screen of UTF-8 text.
std::size_t display_width(const std::string& text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }));
}

}  // namespace

void flush_stdout() {
  if (std::fflush(stdout) != 0 || std::ferror(stdout))
    throw IoError(fmt::format("cannot write to standard output: {}", std::strerror(errno)));
}

std::uint64_t CommonOptions::memory_budget() const {
  if (!max_memory.empty()) {
    const std::uint64_t bytes = parse_bytes(max_memory);
    if (bytes == 0) throw UsageError("--max-memory must be above 0");
    return bytes;
  }
  return usable_memory() / 10 * 9;  // what is left keeps the machine responsive; 0 (unknown) means no limit
}

std::uint64_t CommonOptions::memory_budget(const Stream& stream) const {
  return max_memory.empty() ? stream.info().free_bytes / 10 * 9 : memory_budget();
}

std::unique_ptr<JsonLines> CommonOptions::open_log(bool append) const {
  return log_json.empty() ? nullptr : std::make_unique<JsonLines>(log_json, append);
}

DeviceChoice CommonOptions::choose_device(const std::string& field) const {
  if (field_entry(field).make_device != nullptr) return choose_device();
  CommonOptions on_cpu = *this;
  on_cpu.support = {"the field " + field, false};
  return on_cpu.choose_device();
}

DeviceChoice CommonOptions::choose_device() const {
  const DeviceChoice choice = octrad::choose_device(parse_device(device), support);
  if (choice.cuda) log_info("device {} ({})", choice.name, choice.why);
  else log_verbose("device {} ({})", choice.name, choice.why);
  return choice;
}

void CommonOptions::apply() const {
  if (quiet > 0 && verbose > 0) throw UsageError("-q and -v exclude each other");
  if (verbose > 1) throw UsageError("-v is given twice: there is one level of detail");
  set_log_level(quiet > 0 ? LogLevel::quiet : verbose > 0 ? LogLevel::verbose : LogLevel::normal);
  if (threads > 0) set_thread_count(threads);
  // TBB cannot go on when a thread is refused, so that is found out before.
  const int wanted = thread_count() + own_threads, startable = startable_threads(wanted);
  if (startable < wanted) {
    const int used = std::max({1, startable / 2, startable - own_threads});
    log_warning(
        fmt::format("only {} of {} threads can be started (a limit of the user or of the container): {} for the work",
                    startable, wanted, used));
    set_thread_count(used);
  }
  set_memory_limit(memory_budget());  // refuses nonsense before any work
  if (!support.cuda) choose_device();
  else if (parse_device(device).kind == DeviceRequest::Kind::cuda) octrad::choose_device(parse_device(device), support);
}

CLI::App* add_verb(Program& program, const std::string& name, const std::string& summary, const std::string& example,
                   Devices devices) {
  CLI::App* verb = program.app.add_subcommand(name, summary);
  program.devices[name] = devices;
  CommonOptions& common = program.common;
  verb->add_option("--threads", common.threads, "threads to use; 0: all")
      ->check(whole_in_range(0, 4096))
      ->type_name("N")
      ->group("Common");
  verb->add_option("--seed", common.seed, "of every random number")
      ->check(whole_in_range(0, 9000000000000000))
      ->type_name("N")
      ->group("Common");
  verb->add_option("--max-memory", common.max_memory,
                   "memory budget, such as 512M or 4G; default: 90 % of what is free")
      ->type_name("BYTES")
      ->group("Common");
  verb->add_option("--device", common.device, "auto (the default), cpu, cuda or cuda:N; octrad info says what there is")
      ->type_name("DEVICE")
      ->group("Common");
  verb->add_flag("-q,--quiet", common.quiet, "no progress, only warnings and errors")->group("Common");
  verb->add_flag("-v,--verbose", common.verbose, "more detail, such as every configuration key")->group("Common");
  verb->add_flag("--json", common.json, "print one JSON object on standard output")->group("Common");
  verb->footer("Example:\n  " + example);
  return verb;
}

void ExrOptions::add_to(CLI::App& verb) {
  verb.add_option("--exr-type", type, "numbers of .exr pictures: float, half (about half the size); default: float")
      ->check(unnamed(CLI::IsMember({"float", "half"})))
      ->type_name("TYPE");
  verb.add_option("--exr-compression", settings.compression,
                  "of .exr pictures: " + join(exr_compressions()) + "; default: zip")
      ->check(unnamed(CLI::IsMember(exr_compressions())))
      ->type_name("NAME");
}

ExrSettings ExrOptions::settings_for(const std::string& output) const {
  ExrSettings chosen = settings;
  if (type == "half") chosen.precision = ExrPrecision::half;
  if ((type != "float" || chosen.compression != ExrSettings().compression) &&
      picture_format(output) != PictureFormat::exr)
    throw UsageError("--exr-type and --exr-compression are for .exr pictures, not " + output);
  return chosen;
}

void add_permissive_option(CLI::App& verb, CommonOptions& common) {
  verb.add_flag("--permissive", common.permissive,
                "scene: replace what is not supported by a stand-in (magenta surfaces) or leave it out, and list it");
}

CLI::Option* add_force_option(CLI::App& verb, bool& force) {
  return verb.add_flag("--force", force, "use a model although it was trained on another scene");
}

void add_log_option(CLI::App& verb, CommonOptions& common) {
  verb.add_option("--log-json", common.log_json, "write progress to FILE, one JSON object a line")
      ->type_name("FILE")
      ->group("Common");
}

CLI::Validator in_range(double low, double high) {
  return CLI::Validator(
      [low, high](std::string& text) -> std::string {
        char* end = nullptr;
        const double value = std::strtod(text.c_str(), &end);
        if (!text.empty() && *end == '\0' && value >= low && value <= high) return "";
        const bool number = !text.empty() && *end == '\0' && !std::isnan(value);
        return fmt::format("\"{}\" is {}; expected a number from {:g} to {:g}", text,
                           number ? "out of range" : "not a number", low, high);
      },
      "");
}

CLI::Validator whole_in_range(long long low, long long high) {
  return CLI::Validator(
      [low, high](std::string& text) -> std::string {
        const std::size_t first = text[0] == '-' ? 1 : 0;
        const bool digits = text.find_first_not_of("0123456789", first) == std::string::npos;
        const bool octal = text.size() > first + 1 && text[first] == '0';  // what the parser would take 010 for
        const bool number = digits && !octal && !text.empty() && text != "-";
        const double value = number ? std::strtod(text.c_str(), nullptr) : 0.0;  // of any length
        if (number && value >= static_cast<double>(low) && value <= static_cast<double>(high)) return "";
        return fmt::format("\"{}\" is {}; expected a whole number from {} to {}", text,
                           number ? "out of range" : "not a whole number", low, high);
      },
      "");
}

void print_json(const nlohmann::json& object) { print_text(printable_json_text(object, 2)); }

void print_text(const std::string& raw) {
  const std::string text = printable(raw);
  std::fwrite(text.data(), 1, text.size(), stdout);
  if (text.empty() || text.back() != '\n') std::fputc('\n', stdout);
  flush_stdout();
}

void warn_of_other_view(const std::string& a_file, const Image& a, const std::string& b_file, const Image& b) {
  if (const std::string what = report::view_difference(a, b); !what.empty())
    log_warning(fmt::format("{} and {} differ in {}: they are not pictures of one view", a_file, b_file, what));
}

nlohmann::json stages_json(const StageSplit& stages) {
  nlohmann::json object = nlohmann::json::object();
  for (const auto& [stage, ms] : stages) object[stage] = ms;
  return object;
}

std::string format_stages(const StageSplit& stages) {
  std::string text;
  for (const auto& [stage, ms] : stages) text += fmt::format("{}{} {:.4g}", text.empty() ? "" : ", ", stage, ms);
  return text;
}

void warn_not_saved(const std::string& why) {
  log_warning(why + "; training goes on, and the next checkpoint tries again");
}

void refuse_inputs_as_outputs(const std::string& option, std::vector<std::string> outputs,
                              const std::vector<std::string>& inputs) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  std::erase_if(outputs, [&](const std::string& file) {
    return file.empty() || (fs::exists(file, ignored) && !fs::is_regular_file(file, ignored));  // /dev/null
  });
  if (outputs.empty()) return;
  // Two names of one file are the same path, or lead to the same place on the same disk.
  const auto place_of = [](const std::string& file) {
    struct stat found {};
    return ::stat(file.c_str(), &found) == 0 ? std::optional(std::pair(found.st_dev, found.st_ino)) : std::nullopt;
  };
  // Of a file that is not there yet, "x" and "./x" are the same path only when both are absolute.
  const auto path_of = [&](const std::string& file) {
    return fs::weakly_canonical(fs::absolute(file, ignored), ignored).string();
  };
  std::map<std::string, std::string> by_path;
  std::map<std::pair<dev_t, ino_t>, std::string> by_place;
  for (const std::string& input : inputs) {
    if (input.empty()) continue;
    if (const std::string path = path_of(input); !path.empty()) by_path.emplace(path, input);
    if (const auto place = place_of(input)) by_place.emplace(*place, input);
  }
  for (const std::string& output : outputs) {
    const auto place = place_of(output);
    const auto same_path = by_path.find(path_of(output));
    const auto same_place = place ? by_place.find(*place) : by_place.end();
    if (same_path == by_path.end() && same_place == by_place.end()) continue;
    throw UsageError(fmt::format("{} {}: is {} too, which it would overwrite", option, output,
                                 same_path != by_path.end() ? same_path->second : same_place->second));
  }
}

void refuse_input_as_output(const std::string& option, const std::string& output,
                            const std::vector<std::string>& inputs) {
  refuse_inputs_as_outputs(option, {output}, inputs);
}

std::string format_table(const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> widths;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()), 0);
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], display_width(row[i]));
  }
  std::string out;
  for (const auto& row : rows) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string padding(widths[i] - display_width(row[i]), ' ');
      line += (i > 0 ? "  " : "") + (i == 0 ? row[i] + padding : padding + row[i]);
    }
    line.erase(line.find_last_not_of(' ') + 1);
    out += line + "\n";
  }
  return out;
}

std::vector<double> parse_numbers(const std::string& text, std::size_t count, const std::string& option) {
  std::vector<double> out;
  const char* p = text.c_str();
  while (true) {
    char* end = nullptr;
    const double value = std::strtod(p, &end);
    if (end == p || !std::isfinite(value)) break;
    out.push_back(value);
    p = end;
    while (*p == ' ') ++p;
    if (*p == '\0' || *p != ',') break;
    ++p;
  }
  if (*p != '\0' || out.size() != count) {
    throw UsageError(fmt::format("{} \"{}\": expected {} numbers with commas between them", option, text, count));
  }
  return out;
}

Vec3f parse_vector(const std::string& text, const std::string& option) {
  const std::vector<double> v = parse_numbers(text, 3, option);
  return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

namespace {

// What -D names that is no part of a configuration: how device code runs.
constexpr std::string_view kTuning = "device.";

void add_definitions(CLI::App& verb, std::vector<std::string>& definitions, const std::string& help) {
  verb.add_option("-D", definitions, help)
      ->type_name("KEY=VALUE")
      ->expected(1)
      ->allow_extra_args(false)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
}

}  // namespace

void ConfigOptions::add_definitions_to(CLI::App& verb, const std::string& keys) {
  add_definitions(verb, definitions, "set a parameter of the scene file" + keys);
}

void ConfigOptions::add_to(CLI::App& verb) {
  verb.add_option("--preset", preset, "paper | default | cpu (the default)")->type_name("NAME");
  verb.add_option("--config", file, "JSON file with configuration keys; octrad info --keys lists them")
      ->type_name("FILE");
  add_definitions(verb, definitions, "set a configuration key (octree.levels=6) or a parameter of the scene file");
}

Config ConfigOptions::resolve() const {
  Config config = octrad::preset(preset.empty() ? "cpu" : preset);
  if (!file.empty()) {
    const nlohmann::json json = read_json_file(file);
    if (!preset.empty() && json.is_object() && json.contains("preset") && json["preset"] != preset) {
      throw UsageError(
          fmt::format("--preset {} and {} (preset {}) contradict each other", preset, file, json["preset"].dump()));
    }
    octrad::apply(config, json, file);
  }
  for (const auto& [key, value] : config_definitions()) set(config, key, value);
  return config;
}

std::vector<std::pair<std::string, std::string>> ConfigOptions::config_definitions() const {
  std::vector<std::pair<std::string, std::string>> out;
  for (const std::string& definition : definitions) {
    auto parts = split_definition(definition);
    if (is_config_key(parts.first) && !parts.first.starts_with(kTuning)) out.push_back(std::move(parts));
  }
  return out;
}

void ConfigOptions::refuse_config_definitions(const std::string& why) const {
  const auto keys = config_definitions();
  if (!keys.empty()) throw UsageError(fmt::format("-D {}: {}", keys.front().first, why));
}

DeviceTuning ConfigOptions::tuning() const {
  DeviceTuning tuning;
  for (const std::string& definition : definitions) {
    const auto [key, value] = split_definition(definition);
    if (key.starts_with(kTuning)) set(tuning, key.substr(kTuning.size()), value);
  }
  return tuning;
}

void ConfigOptions::refuse_tuning() const {
  for (const std::string& definition : definitions) {
    const std::string key = split_definition(definition).first;
    if (key.starts_with(kTuning)) throw UsageError(fmt::format("-D {}: nothing runs on a device here", key));
  }
}

std::map<std::string, std::string> ConfigOptions::scene_definitions() const {
  std::map<std::string, std::string> out;
  for (const std::string& definition : definitions) {
    const auto [key, value] = split_definition(definition);
    if (!is_config_key(key)) out[key] = value;
  }
  return out;
}

Model load_to_train(const std::string& file, std::uint64_t& held) {
  const std::uint64_t before = resident_bytes();
  Model model = load_model(file, true);
  held = std::max(resident_bytes(), before) - before;
  return model;
}

void set_seed(Config& config, const CommonOptions& common) {
  if (common.has_seed()) set(config, "seed", std::to_string(common.seed));
}

std::string empty_lookups_text(long long count) {
  return fmt::format("{} look-ups of an octree level found no occupied cell and had features of 0",
                     format_count(count));
}

void warn_of_ignored_keys(const ConfigOptions& options, const Config& config) {
  const auto switches_off = [](const std::string& value) {
    return value == "0" || value == "false" || value == "none" || value == "joined";
  };
  for (const auto& [key, value] : options.config_definitions()) {
    if (ignores_key(field_entry(config.field), key))
      log_warning(fmt::format("-D {}: the field {} does not use it", key, config.field));
    else if (const std::string needed = unmet_condition(config, key); !needed.empty() && !switches_off(value))
      log_warning(fmt::format("-D {} has no effect here: it needs {}", key, needed));
  }
}

}  // namespace octrad::cli
