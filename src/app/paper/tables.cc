// The tables of the report, as HTML, LaTeX and CSV.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "app/paper/published.h"
#include "app/paper/report.h"
#include "octrad/base/bytes.h"
#include "octrad/base/escape.h"

namespace octrad::paper {

namespace {

using nlohmann::json;

// The entries of results.json that stand in one place of a matrix.
std::vector<const json*> find_cells(const json& results, const std::string& matrix, const std::string& equal,
                                    const std::string& scene, const std::string& method,
                                    const std::string& switch_name) {
  std::vector<const json*> found;
  for (const json& cell : results["cells"]) {
    if (cell["scene"] != scene || cell["method"] != method) continue;
    for (const json& place : cell["places"]) {
      if (place["matrix"] == matrix && place["equal"] == equal && place["switch"] == switch_name) {
        found.push_back(&cell);
        break;
      }
    }
  }
  return found;
}

// Mean of a number over entries; null where one lacks it.
json mean(const std::vector<const json*>& cells, const char* key) {
  double sum = 0.0;
  for (const json* cell : cells) {
    const json value = cell->value(key, json());
    if (!value.is_number()) return nullptr;
    sum += value.get<double>();
  }
  return cells.empty() ? json() : json(sum / static_cast<double>(cells.size()));
}

json megabytes(const json& bytes) {
  return bytes.is_number() && bytes.get<double>() > 0 ? json(bytes.get<double>() / 1e6) : json();
}
json above_zero(const json& value) { return value.is_number() && value.get<double>() > 0 ? value : json(); }

const PublishedCell* published(const std::string& method, const std::string& scene) {
  for (const PublishedCell& c : published_cells()) {
    if (method == c.method && scene == c.scene) return &c;
  }
  return nullptr;
}

const PublishedSwitch* published_switch(const std::string& matrix, const std::string& name) {
  for (const PublishedSwitch& s : published_switches()) {
    if (matrix == s.matrix && name == s.name) return &s;
  }
  return nullptr;
}

std::string equal_title(const std::string& equal) {
  return equal == "seconds" ? "equal seconds of training"
         : equal == "steps" ? "equal steps of training"
                            : "equal bytes of the model, equal seconds";
}

// A row is a method or a switch of it.
struct RowKey {
  const Method* method;
  std::string switch_name, title;
};

std::vector<RowKey> rows_of(const Matrix& m) {
  std::vector<RowKey> rows;
  for (const Method* method : m.methods) {
    for (const Switch& s : m.switches) {
      if (*method->field == '\0' && &s != &m.switches.front()) continue;
      std::string title = s.name.empty()         ? method->title
                          : m.methods.size() > 1 ? fmt::format("{}, {}", method->title, s.name)
                                                 : s.name;
      rows.push_back({method, s.name, title});
    }
  }
  return rows;
}

std::vector<std::string> scenes_of(const json& results, const std::string& matrix) {
  std::vector<std::string> scenes;
  for (const json& cell : results["cells"]) {
    for (const json& place : cell["places"]) {
      if (place["matrix"] == matrix && std::find(scenes.begin(), scenes.end(), cell["scene"]) == scenes.end())
        scenes.push_back(cell["scene"]);
    }
  }
  return scenes;
}

std::string anchor_of(const std::vector<const json*>& cells) {
  return cells.empty() ? "" : cell_anchor(*cells.front());
}

// The paper's table: a few figures of every scene.
Table summary(const Matrix& m, const json& results, const std::string& equal, const std::vector<std::string>& scenes) {
  Table t;
  t.matrix = m.name;
  t.name = fmt::format("{}-{}", m.name, equal);
  t.title = fmt::format("{}: {}", m.title, equal_title(equal));
  for (const std::string& scene : scenes) {
    for (const auto& [title, better] : {std::pair{"MAPE", -1}, {"glossy", -1}, {"LPIPS", -1}, {"ms", -1}})
      t.columns.push_back({scene, title, better, false});
  }
  for (const RowKey& key : rows_of(m)) {
    Table::Row row{key.title, "", {}};
    bool any = false;
    for (const std::string& scene : scenes) {
      const auto cells = find_cells(results, m.name, equal, scene, key.method->name, key.switch_name);
      any |= !cells.empty();
      if (row.anchor.empty()) row.anchor = anchor_of(cells);
      for (const char* metric : {"mape", "mape_glossy", "lpips", "frame_ms"}) row.values.push_back(mean(cells, metric));
    }
    if (any) t.rows.push_back(row);
  }
  return t;
}

// Everything of one scene, with the published figures in columns of their own.
Table details(const Matrix& m, const json& results, const std::string& equal, const std::string& scene) {
  Table t;
  t.matrix = m.name;
  t.name = fmt::format("{}-{}-{}", m.name, equal, scene);
  t.title = fmt::format("{}, {}", scene, equal_title(equal));
  const bool ablation = m.switches.size() > 1;
  const char* marked = "published";
  t.columns = {{"", "MAPE", -1, false},
               {marked, "MAPE", 0, true},
               {"", "trimmed", -1, false},
               {"", "glossy", -1, false},
               {"", "LPIPS", -1, false},
               {marked, "LPIPS", 0, true},
               {"", "FLIP", -1, false},
               {"", "SSIM", 1, false},
               {"", "relMSE (noise-free, over R² + 0.01²)", -1, false},
               {"", "mean ratio", 0, false},
               {"", "frame ms", -1, false},
               {marked, "ms", 0, true},
               {"", "training s", 0, false},
               {"", "steps", 0, false},
               {"", "MB", 0, false}};
  const bool with_entries = ablation && std::any_of(published_switches().begin(), published_switches().end(),
                                                    [&](const auto& p) { return m.name == p.matrix && p.entries > 0; });
  if (with_entries) {
    t.columns.push_back({"", "entries", 0, false});
    t.columns.push_back({marked, "entries", 0, true});
  }
  bool any_published = false;
  for (const RowKey& key : rows_of(m)) {
    const auto cells = find_cells(results, m.name, equal, scene, key.method->name, key.switch_name);
    if (cells.empty()) continue;
    json mape, lpips, ms, entries;
    if (const PublishedSwitch* p = ablation ? published_switch(m.name, key.switch_name) : nullptr) {
      mape = p->mape;
      lpips = p->lpips;
      if (p->entries > 0) entries = p->entries;
    } else if (const PublishedCell* c = ablation ? nullptr : published(key.method->name, scene)) {
      mape = c->mape;
      lpips = c->lpips;
      ms = c->ms;
    }
    any_published |= mape.is_number();
    std::string name = key.title;
    for (const json* cell : cells) {
      if (cell->at("status") != "done") {
        name += fmt::format(" ({})", cell->at("status").get<std::string>());
        break;
      }
    }
    t.rows.push_back(
        {name,
         anchor_of(cells),
         {mean(cells, "mape"), mape, mean(cells, "mape_trimmed"), mean(cells, "mape_glossy"), mean(cells, "lpips"),
          lpips, mean(cells, "flip"), mean(cells, "ssim"), mean(cells, "relmse_noise_free"), mean(cells, "mean_ratio"),
          mean(cells, "frame_ms"), ms, above_zero(mean(cells, "seconds")), above_zero(mean(cells, "steps")),
          megabytes(mean(cells, "bytes"))}});
    if (with_entries)
      t.rows.back().values.insert(t.rows.back().values.end(), {above_zero(mean(cells, "entries")), entries});
  }
  if (any_published)
    t.note = kPublishedHow +
             std::string(ablation ? "; the paper names Bathroom for the levels, and no scene for the ablations"
                                  : "; for the paper's scene of this name");
  else {
    for (std::size_t c = t.columns.size(); c-- > 0;) {
      if (!t.columns[c].published) continue;
      t.columns.erase(t.columns.begin() + static_cast<std::ptrdiff_t>(c));
      for (Table::Row& row : t.rows) row.values.erase(row.values.begin() + static_cast<std::ptrdiff_t>(c));
    }
  }
  return t;
}

// What a frame's milliseconds are made of.
Table stages(const Matrix& m, const json& results, const std::string& equal, const std::string& scene) {
  Table t;
  t.matrix = m.name;
  t.name = fmt::format("{}-{}-{}-stages", m.name, equal, scene);
  t.title = fmt::format("{}: milliseconds of a frame by stage, first view", scene);
  const std::vector<RowKey> rows = rows_of(m);
  std::vector<const json*> cells;
  for (const RowKey& key : rows) {
    const auto found = find_cells(results, m.name, equal, scene, key.method->name, key.switch_name);
    cells.push_back(found.empty() || !found.front()->contains("stages_ms") ? nullptr : found.front());
    if (!cells.back()) continue;
    for (const auto& [stage, ms] : cells.back()->at("stages_ms").items()) {
      if (std::none_of(t.columns.begin(), t.columns.end(),
                       [&, name = stage](const auto& c) { return c.title == name; }))
        t.columns.push_back({"", stage, 0, false});
    }
  }
  for (const char* total : {"frame", "samples a pixel"}) t.columns.push_back({"", total, 0, false});
  for (std::size_t r = 0; r < rows.size(); ++r) {
    if (!cells[r]) continue;
    Table::Row row{rows[r].title, cell_anchor(*cells[r]), {}};
    for (const Table::Column& c : t.columns) row.values.push_back(cells[r]->at("stages_ms").value(c.title, json()));
    row.values[row.values.size() - 2] = cells[r]->at("frame_ms");
    row.values.back() = cells[r]->at("frame_spp");
    t.rows.push_back(row);
  }
  return t;
}

// Where the error is: by the roughness of what a pixel sees, and how many standard errors of both pictures the means
// of blocks of pixels are off (1: noise alone).
Table by_roughness(const Matrix& m, const json& results, const std::string& equal, const std::string& scene) {
  Table t;
  t.matrix = m.name;
  t.name = fmt::format("{}-{}-{}-roughness", m.name, equal, scene);
  t.title = fmt::format("{}: MAPE by the roughness of the first hit, and bias of blocks, first view", scene);
  for (const RowKey& key : rows_of(m)) {
    const auto cells = find_cells(results, m.name, equal, scene, key.method->name, key.switch_name);
    if (cells.empty() || !cells.front()->value("by_roughness", json()).is_array()) continue;
    const json& cell = *cells.front();
    Table::Row row{key.title, cell_anchor(cell), {}};
    for (const json& bin : cell["by_roughness"]) {
      const std::string title =
          bin["below"].is_number() ? fmt::format("below {}", bin["below"].get<double>()) : "above";
      if (t.rows.empty()) t.columns.push_back({"roughness", title, -1, false});
      row.values.push_back(bin["mape"]);
    }
    row.values.push_back(cell.value("/blocks/z_rms"_json_pointer, json()));
    t.rows.push_back(row);
  }
  t.columns.push_back({"blocks", "z", 0, false});  // in units of its own noise
  return t;
}

std::string latex_text(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '_' || c == '&' || c == '%' || c == '#' || c == '$') out += '\\';
    out += c;
  }
  return out;
}

}  // namespace

std::string figure(const json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (!value.is_number()) return "-";
  const double v = value.get<double>();
  if (!std::isfinite(v)) return "-";
  return format_three_digits(v);
}

std::string cell_anchor(const json& cell) {
  const std::string folder = cell["folder"];
  return "cell-" + folder.substr(folder.rfind('.') + 1);
}

bool Table::best(std::size_t row, std::size_t column) const {
  const int better = columns[column].better;
  const json& own = rows[row].values[column];
  if (better == 0 || !own.is_number()) return false;
  std::size_t others = 0;
  for (const Row& other : rows) {
    const json& value = other.values[column];
    if (!value.is_number()) continue;
    if (value.get<double>() < 0.0) return false;  // an estimate that is all noise
    ++others;
    if ((value.get<double>() - own.get<double>()) * better > 0) return false;
  }
  return others > 1;
}

std::vector<Table> make_tables(const Plan& plan, const json& results) {
  std::vector<Table> tables;
  for (const Matrix& m : plan.matrices) {
    const auto add = [&](Table&& t) {
      if (m.switches.size() > 1) t.row_title = "switch";
      if (!t.rows.empty()) tables.push_back(std::move(t));
    };
    const std::vector<std::string> scenes = scenes_of(results, m.name);
    for (const Equal e : m.equal) {
      add(summary(m, results, equal_name(e), scenes));
      for (const std::string& scene : scenes) {
        add(details(m, results, equal_name(e), scene));
        if (e != m.equal.front()) continue;
        add(by_roughness(m, results, equal_name(e), scene));
        add(stages(m, results, equal_name(e), scene));
      }
    }
  }
  return tables;
}

std::string table_html(const Table& t) {
  const bool grouped = std::any_of(t.columns.begin(), t.columns.end(), [](const auto& c) { return !c.group.empty(); });
  std::string out = "<div class=\"wide\"><table>\n<thead>";
  if (grouped) {
    out += "<tr><th></th>";
    for (std::size_t c = 0; c < t.columns.size();) {
      std::size_t end = c;
      while (end < t.columns.size() && t.columns[end].group == t.columns[c].group) ++end;
      out += fmt::format("<th colspan=\"{}\"{}>{}</th>", end - c,
                         t.columns[c].published       ? " class=\"published\""
                         : t.columns[c].group.empty() ? ""
                                                      : " class=\"group\"",
                         markup_text(t.columns[c].group));
      c = end;
    }
    out += "</tr>";
  }
  out += fmt::format("<tr><th>{}</th>", markup_text(t.row_title));
  for (const Table::Column& c : t.columns)
    out += fmt::format("<th{}>{}{}</th>", c.published ? " class=\"published\"" : "", markup_text(c.title),
                       c.better < 0   ? " ↓"
                       : c.better > 0 ? " ↑"
                                      : "");
  out += "</tr></thead>\n<tbody>";
  for (std::size_t r = 0; r < t.rows.size(); ++r) {
    const Table::Row& row = t.rows[r];
    const std::string name = markup_text(row.name);
    out +=
        "\n<tr><td>" + (row.anchor.empty() ? name : fmt::format("<a href=\"#{}\">{}</a>", row.anchor, name)) + "</td>";
    for (std::size_t c = 0; c < row.values.size(); ++c) {
      const char* kind = t.columns[c].published      ? " class=\"published\""
                         : t.best(r, c)              ? " class=\"best\""
                         : row.values[c].is_string() ? " class=\"text\""
                                                     : "";
      out += fmt::format("<td{}>{}</td>", kind, markup_text(figure(row.values[c])));
    }
    out += "</tr>";
  }
  out += "\n</tbody></table></div>\n";
  if (!t.note.empty()) out += fmt::format("<p class=\"note\">{}</p>\n", markup_text(t.note));
  return out;
}

std::string table_latex(const Table& t) {
  std::string out =
      fmt::format("% {}\n{}\\begin{{tabular}}{{l{}}}\n\\toprule\n", t.title,
                  t.note.empty() ? "" : fmt::format("% {}\n", t.note), std::string(t.columns.size(), 'c'));
  const bool grouped = std::any_of(t.columns.begin(), t.columns.end(), [](const auto& c) { return !c.group.empty(); });
  if (grouped) {
    for (std::size_t c = 0; c < t.columns.size();) {
      std::size_t end = c;
      while (end < t.columns.size() && t.columns[end].group == t.columns[c].group) ++end;
      out += fmt::format(" & \\multicolumn{{{}}}{{c}}{{{}}}", end - c, latex_text(t.columns[c].group));
      c = end;
    }
    out += " \\\\\n";
  }
  out += latex_text(t.row_title);
  for (const Table::Column& c : t.columns)
    out += " & " + latex_text(c.title) + (c.better < 0 ? " $\\downarrow$" : c.better > 0 ? " $\\uparrow$" : "");
  out += " \\\\\n\\midrule\n";
  for (std::size_t r = 0; r < t.rows.size(); ++r) {
    out += latex_text(t.rows[r].name);
    for (std::size_t c = 0; c < t.rows[r].values.size(); ++c) {
      const std::string value = latex_text(figure(t.rows[r].values[c]));
      const std::string style = t.best(r, c) ? "\\textbf" : t.columns[c].published ? "\\textit" : "";
      out += style.empty() ? fmt::format(" & {}", value) : fmt::format(" & {}{{{}}}", style, value);
    }
    out += " \\\\\n";
  }
  return out + "\\bottomrule\n\\end{tabular}\n";
}

std::string table_markdown(const Table& t) {
  std::string out =
      fmt::format("{}.{}\n\n| {} |", t.title, t.note.empty() ? "" : fmt::format(" {}.", t.note), t.row_title);
  std::string rule = "\n|---|";
  for (const Table::Column& c : t.columns) {
    out += fmt::format(" {}{}{} |", c.group.empty() ? "" : c.group + ": ", c.title,
                       c.better < 0   ? " ↓"
                       : c.better > 0 ? " ↑"
                                      : "");
    rule += "---|";
  }
  out += rule + "\n";
  for (std::size_t r = 0; r < t.rows.size(); ++r) {
    out += fmt::format("| {} |", t.rows[r].name);
    for (std::size_t c = 0; c < t.columns.size(); ++c) {
      const char* style = t.best(r, c) ? "**" : t.columns[c].published ? "*" : "";
      out += fmt::format(" {}{}{} |", style, figure(t.rows[r].values[c]), style);
    }
    out += "\n";
  }
  return out;
}

std::string results_csv(const json& results) {
  static constexpr const char* kColumns[] = {"scene",
                                             "view",
                                             "method",
                                             "field",
                                             "switch",
                                             "seed",
                                             "status",
                                             "spp",
                                             "width",
                                             "height",
                                             "steps",
                                             "seconds",
                                             "bytes",
                                             "mape",
                                             "mape_trimmed",
                                             "mape_glossy",
                                             "lpips",
                                             "flip",
                                             "ssim",
                                             "psnr",
                                             "mse",
                                             "relmse",
                                             "relmse_noise_free",
                                             "mean_ratio",
                                             "frame_spp",
                                             "frame_ms"};
  std::string out = "matrix,equal";
  for (const char* column : kColumns) out += std::string(",") + column;
  out += "\n";
  for (const json& cell : results["cells"]) {
    for (const json& place : cell["places"]) {
      out += place["matrix"].get<std::string>() + "," + place["equal"].get<std::string>();
      for (const char* column : kColumns) {
        const json value = column == std::string("switch") ? place["switch"] : cell.value(column, json());
        out += fmt::format(",{}", value.is_string() ? value.get<std::string>() : value.is_null() ? "" : value.dump());
      }
      out += "\n";
    }
  }
  return out;
}

}  // namespace octrad::paper
