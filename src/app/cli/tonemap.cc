// octrad tonemap: from a linear picture to a PNG for the screen.
#include <fmt/format.h>

#include "app/cli/common.h"
#include "octrad/base/atomic_file.h"
#include "octrad/base/error.h"
#include "octrad/base/log.h"
#include "octrad/image/io.h"
#include "octrad/image/tonemap.h"

namespace octrad::cli {
namespace {

struct TonemapOptions {
  std::string input, output;
  double exposure = 0.0;
  std::string curve = "none", encoding = "srgb";
  double gamma = 2.2;
  std::string layer, channel, range;
};

void tonemap_verb(const CommonOptions& common, const TonemapOptions& options) {
  require_writable(options.output);
  const Image image = read_image(options.input);
  Image8 out;
  if (!options.channel.empty()) {
    const int channel = image.channel(options.channel);
    if (channel < 0) {
      std::string list;
      for (const std::string& name : image.channels) list += (list.empty() ? "" : ", ") + name;
      throw InputError(fmt::format("{} has no channel \"{}\"{}; it has {}", options.input, options.channel,
                                   did_you_mean(options.channel, image.channels), list));
    }
    const std::vector<double> range =
        options.range.empty() ? std::vector<double>{0.0, 1.0} : parse_numbers(options.range, 2, "--range");
    if (range[0] >= range[1]) throw UsageError("--range: the first number must be below the second");
    out = false_color(image, channel, static_cast<float>(range[0]), static_cast<float>(range[1]));
  } else {
    ToneMapping mapping;
    mapping.exposure = static_cast<float>(options.exposure);
    mapping.curve = options.curve == "log1p" ? ToneMapping::Curve::log1p : ToneMapping::Curve::none;
    mapping.encoding = options.encoding == "gamma"    ? ToneMapping::Encoding::gamma
                       : options.encoding == "linear" ? ToneMapping::Encoding::linear
                                                      : ToneMapping::Encoding::srgb;
    mapping.gamma = static_cast<float>(options.gamma);
    out = tonemap(image, mapping, options.layer);
  }
  write_png(options.output, out);
  if (common.json) print_json({{"output", options.output}, {"width", out.width}, {"height", out.height}});
  else log_info("wrote {} ({} x {})", options.output, out.width, out.height);
}

}  // namespace

void add_tonemap(Program& program) {
  auto options = std::make_shared<TonemapOptions>();
  CLI::App* verb = add_verb(program, "tonemap", "Turn a linear picture into a PNG.",
                            "octrad tonemap lhs.exr -o lhs.png --exposure 0.5");
  verb->add_option("input", options->input, "picture (EXR, HDR, PNG or JPG)")->required()->type_name("IN");
  verb->add_option("-o,--output", options->output, "PNG file")->required()->type_name("OUT.png");
  verb->add_option("--exposure", options->exposure, "stops: radiance is multiplied by 2^E")
      ->check(unnamed(CLI::Range(-64.0, 64.0)))
      ->type_name("E")
      ->capture_default_str();
  verb->add_option("--curve", options->curve, "none | log1p: ln(1 + x)")
      ->check(unnamed(CLI::IsMember({"none", "log1p"})))
      ->type_name("NAME")
      ->capture_default_str();
  CLI::Option* encoding = verb->add_option("--encoding", options->encoding, "srgb | gamma | linear")
                              ->check(unnamed(CLI::IsMember({"srgb", "gamma", "linear"})))
                              ->type_name("NAME")
                              ->capture_default_str();
  verb->add_option("--gamma", options->gamma, "x^(1/G); implies --encoding gamma")
      ->check(unnamed(CLI::Range(0.1, 10.0)))
      ->type_name("G")
      ->capture_default_str()
      ->each([options, encoding](const std::string&) {
        if (encoding->count() == 0) options->encoding = "gamma";
      });
  CLI::Option* layer =
      verb->add_option("--layer", options->layer, "colour layer of an EXR, such as albedo")->type_name("NAME");
  verb->add_option("--channel", options->channel, "show one channel in false colours, such as depth.Z")
      ->type_name("NAME")
      ->excludes(layer);
  verb->add_option("--range", options->range, "values shown as black and white with --channel; default 0,1")
      ->type_name("LO,HI");
  verb->callback(
      [&program, options] { program.run = [&program, options] { tonemap_verb(program.common, *options); }; });
}

}  // namespace octrad::cli
