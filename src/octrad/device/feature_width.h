// The number of features of a table's entries as a constant, for kernels.
#pragma once

#include <stdexcept>
#include <type_traits>

namespace octrad {

// Calls f(std::integral_constant<int, features>). Throws std::logic_error unless that is 2, 4 or 8.
template <typename F>
void with_width(int features, F&& f) {
  switch (features) {
    case 2: f(std::integral_constant<int, 2>{}); return;
    case 4: f(std::integral_constant<int, 4>{}); return;
    case 8: f(std::integral_constant<int, 8>{}); return;
    default: throw std::logic_error("a feature vector of an unsupported length");
  }
}

}  // namespace octrad
