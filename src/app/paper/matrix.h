// What `octrad paper` is to do: scenes x methods x switches x seeds, from a JSON file (docs/formats.md, "Matrices").
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace octrad::paper {

// A row of the paper's tables: what is trained, how its picture is made, and what is done with the picture.
struct Method {
  const char* name;
  const char* title;
  const char* field;       // trained; "" for none
  const char* integrator;  // of `octrad render`
  int spp;                 // samples a pixel of its pictures, unless the matrix says otherwise
  bool denoise;            // its picture is denoised afterwards
};
std::span<const Method> methods();
const Method* find_method(const std::string& name);  // null: there is none

// Configuration keys under a name. "" is the method as it is.
struct Switch {
  std::string name;
  std::map<std::string, std::string> keys;
};

// What methods have in common when they are compared: seconds of training, steps of training, or seconds and the bytes
// of the model (the tables of the hash grids are chosen to match the OctaOctree's).
enum class Equal { seconds, steps, bytes };
const char* equal_name(Equal equal);

struct ViewSpec {
  std::string name;
  int sensor = -1;        // of the scene; -1: `camera`
  nlohmann::json camera;  // as `octrad render --camera` takes it
};

struct Matrix {
  std::string name, title, about;
  std::vector<std::string> scenes;                     // names; empty: all there are
  std::map<std::string, std::vector<ViewSpec>> views;  // by scene, "*": others; none: all sensors
  std::vector<const Method*> methods;
  std::vector<Switch> switches;
  std::vector<long long> seeds;
  std::vector<Equal> equal;
  std::string preset = "cpu";
  std::map<std::string, std::string> keys;      // of all trainings
  double seconds = 300.0;                       // of a training
  long long steps = 20000;                      // of a training, where steps are equal
  std::map<std::string, int> spp;               // by method
  int width = 256;                              // of the pictures, in pixels
  int reference_spp = 8192;                     // both halves together
  bool learned = false;                         // also pictures of features and disparity
  std::vector<int> path_spp;                    // convergence: also path tracing with these samples a pixel
  int temporal_frames = 0;                      // frames of a camera path to measure flicker with; 0: none
  int temporal_spp = 256;                       // of the reference's frames
  std::map<std::string, nlohmann::json> paths;  // camera paths by scene; others move a little to the side
};

// Of the built-in matrices' names (configs/paper/NAME.json) and files. Throws IoError, or InputError that names what is
// wrong and what would be accepted.
Matrix read_matrix(const std::string& name_or_file);
Matrix parse_matrix(const std::string& text, const std::string& file);

// configs/paper/NAME.json, as built into the program: name and text.
std::span<const std::pair<const char*, const char*>> builtin_matrices();

}  // namespace octrad::paper
