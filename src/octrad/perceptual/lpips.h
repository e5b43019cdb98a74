// LPIPS, version 0.1: the distance of two pictures in the activations of a network that recognises objects.
//   Zhang, Isola, Efros, Shechtman, Wang: "The Unreasonable Effectiveness of Deep Features as a Perceptual Metric",
//   CVPR 2018. The networks: AlexNet (Krizhevsky 2014, one tower) and SqueezeNet 1.1 (Iandola et al. 2016), trained on
//   ImageNet; the weights are read from files (docs/formats.md).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "octrad/image/image.h"

namespace octrad {

enum class LpipsNet { alex, squeeze };

// "lpips_alex_v0.1.safetensors" and so on.
std::string lpips_file_name(LpipsNet net);

class Lpips {
 public:
  // Reads the weights from `folder`. Throws IoError when there is no such file, InputError when it is broken: each
  // names the file, and what is wrong with which tensor.
  Lpips(const std::string& folder, LpipsNet net);

  // The shorter side of the smallest picture that the network can take.
  int smallest_side() const;

  // Activations of a picture after each stage that counts, divided by their length over the channels.
  struct Tap {
    int channels = 0, width = 0, height = 0;
    std::size_t stride = 0;     // from channel to channel
    std::vector<float> values;  // [channels][stride], a channel row by row
  };
  struct Features {
    int width = 0, height = 0;  // of the picture
    std::vector<Tap> taps;
  };
  // `displayed`: R, G, B as the screen shows them, in [0, 1] (display_color()). Throws InputError when it is smaller
  // than smallest_side(). The same bits at any number of threads.
  Features features(const Image& displayed) const;

  // The distance of two pictures of one size. With a mask (one byte a pixel, 0 leaves it out), the mean over its pixels
  // of the distance's map, which is the sum of the taps' maps, each enlarged bilinearly to the size of the picture (as
  // the authors' package does with spatial=True). Empty: all pixels, and the maps' own means.
  double distance(const Features& a, const Features& b, std::span<const std::uint8_t> mask = {}) const;

 private:
  struct Convolution {
    int inputs = 0, outputs = 0, kernel = 1, stride = 1, padding = 0;
    std::vector<float> weights;  // [outputs][inputs * kernel^2 + 1], the bias last
  };
  struct Layer {
    enum class Kind { convolution, pool, fire } kind = Kind::convolution;
    bool round_up = false;  // pool: a last window that is not whole counts
    bool tap = false;
    std::vector<Convolution> parts;  // of a fire module: squeeze, expand 1 x 1, expand 3 x 3
  };
  static Tap convolve(const Tap& in, const Convolution& c);
  static Tap pool(const Tap& in, bool round_up);
  static Tap run(const Tap& in, const Layer& layer);

  std::vector<Layer> layers_;
  std::vector<std::vector<float>> linear_;  // weights of the channels of each tap
};

}  // namespace octrad
