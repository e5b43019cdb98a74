#include "octrad/scene/write_xml.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include "octrad/base/escape.h"
#include "octrad/base/lower_case.h"
#include "octrad/base/number_text.h"
#include "octrad/image/encode.h"
#include "octrad/scene/builder.h"
#include "octrad/scene/built_files.h"
#include "octrad/scene/description.h"
#include "octrad/scene/params.h"

namespace octrad {
namespace {

// In a value of an attribute a newline would be read as a blank.
std::string attribute_text(const std::string& text) {
  std::string out;
  for (const char c : markup_text(text)) {
    if (c == '\n') out += "&#10;";
    else out += c;
  }
  return out;
}

std::string rgb_text(Vec3f v) { return number_text(v.x) + ", " + number_text(v.y) + ", " + number_text(v.z); }

class Writer {
 public:
  Writer(const Description& description, const Understood& understood, const std::string& output)
      : description_(description),
        understood_(understood) {
    const std::filesystem::path folder = std::filesystem::absolute(output).parent_path();
    std::error_code code;
    folder_ = std::filesystem::weakly_canonical(folder, code);
    files_ = std::filesystem::path(output).stem().string() + "-files";
  }

  void write(const Scene& scene) {
    text_ = "<scene version=\"3.0.0\">\n";
    line(1, "<integrator type=\"path\">");
    line(2, "<integer name=\"max_depth\" value=\"" + std::to_string(scene.max_depth) + "\"/>");
    if (scene.hide_emitters) line(2, "<boolean name=\"hide_emitters\" value=\"true\"/>");
    line(1, "</integrator>");
    for (const auto& child : description_.root->children) {
      if (child->tag != "integrator" && !is_area_light(target_of(*child))) element(*child, 1, "scene");
    }
    result.xml = text_ + "</scene>\n";
  }

  std::set<std::string> notes;  // of what Mitsuba 3 cannot say
  SceneFiles result;

 private:
  using Attributes = std::vector<std::pair<std::string, std::string>>;

  void line(int depth, const std::string& content) {
    text_.append(static_cast<std::size_t>(2 * depth), ' ');
    text_ += content + "\n";
  }
  static std::string tag(const std::string& name, const Attributes& attributes, bool closed) {
    std::string out = "<";
    out += name;
    for (const auto& [key, value] : attributes) {
      out += ' ';
      out += key;
      out += "=\"";
      out += attribute_text(value);
      out += '"';
    }
    out += closed ? "/>" : ">";
    return out;
  }
  const Element& target_of(const Element& e) const {
    if (e.tag != "ref") return e;
    const auto found = description_.ids.find(e.get("id"));
    return found == description_.ids.end() ? e : *found->second;
  }
  static bool is_area_light(const Element& e) { return e.tag == "emitter" && e.get("type") == "area"; }

  // Its name and, outside of objects that are repeated, its id.
  Attributes labels(const Element& e) const {
    Attributes out;
    for (const char* key : {"id", "name"}) {
      if (const std::string* value = e.find(key); value && !(repeated_ && std::string(key) == "id"))
        out.emplace_back(key, *value);
    }
    return out;
  }

  void color(const Element& e, Vec3f v, int depth) {
    const std::string rgb = rgb_text(v);
    const Attributes own = labels(e);
    if (std::any_of(own.begin(), own.end(), [](const auto& a) { return a.first == "id"; })) {
      // A colour that others refer to is an object; d65 is the white of RGB.
      Attributes attributes = {{"type", "d65"}};
      attributes.insert(attributes.end(), own.begin(), own.end());
      line(depth, tag("spectrum", attributes, false));
      line(depth + 1, tag("rgb", {{"name", "color"}, {"value", rgb}}, true));
      line(depth, "</spectrum>");
      return;
    }
    const bool number = v.x == v.y && v.x == v.z && (e.tag == "float" || e.tag == "integer" || e.tag == "ref");
    line(depth, tag(number ? "float" : "rgb", with_value(own, number ? number_text(v.x) : rgb), true));
  }
  static Attributes with_value(Attributes attributes, const std::string& value) {
    attributes.emplace_back("value", value);
    return attributes;
  }

  void element(const Element& e, int depth, const std::string& parent) {
    if (understood_.left_out.count(&e)) {
      // Others may refer to what a shape holds.
      for (const auto& child : e.children) {
        if (e.tag == "shape" && parent == "scene" && child->find("id") &&
            (child->tag == "bsdf" || child->tag == "texture"))
          element(*child, depth, parent);
      }
      return;
    }
    if (const auto found = understood_.stand_ins.find(&e); found != understood_.stand_ins.end())
      return stand_in(e, found->second, depth);
    if (e.tag == "ref") return reference(e, depth, parent);
    if (const auto found = understood_.constants.find(&e);
        found != understood_.constants.end() && e.tag != "float" && e.tag != "integer")
      return color(e, found->second, depth);
    if (e.tag == "transform") return transform(e, depth);
    if (e.tag == "sampler") return sampler(e, depth);
    Attributes attributes = e.attributes;
    const bool matt = e.tag == "bsdf" && e.get("type") == "roughdiffuse";  // which Mitsuba 3 has not
    if (matt) {
      for (auto& [key, value] : attributes) {
        if (key == "type") value = "diffuse";
      }
      notes.insert("bsdf \"roughdiffuse\" is written as diffuse, as Mitsuba 3 has no other");
    }
    if (repeated_) std::erase_if(attributes, [](const auto& a) { return a.first == "id"; });
    if (e.tag == "string" && e.get("name") == "filename") {
      for (auto& [key, value] : attributes) {
        if (key == "value") value = file_name(e);
      }
    }
    line(depth, tag(e.tag, attributes, e.children.empty()));
    if (e.children.empty()) return;
    for (const auto& child : e.children) {
      if (matt && child->get("name") == "alpha") continue;
      if (e.tag == "emitter" && child->get("name") == "through_masks") {
        if (child->get("value") != "false")
          notes.insert("through_masks of lights is left out: in Mitsuba 3 masks have solid shadows");
        continue;
      }
      element(*child, depth + 1, e.tag);
    }
    line(depth, std::string("</").append(e.tag).append(">"));
  }

  void stand_in(const Element& e, Vec3f value, int depth) {
    if (e.tag != "bsdf") return color(e, value, depth);
    Attributes attributes = {{"type", "diffuse"}};
    for (const auto& label : labels(e)) attributes.push_back(label);
    line(depth, tag("bsdf", attributes, false));
    line(depth + 1, tag("rgb", {{"name", "reflectance"}, {"value", rgb_text(value)}}, true));
    line(depth, "</bsdf>");
  }

  // Mitsuba wants an area light for each shape: one that several refer to is repeated.
  void reference(const Element& e, int depth, const std::string& parent) {
    const Element& target = target_of(e);
    if (understood_.left_out.count(&target)) return;
    if (parent == "shape" && is_area_light(target)) {
      const bool before = repeated_;
      repeated_ = true;
      element(target, depth, parent);
      repeated_ = before;
      return;
    }
    Attributes attributes = {{"id", target.get("id")}};  // not that of an alias
    if (const std::string* name = e.find("name")) attributes.emplace_back("name", *name);
    line(depth, tag("ref", attributes, true));
  }

  void transform(const Element& e, int depth) {
    std::vector<std::string> warnings;
    const Transform t = parse_transform(e, warnings);
    std::string numbers;
    for (const double v : t.m) {
      if (!numbers.empty()) numbers += ' ';
      numbers += number_text(v);
    }
    line(depth, tag("transform", labels(e), false));
    line(depth + 1, tag("matrix", {{"value", numbers}}, true));
    line(depth, "</transform>");
  }

  void sampler(const Element& e, int depth) {
    std::string count = "16";
    for (const auto& child : e.children) {
      const auto numbers = child->get("name") == "sample_count" ? parse_numbers(child->get("value")) : std::nullopt;
      if (numbers && numbers->size() == 1 && (*numbers)[0] >= 1.0) count = child->get("value");
    }
    line(depth, tag("sampler", {{"type", "independent"}}, false));
    line(depth + 1, tag("integer", {{"name", "sample_count"}, {"value", count}}, true));
    line(depth, "</sampler>");
  }

  std::string file_name(const Element& e) {
    const std::string& name = e.get("value");
    if (const RawMesh* mesh = description_.built_mesh(name)) {
      const std::string file = files_ + "/" + name + ".ply";
      result.others[file] = [mesh, keep = description_.built] { return ply_bytes(*mesh); };
      return file;
    }
    if (const BuiltPicture* picture = description_.built_picture(name)) {
      const std::string encoded = picture->encoded ? picture->encoded() : "";
      const bool png = encoded.starts_with("\x89PNG"), jpeg = encoded.starts_with("\xff\xd8"), webp = is_webp(encoded);
      const std::string file = files_ + "/" + name + (png || webp ? ".png" : jpeg ? ".jpg" : ".exr");
      result.others[file] = [picture, file, same = png || jpeg, keep = description_.built] {
        return same ? picture->encoded() : encode_image(file, picture->read());
      };
      return file;
    }
    if (const Curves* curves = description_.built_curves(name)) {
      const std::string file = files_ + "/" + name + ".txt";
      result.others[file] = [curves, keep = description_.built] { return curves_text(*curves); };
      return file;
    }
    if (ending_of(name) == ".webp") notes.insert("Mitsuba does not read WebP, which the written file refers to");
    std::error_code code;
    const std::filesystem::path file =
        std::filesystem::weakly_canonical(description_.resolve(e.get("value"), e.location), code);
    const std::filesystem::path relative = std::filesystem::proximate(file, folder_, code);
    return (code || relative.empty() ? file : relative).string();
  }

  const Description& description_;
  const Understood& understood_;
  std::filesystem::path folder_;
  std::string text_, files_;
  bool repeated_ = false;  // what is written stands elsewhere too: without ids
};

}  // namespace

SceneFiles scene_as_xml(const std::string& file, const std::string& output, const LoadOptions& options, Scene& scene) {
  SceneReport report(options.permissive);
  Description description = read_description(file, options.definitions, report);
  Understood understood;
  description.understood = &understood;
  scene = build_scene(description);
  Writer writer(description, understood, output);
  writer.write(scene);
  scene.assumed.insert(scene.assumed.end(), writer.notes.begin(), writer.notes.end());
  return std::move(writer.result);
}

}  // namespace octrad
