// octrad merge: joins independent renderings of one view into a picture that has the samples of all.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "app/cli/common.h"
#include "app/report/picture_origin.h"
#include "octrad/base/atomic_file.h"
#include "octrad/base/bytes.h"
#include "octrad/base/error.h"
#include "octrad/base/log.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/version.h"
#include "octrad/image/io.h"
#include "octrad/image/metrics.h"
#include "octrad/image/tonemap.h"

namespace octrad::cli {
namespace {

// Of a picture, whose metadata may say anything: they are added up.
constexpr long long kMostSamples = 1'000'000'000'000;

struct MergeOptions {
  ExrOptions exr;
  std::vector<std::string> inputs;
  std::string output, aux;
};

struct Part {
  std::string file;
  Image image;
  long long spp = 0;
  std::vector<long long> seeds;  // empty: unknown
};

// "FILE" or "FILE:SPP".
Part read_part(const std::string& word) {
  Part part{word, {}, 0, {}};
  const std::size_t colon = word.rfind(':');
  if (colon != std::string::npos && colon + 1 < word.size() && !std::filesystem::exists(word) &&
      word.find_first_not_of("0123456789", colon + 1) == std::string::npos) {
    part.file = word.substr(0, colon);
    part.spp = std::atoll(word.c_str() + colon + 1);
    if (part.spp <= 0 || part.spp > 1'000'000'000)
      throw UsageError(fmt::format("{}: expected FILE:SPP with 1 to 1,000,000,000 samples a pixel", word));
  }
  part.image = read_image(part.file);
  if (part.image.metadata.count("octrad.denoise") > 0)
    throw InputError(
        fmt::format("{} was denoised: its error is not that of independent samples, which a mean reduces", part.file));
  if (is_display_referred(part.image))
    throw InputError(part.file + ": holds what a screen shows; merge needs linear radiance (EXR, HDR, PFM)");
  if (part.spp == 0) part.spp = report::metadata_value<long long>(part.image, "octrad.render", "spp", 0);
  if (part.spp <= 0 || part.spp > kMostSamples)
    throw InputError(fmt::format("{0} does not say how many samples a pixel it has: write {0}:SPP", part.file));
  part.seeds = report::picture_seeds(part.image);
  return part;
}

// Throws InputError unless the two can be means of one quantity, as far as the files say, with other random numbers.
void check_alike(const Part& a, const Part& b) {
  const auto differ = [&](const std::string& what) {
    throw InputError(fmt::format("{} and {} differ in {}: they are not pictures of one view", a.file, b.file, what));
  };
  if (a.image.width != b.image.width || a.image.height != b.image.height) differ("size");
  if (const std::string what = report::view_difference(a.image, b.image); !what.empty()) differ(what);
  // Caches of one configuration and step are the same one, whatever the names of their files.
  const auto cache = [](const Part& p) {
    const auto config = p.image.metadata.find("octrad.config");
    return std::pair(config == p.image.metadata.end() ? std::string() : config->second,
                     report::metadata_value<long long>(p.image, "octrad.model", "step", -1));
  };
  if (cache(a) != cache(b)) differ("their cache");
  const auto integrator = [](const Part& p) {
    return report::metadata_value(p.image, "octrad.render", "integrator", std::string());
  };
  if (!integrator(a).empty() && !integrator(b).empty() && integrator(a) != integrator(b)) differ("their integrator");
  const auto depth = [](const Part& p) {
    return report::metadata_value<long long>(p.image, "octrad.render", "max_depth", -2);
  };
  if (depth(a) != -2 && depth(b) != -2 && depth(a) != depth(b)) differ("max_depth");
  if (report::mask_of(a.image) != report::mask_of(b.image)) differ("their mask");
  if (report::share_a_seed(a.seeds, b.seeds) || a.image.data == b.image.data)
    throw InputError(fmt::format(
        "{} and {} have the same seed, so that their mean would have as much noise as one of them", a.file, b.file));
}

long long total_spp(const std::vector<Part>& parts, std::size_t begin, std::size_t end) {
  long long sum = 0;
  for (std::size_t i = begin; i < end; ++i) sum += parts[i].spp;
  return sum;
}

// Mean of the parts [begin, end), weighted by their samples.
Image weighted_mean(const std::vector<Part>& parts, std::size_t begin, std::size_t end) {
  Image mean = parts[begin].image;
  std::vector<double> sum(mean.data.size());
  for (std::size_t i = begin; i < end; ++i) {
    for (std::size_t k = 0; k < sum.size(); ++k)
      sum[k] += static_cast<double>(parts[i].image.data[k]) * static_cast<double>(parts[i].spp);
  }
  const auto total = static_cast<double>(total_spp(parts, begin, end));
  for (std::size_t k = 0; k < sum.size(); ++k) mean.data[k] = static_cast<float>(sum[k] / total);
  return mean;
}

// Of a picture that was rendered with a mask, which pixels are not 0 in all channels: those of the mask, which have a
// roughness of 1 at least where nothing is hit; without that layer all but black ones.
std::vector<std::uint8_t> nonzero_pixels(const Image& image) {
  std::vector<std::uint8_t> result(image.pixel_count());
  const std::size_t channels = image.channels.size();
  for (std::size_t k = 0; k < image.data.size(); ++k) {
    if (image.data[k] != 0.0f) result[k / channels] = 1;
  }
  return result;
}

// The colour of `picture` with the layers of `layers`.
Image with_layers(const Image& picture, const Image& layers) {
  std::vector<std::string> names = {"R", "G", "B"};
  std::vector<std::size_t> taken;
  for (std::size_t c = 0; c < layers.channels.size(); ++c) {
    if (layers.channels[c].find('.') == std::string::npos) continue;
    names.push_back(layers.channels[c]);
    taken.push_back(c);
  }
  Image out(picture.width, picture.height, names);
  out.metadata = picture.metadata;
  for (std::size_t p = 0; p < out.pixel_count(); ++p) {
    float* to = &out.data[p * names.size()];
    std::copy_n(&picture.data[p * 3], 3, to);
    for (std::size_t c = 0; c < taken.size(); ++c) to[3 + c] = layers.data[p * layers.channels.size() + taken[c]];
  }
  return out;
}

void merge_verb(const CommonOptions& common, const MergeOptions& o) {
  const ExrSettings exr = o.exr.settings_for(o.output);
  require_writable(o.output);
  if (o.inputs.size() < 2) throw UsageError("merge needs two pictures or more");
  std::vector<Part> parts;
  for (const std::string& word : o.inputs) {
    parts.push_back(read_part(word));
    refuse_input_as_output("-o", o.output, {parts.back().file, o.aux});
    for (std::size_t i = 0; i + 1 < parts.size(); ++i) check_alike(parts[i], parts.back());
  }
  const bool same_layers = std::all_of(parts.begin(), parts.end(),
                                       [&](const Part& p) { return p.image.channels == parts.front().image.channels; });
  if (!o.aux.empty() || !same_layers) {
    for (Part& part : parts) part.image = extract_rgb(part.image);
  }
  // The mean and that of a half, each with its sums.
  ask_memory(parts.front().image.data.size() * 2 * (sizeof(float) + sizeof(double)), o.output + ": merging");
  const std::size_t half = parts.size() / 2, n = parts.size();
  const long long spp = total_spp(parts, 0, n);
  Image out = weighted_mean(parts, 0, n);
  // With the halves a and b, mean - b = (a - b) n_a / (n_a + n_b): its variance times n_b / n_a is that of the mean.
  const double share = static_cast<double>(total_spp(parts, half, n)) / static_cast<double>(total_spp(parts, 0, half));
  const auto not_finite = std::count_if(out.data.begin(), out.data.end(), [](float v) { return !std::isfinite(v); });
  if (not_finite > 0) log_warning(fmt::format("{}: {} values are not finite", o.output, not_finite));
  const std::string mask = report::mask_of(out);
  const Metrics noise = reference_noise(out, weighted_mean(parts, half, n), share,
                                        mask.empty() ? std::vector<std::uint8_t>() : nonzero_pixels(out));
  if (!o.aux.empty()) {
    const Image layers = read_image(o.aux);
    if (layers.width != out.width || layers.height != out.height)
      throw InputError(fmt::format("{} has {} x {} pixels, the pictures have {} x {}", o.aux, layers.width,
                                   layers.height, out.width, out.height));
    warn_of_other_view(o.aux, layers, parts.front().file, parts.front().image);
    out = with_layers(out, layers);
  }
  out.metadata["octrad.version"] = kVersion;
  nlohmann::json render = {{"spp", spp}, {"seeds", nlohmann::json::array()}};
  for (const Part& part : parts) {
    if (part.seeds.empty()) render["seeds"].push_back(nullptr);
    for (const long long seed : part.seeds) render["seeds"].push_back(seed);
  }
  const std::string integrator = report::metadata_value<std::string>(out, "octrad.render", "integrator", "");
  if (!integrator.empty()) {
    render["integrator"] = integrator;
    render["max_depth"] = report::metadata_value(out, "octrad.render", "max_depth", -1);
    if (!mask.empty()) render["mask"] = mask;
    if (const auto view = report::metadata_value(parts.front().image, "octrad.render", "view", std::string());
        !view.empty())
      render["view"] = view;
  }
  out.metadata["octrad.render"] = render.dump();
  write_image(o.output, out, {}, exr);
  if (common.json) {
    print_json({{"output", o.output},
                {"width", out.width},
                {"height", out.height},
                {"spp", spp},
                {"noise", {{"mape", noise.mape}, {"mse", noise.mse}, {"relmse", noise.relmse}}}});
  } else {
    log_info("{}: {} spp of {} pictures, own noise about MAPE {:.4g}, MSE {:.4g}", o.output, format_count(spp), n,
             noise.mape, noise.mse);
  }
}

}  // namespace

void add_merge(Program& program) {
  auto o = std::make_shared<MergeOptions>();
  CLI::App* verb =
      add_verb(program, "merge", "Join renderings of one view with different seeds, and estimate their noise.",
               "octrad merge seed1.exr seed2.exr -o ref.exr");
  verb->add_option(
          "pictures", o->inputs,
          "pictures of one view with different seeds; FILE:SPP for those that do not say their samples a pixel")
      ->required()
      ->type_name("PART");
  verb->add_option("-o,--output", o->output, "their mean, weighted by samples; the ending says the format")
      ->required()
      ->type_name("OUT.exr");
  verb->add_option("--aux", o->aux, "take the layers (roughness, normal ...) from this picture of the view")
      ->type_name("FILE");
  o->exr.add_to(*verb);
  verb->callback([&program, o] { program.run = [&program, o] { merge_verb(program.common, *o); }; });
}

}  // namespace octrad::cli
