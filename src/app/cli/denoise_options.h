// What the verbs that denoise share: options of the denoiser, and what is noted of it in a picture.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "app/cli/common.h"
#include "octrad/image/denoise.h"

namespace octrad::cli {

struct DenoiserOptions {
  std::string library, device = "auto", quality = "default", aux;
  bool prefilter = false, ldr = false;
  std::vector<const CLI::Option*> all;

  // `prefix` ("denoise-") stands before the names that say nothing of a denoiser themselves.
  void add_to(CLI::App& verb, const std::string& prefix, const std::string& group);
  // The first that was given, "" when none was.
  std::string given() const;
  // Loads the library and starts its device: "auto" is a GPU where the pictures come from one and the library offers
  // it. Throws UsageError for unknown words, and what Denoiser throws.
  std::unique_ptr<Denoiser> make(bool pictures_from_gpu) const;
};

// Denoiser::run(), noted in the attribute octrad.denoise.
void denoise(Denoiser& denoiser, Image& image, const std::string& name, const Image* aux = nullptr);

}  // namespace octrad::cli
