#include "app/report/tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "octrad/base/bytes.h"
#include "octrad/base/escape.h"

namespace octrad::report {
namespace {

using Better = MetricColumn::Better;

constexpr MetricColumn kColumns[] = {{"mape", "MAPE", Better::lower},
                                     {"mape_trimmed", "trimmed", Better::lower},
                                     {"mse", "MSE", Better::lower},
                                     {"relmse", "relMSE", Better::lower},
                                     {"psnr", "PSNR", Better::higher},
                                     {"ssim", "SSIM", Better::higher},
                                     {"flip", "FLIP", Better::lower},
                                     {"lpips", "LPIPS", Better::lower},
                                     {"mean_ratio", "mean ratio", Better::none},
                                     {"pixels", "pixels", Better::none}};

std::string csv_cell(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

std::string latex_text(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\') out += "\\textbackslash{}";
    else if (c == '~') out += "\\textasciitilde{}";
    else if (c == '^') out += "\\textasciicircum{}";
    else if (std::string("&%$#_{}").find(c) != std::string::npos) out += std::string("\\") + c;
    else out += c;
  }
  return out;
}

// NaN where there is none.
double value_of(const nlohmann::json& image, const char* key) {
  const auto at = [&](const char* name) {
    const auto found = image.find(name);
    return found != image.end() && found->is_number() ? found->get<double>() : std::numeric_limits<double>::quiet_NaN();
  };
  // A picture that was compared has a PSNR; JSON cannot say infinite.
  if (key == std::string("psnr") && image.contains(key) && image.at(key).is_null() && !std::isnan(at("mape")))
    return std::numeric_limits<double>::infinity();
  return at(key);
}

// Whether no other picture has a better value, where there is more than one picture.
bool is_best(const nlohmann::json& images, const nlohmann::json& image, const MetricColumn& column) {
  const double own = value_of(image, column.key);
  if (images.size() < 2 || column.better == Better::none || std::isnan(own)) return false;
  return std::none_of(images.begin(), images.end(), [&](const nlohmann::json& other) {
    const double value = value_of(other, column.key);
    return column.better == Better::lower ? value < own : value > own;
  });
}

}  // namespace

std::span<const MetricColumn> metric_columns() { return kColumns; }

std::string cell_text(const nlohmann::json& image, const char* key, const char* missing, const char* infinite) {
  const double value = value_of(image, key);
  if (std::isnan(value)) return missing;
  if (std::isinf(value)) return infinite;
  return image.at(key).is_number_integer() ? format_count(image.at(key).get<long long>())
                                           : fmt::format("{:.4g}", value);
}

std::string csv_table(const nlohmann::json& images) {
  std::string out = "image";
  for (const MetricColumn& column : kColumns) out += fmt::format(",{}", column.key);
  out += "\n";
  for (const nlohmann::json& image : images) {
    out += csv_cell(image.at("image").get<std::string>());
    for (const MetricColumn& column : kColumns) {
      const nlohmann::json& value = image.at(column.key);
      out += ',';
      out += value.is_null() ? cell_text(image, column.key, "") : value.dump();
    }
    out += "\n";
  }
  return out;
}

std::string latex_table(const nlohmann::json& images) {
  std::string head = "image", rows;
  for (const MetricColumn& column : kColumns) head += fmt::format(" & {}", column.title);
  for (const nlohmann::json& image : images) {
    rows += latex_text(image.at("image").get<std::string>());
    for (const MetricColumn& column : kColumns) {
      const std::string text = cell_text(image, column.key, "--", "$\\infty$");
      const bool best = is_best(images, image, column);
      rows += fmt::format(" & {}{}{}", best ? "\\textbf{" : "", text, best ? "}" : "");
    }
    rows += " \\\\\n";
  }
  return fmt::format("\\begin{{tabular}}{{l{}}}\n\\hline\n{} \\\\\n\\hline\n{}\\hline\n\\end{{tabular}}\n",
                     std::string(std::size(kColumns), 'r'), head, rows);
}

std::string html_table(const nlohmann::json& images) {
  std::string out = "<div class=\"scroll\"><table>\n<thead><tr><th>image</th>";
  for (const MetricColumn& column : kColumns) out += fmt::format("<th>{}</th>", column.title);
  out += "</tr></thead>\n<tbody>\n";
  for (const nlohmann::json& image : images) {
    out += fmt::format("<tr><td>{}</td>", markup_text(image.at("image").get<std::string>()));
    for (const MetricColumn& column : kColumns) {
      out += fmt::format("<td{}>{}</td>", is_best(images, image, column) ? " class=\"best\"" : "",
                         cell_text(image, column.key, "–", "∞"));
    }
    out += "</tr>\n";
  }
  return out + "</tbody>\n</table></div>\n";
}

}  // namespace octrad::report
