// Typed access to the parameters of one object of a scene file. Parameters that were not read are an error, so that
// none is ignored silently.
#pragma once

#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "octrad/base/vec.h"
#include "octrad/scene/description.h"
#include "octrad/scene/transform.h"

namespace octrad {

inline constexpr const char* kNoMedia =
    " is not supported: light travels in straight lines between surfaces; remove it, or ignore it with --permissive";

// Numbers separated by commas and white space; nullopt when anything else is in between or a number is not finite.
std::optional<std::vector<double>> parse_numbers(const std::string& text);
// Linear colour of "#rrggbb"; none for other texts.
std::optional<Vec3d> parse_hex_color(const std::string& text);

class Params {
 public:
  // `element` is a plugin object such as <bsdf type="diffuse">.
  // Remarks that are no errors go to `warnings`.
  Params(const Description& description, const Element& element, std::vector<std::string>& warnings);

  const Element& element() const { return element_; }
  const Location& location() const { return element_.location; }
  const std::string& type() const { return type_; }
  // Throws that the type is not supported, `remark`, and what is: `known`, `others`.
  [[noreturn]] void fail_type(const std::vector<std::string>& known, const std::string& remark = "",
                              const std::string& others = "") const;
  // The object's name in messages: bsdf "diffuse".
  std::string what() const { return element_.tag + " \"" + type_ + "\""; }

  // Scalar parameters; the default where absent. float_in checks lower <= value <= upper.
  float get_float(const std::string& name, float fallback);
  float float_in(const std::string& name, float fallback, float lower, float upper);
  int int_in(const std::string& name, int fallback, int lower, int upper);
  bool get_bool(const std::string& name, bool fallback);
  std::string get_string(const std::string& name, const std::string& fallback);
  std::string required_string(const std::string& name);
  // One of `choices`, compared without case.
  std::string choice(const std::string& name, const std::string& fallback, const std::vector<std::string>& choices);
  Vec3d get_point(const std::string& name, Vec3d fallback);
  Transform get_transform(const std::string& name);

  // Whether the file gives it; does not count as reading it.
  bool given(const std::string& name) const;
  // The parameter as written (any of <float>, <rgb>, <texture>, <ref> ...), or null. For parameters with several types.
  const Element* find(const std::string& name);
  // Accepts a parameter that has no effect on the picture here.
  void ignore(const std::vector<std::string>& names);
  void ignore_rest();

  // Nested objects with this tag, references resolved, in file order; name attributes are not looked at.
  std::vector<const Element*> nested(const std::string& tag);

  Location where(const std::string& name) const;  // of the parameter, else of the object

  // Refuses the parameters and objects that were not read.
  void finish();

 private:
  SceneReport& report() const { return *description_.report; }
  void refuse(const Location& where, const std::string& message);
  // `names`: those of the children before.
  void check_child(std::size_t index, std::set<std::string_view>& names) const;
  void leave_out(const Element& child) const;
  void leave_out(const std::string& name) const;
  // What `get` returns; where that fails and mistakes are collected, the fallback.
  template <typename T, typename Get>
  T read(const std::string& name, T fallback, Get&& get) {
    if (!report().attempt(where(name), [&] { fallback = get(); })) leave_out(name);
    return fallback;
  }
  const Element* take(const std::string& name);
  const Element* take(const std::string& name, const std::vector<std::string>& tags);

  // Counts the objects that are being read.
  class Nesting {
   public:
    explicit Nesting(const Description& description) : description_(description) { ++description_.open; }
    ~Nesting() { --description_.open; }
    Nesting(const Nesting&) = delete;
    Nesting& operator=(const Nesting&) = delete;

   private:
    const Description& description_;
  };

  const Description& description_;
  const Nesting nesting_{description_};
  const Element& element_;
  std::vector<std::string>& warnings_;
  std::string type_;
  std::vector<bool> used_;
  std::vector<std::string> asked_, asked_tags_;
};

// Refuses attributes that are not in the list.
void check_attributes(const Element& element, const std::vector<std::string>& supported);

// value="x y z" or one number for all, or x=, y=, z= attributes, of which absent ones are the fallback's; `other`
// attributes are permitted.
Vec3d parse_vector(const Element& element, Vec3d fallback, const std::vector<std::string>& other = {});

// The element that a <ref> names (or the element itself when it is none).
const Element& follow_reference(const Description& description, const Element& element);

// For messages: how Mitsuba has called an element since version 0.4; empty where it has its name still.
std::string renamed_tag(const std::string& tag);

// <rgb value="..."> as linear RGB: one number, three numbers, or #rrggbb (sRGB encoded).
Vec3f parse_rgb(const Element& element);

// The transform operations inside <transform>, the first applied first.
Transform parse_transform(const Element& element, std::vector<std::string>& warnings);

}  // namespace octrad
