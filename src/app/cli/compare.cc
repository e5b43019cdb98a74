// octrad compare: how far pictures are from a reference.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include "app/cli/common.h"
#include "octrad/base/bytes.h"
#include "octrad/base/error.h"
#include "octrad/base/log.h"
#include "octrad/image/io.h"
#include "octrad/image/metrics.h"
#include "octrad/image/tonemap.h"

namespace octrad::cli {
namespace {

struct CompareOptions {
  std::string reference;
  std::vector<std::string> images;
  double alpha_below = std::numeric_limits<double>::quiet_NaN(), alpha_above = alpha_below;
  std::string error_folder;
  std::string error_kind = "mape";
  double error_max = 0.5;
};

ErrorKind error_kind(const std::string& name) {
  return name == "squared" ? ErrorKind::squared : name == "relative" ? ErrorKind::relative_squared : ErrorKind::mape;
}

// FOLDER/STEM.error.exr and .png, with numbers where two pictures have one name.
void write_error_images(const CompareOptions& options, std::size_t index, const Image& error) {
  const auto stem = [&](std::size_t i) { return std::filesystem::path(options.images[i]).stem().string(); };
  std::string name = stem(index);
  for (std::size_t i = 0; i < options.images.size(); ++i) {
    if (i != index && stem(i) == stem(index)) {
      name += fmt::format("-{}", index + 1);
      break;
    }
  }
  const std::string base = (std::filesystem::path(options.error_folder) / name).string() + ".error";
  write_exr(base + ".exr", error);
  write_png(base + ".png", false_color(error, 0, 0.0f, static_cast<float>(options.error_max)));
  log_info("wrote {0}.exr and {0}.png (white: {1:g} or more)", base, options.error_max);
}

std::string number(double value, const char* missing) {
  return std::isfinite(value) ? fmt::format("{:.4g}", value) : missing;
}

void compare_verb(const CommonOptions& common, const CompareOptions& options) {
  const Image reference = read_image(options.reference);
  if (!options.error_folder.empty()) {
    std::error_code error;
    std::filesystem::create_directories(options.error_folder, error);
    if (error) throw IoError(fmt::format("cannot make folder {}: {}", options.error_folder, error.message()));
  }
  std::vector<std::uint8_t> mask;
  const bool masked = !std::isnan(options.alpha_below) || !std::isnan(options.alpha_above);
  if (masked) {
    // Below is exclusive and above inclusive, so that the two halves of one threshold share no pixel and miss none.
    const float above =
        std::isnan(options.alpha_above) ? -1.0f : std::nextafter(static_cast<float>(options.alpha_above), -1.0f);
    const float below = std::isnan(options.alpha_below) ? std::numeric_limits<float>::infinity()
                                                        : static_cast<float>(options.alpha_below);
    mask = roughness_mask(reference, above, below);
  }

  nlohmann::json images = nlohmann::json::array();
  std::vector<std::vector<std::string>> table = {
      {"image", "MAPE", "trimmed", "MSE", "relMSE", "PSNR", "mean ratio", "pixels"}};
  for (std::size_t i = 0; i < options.images.size(); ++i) {
    const std::string& file = options.images[i];
    const Image image = read_image(file);
    if (masked && std::none_of(mask.begin(), mask.end(), [](std::uint8_t m) { return m != 0; })) {
      // Expected for a scene without such surfaces: no error, but no numbers either.
      if (i == 0) log_warning(fmt::format("{}: no pixel has such a roughness", options.reference));
      images.push_back({{"image", file},
                        {"mape", nullptr},
                        {"mape_trimmed", nullptr},
                        {"mse", nullptr},
                        {"relmse", nullptr},
                        {"psnr", nullptr},
                        {"mean_ratio", nullptr},
                        {"pixels", 0},
                        {"non_finite", 0}});
      table.push_back({file, "-", "-", "-", "-", "-", "-", "0"});
      continue;
    }
    Metrics m;
    try {
      m = compare(reference, image, mask);
    } catch (const InputError& error) {
      throw InputError(fmt::format("{} and {}: {}", options.reference, file, error.what()));
    }
    if (m.non_finite_image > 0)
      log_warning(fmt::format("{}: {} pixels are not finite and count as black", file, m.non_finite_image));
    if (m.non_finite_reference > 0)
      log_warning(
          fmt::format("{}: {} pixels are not finite and were left out", options.reference, m.non_finite_reference));
    images.push_back({{"image", file},
                      {"mape", m.mape},
                      {"mape_trimmed", m.mape_trimmed},
                      {"mse", m.mse},
                      {"relmse", m.relmse},
                      {"psnr", m.psnr},
                      {"mean_ratio", m.mean_ratio},
                      {"pixels", m.pixels},
                      {"non_finite", m.non_finite_image}});
    table.push_back({file, number(m.mape, "?"), number(m.mape_trimmed, "?"), number(m.mse, "?"), number(m.relmse, "?"),
                     number(m.psnr, "inf"), number(m.mean_ratio, "-"), format_count(m.pixels)});
    if (!options.error_folder.empty())
      write_error_images(options, i, error_image(reference, image, error_kind(options.error_kind), mask));
  }
  if (common.json) print_json({{"reference", options.reference}, {"images", images}});
  else print_text(format_table(table));
}

}  // namespace

void add_compare(Program& program) {
  auto options = std::make_shared<CompareOptions>();
  CLI::App* verb = add_verb(program, "compare", "Measure the error of pictures against a reference.",
                            "octrad compare ref.exr lhs.exr rhs.exr --alpha-below 0.5 --errors errors");
  verb->add_option("reference", options->reference, "reference picture (EXR, HDR, PNG or JPG; linear radiance)")
      ->required()
      ->type_name("REF");
  verb->add_option("images", options->images, "pictures of the same size")->required()->type_name("IMG");
  verb->add_option("--alpha-below", options->alpha_below,
                   "only pixels whose first hit has a roughness below A (layer roughness.Y of REF)")
      ->type_name("A");
  verb->add_option("--alpha-above", options->alpha_above, "only pixels whose first hit has a roughness of at least A")
      ->type_name("A");
  verb->add_option("--errors", options->error_folder, "write error pictures (EXR and false-colour PNG) into FOLDER")
      ->type_name("FOLDER");
  verb->add_option("--error-kind", options->error_kind, "what error pictures show: mape | squared | relative")
      ->check(unnamed(CLI::IsMember({"mape", "squared", "relative"})))
      ->type_name("KIND")
      ->capture_default_str();
  verb->add_option("--error-max", options->error_max, "error shown as white")
      ->check(unnamed(CLI::PositiveNumber))
      ->type_name("E")
      ->capture_default_str();
  verb->callback(
      [&program, options] { program.run = [&program, options] { compare_verb(program.common, *options); }; });
}

}  // namespace octrad::cli
