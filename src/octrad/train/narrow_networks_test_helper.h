// For tests of training that learn little: networks that take a fraction of the presets' time.
#pragma once

#include "octrad/model/config.h"

namespace octrad::testing {

inline void narrow_networks(Config& config) {
  config.decoder_width = config.nr_width = config.ncr_width = 32;
  config.decoder_hidden = config.nr_hidden = config.ncr_hidden = 2;
}

}  // namespace octrad::testing
