#include "app/cli/loaded_scene.h"

#include "octrad/base/bytes.h"
#include "octrad/base/duration.h"
#include "octrad/base/log.h"
#include "octrad/base/stopwatch.h"
#include "octrad/scene/load.h"

namespace octrad::cli {

LoadedScene open_scene(const std::string& file, const std::map<std::string, std::string>& definitions, bool tracing) {
  Stopwatch watch;
  LoadedScene loaded;
  LoadOptions options;
  options.definitions = definitions;
  loaded.scene = std::make_unique<Scene>(load_scene(file, options));
  for (const std::string& warning : loaded.scene->warnings) log_warning(warning);
  const double parsed = watch.seconds();
  if (tracing) {
    loaded.tracer = make_embree_tracer(*loaded.scene);
    loaded.materials = std::make_unique<Materials>(*loaded.scene);
    loaded.lights = std::make_unique<Lights>(*loaded.scene);
  }
  log_verbose("{}: {} triangles in {} shapes, parsed in {}, prepared in {}", file,
              format_count(static_cast<long long>(loaded.scene->triangle_count())), loaded.scene->shapes.size(),
              format_duration(parsed), format_duration(watch.seconds() - parsed));
  return loaded;
}

}  // namespace octrad::cli
