// octrad compare: how far pictures are from a reference.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <optional>

#include "app/cli/common.h"
#include "app/cli/compare.h"
#include "app/report/image_page.h"
#include "app/report/measure.h"
#include "app/report/picture_origin.h"
#include "app/report/tables.h"
#include "octrad/base/atomic_file.h"
#include "octrad/base/bytes.h"
#include "octrad/base/error.h"
#include "octrad/base/escape.h"
#include "octrad/base/log.h"
#include "octrad/base/memory_limit.h"
#include "octrad/image/bias.h"
#include "octrad/image/io.h"
#include "octrad/image/metrics.h"
#include "octrad/image/tonemap.h"
#include "octrad/perceptual/lpips.h"

namespace octrad::cli {
namespace {

constexpr float kRoughnessBins[] = {0.0f, 0.05f, 0.2f, 0.5f, std::numeric_limits<float>::infinity()};
constexpr float kGlossyBelow = 0.5f;

struct CompareOptions {
  std::string reference;
  std::vector<std::string> images;
  std::string reference_b, mask, aux;
  double alpha_below = std::numeric_limits<double>::quiet_NaN(), alpha_above = alpha_below;
  std::string error_folder;
  std::string error_kind = "mape";
  double error_max = 0.5;
  bool signed_errors = false, scores = false, by_roughness = false, temporal = false;
  double flip_ppd = kFlipPixelsPerDegree;
  std::string lpips_weights, lpips_net = "alex";
  std::string csv, latex, html;
};

ErrorKind error_kind(const std::string& name) {
  return name == "squared" ? ErrorKind::squared : name == "relative" ? ErrorKind::relative_squared : ErrorKind::mape;
}

// All files that are read.
std::vector<std::string> inputs_of(const CompareOptions& o) {
  std::vector<std::string> files = o.images;
  files.insert(files.end(), {o.reference, o.reference_b, o.mask, o.aux});
  return files;
}

// The stems of the pictures' names, with numbers where two have one.
std::vector<std::string> map_names(const std::vector<std::string>& images) {
  std::vector<std::string> names;
  for (const std::string& image : images) names.push_back(std::filesystem::path(image).stem().string());
  const std::vector<std::string> stems = names;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (std::count(stems.begin(), stems.end(), stems[i]) < 2) continue;
    do {
      names[i] += fmt::format("-{}", i + 1);
    } while (std::count(names.begin(), names.end(), names[i]) > 1);
  }
  return names;
}

// FOLDER/NAME.KIND.exr and .png
void write_map(const CompareOptions& options, std::size_t index, const std::string& kind, const Image& map,
               const Image8& colors, const std::string& legend) {
  const std::string base =
      (std::filesystem::path(options.error_folder) / map_names(options.images)[index]).string() + "." + kind;
  for (const char* ending : {".exr", ".png"}) refuse_input_as_output("--errors", base + ending, inputs_of(options));
  write_exr(base + ".exr", map);
  write_image(base + ".png", colors);
  log_info("wrote {0}.exr and {0}.png ({1})", base, legend);
}

Image read_same_size(const std::string& file, const Image& reference, const CompareOptions& o) {
  Image image = read_image(file);
  if (image.width != reference.width || image.height != reference.height) {
    throw InputError(fmt::format("{} has {} x {} pixels, {} has {} x {}", file, image.width, image.height, o.reference,
                                 reference.width, reference.height));
  }
  if (file != o.mask) warn_of_other_view(file, image, o.reference, reference);
  return image;
}

// Below is exclusive and above inclusive, so that the two halves of one threshold share no pixel and miss none.
std::vector<std::uint8_t> roughness_from(const Image& layers, float from, float below,
                                         const std::vector<std::uint8_t>& mask) {
  std::vector<std::uint8_t> rough = roughness_mask(layers, from, below);
  for (std::size_t p = 0; p < mask.size(); ++p) rough[p] &= mask[p];
  return rough;
}

bool nothing_in(const std::vector<std::uint8_t>& mask) {
  return !mask.empty() && std::none_of(mask.begin(), mask.end(), [](std::uint8_t m) { return m != 0; });
}

// The picture that has the roughness, where one of those given has.
struct Layers {
  const Image* image = nullptr;
  Image aux;
};

void find_layers(const Image& reference, const CompareOptions& o, Layers& layers) {
  if (!o.aux.empty()) layers.aux = read_same_size(o.aux, reference, o);
  layers.image = o.aux.empty() ? &reference : &layers.aux;
  if (layers.image->channel("roughness.Y") >= 0) return;
  layers.image = nullptr;
  if (std::isnan(o.alpha_below) && std::isnan(o.alpha_above) && !o.by_roughness) return;
  throw InputError(fmt::format(
      "{}: no layer \"roughness.Y\" to select pixels by (every picture that octrad render writes has one){}",
      o.aux.empty() ? o.reference : o.aux,
      o.aux.empty() ? "; --aux FILE takes it from another picture of the view" : ""));
}

void warn_of_mask(const std::string& name, const Image& image, const CompareOptions& o) {
  if (!o.mask.empty() || report::mask_of(image).empty()) return;
  log_warning(fmt::format(
      "{}: was rendered with --mask: the pixels outside are black, and count; --mask FILE leaves them out", name));
}

// The pixels that count, by --mask and the roughness options; empty: all.
std::vector<std::uint8_t> selected_pixels(const Image& reference, const Layers& layers, const CompareOptions& o) {
  std::vector<std::uint8_t> mask;
  if (!o.mask.empty()) mask = picture_mask(read_same_size(o.mask, reference, o));
  if (std::isnan(o.alpha_below) && std::isnan(o.alpha_above)) return mask;
  return roughness_from(
      *layers.image, std::isnan(o.alpha_above) ? 0.0f : static_cast<float>(o.alpha_above),
      std::isnan(o.alpha_below) ? std::numeric_limits<float>::infinity() : static_cast<float>(o.alpha_below), mask);
}

// --reference-b: an independent picture of the same view, and its share of the samples of both.
struct SecondReference {
  Image image;
  double share = 0.5;
};

SecondReference read_second(const Image& reference, const CompareOptions& o) {
  SecondReference second = {read_same_size(o.reference_b, reference, o)};
  if (const std::string what = report::view_difference(reference, second.image); !what.empty())
    throw InputError(
        fmt::format("{} and {} differ in {}: their difference is not their noise", o.reference, o.reference_b, what));
  const auto number_of = [](const Image& image, const char* key) {
    return report::metadata_value<long long>(image, "octrad.render", key, -1);
  };
  const long long n_a = number_of(reference, "spp"), n_b = number_of(second.image, "spp");
  if (report::share_a_seed(report::picture_seeds(reference), report::picture_seeds(second.image)) ||
      second.image.data == reference.data) {
    throw InputError(fmt::format("{} and {} have the same seed: their noise is the same, and its size does not show",
                                 o.reference, o.reference_b));
  }
  if (is_display_referred(reference) || is_display_referred(second.image)) {
    throw InputError(
        fmt::format("{} and {}: --reference-b needs linear radiance (EXR, HDR, PFM), not what a screen shows",
                    o.reference, o.reference_b));
  }
  // Where the files do not say how many samples they have: as many.
  if (n_a > 0 && n_b > 0) second.share = static_cast<double>(n_b) / static_cast<double>(n_a + n_b);
  return second;
}

// Null where no weights are given: then a sentence says how to get them.
std::unique_ptr<Lpips> load_lpips(const CompareOptions& o) {
  std::string folder = o.lpips_weights;
  if (const char* variable = std::getenv("OCTRAD_LPIPS_WEIGHTS"); folder.empty() && variable != nullptr)
    folder = variable;
  if (folder.empty()) {
    log_info(
        "no LPIPS: its weights are not given (--lpips-weights DIR or OCTRAD_LPIPS_WEIGHTS; scripts/convert_lpips.py "
        "makes them from the published files)");
    return nullptr;
  }
  return std::make_unique<Lpips>(folder, o.lpips_net == "alex" ? LpipsNet::alex : LpipsNet::squeeze);
}

void warn_of(const report::PictureErrors& errors, const std::string& file, const std::optional<Metrics>& noise,
             const CompareOptions& o) {
  const Metrics& m = errors.metrics;
  if (m.non_finite_image > 0)
    log_warning(fmt::format("{}: {} pixels are not finite and count as black", file, m.non_finite_image));
  if (m.non_finite_reference > 0)
    log_warning(fmt::format("{}: {} pixels are not finite and were left out", o.reference, m.non_finite_reference));
  if (noise && m.mape <= noise->mape) {
    log_warning(fmt::format(
        "{}: its MAPE {:.4g} is not above the reference's own noise {:.4g}: how near it is to the truth cannot be told; "
        "a reference of more samples can",
        file, m.mape, noise->mape));
  }
}

// The errors of pixels by their roughness; null where there are none.
nlohmann::json errors_by_roughness(const report::Reference& reference, const Image& image, const Image& layers) {
  nlohmann::json bins = nlohmann::json::array();
  for (std::size_t bin = 0; bin + 1 < std::size(kRoughnessBins); ++bin) {
    const float from = kRoughnessBins[bin], below = kRoughnessBins[bin + 1];
    const std::vector<std::uint8_t> mask = roughness_from(layers, from, below, reference.mask());
    nlohmann::json entry = {
        {"from", std::round(static_cast<double>(from) * 1000.0) / 1000.0},
        {"below", std::isfinite(below) ? nlohmann::json(std::round(static_cast<double>(below) * 1000.0) / 1000.0)
                                       : nlohmann::json()},
        {"pixels", 0},
        {"mape", nullptr},
        {"relmse", nullptr},
        {"mean_ratio", nullptr}};
    if (!nothing_in(mask)) {
      const Metrics m = reference.metrics(image, mask);
      entry["pixels"] = m.pixels;
      entry["mape"] = m.mape;
      entry["relmse"] = m.relmse;
      entry["mean_ratio"] = m.mean_ratio;
    }
    bins.push_back(std::move(entry));
  }
  return bins;
}

void write_maps(const CompareOptions& o, std::size_t index, const report::Reference& reference, const Image& file) {
  Image image;
  const Image& compared = reference.compared(file, image);
  const Image error = o.error_kind == "flip" ? reference.flip_map(file)
                                             : error_image(compared, image, error_kind(o.error_kind), reference.mask());
  const float most = static_cast<float>(o.error_max);
  write_map(o, index, "error", error, false_color(error, 0, 0.0f, most),
            fmt::format("white: {:g} or more", o.error_max));
  if (!o.signed_errors) return;
  const Image with_sign = signed_error_image(compared, image, reference.mask());
  write_map(o, index, "signed", with_sign, signed_color(with_sign, 0, most),
            fmt::format("red: too bright, blue: too dark, darkest from {:g} on", o.error_max));
}

// What takes two references: adds to `entry`.
void add_second(const CompareOptions& o, std::size_t index, const report::Reference& reference, const Image& a,
                const SecondReference& second, const Image& image, nlohmann::json& entry) {
  entry["relmse_noise_free"] = nullptr;
  if (is_display_referred(image)) return;
  entry["relmse_noise_free"] = noise_free_error(a, second.image, second.share, image, reference.mask());
  const BlockScores scores = block_scores(a, second.image, second.share, image, 8, reference.mask());
  entry["blocks"] = {{"size", 8}, {"count", scores.blocks}, {"z_rms", scores.rms}, {"beyond_3", scores.beyond_3}};
  if (o.scores) {
    write_map(o, index, "zscores", scores.z, signed_color(scores.z, 0, 6.0f),
              "red: too bright, blue: too dark, darkest from 6 standard errors on; green: no score");
  }
}

void write_and_say(const std::string& file, const std::string& text) {
  write_file(file, text);
  log_info("wrote {}", file);
}

// The file's name alone where no other picture has it.
std::string short_name(const std::string& file, const CompareOptions& o) {
  const auto name = [](const std::string& path) { return std::filesystem::path(path).filename().string(); };
  std::vector<std::string> all = o.images;
  all.push_back(o.reference);
  return std::count_if(all.begin(), all.end(), [&](const std::string& f) { return name(f) == name(file); }) > 1
             ? file
             : name(file);
}

// The page of --html: the table, and all pictures in one viewer.
std::string page_of(const CompareOptions& o, const nlohmann::json& images,
                    const std::vector<report::PageImage>& pictures) {
  std::string body = fmt::format("<h1>Errors against {}</h1>\n", markup_text(o.reference));
  body += report::html_table(images) + report::viewer_html("pictures", pictures, true);
  body +=
      "<p>MAPE: mean of |I − R| / (R + 0.01); PSNR, SSIM and LPIPS: of the pictures as a screen shows them. Made by "
      "<code>octrad compare --html</code>.</p>\n";
  return report::page_html("Errors against " + std::filesystem::path(o.reference).filename().string(), body);
}

// What every picture is compared with, and how.
struct Comparison {
  const CompareOptions& options;
  const Image& file;  // the reference as it was read
  const Layers& layers;
  const report::Reference& reference;
  const Lpips* lpips;  // may be null
  const std::optional<Metrics>& noise;
  const std::optional<SecondReference>& second;
  bool nothing_selected;
};

// The errors of a picture, which are not defined where nothing is selected.
nlohmann::json errors_of(const Comparison& c, std::size_t i, const Image& image) {
  const std::string& name = c.options.images[i];
  try {
    const report::PictureErrors errors = c.reference.errors(image);
    if (is_display_referred(image) != is_display_referred(c.file)) {
      log_warning(
          fmt::format("{}: of this picture and {}, one is linear radiance and the other what a screen shows; "
                      "both are compared as shown, limited to [0, 1]",
                      name, c.options.reference));
    }
    warn_of(errors, name, c.noise, c.options);
    nlohmann::json entry = report::to_json(errors);
    if (!report::mask_of(c.file).empty() || !report::mask_of(image).empty()) {
      log_info("{}: no SSIM, FLIP and LPIPS, which look at neighbours that --mask left out", name);
      for (const char* key : {"ssim", "flip", "lpips"}) entry[key] = nullptr;
    }
    if (c.lpips != nullptr && !errors.lpips) {
      log_warning(fmt::format("{}: no LPIPS: the network needs pictures of at least {} x {} pixels", name,
                              c.lpips->smallest_side(), c.lpips->smallest_side()));
    }
    if (c.second) add_second(c.options, i, c.reference, c.file, *c.second, image, entry);
    return entry;
  } catch (const InputError& error) {
    throw InputError(fmt::format("{} and {}: {}", c.options.reference, name, error.what()));
  }
}

// All that is said of picture `i`, and its maps of errors.
nlohmann::json compare_one(const Comparison& c, std::size_t i, const Image& image) {
  nlohmann::json entry;
  if (c.nothing_selected) {
    for (const report::MetricColumn& column : report::metric_columns()) entry[column.key] = nullptr;
    entry["pixels"] = entry["non_finite"] = 0;
  } else {
    entry = errors_of(c, i, image);
    if (!c.options.error_folder.empty()) write_maps(c.options, i, c.reference, image);
  }
  entry["image"] = c.options.images[i];
  entry["lpips_net"] = c.options.lpips_net;
  entry["mape_glossy"] = nullptr;
  if (c.layers.image == nullptr || c.nothing_selected) return entry;
  const std::vector<std::uint8_t> glossy = roughness_from(*c.layers.image, 0.0f, kGlossyBelow, c.reference.mask());
  if (!nothing_in(glossy)) entry["mape_glossy"] = c.reference.metrics(image, glossy).mape;
  entry["by_roughness"] = errors_by_roughness(c.reference, image, *c.layers.image);
  return entry;
}

void add_roughness_rows(const std::string& name, const nlohmann::json& bins,
                        std::vector<std::vector<std::string>>& table) {
  for (const nlohmann::json& bin : bins) {
    table.push_back({name,
                     fmt::format("{:g} ... {}", bin["from"].get<double>(),
                                 bin["below"].is_null() ? "1" : fmt::format("{:g}", bin["below"].get<double>())),
                     report::cell_text(bin, "mape"), report::cell_text(bin, "relmse"),
                     report::cell_text(bin, "mean_ratio"), report::cell_text(bin, "pixels")});
  }
}

void compare_verb(const CommonOptions& common, const CompareOptions& options) {
  if (options.temporal) {
    compare_temporal(common, options.reference, options.images);
    return;
  }
  std::vector<std::string> taken = inputs_of(options);
  for (const auto& [option, file] : {std::pair<std::string, std::string>{"--csv", options.csv},
                                     {"--latex", options.latex},
                                     {"--html", options.html}}) {
    if (!file.empty()) require_writable(file);
    refuse_input_as_output(option, file, taken);
    taken.push_back(file);
  }
  const Image file = read_image(options.reference);
  // Another picture, both as linear and as shown values, and the planes of SSIM and FLIP; the page holds bytes of each.
  ask_memory(file.pixel_count() * (options.html.empty() ? 80 : 120), options.reference + ": comparing");
  if (!options.error_folder.empty()) {
    std::error_code error;
    std::filesystem::create_directories(options.error_folder, error);
    if (error) throw IoError(fmt::format("cannot make folder {}: {}", options.error_folder, error.message()));
  }
  warn_of_mask(options.reference, file, options);
  Layers layers;
  find_layers(file, options, layers);
  std::vector<std::uint8_t> mask = selected_pixels(file, layers, options);
  const bool nothing_selected = nothing_in(mask);
  // Expected for a scene without such surfaces: no error, but no numbers either.
  if (nothing_selected) log_warning(fmt::format("{}: no pixel is selected", options.reference));
  const std::unique_ptr<Lpips> lpips = load_lpips(options);
  const report::Reference reference(file, std::move(mask), options.flip_ppd, lpips.get());

  nlohmann::json images = nlohmann::json::array(), noise_json;
  std::vector<std::vector<std::string>> table = {{"image"}};
  for (const report::MetricColumn& column : report::metric_columns()) table[0].push_back(column.title);
  const auto add_row = [&](const std::string& name, const nlohmann::json& values) {
    table.push_back({name});
    for (const report::MetricColumn& column : report::metric_columns())
      table.back().push_back(report::cell_text(values, column.key));
  };
  std::vector<std::vector<std::string>> rough_table = {
      {"image", "roughness", "MAPE", "relMSE", "mean ratio", "pixels"}};
  std::vector<report::PageImage> pictures;
  if (!options.html.empty())
    pictures.push_back({short_name(options.reference, options), extract_rgb(file), "reference"});
  std::optional<Metrics> noise;
  std::optional<SecondReference> second;
  if (!options.reference_b.empty()) {
    second = read_second(file, options);
    warn_of_mask(options.reference_b, second->image, options);
  }
  if (second && !nothing_selected) {
    noise = reference_noise(file, second->image, second->share, reference.mask());
    noise_json = {{"image", options.reference_b},
                  {"mape", noise->mape},
                  {"mape_trimmed", noise->mape_trimmed},
                  {"mse", noise->mse},
                  {"relmse", noise->relmse}};
    add_row(options.reference + " (own noise)", noise_json);
    table.back().back() = format_count(noise->pixels);
  }
  const Comparison comparison{options, file, layers, reference, lpips.get(), noise, second, nothing_selected};
  for (std::size_t i = 0; i < options.images.size(); ++i) {
    const std::string& name = options.images[i];
    const Image image = read_same_size(name, file, options);
    warn_of_mask(name, image, options);
    nlohmann::json entry = compare_one(comparison, i, image);
    if (entry.contains("by_roughness")) add_roughness_rows(name, entry["by_roughness"], rough_table);
    add_row(name, entry);
    if (!options.html.empty()) {
      pictures.push_back(
          {short_name(name, options), extract_rgb(image),
           fmt::format("MAPE {}, FLIP {}", report::cell_text(entry, "mape"), report::cell_text(entry, "flip"))});
    }
    images.push_back(std::move(entry));
  }
  if (!options.csv.empty()) write_and_say(options.csv, report::csv_table(images));
  if (!options.latex.empty()) write_and_say(options.latex, report::latex_table(images));
  if (!options.html.empty()) write_and_say(options.html, page_of(options, images, pictures));
  if (common.json) {
    nlohmann::json report = {{"reference", options.reference}, {"images", images}};
    if (!options.reference_b.empty()) report["reference_noise"] = noise_json;
    print_json(report);
  } else {
    print_text(format_table(table));
    if (options.by_roughness) print_text("\n" + format_table(rough_table));
  }
}

}  // namespace

void add_compare(Program& program) {
  auto options = std::make_shared<CompareOptions>();
  CLI::App* verb = add_verb(program, "compare", "Measure the error of pictures against a reference.",
                            "octrad compare ref.exr lhs.exr rhs.exr --alpha-below 0.5 --errors errors");
  verb->add_option("reference", options->reference,
                   "reference picture (EXR, HDR, PFM: linear radiance; PNG, JPEG: sRGB)")
      ->required()
      ->type_name("REF");
  verb->add_option("images", options->images, "at least one picture beside the reference, of the same size")
      ->required()
      ->type_name("IMG");
  verb->add_option("--reference-b", options->reference_b,
                   "a second reference with another seed: estimates the reference's own noise, which no error can show "
                   "less than, the error without that noise, and scores of blocks")
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
  CLI::Option* by_roughness =
      verb->add_flag("--by-roughness", options->by_roughness, "also print the errors of pixels by their roughness");
  CLI::Option* aux = verb->add_option("--aux", options->aux,
                                      "picture of the view that octrad rendered: has the roughness that REF lacks")
                         ->type_name("FILE");
  verb->add_option("--flip-ppd", options->flip_ppd, "pixels per degree of the observer's view, for FLIP")
      ->check(in_range(1.0, 1000.0))
      ->type_name("N")
      ->capture_default_str();
  verb->add_option("--lpips-weights", options->lpips_weights,
                   "folder with the weights of LPIPS (default: the environment variable OCTRAD_LPIPS_WEIGHTS)")
      ->type_name("DIR");
  verb->add_option("--lpips-net", options->lpips_net, "the network of LPIPS: alex | squeeze")
      ->check(unnamed(CLI::IsMember({"alex", "squeeze"})))
      ->type_name("NET")
      ->capture_default_str();
  verb->add_option("--csv", options->csv, "write the table to FILE as CSV")->type_name("FILE");
  verb->add_option("--latex", options->latex, "write the table to FILE as a LaTeX tabular, the best values bold")
      ->type_name("FILE");
  verb->add_option("--html", options->html,
                   "write a page to FILE for a browser: the table, and the pictures to flip between")
      ->type_name("FILE");
  CLI::Option* errors =
      verb->add_option("--errors", options->error_folder, "write error pictures (EXR and false-colour PNG) into FOLDER")
          ->type_name("FOLDER");
  verb->add_option("--error-kind", options->error_kind, "what error pictures show: mape | squared | relative | flip")
      ->check(unnamed(CLI::IsMember({"mape", "squared", "relative", "flip"})))
      ->type_name("KIND")
      ->capture_default_str()
      ->needs(errors);
  verb->add_option("--error-max", options->error_max, "error shown as white")
      ->check(in_range(1e-30, 1e30))
      ->type_name("E")
      ->capture_default_str()
      ->needs(errors);
  verb->add_flag("--signed", options->signed_errors, "also write where pictures are too bright and too dark")
      ->needs(errors);
  CLI::Option* scores =
      verb->add_flag("--zscores", options->scores,
                     "also write how many standard errors blocks of 8 x 8 pixels are off (needs --reference-b)");
  scores->needs(errors);
  verb->add_flag("--temporal", options->temporal,
                 "REF and IMG are folders of frames: the error of the change from frame to frame");
  verb->callback([&program, verb, options, aux, below, above, by_roughness] {
    for (const char* other :
         {"--reference-b", "--mask", "--alpha-below", "--alpha-above", "--by-roughness", "--aux", "--csv", "--latex",
          "--html", "--errors", "--flip-ppd", "--lpips-net", "--lpips-weights"}) {
      if (options->temporal && verb->get_option(other)->count() > 0)
        throw UsageError(fmt::format("--temporal measures sequences of frames, where {} has no meaning", other));
    }
    if (aux->count() > 0 && below->count() + above->count() + by_roughness->count() == 0 && !program.common.json)
      throw UsageError("--aux belongs to --alpha-below, --alpha-above, --by-roughness and --json");
    if (options->scores && options->reference_b.empty())
      throw UsageError("--zscores needs --reference-b: scores are in standard errors of the reference");
    program.run = [&program, options] { compare_verb(program.common, *options); };
  });
}

}  // namespace octrad::cli
