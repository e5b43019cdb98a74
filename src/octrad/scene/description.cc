#include "octrad/scene/description.h"

#include <pugixml.hpp>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <set>

#include "octrad/base/error.h"
#include "octrad/base/input_file.h"
#include "octrad/base/join.h"
#include "octrad/base/lower_case.h"
#include "octrad/base/memory_limit.h"
#include "octrad/scene/built_files.h"
#include "octrad/scene/gltf/gltf.h"
#include "octrad/scene/pbrt/pbrt.h"
#include "octrad/scene/plugins.h"
#include "octrad/scene/scale_textures.h"
#include "octrad/scene/scene.h"
#include "octrad/scene/upgrade.h"

namespace octrad {
namespace {

// Limits on the expansion of one scene, so that files that include each other end with a message and do not exhaust
// memory.
constexpr int kMaxIncludes = 1000;
constexpr std::uint64_t kMaxIncludedBytes = 1'000'000'000;
constexpr int kMaxIncludeDepth = 16;
constexpr int kMaxElementDepth = 64;
constexpr std::size_t kMaxElements = 4'000'000;
constexpr std::size_t kMaxValueLength = 1 << 16;
constexpr std::size_t kMaxAttributes = 64;
constexpr std::size_t kMaxNameLength = 200;  // of parameters: each $ is compared with their beginnings
constexpr std::size_t kMaxSearchPaths = 100, kMaxPathBytes = 1 << 13;  // each is asked for each file

// Of the tree that pugixml makes: nodes of 64 bytes, attributes of 40, a copy of the text; and of line_starts.
std::uint64_t parsing_bytes(const std::string& text) {
  std::uint64_t bytes = text.size();
  for (const char c : text) bytes += c == '<' ? 128 : c == '=' ? 40 : c == '\n' ? 16 : 0;
  return bytes;
}

std::uint64_t bytes_of(const Element& element) {
  std::uint64_t bytes = sizeof(Element) + 64;  // with what the heap adds
  for (const auto& [name, value] : element.attributes) bytes += sizeof(name) + sizeof(value) + value.capacity();
  return bytes;
}

std::string folder_of(const std::string& file) {
  const std::filesystem::path folder = std::filesystem::path(file).parent_path();
  return folder.empty() ? "." : folder.string();
}

bool is_name_character(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
}

class XmlReader {
 public:
  XmlReader(const std::string& file, const std::map<std::string, std::string>& definitions, Description& description,
            SceneReport& report)
      : description_(description),
        report_(report),
        parameters_(definitions.begin(), definitions.end()),
        definitions_(definitions),
        meter_(file + ": the tree of the scene") {}

  void read_main(const std::string& file) {
    std::error_code code;
    including_.push_back(std::filesystem::weakly_canonical(file, code).string());
    if (ending_of(file) == ".octrad")
      throw InputError(file + ": a trained model, not a scene: the scene comes first, the model after --model");
    std::string text = read_file(file);
    if (is_gltf(file, text)) {
      read_gltf(file, std::move(text), description_, report_);
      return check_definitions();
    }
    if (is_pbrt(file)) {
      read_pbrt(file, std::move(text), description_, report_);
      return check_definitions();
    }
    read_document(file, std::move(text), nullptr);
    check_definitions();
    collect_ids(*description_.root);
    resolve_aliases();
    fold_scale_textures(description_);
  }

 private:
  // Parses `text` and appends its elements to `parent`, or makes it the root.
  void read_document(const std::string& file, std::string text, Element* parent) {
    if (text.empty()) throw SceneError(file + ":1:1", "not well-formed XML: the file is empty");
    ask_memory(parsing_bytes(text), file);
    const auto source = std::make_shared<const SourceFile>(file, std::move(text));
    pugi::xml_document document;
    const pugi::xml_parse_result result = document.load_buffer(source->text().data(), source->text().size(),
                                                               pugi::parse_default | pugi::parse_declaration);
    if (!result) {
      fail({source, static_cast<std::size_t>(std::max<std::ptrdiff_t>(result.offset, 0))},
           std::string("not well-formed XML: ") + result.description());
    }
    pugi::xml_node top;
    for (const pugi::xml_node node : document.children()) {
      if (node.type() != pugi::node_element) continue;
      if (top)
        fail(locate(source, node),
             std::string("a second top-level element <") + node.name() + ">; a file holds one <scene>");
      top = node;
    }
    if (!top) fail({source, 0}, "the file holds no element; expected <scene>");
    if (!parent) {
      if (std::string_view(top.name()) != "scene") {
        fail(locate(source, top), std::string("the top-level element is <") + top.name() + ">, expected <scene>");
      }
      description_.root = std::make_unique<Element>();
      description_.root->tag = "scene";
      description_.root->location = locate(source, top);
      read_scene_attributes(top, description_.root->location);
      read_children(source, top, *description_.root, 1);
    } else if (std::string_view(top.name()) == "scene") {
      read_scene_attributes(top, locate(source, top));
      read_children(source, top, *parent, 1);
    } else {
      if (const pugi::xml_attribute version = top.attribute("version")) {
        read_version(version.value(), locate(source, top));
        top.remove_attribute(version);
      }
      read_element(source, top, *parent, 1);
    }
  }

  static Location locate(const std::shared_ptr<const SourceFile>& source, const pugi::xml_node& node) {
    // pugixml gives the offset of the name, one behind the bracket.
    const std::ptrdiff_t offset = node.offset_debug();
    return {source, static_cast<std::size_t>(offset > 0 ? offset - 1 : 0)};
  }

  // Of the file that is read: files that are included may have other versions.
  void read_version(const std::string& version, const Location& where) {
    const auto dot = version.find('.');
    const std::string major = version.substr(0, dot);
    if (major != "0" && major != "1" && major != "2" && major != "3")
      fail(where, "scene version \"" + version + "\" is not supported; expected 3.x (Mitsuba 3), 2.x or 0.x");
    old_ = major == "0" || major == "1";
    if (old_) report_.assume(where, "scene version " + version + " read by the names of Mitsuba 3");
  }

  void read_scene_attributes(const pugi::xml_node& node, const Location& where) {
    const std::string version = node.attribute("version").value();
    if (version.empty()) fail(where, "<scene> has no version attribute; expected version=\"3.0.0\"");
    read_version(version, where);
  }

  void read_children(const std::shared_ptr<const SourceFile>& source, const pugi::xml_node& node, Element& parent,
                     int depth) {
    for (const pugi::xml_node child : node.children()) {
      if (child.type() == pugi::node_element) {
        read_element(source, child, parent, depth);
      } else if (child.type() == pugi::node_pcdata) {
        report_.assume(parent.location, "text inside <" + parent.tag + "> left out, as in Mitsuba: \"" +
                                            std::string(child.value()).substr(0, 40) + "\"");
      }
    }
  }

  void read_element(const std::shared_ptr<const SourceFile>& source, const pugi::xml_node& node, Element& parent,
                    int depth) {
    const Location where = locate(source, node);
    if (depth > kMaxElementDepth)
      fail(where, "elements are nested more than " + std::to_string(kMaxElementDepth) + " deep");
    if (++elements_ > kMaxElements)
      fail(where, "the scene has more than " + std::to_string(kMaxElements) + " elements");
    auto element = std::make_unique<Element>();
    element->tag = node.name();
    element->location = where;
    bool complete = true;  // otherwise the mistake is listed, and the element left out
    for (const pugi::xml_attribute attribute : node.attributes()) {
      if (element->attributes.size() == kMaxAttributes)
        fail(where, "the element has more than " + std::to_string(kMaxAttributes) + " attributes");
      if (element->find(attribute.name()))
        fail(where, std::string("attribute \"") + attribute.name() + "\" is given twice");
      complete &= report_.attempt(where, [&] {
        element->attributes.emplace_back(attribute.name(), substitute(attribute, *element, parent, node, where));
      });
    }
    if (!complete) return;
    meter_.add(bytes_of(*element));
    if (element->tag == "default") {
      check_attributes(*element, {"name", "value"});
      const std::string& name = element->get("name");
      if (name.empty()) fail(where, "<default> has an empty name");
      if (name.size() > kMaxNameLength || name.find('$') != std::string::npos)
        fail(where, "the name of a <default> has no $ and at most " + std::to_string(kMaxNameLength) + " characters");
      declared_.emplace(name, where);
      parameters_.emplace(name, element->get("value"));  // an earlier value (command line, first default) stays
    } else if (element->tag == "include") {
      check_attributes(*element, {"filename"}, {"name"});
      report_.attempt(where, [&] { include(*element, parent); });
    } else if (element->tag == "path") {
      check_attributes(*element, {"value"});
      const std::filesystem::path path = folder_named(element->get("value"), *source);
      std::error_code code;
      if (std::filesystem::is_directory(path, code)) {
        if (description_.search_paths.size() == kMaxSearchPaths)
          fail(where, "<path>: more than " + std::to_string(kMaxSearchPaths) + " folders");
        path_bytes_ += path.string().size();
        if (path_bytes_ > kMaxPathBytes)
          fail(where,
               "<path>: the names of all folders together have more than " + std::to_string(kMaxPathBytes) + " bytes");
        description_.search_paths.insert(description_.search_paths.begin(), path.string());
      } else {
        report_.refuse(where, "<path>: \"" + path.string() + "\" is not a folder");
      }
    } else if (element->tag == "alias") {
      check_attributes(*element, {"id", "as"});
      aliases_.push_back(std::move(element));
    } else {
      read_children(source, node, *element, depth + 1);
      element->old = old_;
      // To Mitsuba 3 the two tags are one; spectra that vary over a surface are textures here.
      if (element->tag == "spectrum") {
        const std::vector<std::string> textures = texture_types();
        if (std::find(textures.begin(), textures.end(), element->get("type")) != textures.end())
          element->tag = "texture";
      }
      if (old_) upgrade_element(*element, report_);
      else downgrade_element(*element, report_);
      parent.children.push_back(std::move(element));
    }
  }

  // Of a <path>: as in Mitsuba beside the file that says so, else where files are looked for, else in the working
  // directory. Where it is nowhere, the first.
  std::filesystem::path folder_named(const std::string& value, const SourceFile& file) const {
    const std::filesystem::path beside = std::filesystem::path(folder_of(file.name())) / value;
    std::error_code code;
    if (std::filesystem::is_directory(beside, code)) return beside;
    for (const std::string& folder : description_.search_paths) {
      const std::filesystem::path path = std::filesystem::path(folder) / value;
      if (std::filesystem::is_directory(path, code)) return path;
    }
    return std::filesystem::is_directory(value, code) ? std::filesystem::path(value) : beside;
  }

  // Whether parameters inside the element can change a picture: those of samplers and most of integrators do not
  // (load.cc).
  static bool has_effect(const Element& element, const Element& parent, const pugi::xml_node& node) {
    if (element.tag == "sampler" || parent.tag == "sampler" || element.tag == "integrator") return false;
    return parent.tag != "integrator" || is_depth(node.attribute("name").value());
  }
  static bool is_depth(std::string_view name) { return name == "max_depth" || name == "maxDepth"; }

  // What a parameter stands for that the file gives no value: what this program takes where a file says nothing, or
  // anything where nothing depends on it.
  static std::optional<std::string> own_default(std::string_view attribute, const Element& element,
                                                const Element& parent, const pugi::xml_node& node) {
    const std::string_view name = node.attribute("name").value();
    if (element.tag == "integrator" && attribute == "type") return "path";
    if (parent.tag == "integrator" && is_depth(name)) return "-1";
    if (parent.tag == "film" && name == "width") return std::to_string(Film().width);
    if (parent.tag == "film" && name == "height") return std::to_string(Film().height);
    if (has_effect(element, parent, node)) return std::nullopt;
    return element.tag == "boolean" ? "false" : element.tag == "string" || element.tag == "sampler" ? "" : "1";
  }

  static void check_attributes(const Element& element, std::vector<std::string> known,
                               const std::vector<std::string>& optional = {}) {
    for (const std::string& name : known) {
      if (!element.find(name)) fail(element.location, "<" + element.tag + "> needs the attribute \"" + name + "\"");
    }
    known.insert(known.end(), optional.begin(), optional.end());
    for (const auto& [name, value] : element.attributes) {
      if (std::find(known.begin(), known.end(), name) == known.end()) {
        fail(element.location, "<" + element.tag + "> has no attribute \"" + name + "\"" + did_you_mean(name, known) +
                                   "; supported: " + join(known));
      }
    }
  }

  void include(const Element& element, Element& parent) {
    const std::string file = description_.resolve(element.get("filename"), element.location);
    std::error_code code;
    const std::string identity = std::filesystem::weakly_canonical(file, code).string();
    if (std::find(including_.begin(), including_.end(), identity) != including_.end()) {
      fail(element.location, "<include>: \"" + file + "\" includes itself");
    }
    if (static_cast<int>(including_.size()) >= kMaxIncludeDepth)
      fail(element.location, "<include>: nested more than " + std::to_string(kMaxIncludeDepth) + " deep");
    if (++includes_ > kMaxIncludes)
      fail(element.location, "<include>: more than " + std::to_string(kMaxIncludes) + " files");
    including_.push_back(identity);
    const bool old = old_;
    report_.attempt(element.location, [&] {
      std::string text = read_file(file);
      included_bytes_ += text.size();
      if (included_bytes_ > kMaxIncludedBytes) fail(element.location, "<include>: more than a gigabyte in all");
      const std::size_t before = parent.children.size();
      read_document(file, std::move(text), &parent);
      // What the single object of a file is to the one that includes it; the elements of a <scene> have no such name.
      if (const std::string* name = element.find("name"); name && parent.children.size() == before + 1)
        parent.children.back()->set("name", *name);
    });
    old_ = old;
    including_.pop_back();
  }

  // Length of the longest parameter with which `text` begins; 0: there is none. Of the names up to `text` in their
  // order the last is that parameter, or has in common with `text` what the parameter is a beginning of.
  std::size_t longest_parameter(std::string_view text) const {
    while (true) {
      const auto after = parameters_.upper_bound(text);
      if (after == parameters_.begin()) return 0;
      const std::string& name = std::prev(after)->first;
      if (text.starts_with(name)) return name.size();
      const auto differ = std::mismatch(name.begin(), name.end(), text.begin(), text.end());
      text = text.substr(0, static_cast<std::size_t>(differ.first - name.begin()));
    }
  }

  // Replaces $name by the parameter's value. Values are not substituted again.
  std::string substitute(const pugi::xml_attribute& attribute, const Element& element, const Element& parent,
                         const pugi::xml_node& node, const Location& where) {
    const std::string text = attribute.value();
    if (text.find('$') == std::string::npos) return text;
    std::string result;
    for (std::size_t i = 0; i < text.size();) {
      if (text[i] == '\\' && i + 1 < text.size() && text[i + 1] == '$') {
        result += '$';
        i += 2;
        continue;
      }
      if (text[i] != '$') {
        result += text[i++];
        continue;
      }
      // The longest parameter that follows, as in Mitsuba; where there is none, what looks like its name.
      std::size_t end = i + 1 + longest_parameter(std::string_view(text).substr(i + 1));
      if (end == i + 1) {
        while (end < text.size() && is_name_character(text[end])) ++end;
      }
      const std::string name = text.substr(i + 1, end - i - 1);
      const auto found = parameters_.find(name);
      i = end;
      const auto fallback = own_default(attribute.name(), element, parent, node);
      if (!name.empty() && found == parameters_.end() && fallback) {
        report_.assume(where, "$" + name + " has no value: " +
                                  (has_effect(element, parent, node) ? *fallback : "it changes nothing") +
                                  ", unless the command line says otherwise");
        result += *fallback;
        continue;
      }
      if (name.empty() || found == parameters_.end()) {
        fail(where, "undefined parameter $" + name + did_you_mean(name, keys_near(parameters_, name)) +
                        "; define it with <default name=\"" + (name.empty() ? "..." : name) +
                        "\" value=\"...\"/> before its use or with -D " + (name.empty() ? "..." : name) + "=value");
      }
      (has_effect(element, parent, node) ? used_ : used_without_effect_).insert(name);
      result += found->second;
      if (result.size() > kMaxValueLength)
        fail(where,
             "an attribute is longer than " + std::to_string(kMaxValueLength) + " characters after substitution");
    }
    return result;
  }

  void check_definitions() const {
    for (const auto& [name, value] : definitions_) {
      if (used_.count(name)) continue;
      if (declared_.count(name) || used_without_effect_.count(name)) {
        description_.warnings.push_back("-D " + name + "=" + value + " changes nothing: the scene file " +
                                        (used_without_effect_.count(name)
                                             ? "uses it for its sampler or integrator, which the command line chooses"
                                             : "does not use this parameter"));
        continue;
      }
      std::vector<std::string> known;
      for (const auto& [key, where] : declared_) known.push_back(key);
      throw InputError("-D " + name + "=" + value + ": " + description_.root->location.file->name() +
                       " has no parameter \"" + name + "\"" + did_you_mean(name, known) +
                       (known.empty() ? "; it has none at all" : "; it has: " + join(known)));
    }
    for (const auto& [name, where] : declared_) {
      if (description_.warnings.size() >= kMostIssues) break;
      if (!used_.count(name) && !used_without_effect_.count(name) && !definitions_.count(name))
        description_.warnings.push_back(where.text() + ": the parameter \"" + name + "\" is not used");
    }
  }

  void collect_ids(const Element& element) {
    const std::string* id = element.find("id");
    if (id && !id->empty() && element.tag != "ref") {
      const auto [at, inserted] = description_.ids.emplace(*id, &element);
      if (!inserted)
        report_.refuse(element.location, "the id \"" + *id + "\" is taken already, at " + at->second->location.text());
    }
    for (const auto& child : element.children) collect_ids(*child);
  }

  void resolve_aliases() {
    for (const auto& alias : aliases_) {
      const auto target = description_.ids.find(alias->get("id"));
      if (target == description_.ids.end()) {
        const std::string& id = alias->get("id");
        report_.refuse(alias->location, "<alias>: nothing has the id \"" + id + "\"" +
                                            did_you_mean(id, keys_near(description_.ids, id)));
        continue;
      }
      if (!description_.ids.emplace(alias->get("as"), target->second).second) {
        report_.refuse(alias->location, "<alias>: the id \"" + alias->get("as") + "\" is taken already");
      }
    }
  }

  Description& description_;
  SceneReport& report_;
  bool old_ = false;  // the file that is read has a version below 2
  std::map<std::string, std::string, std::less<>> parameters_;
  const std::map<std::string, std::string>& definitions_;
  std::map<std::string, Location> declared_;
  std::set<std::string> used_, used_without_effect_;
  std::vector<std::unique_ptr<Element>> aliases_;
  std::vector<std::string> including_;
  int includes_ = 0;
  std::uint64_t included_bytes_ = 0;
  std::size_t path_bytes_ = 0;
  std::size_t elements_ = 0;
  MemoryMeter meter_;
};

}  // namespace

const std::string* Element::find(std::string_view attribute) const {
  for (const auto& [name, value] : attributes) {
    if (name == attribute) return &value;
  }
  return nullptr;
}

void Element::set(const std::string& attribute, const std::string& value) {
  for (auto& [name, text] : attributes) {
    if (name == attribute) {
      text = value;
      return;
    }
  }
  attributes.emplace_back(attribute, value);
}

const std::string& Element::get(std::string_view attribute) const {
  static const std::string empty;
  const std::string* value = find(attribute);
  return value ? *value : empty;
}

Element* Element::child(std::string_view name) const {
  const auto found =
      std::find_if(children.begin(), children.end(), [&](const auto& c) { return c->get("name") == name; });
  return found == children.end() ? nullptr : found->get();
}

std::string Description::resolve(const std::string& file, const Location& where) const {
  if (file.empty()) fail(where, "empty file name");
  std::error_code code;
  std::vector<std::string> tried;
  std::vector<std::string> folders = search_paths;
  if (where.file) folders.push_back(folder_of(where.file->name()));  // of the file that names it, maybe an included one
  // At last the working directory, as in Mitsuba.
  if (std::find(folders.begin(), folders.end(), ".") == folders.end()) folders.emplace_back();
  for (const std::string& folder : folders) {
    const std::filesystem::path path = std::filesystem::path(folder) / file;  // an absolute `file` replaces the folder
    if (std::filesystem::exists(path, code)) {
      if (std::filesystem::is_directory(path, code)) fail(where, "\"" + path.string() + "\" is a folder, not a file");
      return files.emplace_back(path.string());
    }
    if (tried.empty() || tried.back() != path.string()) tried.push_back(path.string());
  }
  if (file.find('\\') != std::string::npos) {  // of another system
    std::string slashes = file;
    std::replace(slashes.begin(), slashes.end(), '\\', '/');
    return resolve(slashes, where);
  }
  fail(where, "file \"" + file + "\" does not exist (looked for " + join(tried) + ")");
}

const RawMesh* Description::built_mesh(const std::string& name) const {
  if (!built) return nullptr;
  const auto found = built->meshes.find(name);
  return found == built->meshes.end() ? nullptr : &found->second;
}

const BuiltPicture* Description::built_picture(const std::string& name) const {
  if (!built) return nullptr;
  const auto found = built->pictures.find(name);
  return found == built->pictures.end() ? nullptr : &found->second;
}

const Curves* Description::built_curves(const std::string& name) const {
  if (!built) return nullptr;
  const auto found = built->curves.find(name);
  return found == built->curves.end() ? nullptr : &found->second;
}

Description read_description(const std::string& file, const std::map<std::string, std::string>& definitions,
                             SceneReport& report) {
  Description description;
  description.report = &report;
  description.search_paths.push_back(folder_of(file));
  XmlReader(file, definitions, description, report).read_main(file);
  return description;
}

}  // namespace octrad
