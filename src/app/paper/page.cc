// index.html: the report for people. One file that needs nothing beside itself.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "app/paper/page_style.h"
#include "app/paper/pictures.h"
#include "app/paper/plot.h"
#include "app/paper/report.h"
#include "app/report/image_page.h"
#include "octrad/base/duration.h"
#include "octrad/base/escape.h"
#include "octrad/base/join.h"

namespace octrad::paper {

namespace {

using nlohmann::json;

std::string method_title(const std::string& name) {
  const Method* method = find_method(name);
  return method ? method->title : name;
}

bool in_matrix(const json& cell, const std::string& matrix, const std::string& equal) {
  return std::any_of(cell["places"].begin(), cell["places"].end(),
                     [&](const json& p) { return p["matrix"] == matrix && p["equal"] == equal; });
}

std::string switch_in(const json& cell, const std::string& matrix) {
  for (const json& p : cell["places"]) {
    if (p["matrix"] == matrix) return p["switch"];
  }
  return "";
}

std::string head_text(const Plan& plan, const json& results) {
  const json& machine = results["machine"];
  std::string out =
      fmt::format("<p>{}; {} ({} cores, {} threads used), device {}.</p>\n", markup_text(results["program"]),
                  markup_text(machine.value("cpu", "?")), machine.value("cores", 0), machine.value("threads", 0),
                  markup_text(machine["auto"].value("device", "cpu")));
  if (results["budget"].is_string() && plan.scale.factor < 1.0) {
    out += fmt::format(
        "<p class=\"scaled\"><b>Scaled down</b> to a budget of {} for everything: training time, and steps times batch, by {:.3g}; batches by {:.3g}; "
        "widths of pictures by {:.3g}, samples of references by {:.3g}; for all methods alike. Full-size figures differ.</p>\n",
        markup_text(results["budget"]), plan.scale.factor, plan.scale.batch(), std::pow(plan.scale.factor, 0.25),
        std::sqrt(plan.scale.factor));
  }
  out += "<ul>";
  for (const json& m : results["matrices"]) {
    out += fmt::format(
        "<li><a href=\"#{0}\">{1}</a> ({0}): preset {2}, {3} or {4} steps a training (full size), pictures {5} pixels wide, references of {6} samples a pixel, seeds {7}.</li>\n",
        markup_text(m["name"]), markup_text(m["title"]), markup_text(m["preset"]), format_duration(m["time"]),
        m["steps"].get<long long>(), m["width_used"].get<int>(), m["reference_spp_used"].get<int>(), m["seeds"].dump());
  }
  std::map<std::string, int> counts;
  for (const json& cell : results["cells"]) ++counts[cell["status"].get<std::string>()];
  out += "</ul>\n<p>Pictures:";
  for (const auto& [status, count] : counts) out += fmt::format(" {} {}", count, status);
  return out + ".</p>\n";
}

// What is missing, with the sentence why: once for each sentence.
std::string missing(const json& results) {
  std::map<std::string, std::set<std::string>> why;
  for (const json& cell : results["cells"]) {
    const std::string status = cell["status"];
    if (status == "done") continue;
    why[fmt::format("{}: {}", status, cell["message"].get<std::string>())].insert(
        fmt::format("{} in {}", cell["method"].get<std::string>(), cell["scene"].get<std::string>()));
  }
  if (why.empty()) return "";
  std::string out = "<h2 id=\"missing\">What is missing</h2>\n<ul>";
  for (const auto& [message, cells] : why)
    out += fmt::format("<li>{} ({})</li>\n", markup_text(message), markup_text(join(cells)));
  return out + "</ul>\n";
}

std::vector<std::string> method_names() {
  std::vector<std::string> names;
  for (const Method& m : methods()) names.push_back(m.title);
  return names;
}

// Error against seconds of training (caches) or rendering (path tracing), a plot a scene.
std::string convergence_plots(const json& results, const Matrix& m) {
  std::string out;
  std::vector<std::string> scenes;
  for (const json& cell : results["cells"]) {
    if (in_matrix(cell, m.name, equal_name(m.equal.front())) &&
        std::find(scenes.begin(), scenes.end(), cell["scene"]) == scenes.end())
      scenes.push_back(cell["scene"]);
  }
  for (const std::string& scene : scenes) {
    std::vector<Series> series;
    std::vector<std::string> names = method_names(), commands;
    std::set<std::string> done;
    for (const json& cell : results["cells"]) {
      if (cell["scene"] != scene || !cell.contains("training") || !in_matrix(cell, m.name, equal_name(m.equal.front())))
        continue;
      const std::string folder = cell["training"];
      if (!done.insert(folder).second) continue;
      for (const json& t : results["trainings"]) {
        if (t["folder"] != folder || !t.contains("convergence")) continue;
        const std::string sw = switch_in(cell, m.name);
        Series s{sw.empty() ? method_title(t["field"]) : sw, {}, true};
        if (m.seeds.size() > 1) s.name += fmt::format(" (seed {})", cell["seed"].get<long long>());
        if (std::find(names.begin(), names.end(), s.name) == names.end()) names.push_back(s.name);
        for (const json& p : t["convergence"]) s.points.emplace_back(p[0], p[2]);
        series.push_back(s);
        commands.push_back(t["command"]);
      }
    }
    for (const json& path : results["path"]) {
      if (path["scene"] != scene) continue;
      Series s{method_title("path"), {}, true};
      for (const json& p : path["points"]) {
        s.points.emplace_back(p["seconds"], p["mape"]);
        commands.push_back(p["command"]);
      }
      series.push_back(s);
    }
    const std::string svg = log_log_plot(series, names, "seconds of training; of rendering for path tracing", "MAPE");
    if (svg.empty()) continue;
    out += fmt::format(
        "<figure class=\"plotted\">{}<figcaption>{}: error against time, first view; pixels of the reference that training compares with.{}</figcaption></figure>\n",
        svg, markup_text(scene), command_details(commands));
  }
  return out.empty() ? "" : fmt::format("<h3>Error against seconds</h3>\n<div class=\"plots\">{}</div>\n", out);
}

// The cost beside the error: milliseconds a frame.
std::string cost_plots(const json& results, const Matrix& m) {
  if (m.methods.size() < 2) return "";
  const std::string equal = equal_name(m.equal.front());
  std::map<std::string, std::map<std::string, Series>> scenes;
  for (const json& cell : results["cells"]) {
    if (cell["status"] != "done" || !in_matrix(cell, m.name, equal) || !cell["mape"].is_number() ||
        !cell["frame_ms"].is_number())
      continue;
    const std::string title = method_title(cell["method"]);
    Series& s = scenes[cell["scene"]][title];
    s.name = title;
    s.line = false;
    s.points.emplace_back(cell["frame_ms"], cell["mape"]);
  }
  std::string out;
  for (const auto& [scene, methods_of] : scenes) {
    std::vector<Series> series;
    for (const std::string& name : method_names()) {
      if (const auto it = methods_of.find(name); it != methods_of.end()) series.push_back(it->second);
    }
    out += fmt::format(
        "<figure class=\"plotted\">{}<figcaption>{}: error against the time of a frame, a mark for each view and seed; the commands are those of the table's rows.</figcaption></figure>\n",
        log_log_plot(series, method_names(), "ms a frame", "MAPE"), markup_text(scene));
  }
  return out.empty() ? ""
                     : fmt::format("<h3>Error against the time of a frame</h3>\n<div class=\"plots\">{}</div>\n", out);
}

// How much the frames of a camera path flicker.
std::string flicker(const json& results, const Matrix& m) {
  if (m.temporal_frames == 0) return "";
  std::string out;
  std::map<std::string, Table> tables;
  std::map<std::string, std::vector<std::string>> commands;
  for (const json& cell : results["cells"]) {
    if (!cell["temporal"].is_number() || !in_matrix(cell, m.name, equal_name(m.equal.front()))) continue;
    Table& t = tables[cell["scene"]];
    t.columns = {
        {"", "mean |ΔI − ΔR|", -1, false}, {"", "as displayed", -1, false}, {"", "MAPE of a picture", -1, false}};
    const std::string sw = switch_in(cell, m.name);
    t.rows.push_back({sw.empty() ? method_title(cell["method"]) : sw,
                      cell_anchor(cell),
                      {cell["temporal"], cell["temporal_displayed"], cell["mape"]}});
    for (const auto& [key, command] : cell["commands"]["temporal"].items()) {
      std::vector<std::string>& list = commands[cell["scene"]];
      if (std::find(list.begin(), list.end(), command) == list.end()) list.push_back(command);
    }
  }
  for (const auto& [scene, table] : tables)
    out += fmt::format("<h4>{}</h4>\n{}{}", markup_text(scene), table_html(table), command_details(commands[scene]));
  if (out.empty()) return "";
  return fmt::format(
             "<h3>Flicker</h3>\n<p>Mean absolute difference of the changes from frame to frame to those of the reference, over {} frames of a moving camera.</p>\n",
             m.temporal_frames) +
         out;
}

// The views of a matrix: name, heading, and the pictures.
struct ViewFigure {
  std::string name, heading;
  double pixels = 0.0;
  int side = 0;
  std::vector<ViewPicture> pictures;
};

std::vector<ViewFigure> view_figures(const Plan& plan, const json& results, const Matrix& m) {
  std::vector<ViewFigure> figures;
  const std::string equal = equal_name(m.equal.front());
  for (const Reference& reference : plan.references) {
    const std::string scene = plan.scenes[reference.scene].name;
    ViewFigure figure_of{m.name + "-" + scene + "-" + reference.view.name,
                         scene + ", " + reference.view.name,
                         0.0,
                         std::max(reference.view.width, reference.view.height),
                         {}};
    figure_of.pictures.push_back({"reference", fmt::format("path tracing, {} spp", 2 * reference.half_spp),
                                  fmt::format("reference-{}-{}", scene, reference.view.name), reference.picture()});
    for (const json& cell : results["cells"]) {
      if (cell["status"] != "done" || cell["scene"] != scene || cell["reference"] != reference.picture() ||
          cell["seed"] != m.seeds.front() || !in_matrix(cell, m.name, equal))
        continue;
      const std::string sw = switch_in(cell, m.name);
      figure_of.pictures.push_back(
          {sw.empty() ? method_title(cell["method"]) : sw,
           fmt::format("MAPE {}, glossy {}, LPIPS {}, {} ms", figure(cell["mape"]), figure(cell["mape_glossy"]),
                       figure(cell["lpips"]), figure(cell["frame_ms"])),
           cell_anchor(cell), cell["picture"]});
    }
    figure_of.pixels = static_cast<double>(reference.view.width) * reference.view.height *
                       static_cast<double>(figure_of.pictures.size());
    if (figure_of.pictures.size() > 1) figures.push_back(std::move(figure_of));
  }
  return figures;
}

// Viewers take 8 bytes a pixel: pictures are made smaller by a whole factor where those of a report are more than 36
// MB.
int viewer_factor(const Plan& plan, const json& results) {
  double pixels = 0.0;
  for (const Matrix& m : plan.matrices) {
    for (const ViewFigure& f : view_figures(plan, results, m)) pixels += f.pixels;
  }
  return std::max(1, static_cast<int>(std::ceil(std::sqrt(8.0 * pixels / 36e6))));
}

// `factor`: of viewer_factor(); none: no viewers.
std::string picture_figures(const Store& store, const Plan& plan, const json& results, const Matrix& m,
                            std::optional<int> factor) {
  std::string out;
  for (const ViewFigure& f : view_figures(plan, results, m)) {
    std::optional<int> side;
    if (factor) side = *factor > 1 ? f.side / *factor : 0;
    out += fmt::format("<h4>{}</h4>\n{}", markup_text(f.heading), view_figure(store, f.name, f.pictures, side));
  }
  return out.empty() ? "" : "<h3>Pictures</h3>\n" + out;
}

std::string learned(const Store& store, const json& results) {
  std::string out;
  for (const json& one : results["learned"]) {
    const std::string scene = one["scene"];
    out += fmt::format("<h3>{}</h3>\n", markup_text(scene));
    std::vector<ViewPicture> disparity, features;
    std::vector<std::string> disparity_commands, feature_commands;
    for (const json& p : one["pictures"]) {
      const std::string integrator = p["integrator"];
      const bool is_feature = integrator.rfind("features", 0) == 0;
      (is_feature ? features : disparity)
          .push_back({is_feature               ? "level " + integrator.substr(8)
                      : integrator == "traced" ? "traced disparity"
                                               : "predicted disparity",
                      "", "", p["picture"]});
      (is_feature ? feature_commands : disparity_commands).push_back(p["command"]);
    }
    out += "<h4>Disparity</h4>\n" + quantity_figure(store, "disparity-" + scene, disparity) +
           command_details(disparity_commands);
    out += "<h4>Features of each level: first three principal components</h4>\n" +
           color_figure(store, "features-" + scene, features) + command_details(feature_commands);
    Table t;
    t.row_title = "level";
    for (const char* title : {"cells an axis", "octahedral resolution", "cells", "entries", "MB"})
      t.columns.push_back({"", title, 0, false});
    double entries = 0, bytes = 0;
    for (const json& level : one["levels"]) {
      t.rows.push_back({std::to_string(level["level"].get<int>()),
                        "",
                        {level["spatial_resolution"], level["octahedral_resolution"], level["cells"], level["entries"],
                         level["bytes"].get<double>() / 1e6}});
      entries += level["entries"].get<double>();
      bytes += level["bytes"].get<double>();
    }
    t.rows.push_back({"all", "", {nullptr, nullptr, nullptr, entries, bytes / 1e6}});
    out += "<h4>Levels</h4>\n" + table_html(t) + command_details({one["levels_command"]});
  }
  return out.empty() ? "" : "<h2 id=\"learned\">What the OctaOctree learned</h2>\n" + out;
}

std::string references(const json& results) {
  Table t;
  t.row_title = "view";
  for (const char* title : {"spp", "own MAPE", "own relMSE", "seconds"}) t.columns.push_back({"", title, 0, false});
  std::string anchors;
  for (const json& r : results["references"]) {
    const std::string anchor = "reference-" + r["scene"].get<std::string>() + "-" + r["view"].get<std::string>();
    const json noise = r.value("noise", json::object());
    t.rows.push_back(
        {r["scene"].get<std::string>() + ", " + r["view"].get<std::string>(),
         anchor,
         {r["spp"], noise.value("mape", json()), noise.value("relmse", json()), r.value("seconds", json())}});
    std::vector<std::string> commands;
    const json made = r.value("commands", json::object());
    for (const char* key : {"a", "b", "merge"}) {
      if (made.contains(key)) commands.push_back(made[key]);
    }
    anchors += fmt::format("<div id=\"{}\"><b>{}, {}</b>{}</div>\n", markup_text(anchor), markup_text(r["scene"]),
                           markup_text(r["view"]), command_list(commands));
  }
  return "<h2 id=\"references\">References</h2>\n<p>Path traced without a bound on depth, in two halves with different seeds; their difference tells the reference's own error, below which nothing can be "
         "measured.</p>\n" +
         table_html(t) + "<h3>Commands</h3>\n" + anchors;
}

std::string all_commands(const json& results) {
  std::string out =
      "<h2 id=\"commands\">Commands</h2>\n<p>Of every row and picture, as they ran in the folder of this report.</p>\n";
  std::set<std::string> done;
  for (const json& cell : results["cells"]) {
    const std::string anchor = cell_anchor(cell);
    const bool first = done.insert(anchor).second;
    std::vector<std::string> commands;
    for (const char* key : {"train", "render", "compare", "compare_glossy", "failed"}) {
      if (!cell["commands"].contains(key) || (!first && std::string(key) == "train")) continue;
      if (const std::string command = cell["commands"][key]; !command.empty()) commands.push_back(command);
    }
    const std::string sw = cell["switch"];
    out += fmt::format("<div{}><b>{}, {}, {}{}, seed {}</b>{}</div>\n", first ? " id=\"" + anchor + "\"" : "",
                       markup_text(cell["scene"]), markup_text(cell["view"]), markup_text(cell["method"]),
                       sw.empty() ? "" : " " + markup_text(sw), cell["seed"].get<long long>(), command_list(commands));
  }
  return out;
}

}  // namespace

std::string command_list(const std::vector<std::string>& commands) {
  std::string out;
  for (const std::string& command : commands) out += "<code>" + markup_text(command) + "</code>\n";
  return out.empty() ? "" : "<pre>" + out + "</pre>";
}

std::string command_details(const std::vector<std::string>& commands) {
  return commands.empty() ? ""
                          : fmt::format("<details><summary>commands</summary>{}</details>", command_list(commands));
}

void write_report(const Store& store, const Plan& plan, const json& results, bool viewers) {
  store.write_text("results.csv", results_csv(results));
  store.make_folder("tables");
  const std::vector<Table> tables = make_tables(plan, results);
  for (const Table& t : tables) {
    store.write_text("tables/" + t.name + ".tex", table_latex(t));
    store.write_text("tables/" + t.name + ".md", table_markdown(t));
  }

  std::string page = fmt::format(
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\n"
      "<title>octrad paper</title>\n{}<style>{}</style></head>\n<body>\n<h1>octrad paper</h1>\n",
      viewers ? report::viewer_head() : "", kPageStyle);
  page += head_text(plan, results);
  std::optional<int> factor;
  if (viewers) factor = viewer_factor(plan, results);
  for (const Matrix& m : plan.matrices) {
    page += fmt::format("<h2 id=\"{}\">{}</h2>\n<p>{}</p>\n", markup_text(m.name), markup_text(m.title),
                        markup_text(m.about));
    for (const Table& t : tables) {
      if (t.matrix != m.name) continue;
      page += fmt::format("<h3>{}</h3>\n{}", markup_text(t.title), table_html(t));
    }
    page += cost_plots(results, m) + convergence_plots(results, m) + flicker(results, m) +
            picture_figures(store, plan, results, m, factor);
  }
  page += learned(store, results) + missing(results) + references(results) + all_commands(results);
  page += fmt::format("<script>{}</script>\n</body></html>\n", kPageScript);
  store.write_text("index.html", page);
}

}  // namespace octrad::paper
