// One interface for pictures: an integrator, a scene and a view, sampled into a film on the CPU or on a Stream.
// Changing the view or the model keeps everything else: this is also the interactive interface.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "octrad/device/stage_times.h"
#include "octrad/model/radiance_field.h"
#include "octrad/render/film.h"
#include "octrad/render/integrator.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad {

// Throws UsageError for a crop that does not lie inside the view's picture.
void require_crop_inside(const View& view);

// What does not change while a renderer lives.
struct RenderSettings {
  Film film;           // reconstruction filter
  int max_depth = -1;  // path: Mitsuba's meaning, -1 unlimited
  int rr_depth = 5;    // path: Russian roulette from this depth on
  unsigned long long seed = 0;
  int expected_spp = 16;  // buffers on a device are made for passes of so many samples a pixel, or fewer
  // Seconds from which on a pass can be stopped that adds to a film: it has to be copied before.
  double long_pass = 0.3;
  std::uint64_t max_memory = 0;  // bytes on the stream, beside what is there already; 0: no limit
};

// Milliseconds of a frame: sampling, film and tone mapping to 8 bits; warm.
struct FrameTimes {
  double median = 0.0, p95 = 0.0;
  StageSplit stages;  // medians, measured in frames of their own
};

inline constexpr int kLargestPass = 64;  // samples a pixel, of whole pictures
// How many samples a pixel the next pass of a picture takes: 1, 1, 2, 4, ... up to the renderer's largest_pass().
int next_pass(int samples, int largest_pass);

// A picture after whole passes of render(), to go on from. Sums of filtered samples depend on the passes in which they
// were taken, in the last bits.
struct FilmState {
  int samples = 0;           // a pixel
  int largest_pass = 0;      // of the renderer
  double seconds = 0.0;      // of sampling
  SampleCounts counts;       // so far
  std::vector<double> sums;  // kFilmNumbers a pixel of the view's crop
};

// Every sample depends on (seed, pixel, number of the sample) alone, and sums are formed in double in a fixed order:
// the same bits for the same calls at any thread count, and a crop holds that part of the whole picture. Samples that
// are not finite count as black (SampleCounts::non_finite).
class Renderer {
 public:
  virtual ~Renderer() = default;
  const IntegratorInfo& integrator() const { return *choice_.info; }

  // What is seen from now on; clears the film. Throws UsageError for a size, a crop or a mask that makes no sense,
  // InputError for a filter that is too wide, MemoryError where not even one row of samples fits into memory.
  void set_view(const View& view);
  const View& view() const { return view_; }
  const FilmWindow& window() const { return window_; }
  // Another model, or new weights of the same; clears the film. The field must outlive its use. Throws UsageError when
  // it does not have what the integrator shows.
  void set_model(RadianceField& field, const Config& config);
  // Other random numbers, those of a renderer made with this seed; clears the film.
  void set_seed(unsigned long long seed);
  // Empties the film: samples are taken from number 0 again.
  void clear();
  // The film as `state` has it, of a picture of this view in these passes; the next sample is number state.samples.
  // Throws InputError where the passes or the number of pixels are others: the bits would not be those of one run.
  void restore(const FilmState& state);

  // Adds the next `count` samples of every pixel to the film. Needs a view. Where that takes long on the CPU, `stop` is
  // asked in between, by one thread at a time; when it says so the film stays as it was, and the result is false.
  bool add_samples(int count, const std::function<bool()>& stop = {});
  int samples() const { return samples_; }  // a pixel, in the film
  // Samples a pixel that one call should ask for at most, to be stopped in time.
  virtual int largest_pass() const = 0;
  // Whether other passes may give other bits: not where each sample counts for its own pixel, in the order of numbers.
  virtual bool passes_matter() const { return true; }
  // The film as it is: R,G,B, albedo.R/G/B, normal.X/Y/Z, depth.Z, roughness.Y. Pixels without samples, and those that
  // the view's mask leaves out, are 0. Those of `channels` alone, which is quicker on a GPU.
  Image image(const ChannelRange& channels = {});
  // The film's sums, kFilmNumbers a pixel.
  virtual std::vector<double> sums() = 0;
  // Rays and queries since the last call.
  virtual SampleCounts take_counts() = 0;
  // Times `count` frames of `spp` samples a pixel; the film is clear afterwards. Throws UsageError for an integrator
  // that makes no frames (features), MemoryError unless a whole frame fits into device memory at once.
  virtual FrameTimes time_frames(int count, int spp) = 0;

 protected:
  Renderer(const PreparedScene& scene, const IntegratorChoice& choice, const RenderSettings& settings,
           RadianceField* field, const Config& config)
      : scene_(scene),
        choice_(choice),
        settings_(settings),
        field_(field),
        config_(config) {}
  virtual Image film_image(const ChannelRange& channels) = 0;  // without regard to the mask
  virtual void view_changed() = 0;
  virtual void model_changed(bool same_shape) = 0;  // same_shape: only weights are new
  virtual void seed_changed() = 0;
  virtual void clear_film() = 0;
  virtual void set_sums(std::span<const double> sums) = 0;
  virtual bool sample(int first, int count, const std::function<bool()>& stop) = 0;
  // What integrators are made from.
  IntegratorInput input() const {
    return {scene_, choice_, settings_.max_depth, settings_.rr_depth, settings_.seed, field_, config_};
  }

  const PreparedScene& scene_;
  const IntegratorChoice choice_;
  RenderSettings settings_;
  RadianceField* field_;  // null without a model
  Config config_;
  View view_;
  FilmWindow window_;  // of view_

 private:
  int samples_ = 0;
};

// `integrator`: a name of integrator.h. `stream`: null for the CPU. `field` and `config`: of the model, for integrators
// that need one. What is passed by pointer or reference must outlive the renderer. Throws UsageError for an unknown
// integrator, a missing model, or a model that does not have what is to be shown.
std::unique_ptr<Renderer> make_renderer(const PreparedScene& scene, const std::string& integrator,
                                        const RenderSettings& settings = {}, RadianceField* field = nullptr,
                                        const Config& config = {}, Stream* stream = nullptr);

// A renderer on the CPU for an integrator that is not in the list.
std::unique_ptr<Renderer> make_renderer(const PreparedScene& scene, std::unique_ptr<Integrator> integrator,
                                        const RenderSettings& settings = {});

// When a picture is done.
struct RenderBudget {
  int spp = 16;                            // samples a pixel; 0: until `seconds` are over
  double seconds = 0.0;                    // stop after this time, between passes; 0: no limit
  std::function<bool()> interrupted = {};  // asked before each pass, and in long ones: see Renderer::add_samples()
  std::function<void(int spp_done, double seconds)> progress = {};  // after each pass
  const FilmState* from = nullptr;                                  // goes on from here, to the same totals
  // Gets what a later run can go on from: every `save_every` seconds, before a pass that `spp` cuts short, and at the
  // end of whole passes.
  std::function<void(const FilmState&)> save = {};
  double save_every = 300.0;
};

struct RenderResult {
  Image image;
  int spp = 0;
  double seconds = 0.0;  // of sampling; like the counts with those of RenderBudget::from
  long long samples = 0;
  SampleCounts counts;
  bool interrupted = false;
};

// A picture of the renderer's view from an empty film, or from a state. Integrators of one
// sample a pixel (features) ignore the budget. Throws UsageError for a budget of nothing.
RenderResult render(Renderer& renderer, const RenderBudget& budget);

}  // namespace octrad
