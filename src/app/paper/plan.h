// From matrices to work: which references, trainings and cells there are, at which size, and in which folder.
#pragma once

#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "app/paper/matrix.h"

namespace octrad::paper {

struct SceneInput {
  std::string name, file;  // the file's absolute name
};

// `list`: scene files and folders of scenes (FOLDER/NAME/scene.xml), with commas between them. Files are the scenes,
// whatever a matrix says; among those of folders a matrix chooses by name. Throws IoError or InputError.
struct SceneChoice {
  std::vector<SceneInput> files, found;
  std::vector<SceneInput> of(const Matrix& matrix) const;
};
SceneChoice choose_scenes(const std::string& list);

// All names of files here are relative to the run's folder, and so are the commands: a report can be read anywhere.
struct PaperScene {
  std::string name, file;  // scenes/NAME/scene.xml
  nlohmann::json info;     // of `octrad info --json`
};

struct View {
  std::string name;
  std::vector<std::string> words;  // of `octrad render`: sensor or camera, and width
  int width = 0, height = 0;
  bool first_sensor = false;
};

// Where the camera of a view is written.
std::string camera_file(const std::string& scene, const ViewSpec& view);

struct Reference {
  std::size_t scene = 0;
  View view;
  int half_spp = 0;
  std::string folder;
  std::string picture() const { return folder + "/ref.exr"; }
};

// Frames of a camera path, path traced, to measure the flicker of cells with.
struct Film {
  std::size_t scene = 0;
  nlohmann::json path;  // as `octrad render --path` takes it
  int width = 0, height = 0, spp = 0;
  std::string folder;
  std::string path_file() const { return folder + "/path.json"; }
};

struct Training {
  std::size_t scene = 0;
  std::string field, preset;
  std::map<std::string, std::string> keys;
  long long seed = 0;
  double seconds = 0.0;  // 0: `steps` is the budget
  long long steps = 0;
  double work = 0.0;  // points x directions of a step
  std::string folder;
  std::optional<std::size_t> reference;
  std::string model() const { return folder + "/model.octrad"; }
};

// Where a cell stands in a matrix. Cells with the same settings are one cell with several places.
struct Place {
  std::size_t matrix = 0;
  std::string switch_name;
  Equal equal = Equal::seconds;
};

struct Cell {
  std::size_t scene = 0;
  const Method* method = nullptr;
  long long seed = 0;
  int spp = 0;
  std::optional<std::size_t> training;
  std::vector<std::size_t> references;  // one a view
  std::string folder;
  std::vector<Place> places;
  bool learned = false;             // also pictures of what was learned
  std::optional<std::size_t> film;  // also its flicker
  bool selected = true;             // by --only
};

// What a budget makes smaller, for all methods alike. The work of everything falls by about `factor`: training time and
// steps x batch by factor, pixels and samples of the references by its root each. Batches are powers of two of the full
// one, never below 128 points; pictures are never narrower than 64 pixels.
struct Scale {
  double factor = 1.0;
  double batch() const;
  int width(int full) const;
  int half_spp(int full) const;
  int film_spp(int full) const { return 2 * half_spp(full); }
};

struct Plan {
  std::vector<Matrix> matrices;
  Scale scale;
  std::vector<PaperScene> scenes;
  std::vector<Reference> references;
  std::vector<Film> films;
  std::vector<Training> trainings;
  std::vector<Cell> cells;
};

// `scenes[m]` are those of matrix m, as indices into plan_scenes. `octaoctree_bytes(scene, matrix, switch)` is the size
// of its model in bytes, for tables at equal bytes.
Plan make_plan(std::vector<Matrix> matrices, const std::vector<PaperScene>& plan_scenes,
               const std::vector<std::vector<std::size_t>>& scenes, Scale scale,
               const std::function<double(std::size_t scene, const Matrix& matrix, const Switch& s)>& octaoctree_bytes);

// Where the flicker of the cell is kept, and its error with more and more samples; "": it has none.
std::string temporal_folder(const Plan& plan, const Cell& cell);
std::string ladder_folder(const Plan& plan, const Cell& cell);
// The samples a pixel of the latter: those of the first matrix that asks for some.
std::vector<int> ladder_spp(const Plan& plan, const Cell& cell);
// `octrad info` of a scene with the OctaOctree of a preset and, of `keys`, those that say which tables it has.
std::vector<std::string> tables_words(const PaperScene& scene, const std::string& preset,
                                      const std::vector<const std::map<std::string, std::string>*>& keys);
// Whether the method traces paths, which go on without a bound, as those of references do.
bool traces_paths(const Method& method);

// "main/cornell-box/nr/full/seconds/s0": what --only looks at.
std::string cell_label(const Plan& plan, const Cell& cell, const Place& place);
// Marks the cells whose label contains one of the words of `patterns` (commas between them); * and ? are wildcards.
// Throws UsageError when none does.
void select_cells(Plan& plan, const std::string& patterns);

}  // namespace octrad::paper
