// Denoising of rendered pictures by Intel Open Image Denoise (Áfra 2019 ff., www.openimagedenoise.org), which is loaded
// while the program runs.
#pragma once

#include <memory>
#include <string>

#include "octrad/image/image.h"

namespace octrad {

struct DenoiseOptions {
  enum class Device { cpu, cuda };
  enum class Quality { library, fast, balanced, high };  // library: its own choice
  std::string library;                                   // file or folder; empty: searched for (oidn_library.h)
  Device device = Device::cpu;
  Quality quality = Quality::library;
  bool albedo = true, normal = true;  // layers that help, where the picture has them; normals only beside the albedo
  bool required = false;              // a picture without one of them is refused
  bool prefilter = false;             // denoise these layers first, and take them for free of noise
  bool hdr = true;                    // colours are radiance, of any size; false: in [0, 1], linear
};

// Where a picture holds what a denoiser uses: the index of each of three channels, -1 where there is none.
struct DenoiseLayers {
  int colour[3] = {-1, -1, -1}, albedo[3] = {-1, -1, -1}, normal[3] = {-1, -1, -1};
};
// The colour R, G, B or that of a layer "Combined", "beauty", "color"; "albedo", "Denoising Albedo" and the like;
// "normal", "nn", "Ns", "Denoising Normal" and the like, as octrad, Mitsuba 3, pbrt 4, Blender and Arnold call them, in
// any case, with or without a layer's name in front ("ViewLayer.Combined.R").
DenoiseLayers find_denoise_layers(const Image& image);

// Colours are denoised with OIDN's filter "RT". Buffers and the filter are kept from picture to picture of one size.
class Denoiser {
 public:
  // Loads the library and starts its device. Throws what OidnLibrary does; InputError for another version than 2;
  // UsageError for normals without albedo; DeviceError when the library has no such device.
  explicit Denoiser(const DenoiseOptions& options);
  ~Denoiser();
  Denoiser(const Denoiser&) = delete;
  Denoiser& operator=(const Denoiser&) = delete;

  // Replaces the colour of `image`; everything else stays. `aux`: the picture whose albedo and normal are used; null:
  // `image` itself. `name` is what messages call the picture. On any error the picture is as it was. Throws InputError
  // for a picture without colour, with values that are not finite in a layer that is used, without layers that are
  // required, or of another size than `aux`; MemoryError, DeviceError when the library fails.
  void run(Image& image, const std::string& name, const Image* aux = nullptr);

  const std::string& version() const { return version_; }  // of the library: "2.5.1"
  const std::string& library() const;                      // its file
  const DenoiseOptions& options() const { return options_; }
  // What the last run() used beside the colour: "albedo, normal", "albedo" or "none".
  const std::string& used() const { return used_; }
  double seconds() const { return seconds_; }  // that it took

 private:
  struct Session;
  DenoiseOptions options_;
  std::unique_ptr<Session> session_;
  std::string version_, used_ = "none";
  double seconds_ = 0.0;
};

}  // namespace octrad
