#include "octrad/base/bytes.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "octrad/base/error.h"
#include "octrad/base/lower_case.h"

namespace octrad {
namespace {

// A line "Name:   123 kB" of a /proc file, in bytes; 0 if absent.
std::uint64_t proc_field(const char* file, const std::string& name) {
  std::ifstream in(file);
  std::string line;
  while (std::getline(in, line)) {
    if (line.compare(0, name.size(), name) == 0) {
      std::istringstream fields(line.substr(name.size()));
      std::uint64_t kilobytes = 0;
      fields >> kilobytes;
      return kilobytes * 1024;
    }
  }
  return 0;
}

// Number in a one-line file; 0 if absent or "max".
std::uint64_t number_in(const std::string& file) {
  std::ifstream in(file);
  std::uint64_t n = 0;
  in >> n;
  return in ? n : 0;
}

}  // namespace

std::uint64_t parse_bytes(const std::string& text) {
  const auto refuse = [&]() -> std::uint64_t {
    throw UsageError(fmt::format(
        "\"{}\" is not an amount of memory: expected bytes or a number with k, M, G or T, such as 512M or 4G", text));
  };
  const char* p = text.c_str();
  if (!((*p >= '0' && *p <= '9') || *p == '.')) return refuse();
  if (p[0] == '0' && (p[1] == 'x' || p[1] == 'X')) return refuse();
  char* end = nullptr;
  const double value = std::strtod(p, &end);
  if (end == p) return refuse();
  std::string unit = lower_case(end);
  unit.erase(0, unit.find_first_not_of(' ') == std::string::npos ? unit.size() : unit.find_first_not_of(' '));
  double factor = 0.0;
  if (unit.empty() || unit == "b") factor = 1.0;
  else if (unit == "k" || unit == "kb" || unit == "kib") factor = 0x1p10;
  else if (unit == "m" || unit == "mb" || unit == "mib") factor = 0x1p20;
  else if (unit == "g" || unit == "gb" || unit == "gib") factor = 0x1p30;
  else if (unit == "t" || unit == "tb" || unit == "tib") factor = 0x1p40;
  else return refuse();
  const double bytes = value * factor;
  if (!std::isfinite(bytes) || bytes >= 0x1p63) return refuse();
  return static_cast<std::uint64_t>(bytes);
}

std::string format_bytes(double bytes) {
  if (bytes < 1024.0) return fmt::format("{:.0f} B", bytes);
  static constexpr const char* kUnits[] = {"KiB", "MiB", "GiB", "TiB", "PiB"};
  int unit = -1;
  do {
    bytes /= 1024.0;
    ++unit;
  } while (bytes >= 1024.0 && unit < 4);
  return fmt::format("{:.{}f} {}", bytes, bytes < 10.0 ? 2 : 1, kUnits[unit]);
}

std::string format_count(long long n) {
  std::string digits = fmt::format("{}", n < 0 ? -n : n);
  for (int i = static_cast<int>(digits.size()) - 3; i > 0; i -= 3) digits.insert(static_cast<std::size_t>(i), 1, ',');
  if (n < 0) digits.insert(digits.begin(), '-');
  return digits;
}

std::string format_three_digits(double value) {
  return std::fabs(value) >= 100.0 ? fmt::format("{:.0f}", value) : fmt::format("{:.3g}", value);
}

std::string format_rate(double r) {
  if (!std::isfinite(r) || r < 0.0) return "?";
  const char* suffix = "";
  if (r >= 1e9) {
    r *= 1e-9;
    suffix = " G";
  } else if (r >= 1e6) {
    r *= 1e-6;
    suffix = " M";
  } else if (r >= 1e3) {
    r *= 1e-3;
    suffix = " k";
  }
  return fmt::format("{:.{}f}{}", r, r < 10.0 ? 2 : r < 100.0 ? 1 : 0, suffix);
}

std::uint64_t resident_bytes() {
  std::ifstream in("/proc/self/statm");
  std::uint64_t total = 0, resident = 0;
  in >> total >> resident;
  return in ? resident * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE)) : 0;
}

std::uint64_t peak_resident_bytes() { return proc_field("/proc/self/status", "VmHWM:"); }

std::uint64_t usable_memory() {
  const std::uint64_t available = proc_field("/proc/meminfo", "MemAvailable:");
  if (available == 0) return 0;
  std::uint64_t usable = available + resident_bytes();
  // Control groups: version 2, then version 1 (whose "no limit" is a huge number).
  if (const std::uint64_t limit = number_in("/sys/fs/cgroup/memory.max"); limit > 0) usable = std::min(usable, limit);
  if (const std::uint64_t limit = number_in("/sys/fs/cgroup/memory/memory.limit_in_bytes"); limit > 0)
    usable = std::min(usable, limit);
  return usable;
}

void append(std::vector<MemoryPart>& parts, const std::vector<MemoryPart>& more) {
  parts.insert(parts.end(), more.begin(), more.end());
}

std::uint64_t total_bytes(const std::vector<MemoryPart>& parts) {
  std::uint64_t sum = 0;
  for (const MemoryPart& part : parts) sum += part.bytes;
  return sum;
}

void require_memory(std::uint64_t budget, const std::string& what, const std::vector<MemoryPart>& items,
                    const std::string& advice) {
  const std::uint64_t total = total_bytes(items);
  if (budget == 0 || total <= budget) return;
  std::vector<MemoryPart> sorted = items;
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const MemoryPart& a, const MemoryPart& b) { return a.bytes > b.bytes; });
  std::string message =
      fmt::format("{} needs {} and the budget is {} (--max-memory)", what, format_bytes(static_cast<double>(total)),
                  format_bytes(static_cast<double>(budget)));
  for (const MemoryPart& item : sorted) {
    if (item.bytes > 0)
      message += fmt::format("\n  {:>10}  {}", format_bytes(static_cast<double>(item.bytes)), item.name);
  }
  if (!advice.empty()) message += "\n" + advice;
  throw MemoryError(message);
}

}  // namespace octrad
