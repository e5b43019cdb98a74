#include "octrad/scene/params.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <utility>

#include "octrad/base/error.h"
#include "octrad/base/join.h"
#include "octrad/base/lower_case.h"
#include "octrad/base/number_text.h"
#include "octrad/base/read_decimal.h"
#include "octrad/image/tonemap_math.h"

namespace octrad {
namespace {

const std::vector<std::string> kPropertyTags = {"float",    "integer", "boolean", "string",   "rgb",
                                                "spectrum", "point",   "vector",  "transform"};
const std::vector<std::string> kObjectTags = {"bsdf",   "texture", "emitter",   "shape",      "sensor",
                                              "film",   "rfilter", "sampler",   "integrator", "medium",
                                              "volume", "phase",   "subsurface"};

bool is_property(const std::string& tag) {
  return std::find(kPropertyTags.begin(), kPropertyTags.end(), tag) != kPropertyTags.end();
}
bool is_object(const std::string& tag) {
  return std::find(kObjectTags.begin(), kObjectTags.end(), tag) != kObjectTags.end();
}

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

std::string trimmed(const std::string& text) {
  std::size_t begin = 0, end = text.size();
  while (begin < end && is_space(text[begin])) ++begin;
  while (end > begin && is_space(text[end - 1])) --end;
  return text.substr(begin, end - begin);
}

// Reads one number at `p`; null when there is none.
const char* read_number(const char* p, const char* end, double& value) {
  if (p < end && *p == '+') ++p;
  const auto result = read_decimal(p, end, value);
  return result.ec == std::errc() && std::isfinite(value) ? result.ptr : nullptr;
}

constexpr std::size_t kMaxParameters = 1000;  // of one object: each is looked for among the others
constexpr int kMaxOpen = 200;                 // objects in objects
// A few words refer to an object again, and reading it takes time.
constexpr std::uint64_t kReadAgain = 1'000'000, kReadAgainEach = 16;

const std::string& value_of(const Element& element) {
  const std::string* value = element.find("value");
  if (!value) fail(element.location, "<" + element.tag + "> needs the attribute \"value\"");
  return *value;
}

}  // namespace

void check_attributes(const Element& element, const std::vector<std::string>& supported) {
  for (const auto& [name, value] : element.attributes) {
    if (std::find(supported.begin(), supported.end(), name) == supported.end()) {
      fail(element.location, "<" + element.tag + "> has no attribute \"" + name + "\"" + did_you_mean(name, supported) +
                                 "; supported: " + join(supported));
    }
  }
}

namespace {

double parse_double(const Element& element) {
  check_attributes(element, {"name", "value"});
  const std::string text = trimmed(value_of(element));
  double value = 0.0;
  const char* end = read_number(text.data(), text.data() + text.size(), value);
  if (text.empty() || end != text.data() + text.size())
    fail(element.location, "\"" + value_of(element) + "\" is not a finite number");
  return value;
}

}  // namespace

Vec3d parse_vector(const Element& element, Vec3d fallback, const std::vector<std::string>& other) {
  std::vector<std::string> supported = {"value", "x", "y", "z"};
  supported.insert(supported.end(), other.begin(), other.end());
  check_attributes(element, supported);
  const bool by_component = element.find("x") || element.find("y") || element.find("z");
  if (const std::string* value = element.find("value")) {
    if (by_component)
      fail(element.location, "<" + element.tag + "> has both \"value\" and \"x\"/\"y\"/\"z\"; give one of them");
    const auto numbers = parse_numbers(*value);
    if (numbers && numbers->size() == 3) return {(*numbers)[0], (*numbers)[1], (*numbers)[2]};
    if (numbers && numbers->size() == 1) return Vec3d((*numbers)[0]);
    fail(element.location, "<" + element.tag + ">: \"" + *value + "\" is not one or three finite numbers");
  }
  if (!by_component && (element.tag == "translate" || element.tag == "scale")) return fallback;
  if (!by_component) fail(element.location, "<" + element.tag + "> needs \"value\" or some of \"x\", \"y\", \"z\"");
  Vec3d result = fallback;
  for (int i = 0; i < 3; ++i) {
    const std::string* text = element.find(std::string(1, static_cast<char>('x' + i)));
    if (!text) continue;
    const auto numbers = parse_numbers(*text);
    if (!numbers || numbers->size() != 1)
      fail(element.location, "<" + element.tag + ">: \"" + *text + "\" is not a finite number");
    result[i] = (*numbers)[0];
  }
  return result;
}

namespace {

Vec3d triple(const Element& element, const std::string& attribute) {
  const auto numbers = parse_numbers(element.get(attribute));
  if (!numbers || numbers->size() != 3) {
    fail(element.location,
         "<" + element.tag + ">: " + attribute + "=\"" + element.get(attribute) + "\" is not three finite numbers");
  }
  return {(*numbers)[0], (*numbers)[1], (*numbers)[2]};
}

// A unit vector at a right angle to `n`: the one that Mitsuba takes where <lookat> has no up vector (Duff et al. 2017).
Vec3d any_normal(Vec3d n) {
  const double sign = std::copysign(1.0, n.z), a = -1.0 / (sign + n.z);
  return {1.0 + sign * n.x * n.x * a, sign * n.x * n.y * a, -sign * n.x};
}

Transform parse_operation(const Element& e, std::vector<std::string>& warnings) {
  if (e.tag == "translate") return Transform::translate(parse_vector(e, Vec3d(0.0)));
  if (e.tag == "scale") return Transform::scale(parse_vector(e, Vec3d(1.0)));
  if (e.tag == "rotate") {
    const Vec3d axis = parse_vector(e, Vec3d(0.0), {"angle"});
    const auto angle = parse_numbers(e.get("angle"));
    if (!angle || angle->size() != 1)
      fail(e.location, "<rotate>: angle=\"" + e.get("angle") + "\" is not a finite number (degrees)");
    if (!(length(axis) > 0.0)) fail(e.location, "<rotate>: the axis is zero; give x, y, z");
    if (std::fabs(length(axis) - 1.0) > 1e-4 && warnings.size() < kMostIssues) {
      warnings.push_back(e.location.text() +
                         ": <rotate>: the axis was normalised (Mitsuba 3.9 does not: its result is not a rotation)");
    }
    return Transform::rotate(axis, (*angle)[0]);
  }
  if (e.tag == "matrix") {
    check_attributes(e, {"value"});
    const auto numbers = parse_numbers(value_of(e));
    if (!numbers || (numbers->size() != 16 && numbers->size() != 9)) {
      fail(e.location, "<matrix> needs 16 (or 9) finite numbers, row after row" +
                           (numbers ? ", not " + std::to_string(numbers->size()) : std::string("")));
    }
    Transform t;
    const int n = numbers->size() == 16 ? 4 : 3;
    for (int row = 0; row < n; ++row) {
      for (int column = 0; column < n; ++column)
        t(row, column) = (*numbers)[static_cast<std::size_t>(row * n + column)];
    }
    // Rounded by whoever wrote it.
    const double last[4] = {0.0, 0.0, 0.0, 1.0};
    bool rounded = true;
    for (int column = 0; column < 4; ++column) rounded = rounded && std::fabs(t(3, column) - last[column]) < 1e-5;
    for (int column = 0; rounded && column < 4; ++column) t(3, column) = last[column];
    if (!t.is_affine()) fail(e.location, "<matrix>: the last row must be 0 0 0 1");
    return t;
  }
  if (e.tag == "lookat" || e.tag == "lookAt" || e.tag == "look_at") {
    check_attributes(e, {"origin", "target", "up"});
    const Vec3d origin = triple(e, "origin"), target = triple(e, "target");
    Vec3d up(0.0);
    if (!e.get("up").empty()) up = triple(e, "up");
    if (!(length(up) > 0.0) && length(target - origin) > 0.0) up = any_normal(normalize(target - origin));
    const auto t = Transform::look_at(origin, target, up);
    if (!t)
      fail(e.location,
           "<lookat>: origin, target and up do not define a view (equal points, or up along the view direction)");
    return *t;
  }
  fail(e.location, "unknown transform operation <" + e.tag + ">" +
                       did_you_mean(e.tag, {"translate", "scale", "rotate", "matrix", "lookat"}) +
                       "; supported: translate, scale, rotate, matrix, lookat");
}

}  // namespace

std::optional<std::vector<double>> parse_numbers(const std::string& text) {
  std::vector<double> numbers;
  const char* p = text.data();
  const char* const end = p + text.size();
  bool separated = true;
  while (true) {
    while (p < end && (is_space(*p) || *p == ',')) {  // any number of them, as in Mitsuba
      separated = true;
      ++p;
    }
    if (p == end) return numbers;
    if (!separated) return std::nullopt;
    double value = 0.0;
    const char* next = read_number(p, end, value);
    if (!next) return std::nullopt;
    numbers.push_back(value);
    p = next;
    separated = false;
  }
}

std::optional<Vec3d> parse_hex_color(const std::string& text) {
  if (text.size() != 7 || text[0] != '#') return std::nullopt;
  Vec3d rgb;
  for (int i = 0; i < 3; ++i) {
    int byte = 0;
    const char* begin = text.data() + 1 + 2 * i;
    const auto result = std::from_chars(begin, begin + 2, byte, 16);
    if (result.ptr != begin + 2 || byte < 0) return std::nullopt;
    rgb[i] = decode_srgb(byte / 255.0);
  }
  return rgb;
}

Vec3f parse_rgb(const Element& element) {
  check_attributes(element, {"name", "value"});
  const std::string text = trimmed(value_of(element));
  if (const auto color = parse_hex_color(text)) return Vec3f(*color);
  const auto numbers = parse_numbers(text);
  if (!numbers || (numbers->size() != 1 && numbers->size() != 3)) {
    fail(element.location,
         "<rgb>: \"" + text +
             "\" is not a colour; supported: one number, three numbers (commas or spaces between), #rrggbb");
  }
  if (numbers->size() == 1) return Vec3f(static_cast<float>((*numbers)[0]));
  return {static_cast<float>((*numbers)[0]), static_cast<float>((*numbers)[1]), static_cast<float>((*numbers)[2])};
}

Transform parse_transform(const Element& element, std::vector<std::string>& warnings) {
  check_attributes(element, {"name"});
  Transform result;
  for (const auto& child : element.children) {
    if (!child->children.empty()) fail(child->children[0]->location, "<" + child->tag + "> holds no other elements");
    result = parse_operation(*child, warnings) * result;
  }
  return result;
}

std::string renamed_tag(const std::string& tag) {
  return tag == "camera" ? ", now called <sensor>" : tag == "luminaire" ? ", now called <emitter>" : "";
}

const Element& follow_reference(const Description& description, const Element& element) {
  if (element.tag != "ref") return element;
  check_attributes(element, {"id", "name"});
  const std::string* id = element.find("id");
  if (!id) fail(element.location, "<ref> needs the attribute \"id\"");
  const auto target = description.ids.find(*id);
  if (target == description.ids.end()) {
    fail(element.location,
         "<ref>: nothing has the id \"" + *id + "\"" + did_you_mean(*id, keys_near(description.ids, *id)));
  }
  return *target->second;
}

Params::Params(const Description& description, const Element& element, std::vector<std::string>& warnings)
    : description_(description),
      element_(element),
      warnings_(warnings),
      used_(element.children.size(), false) {
  check_attributes(element, {"type", "id", "name"});
  const std::string* type = element.find("type");
  if (!type || type->empty()) fail(element.location, "<" + element.tag + "> needs the attribute \"type\"");
  type_ = *type;
  if (element.children.size() > kMaxParameters)
    fail(element.location, what() + " has more than " + std::to_string(kMaxParameters) + " parameters");
  if (description.open > kMaxOpen)
    fail(element.location, what() + " is nested more than " + std::to_string(kMaxOpen) +
                               " deep: it may contain itself through its references");
  (std::exchange(element.was_read, true) ? description.read_again : description.read_once) += element.children.size();
  if (description.read_again > kReadAgain + kReadAgainEach * description.read_once)
    fail(element.location, "objects are referred to too often: " + std::to_string(description.read_again) +
                               " of their parameters would be read again");
  std::set<std::string_view> names;
  for (std::size_t i = 0; i < element.children.size(); ++i) {
    const Element& child = *element.children[i];
    used_[i] = !report().attempt(child.location, [&] { check_child(i, names); });
    if (used_[i]) leave_out(child);
  }
}

void Params::check_child(std::size_t i, std::set<std::string_view>& names) const {
  const Element& child = *element_.children[i];
  if (child.tag == "animation")
    fail(child.location, "<animation> inside " + what() + " is not supported: nothing moves; give one <transform>");
  if (child.tag != "ref" && !is_property(child.tag) && !is_object(child.tag)) {
    std::vector<std::string> known = kPropertyTags;
    known.insert(known.end(), kObjectTags.begin(), kObjectTags.end());
    known.push_back("ref");
    const bool operation = child.tag == "translate" || child.tag == "scale" || child.tag == "rotate" ||
                           child.tag == "matrix" || child.tag == "lookat";
    const std::string now = renamed_tag(child.tag);
    fail(child.location, "unknown element <" + child.tag + "> inside " + what() +
                             (operation     ? "; transform operations stand inside <transform>"
                              : now.empty() ? did_you_mean(child.tag, known)
                                            : now));
  }
  if (is_property(child.tag) && !child.find("name"))
    fail(child.location, "<" + child.tag + "> inside " + what() + " needs a name");
  const std::string& name = child.get("name");
  if (!name.empty() && !names.insert(name).second)
    fail(child.location, "parameter \"" + name + "\" of " + what() + " is given twice");
}

const Element* Params::take(const std::string& name) {
  asked_.push_back(name);
  for (std::size_t i = 0; i < used_.size(); ++i) {
    if (!used_[i] && element_.children[i]->get("name") == name) {
      used_[i] = true;
      return element_.children[i].get();
    }
  }
  return nullptr;
}

const Element* Params::take(const std::string& name, const std::vector<std::string>& tags) {
  const Element* found = take(name);
  if (found && std::find(tags.begin(), tags.end(), found->tag) == tags.end()) {
    fail(found->location, "parameter \"" + name + "\" of " + what() + " must be <" + join(tags, "> or <") + ">, not <" +
                              found->tag + ">");
  }
  return found;
}

Location Params::where(const std::string& name) const {
  for (const auto& child : element_.children) {
    if (child->get("name") == name) return child->location;
  }
  return element_.location;
}

void Params::fail_type(const std::vector<std::string>& known, const std::string& remark,
                       const std::string& others) const {
  fail(location(),
       what() + " is not supported" + did_you_mean(type_, known) + remark + "; supported: " + join(known) + others);
}

bool Params::given(const std::string& name) const {
  return std::any_of(element_.children.begin(), element_.children.end(),
                     [&](const auto& child) { return child->get("name") == name; });
}

float Params::get_float(const std::string& name, float fallback) {
  return read<float>(name, fallback, [&] {
    const Element* e = take(name, {"float", "integer"});
    if (!e) return fallback;
    const auto value = static_cast<float>(parse_double(*e));
    if (!std::isfinite(value)) fail(e->location, "\"" + e->get("value") + "\" is too large");
    return value;
  });
}

float Params::float_in(const std::string& name, float fallback, float lower, float upper) {
  const float value = get_float(name, fallback);
  if (!(value >= lower && value <= upper)) {
    refuse(where(name), "parameter \"" + name + "\" of " + what() + " is " + number_text(value) +
                            "; it must be between " + number_text(lower) + " and " + number_text(upper));
    leave_out(name);
    return fallback;
  }
  return value;
}

int Params::int_in(const std::string& name, int fallback, int lower, int upper) {
  return read<int>(name, fallback, [&] {
    const Element* e = take(name, {"integer"});
    if (!e) return fallback;
    check_attributes(*e, {"name", "value"});
    const std::string text = trimmed(value_of(*e));
    int value = 0;
    const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
    if (text.empty() || result.ec != std::errc() || result.ptr != text.data() + text.size()) {
      fail(e->location, "\"" + value_of(*e) + "\" is not a 32-bit integer");
    }
    if (value < lower || value > upper) {
      fail(e->location, "parameter \"" + name + "\" of " + what() + " is " + std::to_string(value) +
                            "; it must be between " + std::to_string(lower) + " and " + std::to_string(upper));
    }
    return value;
  });
}

bool Params::get_bool(const std::string& name, bool fallback) {
  return read<bool>(name, fallback, [&] {
    const Element* e = take(name, {"boolean"});
    if (!e) return fallback;
    check_attributes(*e, {"name", "value"});
    const std::string text = lower_case(trimmed(value_of(*e)));
    if (text != "true" && text != "false")
      fail(e->location, "\"" + value_of(*e) + "\" is not a boolean; supported: true, false");
    return text == "true";
  });
}

std::string Params::get_string(const std::string& name, const std::string& fallback) {
  const Element* e = take(name, {"string"});
  if (!e) return fallback;
  check_attributes(*e, {"name", "value"});
  return value_of(*e);
}

std::string Params::required_string(const std::string& name) {
  const Element* e = take(name, {"string"});
  if (!e) fail(location(), what() + " needs the parameter <string name=\"" + name + "\" value=\"...\"/>");
  check_attributes(*e, {"name", "value"});
  if (value_of(*e).empty()) fail(e->location, "parameter \"" + name + "\" of " + what() + " is empty");
  return value_of(*e);
}

std::string Params::choice(const std::string& name, const std::string& fallback,
                           const std::vector<std::string>& choices) {
  std::string value = lower_case(get_string(name, fallback));
  if (std::find(choices.begin(), choices.end(), value) == choices.end()) {
    refuse(where(name), "parameter \"" + name + "\" of " + what() + " cannot be \"" + value + "\"" +
                            did_you_mean(value, choices) + "; supported: " + join(choices));
    leave_out(name);
    return fallback;
  }
  return value;
}

Vec3d Params::get_point(const std::string& name, Vec3d fallback) {
  return read<Vec3d>(name, fallback, [&] {
    const Element* e = take(name, {"point", "vector"});
    return e ? parse_vector(*e, Vec3d(0.0), {"name"}) : fallback;
  });
}

Transform Params::get_transform(const std::string& name) {
  return read<Transform>(name, Transform(), [&] {
    const Element* e = take(name, {"transform"});
    return e ? parse_transform(*e, warnings_) : Transform();
  });
}

const Element* Params::find(const std::string& name) { return take(name); }

void Params::ignore(const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    if (const Element* found = take(name)) leave_out(*found);
  }
}

void Params::leave_out(const Element& child) const {
  if (description_.understood) description_.understood->left_out.insert(&child);
}

void Params::leave_out(const std::string& name) const {
  for (const auto& child : element_.children) {
    if (child->get("name") == name) leave_out(*child);
  }
}

void Params::refuse(const Location& where, const std::string& message) { report().refuse(where, message); }

void Params::ignore_rest() { used_.assign(used_.size(), true); }

std::vector<const Element*> Params::nested(const std::string& tag) {
  asked_tags_.push_back(tag);
  std::vector<const Element*> found;
  for (std::size_t i = 0; i < used_.size(); ++i) {
    if (used_[i]) continue;
    const Element& target = follow_reference(description_, *element_.children[i]);
    if (target.tag != tag) continue;
    used_[i] = true;
    found.push_back(&target);
  }
  return found;
}

void Params::finish() {
  if (std::find(used_.begin(), used_.end(), false) == used_.end()) return;
  std::vector<std::string> parameters;
  for (const std::string& word : asked_) {
    if (std::find(parameters.begin(), parameters.end(), word) == parameters.end()) parameters.push_back(word);
  }
  std::string supported = "; supported: " + (parameters.empty() ? std::string("none") : join(parameters));
  if (!asked_tags_.empty()) supported += "; nested: <" + join(asked_tags_, ">, <") + ">";
  for (std::size_t i = 0; i < used_.size(); ++i) {
    if (used_[i]) continue;
    const Element& child = *element_.children[i];
    const std::string& name = child.get("name");
    leave_out(child);
    if (child.tag == "sensor") {
      report().assume(child.location, "the <sensor> inside " + what() +
                                          " is left out; octrad query gives values at points of surfaces");
      continue;
    }
    // Mitsuba 0.6 warned of these; Mitsuba 3 takes them for mistakes.
    if (element_.old && is_property(child.tag)) {
      report().assume(child.location,
                      "parameter \"" + name + "\" of " + what() + " is not used" + did_you_mean(name, parameters));
      continue;
    }
    report().attempt(child.location, [&] {
      const Element& target = follow_reference(description_, child);
      if (target.tag == "medium" || target.tag == "subsurface")
        fail(child.location, "<" + target.tag + "> inside " + what() + kNoMedia);
      if (!name.empty())
        fail(child.location,
             "unknown parameter \"" + name + "\" of " + what() + did_you_mean(name, parameters) + supported);
      fail(child.location, "<" + target.tag + "> cannot stand inside " + what() + supported);
    });
  }
}

}  // namespace octrad
