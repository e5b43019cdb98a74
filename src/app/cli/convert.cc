// octrad convert: a scene file of any version that can be read, as a plain file of Mitsuba 3.
#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "app/cli/common.h"
#include "app/cli/open_scene.h"
#include "octrad/base/atomic_file.h"
#include "octrad/base/input_file.h"
#include "octrad/base/interrupt.h"
#include "octrad/base/log.h"
#include "octrad/scene/write_xml.h"

namespace octrad::cli {
namespace {

struct ConvertOptions {
  std::string scene, output;
  ConfigOptions definitions;
};

// The folder of files that belong to a scene file; where it is new, it is removed again unless keep() is called.
class FolderBeside {
 public:
  explicit FolderBeside(std::filesystem::path path) : path_(std::move(path)) {
    std::error_code failed;  // writing says what is wrong
    made_ = std::filesystem::create_directory(path_, failed);
  }
  ~FolderBeside() {
    std::error_code failed;
    if (made_) std::filesystem::remove(path_, failed);
  }
  FolderBeside(const FolderBeside&) = delete;
  FolderBeside& operator=(const FolderBeside&) = delete;
  void keep() { made_ = false; }

 private:
  std::filesystem::path path_;
  bool made_ = false;
};

// How many new files can be open at once; asks the system for as many as it gives.
std::size_t most_open_files() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return 64;
  limit.rlim_cur = limit.rlim_max;
  setrlimit(RLIMIT_NOFILE, &limit);
  getrlimit(RLIMIT_NOFILE, &limit);
  constexpr rlim_t others = 64;
  return static_cast<std::size_t>(std::clamp<rlim_t>(limit.rlim_cur, others + 1, 100'000 + others) - others);
}

// All files are on the disk before the first of them replaces one that was there; the scene file is the last. More than
// a program may have open are replaced in portions. False where a signal came before any was replaced by the last
// portion.
bool write_all(const std::filesystem::path& folder, const SceneFiles& files, const std::string& output) {
  defer_interrupts();
  const std::size_t most = most_open_files();
  std::optional<FolderBeside> beside;
  std::vector<std::unique_ptr<AtomicFile>> written;
  const auto commit = [&] {
    for (const auto& file : written) file->prepare();
    if (beside) beside->keep();
    for (const auto& file : written) file->commit();
    written.clear();
  };
  const auto add = [&](const std::string& file, const std::string& bytes) {
    written.push_back(std::make_unique<AtomicFile>(file));
    written.back()->write(bytes);
    written.back()->sync();
  };
  for (const auto& [name, bytes] : files.others) {
    const std::filesystem::path path = folder / name;
    if (!beside) beside.emplace(path.parent_path());
    add(path.string(), bytes());
    if (interrupted()) return false;
    if (written.size() >= most) commit();
  }
  std::error_code failed;
  const auto status = std::filesystem::status(output, failed);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) commit();  // a pipe gets it at once
  add(output, files.xml);
  if (interrupted()) return false;
  commit();
  return true;
}

// Throws UsageError where a file beside the scene file would replace one that belongs to something else: that the scene
// file which is replaced does not name.
void refuse_strangers(const std::string& output, const std::filesystem::path& folder, const SceneFiles& files) {
  std::error_code ignored;
  const std::string before = std::filesystem::is_regular_file(output, ignored) ? read_file(output) : std::string();
  for (const auto& [name, bytes] : files.others) {
    const std::string file = (folder / name).string();
    if (std::filesystem::exists(file, ignored) && before.find(name) == std::string::npos)
      throw UsageError(fmt::format(
          "-o {0}: would replace {1}, which is not a file of {0}; take another name, or remove it", output, file));
  }
}

void convert_verb(const CommonOptions& common, const ConvertOptions& o) {
  refuse_input_as_output("-o", o.output, {o.scene});
  o.definitions.refuse_tuning();
  o.definitions.refuse_config_definitions(
      "sets a parameter of the scene file here, and those have no dot in their names");
  LoadOptions options;
  options.definitions = o.definitions.scene_definitions();
  options.permissive = common.permissive;
  Scene scene;
  SceneFiles files;
  read_scene(o.scene, options, [&] { files = scene_as_xml(o.scene, o.output, options, scene); });
  const std::filesystem::path folder = std::filesystem::path(o.output).parent_path();
  std::vector<std::string> outputs = {o.output};
  for (const auto& [name, bytes] : files.others) outputs.push_back((folder / name).string());
  refuse_inputs_as_outputs("-o", outputs, scene.other_files);
  refuse_strangers(o.output, folder, files);
  log_findings(scene);
  if (!write_all(folder, files, o.output)) return;
  if (common.json) {
    print_json({{"output", o.output},
                {"files", files.others.size()},
                {"fingerprint", scene.fingerprint},
                {"assumed", scene.assumed},
                {"refused", issues_json(scene.refused)}});
  } else {
    log_info("wrote {}{}", o.output,
             files.others.empty() ? "" : fmt::format(" and {} files that it refers to", files.others.size()));
  }
}

}  // namespace

void add_convert(Program& program) {
  auto o = std::make_shared<ConvertOptions>();
  CLI::App* verb = add_verb(program, "convert", "Write a scene file as a plain file of Mitsuba 3.",
                            "octrad convert old.xml -o scene.xml");
  verb->add_option("scene", o->scene, "scene file, of any version that can be read")->required()->type_name("SCENE");
  verb->add_option("-o,--output", o->output, "the file that is written")->required()->type_name("FILE");
  o->definitions.add_definitions_to(*verb);
  add_permissive_option(*verb, program.common);
  verb->callback([&program, o] { program.run = [&program, o] { convert_verb(program.common, *o); }; });
}

}  // namespace octrad::cli
