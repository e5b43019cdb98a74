// Integrators: what finds the radiance of camera samples. docs/extending.md shows how one is added.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "octrad/model/config.h"
#include "octrad/render/film_math.h"
#include "octrad/render/view.h"
#include "octrad/scene/camera_math.h"

namespace octrad {

class DeviceField;
struct Image;
class PreparedScene;
class RadianceField;
class Stream;
struct CameraJob;
struct DeviceWorld;
struct IntegratorInfo;
struct SamplePlanes;

struct SampleCounts {
  long long rays = 0, queries = 0, non_finite = 0;
  long long empty_lookups = 0;  // RadianceField::take_empty_lookups
  SampleCounts& operator+=(const SampleCounts& b) {
    rays += b.rays;
    queries += b.queries;
    non_finite += b.non_finite;
    empty_lookups += b.empty_lookups;
    return *this;
  }
};

// An integrator by its name; of a family with a member for each level of a field, also the level (1 ...).
struct IntegratorChoice {
  const IntegratorInfo* info = nullptr;
  int level = 0;
};

// What integrators are made from; all of it outlives them.
struct IntegratorInput {
  const PreparedScene& scene;
  IntegratorChoice choice;
  int max_depth = -1, rr_depth = 5;  // path
  unsigned long long seed = 0;
  const RadianceField* field = nullptr;  // null without a model
  const Config& config;                  // of the model
};

// On the CPU.
class Integrator {
 public:
  virtual ~Integrator() = default;
  // Called before the first sample of a film.
  virtual void begin(const View&) {}
  // Fills out[i] for samples[i], some hundred to a few thousand of one tile. Called from several threads.
  virtual SampleCounts sample(std::span<CameraSample> samples, std::span<PixelSample> out) = 0;
  // May change the picture of the samples so far.
  virtual void finish(Image&) const {}
};

// On a Stream: for the samples of a job at once.
class DeviceIntegrator {
 public:
  virtual ~DeviceIntegrator() = default;
  virtual void begin(const View&) {}
  // What the next run() sees; not while the stream records.
  virtual void set(const CameraJob& job) = 0;
  virtual void run(std::size_t samples) = 0;
  virtual const CameraJob* job() const = 0;  // device memory
  virtual SamplePlanes samples() const = 0;
  virtual SampleCounts take_counts() = 0;  // since the last call
  virtual void finish(Image&) const {}
};

// What is known of an integrator.
struct IntegratorInfo {
  const char* name;     // of a family without the level: "features" stands for features1, features2, ...
  const char* summary;  // half a sentence
  int default_spp;
  bool needs_model = false;
  bool per_level = false;        // a family: a member for each level of the field
  bool needs_disparity = false;  // shows what only fields that predict disparity have
  bool uses_depth = false;       // max_depth and rr_depth count
  bool one_sample = false;       // one sample a pixel and no more; no frames
  bool recordable = true;        // on a stream
  bool denoised = false;         // pictures are for a Denoiser (image/denoise.h), which whoever saves them runs
  std::unique_ptr<Integrator> (*make)(const IntegratorInput&) = nullptr;
  // Makes the integrator of a stream for jobs of up to `capacity` samples. `field`: null without a model.
  std::unique_ptr<DeviceIntegrator> (*make_device)(const IntegratorInput&, Stream&, const DeviceWorld&,
                                                   DeviceField* field, std::size_t capacity) = nullptr;
  std::size_t (*device_bytes)(const IntegratorInput&, std::size_t capacity) = nullptr;
};

// All integrators (integrators.cc).
std::span<const IntegratorInfo> integrators();
// Names of all integrators; with a field those of its levels, else families by their first member.
std::vector<std::string> integrator_names(const RadianceField* field = nullptr);
// Throws UsageError for a name that is not known, with a suggestion, or that `field` does not have. Without a field the
// levels of a family are not checked.
IntegratorChoice find_integrator(const std::string& name, const RadianceField* field = nullptr);

}  // namespace octrad
