// What is fuzzed: every reader of files that others wrote, each as a function of bytes.
#pragma once

#include <span>
#include <string>

namespace octrad::fuzz {

struct Target {
  const char* name;
  // Reads `bytes`, with 400 MB; what a user would be told (octrad::Error) ends inside. Everything else is a finding.
  void (*run)(const std::string& bytes);
};

std::span<const Target> targets();
// Throws std::runtime_error with the list of names.
const Target& find_target(const std::string& name);

// Goes into a new temporary folder that holds what seeds refer to: meshes, a texture, a spectrum, a part of a scene.
void prepare();

}  // namespace octrad::fuzz
