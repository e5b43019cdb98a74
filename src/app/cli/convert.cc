// octrad convert: a scene file of any version that can be read, as a plain file of Mitsuba 3.
#include <fmt/format.h>

#include <filesystem>

#include "app/cli/common.h"
#include "app/cli/open_scene.h"
#include "octrad/base/atomic_file.h"
#include "octrad/base/log.h"
#include "octrad/scene/write_xml.h"

namespace octrad::cli {
namespace {

struct ConvertOptions {
  std::string scene, output;
  ConfigOptions definitions;
};

void convert_verb(const CommonOptions& common, const ConvertOptions& o) {
  refuse_input_as_output("-o", o.output, {o.scene});
  o.definitions.refuse_tuning();
  o.definitions.refuse_config_definitions(
      "sets a parameter of the scene file here, and those have no dot in their names");
  LoadOptions options;
  options.definitions = o.definitions.scene_definitions();
  options.permissive = common.permissive;
  Scene scene;
  const SceneFiles files = scene_as_xml(o.scene, o.output, options, scene);
  const std::filesystem::path folder = std::filesystem::path(o.output).parent_path();
  std::vector<std::string> outputs = {o.output};
  for (const auto& [name, write] : files.others) outputs.push_back((folder / name).string());
  refuse_inputs_as_outputs("-o", outputs, scene.other_files);
  log_findings(scene);
  for (const auto& [name, write] : files.others) {
    const std::filesystem::path path = folder / name;
    std::error_code failed;
    std::filesystem::create_directory(path.parent_path(), failed);  // writing says what is wrong
    write(path.string());
  }
  write_file(o.output, files.xml);
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
