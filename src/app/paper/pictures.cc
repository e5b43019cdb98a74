#include "app/paper/pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <functional>
#include <optional>

#include "app/paper/report.h"
#include "app/report/image_page.h"
#include "octrad/base/error.h"
#include "octrad/base/escape.h"
#include "octrad/base/log.h"
#include "octrad/image/encode.h"
#include "octrad/image/io.h"
#include "octrad/image/metrics.h"
#include "octrad/image/tonemap.h"

namespace octrad::paper {

namespace {

constexpr float kErrorMax = 0.5f;     // MAPE shown as white
constexpr int kEmbeddedQuality = 85;  // of the page's JPEGs; those of the folder pictures/ have 95

std::string image_element(const Store& store, const std::string& name, const Image8& image, const char* kind,
                          const std::string& alt) {
  const std::string file = "pictures/" + name + ".jpg";
  write_image(store.path(file), image);
  const std::string bytes = encode_jpeg(image, kEmbeddedQuality);
  return fmt::format("<img class=\"{}\" width=\"{}\" height=\"{}\" alt=\"{}\" src=\"data:image/jpeg;base64,{}\">", kind,
                     image.width, image.height, markup_text(alt), report::base64({bytes.begin(), bytes.end()}));
}

std::optional<Image> read(const Store& store, const std::string& file) {
  try {
    return read_image(store.path(file));
  } catch (const Error& error) {
    log_warning(fmt::format("not in the report: {}", error.what()));
    return std::nullopt;
  }
}

// Of finite values above 0; 0 where there are none.
float quantile(std::vector<float> values, double q) {
  std::erase_if(values, [](float v) { return !(v > 0.0f && std::isfinite(v)); });
  if (values.empty()) return 0.0f;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

std::vector<float> first_channel(const Image& image) {
  std::vector<float> values;
  for (std::size_t i = 0; i < image.data.size(); i += image.channels.size()) values.push_back(image.data[i]);
  return values;
}

// Stops that bring the median luminance to a mid grey.
float exposure_for(const Image& reference) {
  const Image rgb = extract_rgb(reference);
  std::vector<float> values;
  for (std::size_t p = 0; p < rgb.pixel_count(); ++p)
    values.push_back(luminance(Vec3f{rgb.data[3 * p], rgb.data[3 * p + 1], rgb.data[3 * p + 2]}));
  const float median = quantile(std::move(values), 0.5);
  return median > 0.0f ? std::log2(0.22f / median) : 0.0f;
}

struct Box {
  int x = 0, y = 0, side = 0;
};

// The square where the pictures differ most from the reference on glossy surfaces (anywhere, where there are none): a
// sixth of the width. Values above 1 count as 1, so that fireflies do not decide.
Box most_different(const Image& reference, const std::vector<Image>& errors) {
  std::vector<std::uint8_t> glossy(reference.pixel_count(), 1);
  if (reference.channel("roughness.Y") >= 0) {
    const std::vector<std::uint8_t> mask = roughness_mask(reference, 0.0f, 0.5f);
    if (std::any_of(mask.begin(), mask.end(), [](std::uint8_t m) { return m != 0; })) glossy = mask;
  }
  Box best;
  const int width = errors.front().width, height = errors.front().height;
  best.side = std::max(8, std::min({width / 6, height / 3, 96}));
  double most = -1.0;
  for (int y = 0; y + best.side <= height; y += best.side / 2) {
    for (int x = 0; x + best.side <= width; x += best.side / 2) {
      double sum = 0.0;
      for (const Image& error : errors) {
        for (int j = y; j < y + best.side; ++j) {
          for (int i = x; i < x + best.side; ++i) {
            if (glossy[static_cast<std::size_t>(j * width + i)] != 0) sum += std::min(1.0f, error.at(i, j, 0));
          }
        }
      }
      if (sum <= most) continue;
      most = sum;
      best.x = x;
      best.y = y;
    }
  }
  return best;
}

Image8 cut(const Image8& image, const Box& box) {
  Image8 out(box.side, box.side, image.channels);
  const auto row = static_cast<std::size_t>(box.side * image.channels);
  for (int y = 0; y < box.side; ++y) {
    const auto from = static_cast<std::size_t>(((box.y + y) * image.width + box.x) * image.channels);
    std::copy_n(&image.data[from], row, &out.data[static_cast<std::size_t>(y) * row]);
  }
  return out;
}

std::string caption(const ViewPicture& picture) {
  return fmt::format("<figcaption>{}<br>{}</figcaption>",
                     picture.anchor.empty()
                         ? markup_text(picture.title)
                         : fmt::format("<a href=\"#{}\">{}</a>", picture.anchor, markup_text(picture.title)),
                     markup_text(picture.caption));
}

std::string row_figure(const Store& store, const std::string& name, const std::vector<ViewPicture>& pictures,
                       const std::function<Image8(const Image&)>& show) {
  store.make_folder("pictures");
  std::string out = "<div class=\"pictures small\">\n";
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    if (const std::optional<Image> image = read(store, pictures[i].file))
      out += "<figure>" +
             image_element(store, fmt::format("{}-{}", name, i), show(*image), "shown", pictures[i].title) +
             caption(pictures[i]) + "</figure>\n";
  }
  return out + "</div>\n";
}

}  // namespace

std::string view_figure(const Store& store, const std::string& name, const std::vector<ViewPicture>& pictures,
                        std::optional<int> viewer_side) {
  if (pictures.empty()) return "";
  store.make_folder("pictures");
  const std::optional<Image> reference = read(store, pictures.front().file);
  if (!reference) return "";
  ToneMapping mapping;
  mapping.exposure = exposure_for(*reference);
  mapping.curve = ToneMapping::Curve::filmic;

  std::vector<const ViewPicture*> shown;
  std::vector<Image8> seen;
  std::vector<Image> errors;
  std::vector<report::PageImage> viewed;
  for (const ViewPicture& picture : pictures) {
    const bool is_reference = &picture == &pictures.front();
    std::optional<Image> image = is_reference ? reference : read(store, picture.file);
    if (!image || image->width != reference->width || image->height != reference->height) continue;
    shown.push_back(&picture);
    seen.push_back(tonemap(*image, mapping));
    if (!is_reference) errors.push_back(error_image(*reference, *image));
    if (viewer_side) viewed.push_back({picture.title, extract_rgb(*image), picture.caption});
  }
  const Box box = errors.empty() ? Box{0, 0, 8} : most_different(*reference, errors);
  std::string out = fmt::format("<div class=\"pictures\" data-box=\"{} {} {}\">\n", box.x, box.y, box.side);
  for (std::size_t i = 0; i < shown.size(); ++i) {
    const std::string base = fmt::format("{}-{}", name, i);
    out += "<figure>" + image_element(store, base, seen[i], "shown", shown[i]->title) + "<div class=\"below\">" +
           image_element(store, base + "-inset", cut(seen[i], box), "inset", "part of it");
    if (i > 0)
      out +=
          image_element(store, base + "-error", false_color(errors[i - 1], 0, 0.0f, kErrorMax), "error", "error map");
    out += "</div>" + caption(*shown[i]) + "</figure>\n";
  }
  std::string viewer;
  if (viewer_side) {
    std::string id = "viewer";
    for (const char c : name)
      id += std::isalnum(static_cast<unsigned char>(c)) ? std::string(1, c) : fmt::format("{:02x}", c);
    viewer = report::viewer_html(id, viewed, true, *viewer_side);
  }
  return viewer + out +
         fmt::format(
             "</div>\n<p class=\"note\">Exposure {:+.1f} stops, filmic curve, sRGB. Cut out: {} × {} pixels at ({}, {}), where the pictures differ most from the reference on glossy surfaces. "
             "Error maps: |I − R| / (R + 0.01), black 0, white {} or more.</p>\n",
             mapping.exposure, box.side, box.side, box.x, box.y, kErrorMax);
}

std::string color_figure(const Store& store, const std::string& name, const std::vector<ViewPicture>& pictures) {
  return row_figure(store, name, pictures, [](const Image& image) { return tonemap(image, {}); });
}

std::string quantity_figure(const Store& store, const std::string& name, const std::vector<ViewPicture>& pictures) {
  float top = 0.0f;
  std::string out = row_figure(store, name, pictures, [&](const Image& image) {
    if (top == 0.0f) top = std::max(1e-6f, quantile(first_channel(image), 0.9));
    return false_color(image, 0, 0.0f, top);
  });
  return out + fmt::format("<p class=\"note\">Black 0, white {} or more (1 / world unit).</p>\n", figure(top));
}

}  // namespace octrad::paper
