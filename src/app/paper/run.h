// `octrad paper`: everything of a plan that is not there yet, and then the report.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "app/paper/plan.h"

namespace octrad::paper {

struct PaperOptions {
  std::vector<std::string> matrices;  // names or files
  std::string scenes;                 // of choose_scenes()
  std::string output;                 // folder
  std::string references;             // folder that keeps them; "": in the output
  std::string budget;                 // a duration; "": the matrices as they are
  std::string only;                   // of select_cells()
  bool dry_run = false;
  bool no_viewers = false;                  // in the page
  std::string lpips_weights, oidn_library;  // of compare and render
  std::vector<std::string> common, device;  // options that all commands get, and those of train and render
};

struct PaperSummary {
  std::size_t done = 0, waiting = 0, unavailable = 0, failed = 0;  // cells
  double seconds = 0.0;
  bool interrupted = false;
  std::string first_failure;
  std::string plan;          // of a dry run, for people
  nlohmann::json plan_json;  // the same
};

// Throws IoError, InputError or UsageError when it cannot start or files cannot be written; what is finished stays.
// Cells that fail do not end it.
PaperSummary run_paper(const PaperOptions& options);

}  // namespace octrad::paper
