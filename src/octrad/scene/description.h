// A Mitsuba 3 XML file as a tree: <default>s substituted, <include>s spliced in, <alias>es and ids collected. Nothing
// is interpreted yet; every element and attribute keeps its line and column.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "octrad/scene/source.h"

namespace octrad {

struct Element {
  std::string tag;
  std::vector<std::pair<std::string, std::string>> attributes;  // values substituted, in file order
  std::vector<std::unique_ptr<Element>> children;
  Location location;

  const std::string* find(std::string_view attribute) const;
  // Value of the attribute or "" when absent.
  const std::string& get(std::string_view attribute) const;
};

struct Description {
  std::unique_ptr<Element> root;              // the <scene>
  std::map<std::string, const Element*> ids;  // every element with an id, aliases included
  std::vector<std::string> search_paths;      // folder of the scene file first, then its <path>s
  std::vector<std::string> warnings;          // of definitions that change nothing
  mutable std::vector<std::string> files;     // found by resolve()
  // Full name of an existing file, or an error at `where` that lists what was tried.
  std::string resolve(const std::string& file, const Location& where) const;
};

// Throws InputError with file:line:column, or IoError when the scene file itself cannot be read.
Description read_description(const std::string& file, const std::map<std::string, std::string>& definitions);

}  // namespace octrad
