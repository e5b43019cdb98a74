// Tables of metrics for people and programs.
#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>

namespace octrad::report {

// The metrics in the order in which tables have them.
struct MetricColumn {
  const char* key;    // in JSON and CSV
  const char* title;  // for people
  enum class Better { lower, higher, none } better;
};
std::span<const MetricColumn> metric_columns();
// The cell of a column in such an object as `compare --json` has for a picture: "0.01234", "1,000", `missing` for null;
// `infinite` for the PSNR of pictures that show the same, which JSON cannot say.
std::string cell_text(const nlohmann::json& image, const char* key, const char* missing = "-",
                      const char* infinite = "inf");

// Tables of such objects ("image" is the picture's name): CSV (RFC 4180), a
// LaTeX tabular, a table of HTML. In the last two the best values are bold.
std::string csv_table(const nlohmann::json& images);
std::string latex_table(const nlohmann::json& images);
std::string html_table(const nlohmann::json& images);

}  // namespace octrad::report
