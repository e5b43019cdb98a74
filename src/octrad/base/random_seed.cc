#include "octrad/base/random_seed.h"

#include <unistd.h>

#include <chrono>

namespace octrad {

std::uint64_t random_seed() {
  std::uint64_t seed = 0;
  // Kernels before 3.17, and some sandboxes, refuse: the clock and the process differ from run to run as well.
  if (getentropy(&seed, sizeof seed) != 0)
    seed = static_cast<std::uint64_t>(std::chrono::system_clock::now().time_since_epoch().count()) ^
           static_cast<std::uint64_t>(getpid()) << 40;
  return seed;
}

}  // namespace octrad
