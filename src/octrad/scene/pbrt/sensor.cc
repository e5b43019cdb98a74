// Cameras and films of pbrt.
#include <algorithm>
#include <cmath>

#include "octrad/base/number_text.h"
#include "octrad/scene/limits.h"
#include "octrad/scene/pbrt/parts.h"

namespace octrad {
namespace {

void add_film(Element& sensor, const PbrtObject& f, const PbrtObject* filter, bool old, const Location& where,
              double width, double height, SceneReport& report) {
  Element& e = add_element(sensor, where, "film", {{"type", "hdrfilm"}});
  const auto whole = [&](const char* name, double value) {
    add_pbrt_value(e, where, "integer", name, std::to_string(static_cast<long>(value)));
  };
  whole("width", width);
  whole("height", height);
  double crop[4] = {0.0, width, 0.0, height};
  const auto four = [](const PbrtParameter& p) {
    if (p.numbers.size() != 4) fail(p.where, "the parameter \"" + p.name + "\" of a film must be four numbers");
  };
  if (const PbrtParameter* p = f.find("cropwindow", {"float"})) {
    four(*p);
    for (int i = 0; i < 4; ++i)
      crop[i] = std::ceil(std::clamp(p->numbers[static_cast<std::size_t>(i)], 0.0, 1.0) * (i < 2 ? width : height));
  } else if (const PbrtParameter* q = f.find("pixelbounds", {"integer"})) {
    four(*q);
    for (int i = 0; i < 4; ++i)
      crop[i] = std::clamp(q->numbers[static_cast<std::size_t>(i)], 0.0, i < 2 ? width : height);
  }
  if (crop[0] < crop[1] && crop[2] < crop[3] && (crop[1] - crop[0] < width || crop[3] - crop[2] < height)) {
    whole("crop_offset_x", crop[0]);
    whole("crop_offset_y", crop[2]);
    whole("crop_width", crop[1] - crop[0]);
    whole("crop_height", crop[3] - crop[2]);
  }
  if (f.has("sensor") && f.text("sensor", "cie1931") != "cie1931")
    report.assume(f.location(), "the film shows linear sRGB: the response of its sensor is left out");
  f.ignore({"filename", "savefp16", old ? "scale" : "iso"});
  f.note_unused(report);
  // Without a filter that of version 3 is a box; version 4 has octrad's own gaussian.
  const std::string type = filter ? filter->type() : old ? "box" : "gaussian";
  const char* name = type == "box"        ? "box"
                     : type == "triangle" ? "tent"
                     : type == "mitchell" ? "mitchell"
                     : type == "sinc"     ? "lanczos"
                                          : "gaussian";
  if (std::string(name) == "gaussian" && type != "gaussian")
    report.assume(filter->location(), "PixelFilter \"" + type + "\" read as gaussian");
  Element& r = add_element(e, filter ? filter->location() : where, "rfilter", {{"type", name}});
  if (!filter) return;
  const auto value = [&](const char* key, double number) {
    add_pbrt_value(r, where, "float", key, number_text(number));
  };
  const auto radius = [&](double fallback) {
    return filter->number(filter->has("xradius") ? "xradius" : "xwidth", fallback, 0.05, 8.0);
  };
  if (type == "triangle") {
    const double wide = radius(2.0);
    value("radius", wide);
    if (filter->number(filter->has("yradius") ? "yradius" : "ywidth", wide) != wide)
      report.assume(filter->location(), "filters are as high as they are wide");
  }
  if (type == "mitchell") {
    value("B", filter->number("B", 1.0 / 3.0, 0.0, 1.0));
    value("C", filter->number("C", 1.0 / 3.0, 0.0, 1.0));
  }
  if (type == "sinc")
    add_pbrt_value(r, where, "integer", "lobes", number_text(std::lround(filter->number("tau", 3.0, 1.0, 8.0))));
  if (type == "gaussian") {
    // exp(-alpha x^2) in version 3.
    value("stddev", old ? std::clamp(std::sqrt(0.5 / filter->number("alpha", 2.0, 0.05, 1000.0)), 0.02, 2.0)
                        : filter->number("sigma", 0.5, 0.02, 2.0));
  }
  if (type != "triangle" && (filter->has("xradius") || filter->has("xwidth")))
    report.assume(filter->location(), "filters but the triangle reach as far as they do in Mitsuba");
  filter->ignore({"xradius", "yradius", "xwidth", "ywidth"});
  filter->note_unused(report);
}

}  // namespace

void add_pbrt_sensor(const PbrtObject& c, const Transform& camera_to_world, const PbrtObject* film,
                     const PbrtObject* filter, bool old, Element& root, SceneReport& report) {
  const Location where = c.location();
  const std::string& type = c.type();
  const bool orthographic = type == "orthographic";
  if (!orthographic && type != "perspective")
    fail(where, c.what() + " is not supported; supported: perspective, orthographic");
  static const PbrtObject no_film("Film", "", Location());
  const PbrtObject& f = film ? *film : no_film;
  const double width = std::floor(f.number("xresolution", 1280, 1, kMostFilmPixels)),
               height = std::floor(f.number("yresolution", 720, 1, kMostFilmPixels));
  const double aspect = c.number("frameaspectratio", width / height, 1e-3, 1e3);
  // Of the plane at distance 1 times the tangent of half the field of view, or in units of the camera.
  double window[4] = {-std::max(aspect, 1.0), std::max(aspect, 1.0), -std::max(1.0 / aspect, 1.0),
                      std::max(1.0 / aspect, 1.0)};
  if (const PbrtParameter* p = c.find("screenwindow", {"float"})) {
    if (p->numbers.size() != 4 || !(p->numbers[0] < p->numbers[1]) || !(p->numbers[2] < p->numbers[3]))
      fail(p->where, "the screenwindow must be four numbers: the ends of x and of y");
    std::copy(p->numbers.begin(), p->numbers.end(), window);
  }
  const double size_x = window[1] - window[0], size_y = window[3] - window[2];
  const double radius = c.number("lensradius", 0.0, 0.0), focus = c.number("focaldistance", 1e6, 0.0);
  c.ignore({"shutteropen", "shutterclose"});
  const bool lens = radius > 0.0 && !orthographic;
  if (orthographic && radius > 0.0) report.assume(where, "an orthographic camera has no lens");
  if (std::fabs(size_x * height - size_y * width) > 1e-3 * size_y * width)
    report.assume(where, "pixels are square: the screenwindow has the height that is given");

  // pbrt's x runs to the right of the picture, Mitsuba's to the left. Scales of the camera change no direction.
  Transform t = camera_to_world;
  double unit = 0.0;
  for (int i = 0; i < 3; ++i) {
    const double l = length(t.column(i));
    unit = std::max(unit, l);
    for (int row = 0; row < 3; ++row) t(row, i) /= l;
  }
  t = t * Transform::scale({-1.0, 1.0, 1.0});
  const double middle_x = 0.5 * (window[0] + window[1]), middle_y = 0.5 * (window[2] + window[3]);
  if (orthographic)
    t = t * Transform::translate({-middle_x * unit, middle_y * unit, 0.0}) *
        Transform::scale({0.5 * size_x * unit, 0.5 * size_y * unit * width / height, 1.0});

  Element& e = add_element(root, where, "sensor",
                           {{"type", orthographic ? "orthographic"
                                     : lens       ? "thinlens"
                                                  : "perspective"}});
  if (!orthographic) {
    const double half = std::tan(
        0.5 * (c.has("halffov") ? 2.0 * c.number("halffov", 45.0, 1e-3, 89.9) : c.number("fov", 90.0, 1e-3, 179.9)) /
        kPbrtDegrees);
    add_pbrt_value(e, where, "float", "fov", number_text(2.0 * std::atan(half * 0.5 * size_y) * kPbrtDegrees));
    add_pbrt_value(e, where, "string", "fov_axis", "y");
  }
  if (lens) {
    add_pbrt_value(e, where, "float", "aperture_radius", number_text(radius * unit));
    add_pbrt_value(e, where, "float", "focus_distance", number_text(focus * unit));
    if (middle_x != 0.0 || middle_y != 0.0)
      report.assume(where, "a camera with a lens looks straight on: the offset of its screenwindow is left out");
  } else if (!orthographic) {
    const double x = middle_x / size_x, y = middle_y / size_y;
    if (x != 0.0) add_pbrt_value(e, where, "float", "principal_point_offset_x", number_text(x));
    if (y != 0.0) add_pbrt_value(e, where, "float", "principal_point_offset_y", number_text(-y));
  }
  add_pbrt_value(e, where, "float", "near_clip", "0.0001");
  add_pbrt_value(e, where, "float", "far_clip", "1e10");
  add_matrix(e, where, "to_world", t);
  add_film(e, f, filter, old, where, width, height, report);
  c.note_unused(report);
}

}  // namespace octrad
