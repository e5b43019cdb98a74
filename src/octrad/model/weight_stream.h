// Which random numbers the weights of a network or a table begin with (RngPurpose::weights).
#pragma once

namespace octrad {

// Streams of one field must differ. Models depend on the numbers: they stay as they are.
enum WeightStream : unsigned long long {
  kDecoderWeights = 1,
  kDisparityNetworkWeights = 2,
  kDisparityGridWeights = 3,
  kNrDecoderWeights = 4,
  kNrGridWeights = 5,
  kNcrDecoderWeights = 6,
  kNcrGridWeights = 7,
  kNcrConeGridWeights = 8,
  kNcrConeNetworkWeights = 9,
  kNcrMergeNetworkWeights = 10,
};

}  // namespace octrad
