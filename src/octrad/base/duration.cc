#include "octrad/base/duration.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>

#include "octrad/base/error.h"

namespace octrad {
namespace {
[[noreturn]] void refuse(const std::string& text) {
  throw UsageError(fmt::format(
      "\"{}\" is not a duration: expected seconds or a number with a unit, such as 90, 30s, 2m, 1.5h or 1h30m", text));
}
}  // namespace

double parse_duration(const std::string& text) {
  const char* p = text.c_str();
  double total = 0.0;
  double previous_unit = 1e300;
  if (*p == '\0') refuse(text);
  while (*p != '\0') {
    // strtod alone would also take signs, blanks, "inf", "nan" and hexadecimal.
    if (!((*p >= '0' && *p <= '9') || *p == '.')) refuse(text);
    if (p[0] == '0' && (p[1] == 'x' || p[1] == 'X')) refuse(text);
    char* end = nullptr;
    const double value = std::strtod(p, &end);
    if (end == p) refuse(text);
    p = end;
    double unit = 1.0;
    if (p[0] == 'm' && p[1] == 's') {
      unit = 1e-3;
      p += 2;
    } else if (*p == 's') {
      unit = 1.0;
      ++p;
    } else if (*p == 'm') {
      unit = 60.0;
      ++p;
    } else if (*p == 'h') {
      unit = 3600.0;
      ++p;
    } else if (*p == 'd') {
      unit = 86400.0;
      ++p;
    } else if (*p != '\0') refuse(text);
    if (unit >= previous_unit) refuse(text);  // "2m2m", "1s1h"
    previous_unit = unit;
    total += value * unit;
  }
  if (!std::isfinite(total)) refuse(text);
  return total;
}

std::string format_duration(double seconds) {
  if (!std::isfinite(seconds) || seconds < 0.0) return "?";
  if (seconds < 1.0) return fmt::format("{:.0f} ms", seconds * 1e3);
  if (seconds < 59.95) return fmt::format("{:.1f} s", seconds);
  const long long s = std::llround(seconds);
  if (s < 3600) return fmt::format("{}m {:02}s", s / 60, s % 60);
  if (s < 86400) return fmt::format("{}h {:02}m", s / 3600, s % 3600 / 60);
  return fmt::format("{}d {:02}h", s / 86400, s % 86400 / 3600);
}

}  // namespace octrad
