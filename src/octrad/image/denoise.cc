#include "octrad/image/denoise.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "octrad/base/error.h"
#include "octrad/base/join.h"
#include "octrad/base/lower_case.h"
#include "octrad/base/stopwatch.h"
#include "octrad/base/threads.h"
#include "octrad/image/oidn_library.h"

namespace octrad {
namespace {

using Three = int[3];

const char* name_of(DenoiseOptions::Device device) { return device == DenoiseOptions::Device::cuda ? "cuda" : "cpu"; }

// The three channels of the first layer whose last word is one of `names`, in their order: R, G, B, or for vectors X,
// Y, Z.
void find_layer(const Image& image, std::initializer_list<const char*> names, bool vectors, Three& out) {
  for (const char* name : names) {
    for (const std::string& channel : image.channels) {
      const std::size_t dot = channel.rfind('.');
      const std::string layer = dot == std::string::npos ? "" : channel.substr(0, dot);
      const std::size_t before = layer.rfind('.');
      if (lower_case(before == std::string::npos ? layer : layer.substr(before + 1)) != name) continue;
      const std::string prefix = layer.empty() ? "" : layer + ".";
      for (const char* components : {"RGB", "XYZ"}) {
        int found[3];
        for (std::size_t c = 0; c < 3; ++c) found[c] = image.channel(prefix + components[c]);
        if (std::min({found[0], found[1], found[2]}) < 0 || (!vectors && components[0] == 'X')) continue;
        std::copy(std::begin(found), std::end(found), std::begin(out));
        return;
      }
    }
  }
}

// The three channels, packed. Throws InputError where one of the values is not finite.
std::vector<float> gather(const Image& image, const Three& channels, const std::string& name, const char* layer) {
  std::vector<float> values(image.pixel_count() * 3);
  std::size_t broken = 0, first = 0;
  for (std::size_t p = 0; p < image.pixel_count(); ++p) {
    bool finite = true;
    for (std::size_t c = 0; c < 3; ++c) {
      const float value = image.data[p * image.channels.size() + static_cast<std::size_t>(channels[c])];
      values[3 * p + c] = value;
      finite = finite && std::isfinite(value);
    }
    if (!finite && broken++ == 0) first = p;
  }
  if (broken > 0) {
    const auto width = static_cast<std::size_t>(image.width);
    throw InputError(
        fmt::format("{}: the {} of {} pixel{} is not finite (the first at {}, {}), which would spoil what is "
                    "around them",
                    name, layer, broken, broken == 1 ? "" : "s", first % width, first / width));
  }
  return values;
}

}  // namespace

DenoiseLayers find_denoise_layers(const Image& image) {
  DenoiseLayers layers;
  find_layer(image, {"", "combined", "beauty", "color", "colour", "rgba"}, false, layers.colour);
  find_layer(image, {"albedo", "denoising albedo", "denoise_albedo", "diffuse_albedo"}, false, layers.albedo);
  find_layer(
      image,
      {"normal", "normals", "sh_normal", "shading_normal", "nn", "ns", "denoising normal", "denoise_normal", "n"}, true,
      layers.normal);
  return layers;
}

// A device with its filters and buffers.
struct Denoiser::Session {
  explicit Session(const DenoiseOptions& options) : library(options.library), api(library.functions()) {}
  ~Session() {
    drop_filters();
    if (device != nullptr) api.oidnReleaseDevice(device);
  }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  void check() {
    const char* message = nullptr;
    const int error = api.oidnGetDeviceError(device, &message);
    if (error == 0) return;
    const std::string text = std::string("Open Image Denoise: ") + (message == nullptr ? "unknown error" : message);
    if (error == oidn::kErrorOutOfMemory) throw MemoryError(text);
    throw DeviceError(text);
  }

  void drop_filters() {
    for (void* filter : filters) api.oidnReleaseFilter(filter);
    for (void* buffer : {colour, albedo, normal, output})
      if (buffer != nullptr) api.oidnReleaseBuffer(buffer);
    filters.clear();
    colour = albedo = normal = output = nullptr;
  }

  void* new_buffer(int w, int h) {
    void* buffer =
        api.oidnNewBuffer(device, static_cast<std::size_t>(w) * static_cast<std::size_t>(h) * 3 * sizeof(float));
    check();
    return buffer;
  }

  void set_image(void* filter, const char* name, void* buffer) {
    api.oidnSetFilterImage(filter, name, buffer, oidn::kFormatFloat3, static_cast<std::size_t>(width),
                           static_cast<std::size_t>(height), 0, 0, 0);
  }

  void* new_filter(const DenoiseOptions& options) {
    void* filter = api.oidnNewFilter(device, "RT");
    check();
    filters.push_back(filter);
    static constexpr int kQualities[] = {0, oidn::kQualityFast, oidn::kQualityBalanced, oidn::kQualityHigh};
    if (options.quality != DenoiseOptions::Quality::library)
      api.oidnSetFilterInt(filter, "quality", kQualities[static_cast<int>(options.quality)]);
    return filter;
  }

  void commit(void* filter) {
    api.oidnCommitFilter(filter);
    check();
  }

  // Filters for pictures of this size, the last one for the colour.
  void prepare(const DenoiseOptions& options, int w, int h, bool use_albedo, bool use_normal) {
    if (!filters.empty() && w == width && h == height && use_albedo == (albedo != nullptr) &&
        use_normal == (normal != nullptr))
      return;
    drop_filters();
    width = w;
    height = h;
    try {
      colour = new_buffer(w, h);
      output = new_buffer(w, h);
      if (use_albedo) albedo = new_buffer(w, h);
      if (use_normal) normal = new_buffer(w, h);
      for (const auto& [name, buffer] : {std::pair{"albedo", albedo}, {"normal", normal}}) {
        if (!options.prefilter || buffer == nullptr) continue;
        void* filter = new_filter(options);
        set_image(filter, name, buffer);
        set_image(filter, "output", buffer);
        commit(filter);
      }
      void* filter = new_filter(options);
      set_image(filter, "color", colour);
      if (albedo != nullptr) set_image(filter, "albedo", albedo);
      if (normal != nullptr) set_image(filter, "normal", normal);
      set_image(filter, "output", output);
      api.oidnSetFilterBool(filter, "hdr", options.hdr);
      if (options.prefilter && albedo != nullptr) api.oidnSetFilterBool(filter, "cleanAux", true);
      commit(filter);
    } catch (...) {
      drop_filters();
      throw;
    }
  }

  OidnLibrary library;
  const OidnFunctions& api;
  void* device = nullptr;
  void *colour = nullptr, *albedo = nullptr, *normal = nullptr, *output = nullptr;
  std::vector<void*> filters;  // in the order in which they run
  int width = 0, height = 0;
};

Denoiser::Denoiser(const DenoiseOptions& options) : options_(options) {
  if (options.normal && !options.albedo)
    throw UsageError("the denoiser takes normals only beside the albedo: albedo,normal or albedo or none");
  session_ = std::make_unique<Session>(options);
  Session& s = *session_;
  const bool cuda = options.device == DenoiseOptions::Device::cuda;
  s.device = s.api.oidnNewDevice(cuda ? oidn::kDeviceCuda : oidn::kDeviceCpu);
  if (s.device == nullptr) {
    const char* message = nullptr;
    s.api.oidnGetDeviceError(nullptr, &message);
    throw DeviceError(fmt::format("{} offers no device \"{}\" here{}{}", s.library.file(), name_of(options.device),
                                  message == nullptr ? "" : ": ", message == nullptr ? "" : message));
  }
  const int version = s.api.oidnGetDeviceInt(s.device, "version");  // major * 10000 + minor * 100 + patch
  version_ = fmt::format("{}.{}.{}", version / 10000, version / 100 % 100, version % 100);
  if (version < 20000 || version >= 30000)
    throw InputError(
        fmt::format("{}: version {} of Open Image Denoise, where version 2 is needed", s.library.file(), version_));
  if (!cuda) {
    s.api.oidnSetDeviceInt(s.device, "numThreads", thread_count());
    s.api.oidnSetDeviceBool(s.device, "setAffinity", false);  // threads are shared with everything else
  }
  s.api.oidnCommitDevice(s.device);
  s.check();
}

Denoiser::~Denoiser() = default;

const std::string& Denoiser::library() const { return session_->library.file(); }

void Denoiser::run(Image& image, const std::string& name, const Image* aux) {
  const Stopwatch watch;
  const Image& help = aux == nullptr ? image : *aux;
  if (image.width < 1 || image.height < 1)
    throw InputError(fmt::format("{}: a picture of {} x {} pixels", name, image.width, image.height));
  if (help.width != image.width || help.height != image.height)
    throw InputError(fmt::format("{}: the picture has {} x {} pixels, its albedo and normals have {} x {}", name,
                                 image.width, image.height, help.width, help.height));
  const DenoiseLayers layers = find_denoise_layers(help);
  DenoiseLayers own = aux == nullptr ? layers : find_denoise_layers(image);
  if (own.colour[0] < 0)
    throw InputError(
        fmt::format("{}: no colour to denoise: needs the channels R, G and B; it has {}", name, join(image.channels)));
  const bool use_albedo = options_.albedo && layers.albedo[0] >= 0;
  const bool use_normal = options_.normal && use_albedo && layers.normal[0] >= 0;
  for (const auto& [wanted, found, layer] :
       {std::tuple{options_.albedo, use_albedo, "albedo"}, {options_.normal, use_normal, "normal"}}) {
    if (options_.required && wanted && !found)
      throw InputError(fmt::format("{}: no layer \"{}\"; it has {}", name, layer, join(help.channels)));
  }
  std::vector<float> colour = gather(image, own.colour, name, "colour");
  Session& s = *session_;
  s.prepare(options_, image.width, image.height, use_albedo, use_normal);
  const std::size_t bytes = colour.size() * sizeof(float);
  if (use_albedo) s.api.oidnWriteBuffer(s.albedo, 0, bytes, gather(help, layers.albedo, name, "albedo").data());
  if (use_normal) s.api.oidnWriteBuffer(s.normal, 0, bytes, gather(help, layers.normal, name, "normal").data());
  s.api.oidnWriteBuffer(s.colour, 0, bytes, colour.data());
  for (void* filter : s.filters) s.api.oidnExecuteFilter(filter);
  s.api.oidnReadBuffer(s.output, 0, bytes, colour.data());
  s.check();
  for (std::size_t p = 0; p < image.pixel_count(); ++p) {
    for (std::size_t c = 0; c < 3; ++c)
      image.data[p * image.channels.size() + static_cast<std::size_t>(own.colour[c])] = colour[3 * p + c];
  }
  used_ = use_normal ? "albedo, normal" : use_albedo ? "albedo" : "none";
  seconds_ = watch.seconds();
}

}  // namespace octrad
