#include "octrad/scene/make_element.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "octrad/base/number_text.h"
#include "octrad/scene/limits.h"

namespace octrad {

Element& add_element(Element& parent, const Location& where, const std::string& tag, Attributes attributes) {
  auto element = std::make_unique<Element>();
  element->tag = tag;
  element->attributes = std::move(attributes);
  element->location = where;
  parent.children.push_back(std::move(element));
  return *parent.children.back();
}

std::unique_ptr<Element> make_property(const std::string& tag, const std::string& name, const std::string& value,
                                       const Element& near) {
  auto e = std::make_unique<Element>();
  e->tag = tag;
  e->location = near.location;
  if (!name.empty()) e->attributes.emplace_back("name", name);
  e->attributes.emplace_back("value", value);
  return e;
}

void add_matrix(Element& parent, const Location& where, const std::string& name, const Transform& t) {
  std::string numbers;
  for (const double v : t.m) {
    if (!numbers.empty()) numbers += ' ';
    numbers += number_text(v);
  }
  Element& transform = add_element(parent, where, "transform", {{"name", name}});
  add_element(transform, where, "matrix", {{"value", numbers}});
}

std::string three_numbers(Vec3d v) { return number_text(v.x) + ", " + number_text(v.y) + ", " + number_text(v.z); }

Element& make_sensor(Element& root, const Location& where, const Transform& to_world, const MadeSensor& sensor) {
  constexpr int kFilmHeight = 720;
  Element& element = add_element(root, where, "sensor", {{"type", sensor.type}});
  const auto value = [&](Element& parent, const char* tag, const char* name, const std::string& text) {
    add_element(parent, where, tag, {{"name", name}, {"value", text}});
  };
  if (sensor.type == "perspective") {
    value(element, "float", "fov", number_text(sensor.fov_degrees));
    value(element, "string", "fov_axis", "y");
  }
  value(element, "float", "near_clip", number_text(sensor.near_clip));
  value(element, "float", "far_clip", number_text(std::max(sensor.far_clip, sensor.near_clip * 2.0)));
  add_matrix(element, where, "to_world", to_world);
  Element& film = add_element(element, where, "film", {{"type", "hdrfilm"}});
  const int width = std::clamp(static_cast<int>(std::lround(kFilmHeight * sensor.aspect)), 1, kMostFilmPixels);
  value(film, "integer", "width", std::to_string(width));
  value(film, "integer", "height", std::to_string(kFilmHeight));
  return element;
}

Element& make_overview_sensor(Element& root, const Location& where, const Bounds3f& bounds) {
  const Vec3d center = (Vec3d(bounds.lower) + Vec3d(bounds.upper)) * 0.5;
  const double radius = std::max(0.5 * length(Vec3d(bounds.upper) - Vec3d(bounds.lower)), 1e-6);
  MadeSensor sensor;
  const double distance = radius / std::sin(0.5 * sensor.fov_degrees * std::numbers::pi / 180.0);
  sensor.near_clip = distance * 1e-4;
  sensor.far_clip = distance * 10.0;
  const Vec3d direction = normalize(Vec3d(0.5, 0.4, 1.0));
  const auto view = Transform::look_at(center + direction * distance, center, {0, 1, 0});
  return make_sensor(root, where, view.value_or(Transform()), sensor);
}

}  // namespace octrad
