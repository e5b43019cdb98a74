// A scene file as a tree of Mitsuba's elements. Of XML: <default>s substituted, <include>s spliced in, <alias>es and
// ids collected. Nothing is interpreted yet; every element and attribute keeps its line and column.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "octrad/base/vec.h"
#include "octrad/scene/report.h"

namespace octrad {

struct Element {
  std::string tag;
  std::vector<std::pair<std::string, std::string>> attributes;  // values substituted, in file order
  std::vector<std::unique_ptr<Element>> children;
  Location location;
  bool old = false;               // of a file whose version is below 2
  mutable bool was_read = false;  // by a Params

  const std::string* find(std::string_view attribute) const;
  void set(const std::string& attribute, const std::string& value);  // or adds it
  // Value of the attribute or "" when absent.
  const std::string& get(std::string_view attribute) const;
  // The first child with that name; null when absent.
  Element* child(std::string_view name) const;
};

// What became of single elements, for writing the scene again (write_xml.h).
struct Understood {
  std::map<const Element*, Vec3f> constants;  // colours and spectra
  std::map<const Element*, Vec3f> stand_ins;  // textures and bsdfs that could not be used, and their colour
  std::set<const Element*> left_out;          // what could not be used, and what changes nothing
};

struct BuiltFiles;
struct CurvePoint;
struct BuiltPicture;
struct RawMesh;

struct Description {
  std::unique_ptr<Element> root;              // the <scene>
  std::map<std::string, const Element*> ids;  // every element with an id, aliases included
  std::vector<std::string> search_paths;      // the last <path> first, as in Mitsuba; then the scene file's folder
  std::vector<std::string> warnings;          // of definitions and defaults that change nothing
  SceneReport* report = nullptr;              // where mistakes and assumptions go
  Understood* understood = nullptr;           // where not null, filled by those who read the elements
  mutable std::vector<std::string> files;     // found by resolve()
  mutable int open = 0;                       // objects that are being read, each inside of the one before
  // Parameters of objects that were read: for the first time, and again through references.
  mutable std::uint64_t read_once = 0, read_again = 0;
  std::shared_ptr<BuiltFiles> built;  // what names of files stand for that are in no file; or null
  // What the name of a file stands for where it is built, or null.
  const RawMesh* built_mesh(const std::string& name) const;
  const BuiltPicture* built_picture(const std::string& name) const;
  const std::vector<std::vector<CurvePoint>>* built_curves(const std::string& name) const;
  // Full name of an existing file in the search paths or beside the file of `where`, or an error there that lists what
  // was tried.
  std::string resolve(const std::string& file, const Location& where) const;
};

// Mitsuba XML, glTF (gltf.h) or pbrt (pbrt.h); XML of versions below 2 in the terms of version 3 (upgrade.h). Throws
// InputError with file:line:column, or IoError when the scene file itself cannot be read; mistakes that `report`
// collects are listed there, and what holds them is left out. `report` must outlive the result.
Description read_description(const std::string& file, const std::map<std::string, std::string>& definitions,
                             SceneReport& report);

}  // namespace octrad
