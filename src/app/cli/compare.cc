// octrad compare: how far pictures are from a reference.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>

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
  std::string reference_b, mask, aux;
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
  write_image(base + ".png", false_color(error, 0, 0.0f, static_cast<float>(options.error_max)));
  log_info("wrote {0}.exr and {0}.png (white: {1:g} or more)", base, options.error_max);
}

std::string number(double value, const char* missing) {
  return std::isfinite(value) ? fmt::format("{:.4g}", value) : missing;
}

Image read_same_size(const std::string& file, const Image& reference, const CompareOptions& o) {
  Image image = read_image(file);
  if (image.width != reference.width || image.height != reference.height) {
    throw InputError(fmt::format("{} has {} x {} pixels, {} has {} x {}", file, image.width, image.height, o.reference,
                                 reference.width, reference.height));
  }
  return image;
}

// The pixels that count, by --mask and the roughness options; empty: all.
std::vector<std::uint8_t> selected_pixels(const Image& reference, const CompareOptions& o) {
  std::vector<std::uint8_t> mask;
  if (!o.mask.empty()) mask = picture_mask(read_same_size(o.mask, reference, o));
  if (std::isnan(o.alpha_below) && std::isnan(o.alpha_above)) return mask;
  // Below is exclusive and above inclusive, so that the two halves of one threshold share no pixel and miss none.
  const float above = std::isnan(o.alpha_above) ? -1.0f : std::nextafter(static_cast<float>(o.alpha_above), -1.0f);
  const float below =
      std::isnan(o.alpha_below) ? std::numeric_limits<float>::infinity() : static_cast<float>(o.alpha_below);
  const std::string& file = o.aux.empty() ? o.reference : o.aux;
  const Image layers = o.aux.empty() ? Image() : read_same_size(o.aux, reference, o);
  std::vector<std::uint8_t> rough;
  try {
    rough = roughness_mask(o.aux.empty() ? reference : layers, above, below);
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}: {}{}", file, error.what(),
                                 o.aux.empty() ? "; --aux FILE takes it from another picture of the view" : ""));
  }
  for (std::size_t p = 0; p < mask.size(); ++p) rough[p] &= mask[p];
  return rough;
}

// The reference's own noise, estimated from --reference-b.
Metrics estimate_noise(const Image& reference, const CompareOptions& o, const std::vector<std::uint8_t>& mask) {
  const Image other = read_same_size(o.reference_b, reference, o);
  const auto number_of = [](const Image& image, const char* key) {
    return metadata_value<long long>(image, "octrad.render", key, -1);
  };
  const long long seed = number_of(reference, "seed"), n_a = number_of(reference, "spp"), n_b = number_of(other, "spp");
  if ((seed >= 0 && seed == number_of(other, "seed")) || other.data == reference.data) {
    throw InputError(fmt::format("{} and {} have the same seed: their noise is the same, and its size does not show",
                                 o.reference, o.reference_b));
  }
  // Where the files do not say how many samples they have: as many.
  const double share = n_a > 0 && n_b > 0 ? static_cast<double>(n_b) / static_cast<double>(n_a + n_b) : 0.5;
  return reference_noise(reference, other, share, mask);
}

void compare_verb(const CommonOptions& common, const CompareOptions& options) {
  const Image reference = read_image(options.reference);
  if (!options.error_folder.empty()) {
    std::error_code error;
    std::filesystem::create_directories(options.error_folder, error);
    if (error) throw IoError(fmt::format("cannot make folder {}: {}", options.error_folder, error.message()));
  }
  const std::vector<std::uint8_t> mask = selected_pixels(reference, options);
  const bool nothing_selected =
      !mask.empty() && std::none_of(mask.begin(), mask.end(), [](std::uint8_t m) { return m != 0; });
  // Expected for a scene without such surfaces: no error, but no numbers either.
  if (nothing_selected) log_warning(fmt::format("{}: no pixel is selected", options.reference));

  nlohmann::json images = nlohmann::json::array(), noise_json;
  std::vector<std::vector<std::string>> table = {
      {"image", "MAPE", "trimmed", "MSE", "relMSE", "PSNR", "mean ratio", "pixels"}};
  std::optional<Metrics> noise;
  if (!options.reference_b.empty() && !nothing_selected) {
    noise = estimate_noise(reference, options, mask);
    noise_json = {{"image", options.reference_b},
                  {"mape", noise->mape},
                  {"mape_trimmed", noise->mape_trimmed},
                  {"mse", noise->mse},
                  {"relmse", noise->relmse}};
    table.push_back({options.reference + " (own noise)", number(noise->mape, "?"), number(noise->mape_trimmed, "?"),
                     number(noise->mse, "?"), number(noise->relmse, "?"), "", "", format_count(noise->pixels)});
  }
  for (std::size_t i = 0; i < options.images.size(); ++i) {
    const std::string& file = options.images[i];
    const Image image = read_same_size(file, reference, options);
    if (nothing_selected) {
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
    if (noise && m.mape <= noise->mape) {
      log_warning(fmt::format(
          "{}: its MAPE {:.4g} is not above the reference's own noise {:.4g}: how near it is to the truth cannot be told; "
          "a reference of more samples can",
          file, m.mape, noise->mape));
    }
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
  if (common.json) {
    nlohmann::json report = {{"reference", options.reference}, {"images", images}};
    if (!options.reference_b.empty()) report["reference_noise"] = noise_json;
    print_json(report);
  } else {
    print_text(format_table(table));
  }
}

}  // namespace

void add_compare(Program& program) {
  auto options = std::make_shared<CompareOptions>();
  CLI::App* verb = add_verb(program, "compare", "Measure the error of pictures against a reference.",
                            "octrad compare ref.exr lhs.exr rhs.exr --alpha-below 0.5 --errors errors");
  verb->add_option("reference", options->reference, "reference picture (EXR, HDR, PFM, PNG or JPEG; linear radiance)")
      ->required()
      ->type_name("REF");
  verb->add_option("images", options->images, "pictures of the same size")->required()->type_name("IMG");
  verb->add_option("--reference-b", options->reference_b,
                   "a second reference with another seed: estimates the reference's own noise, which no error can show "
                   "less than")
      ->type_name("REF2");
  verb->add_option("--mask", options->mask, "only pixels that are white in FILE (mean of the colour at least 0.5)")
      ->type_name("FILE");
  CLI::Option* below =
      verb->add_option("--alpha-below", options->alpha_below,
                       "only pixels whose first hit has a roughness below A (layer roughness.Y of REF or --aux)")
          ->check(in_range(0.0, 1000.0))
          ->type_name("A");
  CLI::Option* above = verb->add_option("--alpha-above", options->alpha_above,
                                        "only pixels whose first hit has a roughness of at least A")
                           ->check(in_range(0.0, 1000.0))
                           ->type_name("A");
  CLI::Option* aux = verb->add_option("--aux", options->aux,
                                      "picture of the view that octrad rendered: has the roughness that REF lacks")
                         ->type_name("FILE");
  CLI::Option* errors =
      verb->add_option("--errors", options->error_folder, "write error pictures (EXR and false-colour PNG) into FOLDER")
          ->type_name("FOLDER");
  verb->add_option("--error-kind", options->error_kind, "what error pictures show: mape | squared | relative")
      ->check(unnamed(CLI::IsMember({"mape", "squared", "relative"})))
      ->type_name("KIND")
      ->capture_default_str()
      ->needs(errors);
  verb->add_option("--error-max", options->error_max, "error shown as white")
      ->check(in_range(1e-30, 1e30))
      ->type_name("E")
      ->capture_default_str()
      ->needs(errors);
  verb->callback([&program, options, aux, below, above] {
    if (aux->count() > 0 && below->count() + above->count() == 0)
      throw UsageError("--aux belongs to --alpha-below and --alpha-above");
    program.run = [&program, options] { compare_verb(program.common, *options); };
  });
}

}  // namespace octrad::cli
