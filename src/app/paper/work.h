// The work that the cells of a plan are made of: the commands that make references, models, pictures and their errors,
// and what is kept of what they print. Files are named within the run's folder.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "app/paper/plan.h"
#include "app/paper/rates.h"
#include "app/paper/store.h"

namespace octrad::paper {

struct WorkOptions {
  std::vector<std::string> device;          // that train and render get
  std::string lpips_weights, oidn_library;  // of compare and render; "": none
};

// Whether it needs a library for denoising.
bool denoises(const Method& method);

class Work {
 public:
  // Plan and rates may change until the first of these is called. They throw CommandFailed, InputError, MemoryError,
  // Interrupted, and JSON's exception where a command printed something unexpected.
  Work(Store& store, const Plan& plan, const Rates& rates, WorkOptions options);

  void render_reference(const Reference& reference);
  void train(const Training& training);
  // The cell's pictures and their errors.
  void make_cell(const Cell& cell);
  // Pictures and tables of what the cell's model learned.
  void make_learned(const Cell& cell);
  // Frames along a camera path, path traced.
  void render_film(const Film& film);
  // How much the cell's frames of a camera path flicker.
  void make_temporal(const Cell& cell);
  // Path tracing with more and more samples: its error against its time.
  void make_ladder(const Cell& cell);

 private:
  std::vector<std::string> render_words(const Cell& cell, int spp) const;
  nlohmann::json make_view(const Cell& cell, const Reference& reference);
  std::vector<std::string> with_device(std::vector<std::string> words) const;

  Store& store_;
  const Plan& plan_;
  const Rates& rates_;
  const WorkOptions o_;
};

}  // namespace octrad::paper
