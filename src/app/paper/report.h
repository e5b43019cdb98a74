// What a run leaves: results.json, tables as CSV, LaTeX and Markdown, and a page that needs nothing beside itself.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "app/paper/plan.h"
#include "app/paper/store.h"

namespace octrad::paper {

// results.json (docs/formats.md) of what is there so far, written and returned. `head`: program, budget, machine.
nlohmann::json write_results(const Store& store, const Plan& plan, const nlohmann::json& head);

// index.html, results.csv, tables/*.tex and tables/*.md from it. `viewers`: the page's pictures can be flipped and
// zoomed, which is two thirds of its bytes.
void write_report(const Store& store, const Plan& plan, const nlohmann::json& results, bool viewers);

// A table of the report. Its numbers are means over views and seeds.
struct Table {
  struct Column {
    std::string group;  // a scene, or ""
    std::string title;
    int better = 0;  // -1: smaller values, 1: larger ones, 0: neither
    bool published = false;
  };
  struct Row {
    std::string name;
    std::string anchor;                  // of the commands in the appendix of the page; may be empty
    std::vector<nlohmann::json> values;  // numbers, texts, or null where there is none
  };
  std::string matrix, name, title, note;  // name: of its file; the last two for people
  std::string row_title = "method";
  std::vector<Column> columns;
  std::vector<Row> rows;

  // Whether the value is the best of its column.
  bool best(std::size_t row, std::size_t column) const;
};
std::vector<Table> make_tables(const Plan& plan, const nlohmann::json& results);
std::string table_html(const Table& table);
std::string table_latex(const Table& table);
std::string table_markdown(const Table& table);
std::string results_csv(const nlohmann::json& results);

// A value as tables show it: numbers with three significant digits, "-" for null.
std::string figure(const nlohmann::json& value);
// Commands, as they are and behind a click.
std::string command_list(const std::vector<std::string>& commands);
std::string command_details(const std::vector<std::string>& commands);
// "cell-..." of a cell's entry in results.json: where its commands stand on the page.
std::string cell_anchor(const nlohmann::json& cell);

}  // namespace octrad::paper
