#include "app/cli/denoise_options.h"

#include <fmt/format.h>

#include "octrad/base/error.h"
#include "octrad/base/log.h"

namespace octrad::cli {

void DenoiserOptions::add_to(CLI::App& verb, const std::string& prefix, const std::string& group) {
  const auto name = [&](const char* text) { return "--" + prefix + text; };
  all = {
      verb.add_option(name("aux"), aux,
                      "layers that help: albedo,normal | albedo | none; default: those that the picture has")
          ->check(unnamed(CLI::IsMember({"albedo,normal", "albedo", "none"})))
          ->type_name("LAYERS")
          ->group(group),
      verb.add_flag(name("prefilter"), prefilter, "denoise these layers first")->group(group),
      verb.add_option(name("quality"), quality, "default | fast | balanced | high")
          ->check(unnamed(CLI::IsMember({"default", "fast", "balanced", "high"})))
          ->type_name("Q")
          ->group(group),
      verb.add_option("--oidn-library", library,
                      "Open Image Denoise's library or its folder; default: OCTRAD_OIDN_LIBRARY, then the usual places")
          ->type_name("PATH")
          ->group(group),
      verb.add_option("--oidn-device", device,
                      "auto | cpu | cuda: where the denoiser runs; auto: on a GPU when the rendering does")
          ->check(unnamed(CLI::IsMember({"auto", "cpu", "cuda"})))
          ->type_name("DEVICE")
          ->group(group),
  };
}

std::string DenoiserOptions::given() const {
  for (const CLI::Option* option : all) {
    if (option->count() > 0) return option->get_name();
  }
  return "";
}

std::unique_ptr<Denoiser> DenoiserOptions::make(bool pictures_from_gpu) const {
  using Quality = DenoiseOptions::Quality;
  DenoiseOptions options;
  options.library = library;
  options.quality = quality == "fast"       ? Quality::fast
                    : quality == "balanced" ? Quality::balanced
                    : quality == "high"     ? Quality::high
                                            : Quality::library;
  options.required = !aux.empty();
  options.albedo = aux != "none";
  options.normal = aux.empty() || aux == "albedo,normal";
  options.prefilter = prefilter;
  options.hdr = !ldr;
  if (prefilter && aux == "none") throw UsageError("there are no layers to denoise first: --prefilter and none");
  std::unique_ptr<Denoiser> denoiser;
  if (device == "cuda" || (device == "auto" && pictures_from_gpu)) {
    options.device = DenoiseOptions::Device::cuda;
    try {
      denoiser = std::make_unique<Denoiser>(options);
    } catch (const DeviceError& error) {
      if (device == "cuda") throw;
      log_verbose("the denoiser runs on the CPU: {}", error.what());
      options.device = DenoiseOptions::Device::cpu;
    }
  }
  if (!denoiser) denoiser = std::make_unique<Denoiser>(options);
  log_verbose("Open Image Denoise {} ({})", denoiser->version(), denoiser->library());
  return denoiser;
}

void denoise(Denoiser& denoiser, Image& image, const std::string& name, const Image* aux) {
  denoiser.run(image, name, aux);
  const DenoiseOptions& o = denoiser.options();
  static constexpr const char* kQualities[] = {"default", "fast", "balanced", "high"};
  image.metadata["octrad.denoise"] = nlohmann::json{
      {"denoiser", "Intel Open Image Denoise"},
      {"version", denoiser.version()},
      {"device", o.device == DenoiseOptions::Device::cuda ? "cuda" : "cpu"},
      {"quality", kQualities[static_cast<int>(o.quality)]},
      {"aux", denoiser.used()},
      {"prefilter", o.prefilter},
      {"hdr", o.hdr},
      {"seconds", denoiser.seconds()}}.dump();
}

}  // namespace octrad::cli
