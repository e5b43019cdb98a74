#include "app/report/tables.h"

#include <fmt/format.h>

#include <optional>

#include "app/report/image_page.h"
#include "octrad/base/bytes.h"

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

// The best value of each column where there is more than one picture.
std::optional<double> best_of(const nlohmann::json& images, const MetricColumn& column) {
  std::optional<double> best;
  if (images.size() < 2 || column.better == Better::none) return best;
  for (const nlohmann::json& image : images) {
    const nlohmann::json& value = image.at(column.key);
    if (!value.is_number()) continue;
    const double v = value.get<double>();
    if (!best || (column.better == Better::lower ? v < *best : v > *best)) best = v;
  }
  return best;
}

bool is_best(const nlohmann::json& value, const std::optional<double>& best) {
  return best && value.is_number() && value.get<double>() == *best;
}

}  // namespace

std::span<const MetricColumn> metric_columns() { return kColumns; }

std::string number_text(const nlohmann::json& value, const char* missing) {
  return value.is_number_integer() ? format_count(value.get<long long>())
         : value.is_number()       ? fmt::format("{:.4g}", value.get<double>())
                                   : missing;
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
      if (!value.is_null()) out += value.dump();
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
      const nlohmann::json& value = image.at(column.key);
      const std::string text = number_text(value, "--");
      const bool best = is_best(value, best_of(images, column));
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
    out += fmt::format("<tr><td>{}</td>", html_text(image.at("image").get<std::string>()));
    for (const MetricColumn& column : kColumns) {
      const nlohmann::json& value = image.at(column.key);
      out += fmt::format("<td{}>{}</td>", is_best(value, best_of(images, column)) ? " class=\"best\"" : "",
                         number_text(value, "–"));
    }
    out += "</tr>\n";
  }
  return out + "</tbody>\n</table></div>\n";
}

}  // namespace octrad::report
