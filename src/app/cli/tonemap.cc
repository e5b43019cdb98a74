// octrad tonemap: from linear pictures to a PNG or JPEG for the screen.
#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <sstream>

#include "app/cli/common.h"
#include "octrad/base/atomic_file.h"
#include "octrad/base/error.h"
#include "octrad/base/join.h"
#include "octrad/base/log.h"
#include "octrad/image/contact_sheet.h"
#include "octrad/image/io.h"
#include "octrad/image/tonemap.h"

namespace octrad::cli {
namespace {

struct TonemapOptions {
  std::vector<std::string> inputs;
  std::string output;
  double exposure = 0.0;
  std::string curve = "none", encoding = "srgb";
  double gamma = 2.2;
  std::string layer, channel, range, labels;
  int columns = 0;
  std::string mapping_option;  // the first of --exposure, --curve, --encoding and --gamma that was given
};

// The texts between the commas; the files' names without --labels.
std::vector<std::string> labels_of(const TonemapOptions& o) {
  std::vector<std::string> labels;
  if (o.labels.empty()) {
    for (const std::string& file : o.inputs) labels.push_back(std::filesystem::path(file).stem().string());
    return labels;
  }
  std::istringstream text(o.labels + ",");
  for (std::string label; std::getline(text, label, ',');) labels.push_back(label);
  if (labels.size() != o.inputs.size())
    throw UsageError(fmt::format("--labels: {} for {} pictures", labels.size(), o.inputs.size()));
  return labels;
}

ToneMapping mapping_of(const TonemapOptions& o) {
  ToneMapping mapping;
  mapping.exposure = static_cast<float>(o.exposure);
  mapping.curve = o.curve == "log1p"    ? ToneMapping::Curve::log1p
                  : o.curve == "filmic" ? ToneMapping::Curve::filmic
                                        : ToneMapping::Curve::none;
  mapping.encoding = o.encoding == "gamma"    ? ToneMapping::Encoding::gamma
                     : o.encoding == "linear" ? ToneMapping::Encoding::linear
                                              : ToneMapping::Encoding::srgb;
  mapping.gamma = static_cast<float>(o.gamma);
  return mapping;
}

// The picture for the screen: one channel in false colours, a layer of vectors, or a tone-mapped colour.
Image8 displayed(const TonemapOptions& o, const std::string& file) {
  const Image image = read_image(file);
  const bool vectors = is_vector_layer(image, o.layer);
  if (o.channel.empty() && !vectors) {
    if (!o.range.empty()) throw UsageError("--range belongs to --channel, or to a --layer of vectors such as normal");
    return tonemap(image, mapping_of(o), o.layer);
  }
  if (!o.mapping_option.empty()) {
    throw UsageError(fmt::format("{} is for colours; {} is shown over --range", o.mapping_option,
                                 vectors ? "a layer of vectors" : "a channel"));
  }
  const std::vector<double> range = !o.range.empty() ? parse_numbers(o.range, 2, "--range")
                                    : vectors        ? std::vector<double>{-1.0, 1.0}
                                                     : std::vector<double>{0.0, 1.0};
  const auto lower = static_cast<float>(range[0]), upper = static_cast<float>(range[1]);
  if (!(lower < upper) || !std::isfinite(upper - lower))
    throw UsageError("--range: the first number must be below the second, and both far from the ends of 32-bit floats");
  if (vectors) return vector_color(image, o.layer, lower, upper);
  const int channel = image.channel(o.channel);
  if (channel < 0) {
    throw InputError(fmt::format("{} has no channel \"{}\"{}; it has {}", file, o.channel,
                                 did_you_mean(o.channel, image.channels), join(image.channels)));
  }
  return false_color(image, channel, lower, upper);
}

void tonemap_verb(const CommonOptions& common, const TonemapOptions& o) {
  if (!is_display_format(picture_format(o.output)))
    throw UsageError(fmt::format("-o {}: tonemap writes pictures for the screen, .png or .jpg", o.output));
  const std::vector<std::string> labels = labels_of(o);
  require_writable(o.output);
  refuse_input_as_output("-o", o.output, o.inputs);
  const bool sheet = o.inputs.size() > 1 || !o.labels.empty();
  if (!sheet && o.columns > 0) throw UsageError("--columns belongs to several pictures");
  std::vector<LabelledImage> pictures;
  for (std::size_t i = 0; i < o.inputs.size(); ++i) pictures.push_back({displayed(o, o.inputs[i]), labels[i]});
  const Image8 out = sheet ? contact_sheet(pictures, o.columns) : std::move(pictures.front().image);
  write_image(o.output, out);
  if (common.json) print_json({{"output", o.output}, {"width", out.width}, {"height", out.height}});
  else log_info("wrote {} ({} x {})", o.output, out.width, out.height);
}

}  // namespace

void add_tonemap(Program& program) {
  auto options = std::make_shared<TonemapOptions>();
  CLI::App* verb = add_verb(program, "tonemap", "Turn linear pictures into a PNG or JPEG for the screen.",
                            "octrad tonemap lhs.exr -o lhs.png --exposure 0.5\n"
                            "  octrad tonemap ref.exr lhs.exr -o both.jpg --curve filmic --labels reference,cache");
  verb->add_option("input", options->inputs, "picture (EXR, HDR, PFM, PNG or JPEG); several become one contact sheet")
      ->required()
      ->type_name("IN");
  verb->add_option("-o,--output", options->output, "PNG or JPEG file, by its ending")->required()->type_name("OUT.png");
  std::vector<CLI::Option*> mapping = {
      verb->add_option("--exposure", options->exposure, "stops: radiance is multiplied by 2^E")
          ->check(in_range(-64.0, 64.0))
          ->type_name("E")
          ->capture_default_str(),
      verb->add_option("--curve", options->curve, "none | log1p: ln(1 + x) | filmic: rolls highlights off")
          ->check(unnamed(CLI::IsMember({"none", "log1p", "filmic"})))
          ->type_name("NAME")
          ->capture_default_str(),
      verb->add_option("--encoding", options->encoding, "srgb | gamma | linear")
          ->check(unnamed(CLI::IsMember({"srgb", "gamma", "linear"})))
          ->type_name("NAME")
          ->capture_default_str(),
      verb->add_option("--gamma", options->gamma, "x^(1/G); implies --encoding gamma")
          ->check(in_range(0.1, 10.0))
          ->type_name("G")
          ->capture_default_str()};
  CLI::Option* layer =
      verb->add_option("--layer", options->layer, "layer of an EXR: a colour such as albedo, or vectors such as normal")
          ->type_name("NAME");
  verb->add_option("--channel", options->channel, "show one channel in false colours, such as depth.Z")
      ->type_name("NAME")
      ->excludes(layer);
  verb->add_option("--range", options->range,
                   "values shown as black and white: of --channel, default 0,1, or of vectors, default -1,1")
      ->type_name("LO,HI");
  verb->add_option("--labels", options->labels, "names below the pictures; default: the files' names")
      ->type_name("A,B,...");
  verb->add_option("--columns", options->columns, "of a contact sheet; default: as square as it gets")
      ->check(whole_in_range(1, 1000))
      ->type_name("N");
  verb->callback([&program, options, mapping] {
    for (const CLI::Option* option : mapping) {
      if (option->count() > 0 && options->mapping_option.empty()) options->mapping_option = option->get_name();
    }
    const CLI::Option *encoding = mapping[2], *gamma = mapping[3];
    if (gamma->count() > 0 && encoding->count() == 0) options->encoding = "gamma";
    if (gamma->count() > 0 && options->encoding != "gamma")
      throw UsageError("--gamma belongs to --encoding gamma, not " + options->encoding);
    program.run = [&program, options] { tonemap_verb(program.common, *options); };
  });
}

}  // namespace octrad::cli
