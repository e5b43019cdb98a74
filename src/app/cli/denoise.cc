// octrad denoise: a picture with colour and first-hit layers through Intel Open Image Denoise.
#include <fmt/format.h>

#include "app/cli/common.h"
#include "app/cli/denoise_options.h"
#include "app/report/picture_origin.h"
#include "octrad/base/atomic_file.h"
#include "octrad/base/bytes.h"
#include "octrad/base/duration.h"
#include "octrad/base/error.h"
#include "octrad/base/log.h"
#include "octrad/base/version.h"
#include "octrad/image/io.h"
#include "octrad/image/tonemap.h"

namespace octrad::cli {
namespace {

struct DenoiseVerbOptions {
  ExrOptions exr;
  std::string input, output, layers_from;
  DenoiserOptions denoiser;
};

Image read_linear(const std::string& file) {
  Image image = read_image(file);
  if (is_display_referred(image))
    throw InputError(file + ": a picture for the screen; the denoiser takes linear ones (EXR, HDR, PFM)");
  if (!report::mask_of(image).empty())
    throw InputError(file + ": was rendered with --mask; a denoiser needs every pixel");
  return image;
}

void denoise_verb(const CommonOptions& common, const DenoiseVerbOptions& o) {
  picture_format(o.output);  // refuses an unknown ending
  const ExrSettings exr = o.exr.settings_for(o.output);
  require_writable(o.output);
  refuse_input_as_output("-o", o.output, {o.input, o.layers_from});
  Image image = read_linear(o.input);
  require_format_size(o.output, image.width, image.height);
  Image layers;
  if (!o.layers_from.empty()) layers = read_linear(o.layers_from);
  const bool again = image.metadata.count("octrad.denoise") > 0;
  if (again) log_warning(fmt::format("{} has been denoised before", o.input));
  // The denoiser's own copies: colour, result and two layers.
  require_memory(common.memory_budget(), fmt::format("denoising {} x {} pixels", image.width, image.height),
                 {{"colour, layers and result", image.pixel_count() * 4 * 3 * sizeof(float)},
                  {"the program and the picture, in memory already", resident_bytes()}},
                 "a smaller picture needs less");
  const std::unique_ptr<Denoiser> denoiser = o.denoiser.make(false);
  denoise(*denoiser, image, o.input, o.layers_from.empty() ? nullptr : &layers);
  image.metadata["octrad.version"] = kVersion;
  write_image(o.output, image, {}, exr);
  if (common.json) {
    print_json({{"output", o.output},
                {"width", image.width},
                {"height", image.height},
                {"denoise_seconds", denoiser->seconds()},
                {"aux", denoiser->used()},
                {"denoiser_version", denoiser->version()},
                {"library", denoiser->library()}});
  } else {
    log_info("{}: {} x {}, denoised in {} (Open Image Denoise {}; layers: {})", o.output, image.width, image.height,
             format_duration(denoiser->seconds()), denoiser->version(), denoiser->used());
  }
}

}  // namespace

void add_denoise(Program& program) {
  auto o = std::make_shared<DenoiseVerbOptions>();
  CLI::App* verb = add_verb(program, "denoise", "Remove the noise of a rendered picture with Intel Open Image Denoise.",
                            "octrad denoise noisy.exr -o smooth.exr");
  verb->add_option("picture", o->input, "linear picture; EXR with albedo and normal layers gives the best result")
      ->required()
      ->type_name("IN.exr");
  verb->add_option("-o,--output", o->output, "with all other layers and the metadata; the ending says the format")
      ->required()
      ->type_name("OUT.exr");
  verb->add_option("--layers-from", o->layers_from, "take albedo and normals from this picture of the view")
      ->type_name("FILE");
  verb->add_flag("--ldr", o->denoiser.ldr, "colours lie in [0, 1]; without it they are radiance of any size");
  o->denoiser.add_to(*verb, "", "Denoiser");
  o->exr.add_to(*verb);
  verb->callback([&program, o] { program.run = [&program, o] { denoise_verb(program.common, *o); }; });
}

}  // namespace octrad::cli
