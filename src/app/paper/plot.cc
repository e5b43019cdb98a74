#include "app/paper/plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "octrad/base/escape.h"

namespace octrad::paper {

namespace {

constexpr double kLeft = 62, kTop = 12, kPlotWidth = 400, kPlotHeight = 260, kBottom = 44, kLegend = 210;

// Okabe and Ito's colours, which people who see few colours can tell apart.
constexpr std::array kColors = {"#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#7f7f7f"};
constexpr std::array kDashes = {"", "6 3", "2 3", "8 3 2 3"};

struct Axis {
  double low, high;  // powers of 10 as exponents
  double begin, length;
  double operator()(double v) const { return begin + (std::log10(v) - low) / (high - low) * length; }
};

Axis make_axis(double low, double high, double begin, double length) {
  low = std::log10(low);
  high = std::log10(high);
  const double margin = std::max(0.04 * (high - low), 0.05);
  return {low - margin, high + margin, begin, length};
}

// 1, 2, 5 x 10^n within the axis; only 1 where there would be too many.
std::vector<double> ticks(const Axis& axis) {
  std::vector<double> out;
  const bool few = axis.high - axis.low > 3.0;
  for (int decade = static_cast<int>(std::floor(axis.low)); decade <= static_cast<int>(std::ceil(axis.high));
       ++decade) {
    for (const double digit : {1.0, 2.0, 5.0}) {
      const double v = digit * std::pow(10.0, decade), at = std::log10(v);
      if (at >= axis.low && at <= axis.high && (digit == 1.0 || !few)) out.push_back(v);
    }
  }
  return out;
}

std::string mark(std::size_t kind, double x, double y, const char* color) {
  switch (kind % 4) {
    case 0: return fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3\" fill=\"{}\"/>", x, y, color);
    case 1:
      return fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"6\" height=\"6\" fill=\"{}\"/>", x - 3, y - 3, color);
    case 2: return fmt::format("<path d=\"M{:.1f} {:.1f}l3.5 6h-7z\" fill=\"{}\"/>", x, y - 4, color);
    default: return fmt::format("<path d=\"M{:.1f} {:.1f}l4 4l-4 4l-4 -4z\" fill=\"{}\"/>", x, y - 4, color);
  }
}

}  // namespace

std::string log_log_plot(const std::vector<Series>& all, const std::vector<std::string>& names,
                         const std::string& x_title, const std::string& y_title) {
  std::vector<Series> series = all;
  double x0 = 1e300, x1 = 0.0, y0 = 1e300, y1 = 0.0;
  for (Series& s : series) {
    std::erase_if(s.points, [](const auto& p) {
      return !(p.first > 0.0 && p.second > 0.0 && std::isfinite(p.first + p.second));
    });
    for (const auto& [x, y] : s.points) {
      x0 = std::min(x0, x);
      x1 = std::max(x1, x);
      y0 = std::min(y0, y);
      y1 = std::max(y1, y);
    }
  }
  std::erase_if(series, [](const Series& s) { return s.points.empty(); });
  if (series.empty()) return "";
  const Axis x = make_axis(x0, x1, kLeft, kPlotWidth), y = make_axis(y0, y1, kTop + kPlotHeight, -kPlotHeight);
  const double width = kLeft + kPlotWidth + kLegend, height = kTop + kPlotHeight + kBottom;
  std::string svg = fmt::format(
      "<svg class=\"plot\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" role=\"img\">\n", width, height);
  for (const double v : ticks(x)) {
    svg += fmt::format(
        "<line class=\"grid\" x1=\"{0:.1f}\" x2=\"{0:.1f}\" y1=\"{1}\" y2=\"{2}\"/><text x=\"{0:.1f}\" y=\"{3}\" text-anchor=\"middle\">{4:g}</text>\n",
        x(v), kTop, kTop + kPlotHeight, kTop + kPlotHeight + 16, v);
  }
  for (const double v : ticks(y)) {
    svg += fmt::format(
        "<line class=\"grid\" x1=\"{1}\" x2=\"{2}\" y1=\"{0:.1f}\" y2=\"{0:.1f}\"/><text x=\"{3}\" y=\"{4:.1f}\" text-anchor=\"end\">{5:g}</text>\n",
        y(v), kLeft, kLeft + kPlotWidth, kLeft - 6, y(v) + 4, v);
  }
  svg += fmt::format("<rect class=\"frame\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/>\n", kLeft, kTop, kPlotWidth,
                     kPlotHeight);
  svg += fmt::format("<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n", kLeft + kPlotWidth / 2, height - 8,
                     markup_text(x_title));
  svg += fmt::format("<text transform=\"translate(14 {}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n",
                     kTop + kPlotHeight / 2, markup_text(y_title));
  double legend = kTop + 12;
  for (const Series& s : series) {
    const auto kind = static_cast<std::size_t>(std::find(names.begin(), names.end(), s.name) - names.begin());
    const char* color = kColors[kind % kColors.size()];
    std::string line;
    for (const auto& [px, py] : s.points)
      line += fmt::format("{}{:.1f} {:.1f}", line.empty() ? "M" : "L", x(px), y(py));
    if (s.line)
      svg += fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\" stroke-dasharray=\"{}\"/>\n",
                         line, color, kDashes[kind / 2 % kDashes.size()]);
    for (const auto& [px, py] : s.points) svg += mark(kind, x(px), y(py), color);
    const double at = kLeft + kPlotWidth + 12;
    if (s.line)
      svg += fmt::format(
          "<line x1=\"{}\" x2=\"{}\" y1=\"{}\" y2=\"{}\" stroke=\"{}\" stroke-width=\"1.6\" stroke-dasharray=\"{}\"/>",
          at, at + 22, legend - 4, legend - 4, color, kDashes[kind / 2 % kDashes.size()]);
    svg += mark(kind, at + 11, legend - 4, color) +
           fmt::format("<text x=\"{}\" y=\"{}\">{}</text>\n", at + 28, legend, markup_text(s.name));
    legend += 17;
  }
  return svg + "</svg>\n";
}

}  // namespace octrad::paper
