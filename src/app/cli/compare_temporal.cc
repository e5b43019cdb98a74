// octrad compare --temporal: the error of the change from frame to frame.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <sstream>
#include <utility>

#include "app/cli/compare.h"
#include "octrad/base/error.h"
#include "octrad/base/input_file.h"
#include "octrad/base/memory_limit.h"
#include "octrad/image/io.h"
#include "octrad/image/metrics.h"
#include "octrad/image/tonemap.h"

namespace octrad::cli {
namespace {

std::vector<std::string> frames_of(const std::string& sequence) {
  namespace fs = std::filesystem;
  std::vector<std::string> files;
  std::error_code error;
  if (fs::is_directory(sequence, error)) {
    for (fs::directory_iterator entry(sequence, error), end; !error && entry != end; entry.increment(error)) {
      const bool hidden = entry->path().filename().string().starts_with('.');  // "._f0.exr" of other systems
      if (!hidden && is_picture_name(entry->path().string())) files.push_back(entry->path().string());
    }
    if (error) throw IoError(fmt::format("cannot read folder {}: {}", sequence, error.message()));
    std::sort(files.begin(), files.end());
  } else {
    std::istringstream lines(read_file(sequence));
    if (fs::path(sequence).extension() != ".txt")
      throw InputError(
          fmt::format("{}: --temporal takes folders of frames, or text files (.txt) with their names", sequence));
    for (std::string line; std::getline(lines, line);) {
      while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.pop_back();
      if (!line.empty()) files.push_back((fs::path(sequence).parent_path() / line).string());
    }
  }
  if (files.size() < 2) throw InputError(fmt::format("{} has {} frames; a change needs two", sequence, files.size()));
  return files;
}

// A frame as linear values and as a screen shows it; black where it is not finite.
struct Frame {
  Image linear, displayed;
};

// Where one of a pair is for the screen (PNG, JPEG), both are limited to what it shows.
std::pair<Frame, Frame> read_pair(const std::string& reference_file, const std::string& file) {
  const Image reference = read_image(reference_file), image = read_image(file);
  ask_memory(reference.pixel_count() * 8 * sizeof(Vec3f), reference_file + ": comparing");  // two frames of each kind
  const bool shown = is_display_referred(reference) || is_display_referred(image);
  const auto frame = [&](const Image& from) {
    Frame made = {shown ? shown_linear_color(from) : linear_color(from), display_color(from)};
    for (float& v : made.linear.data) v = std::isfinite(v) ? v : 0.0f;
    return made;
  };
  return {frame(reference), frame(image)};
}

// Mean over pixels and channels of |(I1 - I0) - (R1 - R0)|.
double change_error(const Image& r0, const Image& r1, const Image& i0, const Image& i1) {
  double sum = 0.0;
  for (std::size_t k = 0; k < r0.data.size(); ++k) {
    sum += std::abs((static_cast<double>(i1.data[k]) - static_cast<double>(i0.data[k])) -
                    (static_cast<double>(r1.data[k]) - static_cast<double>(r0.data[k])));
  }
  return sum / static_cast<double>(r0.data.size());
}

}  // namespace

void compare_temporal(const CommonOptions& common, const std::string& reference,
                      const std::vector<std::string>& sequences) {
  const std::vector<std::string> reference_files = frames_of(reference);
  nlohmann::json images = nlohmann::json::array();
  std::vector<std::vector<std::string>> table = {{"frames", "temporal", "temporal, displayed", "MAPE", "changes"}};
  for (const std::string& sequence : sequences) {
    const std::vector<std::string> files = frames_of(sequence);
    if (files.size() != reference_files.size()) {
      throw InputError(
          fmt::format("{} has {} frames, {} has {}", sequence, files.size(), reference, reference_files.size()));
    }
    Frame r0, i0;
    double linear = 0.0, displayed = 0.0, mape = 0.0;
    nlohmann::json by_change = nlohmann::json::array();
    const double changes = static_cast<double>(files.size() - 1);
    for (std::size_t t = 0; t < files.size(); ++t) {
      auto [r1, i1] = read_pair(reference_files[t], files[t]);
      try {
        check_comparable(r1.linear, i1.linear, {});
        if (t > 0) check_comparable(r0.linear, r1.linear, {});
      } catch (const InputError& error) {
        throw InputError(fmt::format("{} and {}: {}", reference_files[t], files[t], error.what()));
      }
      mape += compare(r1.linear, i1.linear).mape / static_cast<double>(files.size());
      if (t > 0) {
        const double change = change_error(r0.linear, r1.linear, i0.linear, i1.linear);
        by_change.push_back(change);
        linear += change / changes;
        displayed += change_error(r0.displayed, r1.displayed, i0.displayed, i1.displayed) / changes;
      }
      r0 = std::move(r1);
      i0 = std::move(i1);
    }
    images.push_back({{"image", sequence},
                      {"temporal", linear},
                      {"temporal_displayed", displayed},
                      {"mape", mape},
                      {"frames", files.size()},
                      {"by_change", by_change}});
    table.push_back({sequence, fmt::format("{:.4g}", linear), fmt::format("{:.4g}", displayed),
                     fmt::format("{:.4g}", mape), std::to_string(files.size() - 1)});
  }
  if (common.json) print_json({{"reference", reference}, {"images", images}});
  else print_text(format_table(table));
}

}  // namespace octrad::cli
