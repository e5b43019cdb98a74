// What the verbs of the command line share: options, the place where results are printed, configuration.
#pragma once

#include <CLI/CLI.hpp>

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "octrad/base/progress.h"
#include "octrad/base/vec.h"
#include "octrad/device/choose.h"
#include "octrad/device/stage_times.h"
#include "octrad/image/io.h"
#include "octrad/model/config.h"
#include "octrad/model/model_file.h"

namespace octrad::cli {

// Options that every verb has.
struct CommonOptions {
  int threads = 0;         // 0: all
  long long seed = -1;     // -1: not given
  std::string max_memory;  // "4G"; empty: what the machine can give
  std::string device = "auto";
  DeviceSupport support;       // of the verb that runs
  int quiet = 0, verbose = 0;  // how often they were given
  bool json = false;
  std::string log_json;
  bool permissive = false;  // of verbs that read scenes
  int own_threads = 0;      // that the verb starts beside those of parallel loops

  bool has_seed() const { return seed >= 0; }
  std::uint64_t memory_budget() const;
  // The same for the memory of a device: 90 % of what is free there by default.
  std::uint64_t memory_budget(const Stream& stream) const;
  // The --log-json file, null if not asked for.
  std::unique_ptr<JsonLines> open_log(bool append = false) const;
  // The device that the verb works on, by --device and what the machine has; says so when that is a GPU, and with -v
  // always. Throws DeviceError when one is asked for that cannot be used.
  DeviceChoice choose_device() const;
  // The same for a verb's work on a radiance field, which may have no code for devices.
  DeviceChoice choose_device(const std::string& field) const;
  // Applies threads and verbosity, and refuses nonsense and devices that cannot be used; called once, after parsing.
  void apply() const;
};

// Where a verb's work can be done: on the CPU only (asking for a CUDA device is an error), or also on a CUDA device.
enum class Devices { cpu, cuda };

// A verb adds its subcommand to `program`; the chosen one's action is put into `run` while parsing.
struct Program {
  CLI::App app;
  CommonOptions common;
  std::function<void()> run;
  std::map<std::string, Devices> devices;  // of each verb

  std::set<std::string> device_verbs() const {  // those with a path on CUDA devices
    std::set<std::string> verbs;
    for (const auto& [verb, where] : devices) {
      if (where != Devices::cpu) verbs.insert(verb);
    }
    return verbs;
  }
};

// Adds a subcommand with the common options. `example` is shown at the end of --help.
CLI::App* add_verb(Program& program, const std::string& name, const std::string& summary, const std::string& example,
                   Devices devices = Devices::cpu);

void add_train(Program& program);
void add_render(Program& program);
void add_view(Program& program);
void add_compare(Program& program);
void add_convert(Program& program);
void add_denoise(Program& program);
void add_merge(Program& program);
void add_info(Program& program);
void add_query(Program& program);
void add_tonemap(Program& program);
void add_selftest(Program& program);
void add_paper(Program& program);

// Adds --log-json: for verbs whose work has progress to write.
void add_log_option(CLI::App& verb, CommonOptions& common);

// Adds --permissive: for verbs that read scenes.
void add_permissive_option(CLI::App& verb, CommonOptions& common);

// Adds --force: for verbs that use a model with a scene (check_scene).
CLI::Option* add_force_option(CLI::App& verb, bool& force);

// A check that does not add itself to the help text (the option's own text says what is accepted).
template <typename Validator>
CLI::Validator unnamed(Validator validator) {
  return validator.description("");
}

// --exr-type and --exr-compression of verbs that write pictures.
struct ExrOptions {
  std::string type = "float";
  ExrSettings settings;

  void add_to(CLI::App& verb);
  // The settings. Throws UsageError where they were given for a picture of another format.
  ExrSettings settings_for(const std::string& output) const;
};

// A check that an option's value is a number from `low` to `high`, or a whole one. Its messages say what is accepted.
CLI::Validator in_range(double low, double high);
CLI::Validator whole_in_range(long long low, long long high);

// Standard output: with --json exactly one object, without it text. Throws IoError when it cannot be written.
void print_json(const nlohmann::json& object);
void print_text(const std::string& text);
// What was written to standard output is there. Throws IoError where it is not.
void flush_stdout();

// Milliseconds by stage: an object, and "first hits 0.31, field 0.92".
nlohmann::json stages_json(const StageSplit& stages);
std::string format_stages(const StageSplit& stages);

// What is said of a checkpoint that could not be written (TrainOptions::not_saved), and why.
void warn_not_saved(const std::string& why);

// Throws UsageError where an output, given as `option`, is one of `inputs` by whatever name: it would be overwritten.
void refuse_inputs_as_outputs(const std::string& option, std::vector<std::string> outputs,
                              const std::vector<std::string>& inputs);
void refuse_input_as_output(const std::string& option, const std::string& output,
                            const std::vector<std::string>& inputs);

// Rows of cells as aligned columns; the first column to the left, others to the right.
std::string format_table(const std::vector<std::vector<std::string>>& rows);

// "x,y,z" -> numbers. Throws UsageError naming `option`.
std::vector<double> parse_numbers(const std::string& text, std::size_t count, const std::string& option);
Vec3f parse_vector(const std::string& text, const std::string& option);

// --preset, --config and -D of verbs that have a configuration; others fill `definitions` alone.
struct ConfigOptions {
  std::string preset;
  std::string file;
  std::vector<std::string> definitions;  // "key=value"

  void add_to(CLI::App& verb);
  // -D alone, for parameters of the scene file. `keys`: what else it sets, to follow in the help text.
  void add_definitions_to(CLI::App& verb, const std::string& keys = "");
  bool given() const { return !preset.empty() || !file.empty() || !definitions.empty(); }
  // Preset, then the file, then the definitions that name configuration keys.
  Config resolve() const;
  // The definitions that name configuration keys, in order (not checked).
  std::vector<std::pair<std::string, std::string>> config_definitions() const;
  // Throws UsageError where a definition names a configuration key: `why` there is none here.
  void refuse_config_definitions(const std::string& why) const;
  // Of the definitions named device.KEY. Throws UsageError.
  DeviceTuning tuning() const;
  // Throws UsageError where there are some: of verbs that run nothing on a device.
  void refuse_tuning() const;
  // The other definitions: parameters of the scene file ("<default name=...>"). A name with a dot is a configuration
  // key.
  std::map<std::string, std::string> scene_definitions() const;
};

// The model, with what training it on takes. `held`: bytes that the program grew by, which the estimate of that
// training counts once more. Throws as load_model().
Model load_to_train(const std::string& file, std::uint64_t& held);

// Makes `--seed`, where it is given, that of the configuration.
void set_seed(Config& config, const CommonOptions& common);

// Warns where two pictures are not of one view (report::view_difference).
void warn_of_other_view(const std::string& a_file, const Image& a, const std::string& b_file, const Image& b);

// What to say of look-ups that found nothing (RadianceField::take_empty_lookups).
std::string empty_lookups_text(long long count);

// Warns of keys on the command line (-D) that the field of `config` does not use.
void warn_of_ignored_keys(const ConfigOptions& options, const Config& config);

}  // namespace octrad::cli
