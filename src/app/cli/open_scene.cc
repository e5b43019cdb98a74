#include "app/cli/open_scene.h"

#include "app/cli/common.h"
#include "octrad/base/bytes.h"
#include "octrad/base/duration.h"
#include "octrad/base/log.h"
#include "octrad/base/stopwatch.h"
#include "octrad/scene/load.h"

namespace octrad::cli {

Scene open_scene(const std::string& file, const std::map<std::string, std::string>& definitions,
                 const std::vector<std::pair<std::string, std::string>>& outputs) {
  const Stopwatch watch;
  LoadOptions options;
  options.definitions = definitions;
  Scene scene = load_scene(file, options);
  for (const auto& [option, output] : outputs) refuse_input_as_output(option, output, scene.other_files);
  for (const std::string& warning : scene.warnings) log_warning(warning);
  log_verbose("{}: {} triangles in {} shapes, parsed in {}", file,
              format_count(static_cast<long long>(scene.triangle_count())), scene.shapes.size(),
              format_duration(watch.seconds()));
  return scene;
}

}  // namespace octrad::cli
