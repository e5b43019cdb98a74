#include "octrad/scene/scale_textures.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "octrad/base/error.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/number_text.h"
#include "octrad/image/io.h"
#include "octrad/scene/built_files.h"
#include "octrad/scene/make_element.h"
#include "octrad/scene/params.h"
#include "octrad/scene/picture_values.h"

namespace octrad {
namespace {

constexpr int kMostScales = 200;  // in one another

bool is_scale_texture(const Element& e) { return e.old && e.tag == "texture" && e.get("type") == "scale"; }

bool holds_id(const Element& e) {
  return e.find("id") || std::any_of(e.children.begin(), e.children.end(), [](const auto& c) { return holds_id(*c); });
}

bool is_grey(Vec3d v) { return v.x == v.y && v.x == v.z; }

// Of <float>, <rgb> and spectra of numbers alone.
std::optional<Vec3d> plain_color(const Element& e) {
  if (e.tag == "rgb") {
    if (const auto hex = parse_hex_color(e.get("value"))) return hex;
  } else if (e.tag != "float" && e.tag != "integer" && e.tag != "spectrum") {
    return std::nullopt;
  }
  const auto numbers = parse_numbers(e.get("value"));
  if (!numbers || (numbers->size() != 1 && (numbers->size() != 3 || e.tag != "rgb"))) return std::nullopt;
  return numbers->size() == 1 ? Vec3d((*numbers)[0]) : Vec3d((*numbers)[0], (*numbers)[1], (*numbers)[2]);
}

// The picture, linear and times the factor.
Image scaled_picture(const std::string& file, bool raw, Vec3d factor) {
  const MemoryScope scope;
  const Image in = read_image(file);
  const LinearValues decoded(in);
  const auto linear = [&](float v) { return raw ? static_cast<double>(v) : decoded(v); };
  const bool colored = in.channel("R") >= 0 && in.channel("G") >= 0 && in.channel("B") >= 0;
  if (!colored && is_grey(factor)) {
    ask_memory(in.data.size() * sizeof(float), file);
    Image out(in.width, in.height, in.channels);
    for (std::size_t i = 0; i < in.data.size(); ++i) out.data[i] = static_cast<float>(linear(in.data[i]) * factor.x);
    return out;
  }
  ask_memory(in.pixel_count() * sizeof(Vec3f), file);
  const std::vector<int> from = color_channels(in);
  Image out(in.width, in.height, {"R", "G", "B"});
  for (int y = 0; y < in.height; ++y) {
    for (int x = 0; x < in.width; ++x) {
      Vec3d v;
      for (int c = 0; c < 3; ++c) v[c] = linear(in.at(x, y, from[static_cast<std::size_t>(c)]));
      out.set_rgb(x, y, Vec3f(v * factor));
    }
  }
  return out;
}

class ScaleFolder {
 public:
  explicit ScaleFolder(Description& description)
      : description_(description),
        meter_(description.root->location.text() + ": the textures that are scaled") {}

  void run() {
    collect(*description_.root);
    for (Element* element : order_) fold(*element, 0);
    for (auto& element : freed_) description_.root->children.push_back(std::move(element));
  }

 private:
  void collect(Element& e) {
    if (is_scale_texture(e)) {
      scales_.emplace(&e, &e);
      order_.push_back(&e);
    }
    if (e.get("name") == "filename") names_.insert(e.get("value"));
    for (const auto& c : e.children) collect(*c);
  }

  void fold(Element& e, int depth) {
    if (depth > kMostScales || !is_scale_texture(e)) return;
    Vec3d factor(1.0);
    const Element* inside = nullptr;
    for (const auto& c : e.children) {
      if (c->get("name") == "scale" && c->tag != "texture") {
        const auto given = plain_color(*c);
        if (!given || std::min({given->x, given->y, given->z}) < 0.0) return;
        factor = *given;
      } else if (inside) {
        return;
      } else {
        inside = c.get();
      }
    }
    if (!inside) return;
    const auto found = inside->tag == "ref" ? description_.ids.find(inside->get("id")) : description_.ids.end();
    if (inside->tag == "ref" && found == description_.ids.end()) return;
    const Element& target = inside->tag == "ref" ? *found->second : *inside;
    if (const auto other = scales_.find(&target); other != scales_.end()) fold(*other->second, depth + 1);
    const std::string type = target.get("type");
    std::vector<std::unique_ptr<Element>> made;
    std::string tag = "texture", now = type;
    if (const auto constant = plain_color(target); constant && !target.find("type")) {
      tag = "spectrum";
      const Vec3d value = *constant * factor;
      now = is_grey(value) && target.tag != "rgb" ? "uniform" : "srgb";
      made.push_back(now == "srgb" ? value_of("rgb", "color", three_numbers(value), target)
                                   : value_of("float", "value", number_text(value.x), target));
    } else if (target.tag == "texture" && type == "bitmap") {
      made = bitmap(target, factor, e);
    } else if (target.tag == "texture" && type == "checkerboard") {
      for (const auto& [name, fallback] : {std::pair("color0", 0.4), std::pair("color1", 0.2)}) {
        const Element* given = target.child(name);
        const auto color = given ? plain_color(*given) : Vec3d(fallback);
        if (!color) return;
        made.push_back(value_of("rgb", name, three_numbers(*color * factor), target));
      }
      copy_others(target, {"color0", "color1"}, made);
    } else if (target.tag == "texture" && type == "mesh_attribute" && is_grey(factor)) {
      const Element* given = target.child("scale");
      const auto before = given ? plain_color(*given) : Vec3d(1.0);
      if (!before) return;
      made.push_back(value_of("float", "scale", number_text(before->x * factor.x), target));
      copy_others(target, {"scale"}, made);
    } else {
      return;
    }
    description_.report->assume(e.location,
                                "a texture \"scale\" read as the texture in it, with the factor in its values");
    // Others may refer to what stood inside.
    for (auto& c : e.children) {
      (c->tag != "ref" && holds_id(*c) ? freed_ : dropped_).push_back(std::move(c));
    }
    e.tag = tag;
    e.set("type", now);
    e.children = std::move(made);
  }

  // The parameters of a bitmap of the picture that `target` has, times the factor.
  std::vector<std::unique_ptr<Element>> bitmap(const Element& target, Vec3d factor, const Element& scale) {
    std::vector<std::unique_ptr<Element>> made;
    const Element* name = target.child("filename");
    Picture picture;
    if (const auto folded = pictures_.find(&target); folded != pictures_.end()) {
      picture = folded->second;
    } else {
      const Element* raw = target.child("raw");
      picture.raw = raw && raw->get("value") == "true";
      try {
        picture.file = description_.resolve(name ? name->get("value") : "", name ? name->location : target.location);
      } catch (const InputError&) {  // found again, and refused, where the bitmap is read
        copy_others(target, {}, made);
        return made;
      }
    }
    picture.factor = picture.factor * factor;
    pictures_[&scale] = picture;
    made.push_back(value_of("string", "filename", built(picture), name ? *name : target));
    made.push_back(value_of("boolean", "raw", "true", target));
    copy_others(target, {"filename", "raw"}, made);
    return made;
  }

  struct Picture {
    std::string file;
    bool raw = false;
    Vec3d factor{1.0, 1.0, 1.0};
  };

  // The name of a picture that is built; none that the file has.
  std::string built(const Picture& picture) {
    const auto [at, inserted] =
        built_.try_emplace((picture.raw ? "raw " : "") + three_numbers(picture.factor) + " " + picture.file, "");
    if (!inserted) return at->second;
    // After its file, in letters that any file may have in its name.
    std::string stem;
    for (const char c : std::filesystem::path(picture.file).stem().string().substr(0, 60)) {
      const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
      stem += plain ? c : '-';
    }
    do at->second = stem + "-scaled" + std::to_string(count_++);
    while (names_.count(at->second));
    if (!description_.built) description_.built = std::make_shared<BuiltFiles>();
    BuiltPicture made;
    made.read = [picture] { return scaled_picture(picture.file, picture.raw, picture.factor); };
    description_.built->pictures.emplace(at->second, std::move(made));
    return at->second;
  }

  std::unique_ptr<Element> value_of(const std::string& tag, const std::string& name, const std::string& value,
                                    const Element& near) {
    auto e = make_property(tag, name, value, near);
    e->old = true;
    return e;
  }

  std::unique_ptr<Element> copy(const Element& e) {
    meter_.add(sizeof(Element) + 200 * (e.attributes.size() + 1));
    auto made = std::make_unique<Element>();
    made->tag = e.tag;
    made->location = e.location;
    made->old = e.old;
    for (const auto& attribute : e.attributes) {
      if (attribute.first != "id") made->attributes.push_back(attribute);
    }
    for (const auto& c : e.children) made->children.push_back(copy(*c));
    return made;
  }
  void copy_others(const Element& from, const std::vector<std::string>& but,
                   std::vector<std::unique_ptr<Element>>& to) {
    for (const auto& c : from.children) {
      if (std::find(but.begin(), but.end(), c->get("name")) == but.end()) to.push_back(copy(*c));
    }
  }

  Description& description_;
  MemoryMeter meter_;
  std::map<const Element*, Element*> scales_;
  std::vector<Element*> order_;                            // of them in the file
  std::map<const Element*, Picture> pictures_;             // of those that are bitmaps now
  std::set<std::string> names_;                            // of files
  std::map<std::string, std::string> built_;               // by what they are made of
  std::vector<std::unique_ptr<Element>> freed_, dropped_;  // what stood in them, with ids and without
  std::size_t count_ = 0;
};

}  // namespace

void fold_scale_textures(Description& description) { ScaleFolder(description).run(); }

}  // namespace octrad
