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
// "0.01234", "1,000", or `missing` for null.
std::string number_text(const nlohmann::json& value, const char* missing = "-");

// Tables of what `compare --json` has for each picture ("image" is its name, a column may be null): CSV (RFC 4180), a
// LaTeX tabular, a table of HTML. In the last two the best values are bold.
std::string csv_table(const nlohmann::json& images);
std::string latex_table(const nlohmann::json& images);
std::string html_table(const nlohmann::json& images);

}  // namespace octrad::report
