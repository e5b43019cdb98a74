// What scene files may give objects of each type, for people: octrad info --plugins, the tables of docs/scenes.md.
#pragma once

#include <string>
#include <vector>

namespace octrad {

struct PluginHelp {
  std::vector<std::string> types;  // those that the text is about, all of them
  // One line of Markdown: parameters in back-quotes, behind each its default in parentheses, and what to know of the
  // type. tests/test_scene_docs.py reads names and defaults, and tries them.
  std::string text;
  std::string as{};  // a type of the entry before, whose text comes first; "" for none
};

// An element of scene files, such as "bsdf", and its types.
struct PluginKindHelp {
  std::string tag;
  std::string all;  // Markdown too: what every type has; may be empty
  std::vector<PluginHelp> entries;
};

// The same tags and types as plugin_types(), which a test compares, in the order that they are shown in.
const std::vector<PluginKindHelp>& plugin_help();

}  // namespace octrad
