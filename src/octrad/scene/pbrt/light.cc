// Lights of pbrt that are no surfaces.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "octrad/base/memory_limit.h"
#include "octrad/base/number_text.h"
#include "octrad/image/io.h"
#include "octrad/scene/params.h"
#include "octrad/scene/pbrt/parts.h"
#include "octrad/scene/picture_values.h"

namespace octrad {
namespace {

// Where the direction (x, y, z) lies in a square picture of all directions, both coordinates in [0, 1]: Clarberg, P.
// 2008, "Fast Equal-Area Mapping of the (Hemi)Sphere using SIMD".
Vec2<double> equal_area_square(Vec3d d) {
  const double x = std::fabs(d.x), y = std::fabs(d.y), z = std::fabs(d.z), r = std::sqrt(std::max(0.0, 1.0 - z));
  const double larger = std::max(x, y), smaller = std::min(x, y);
  double phi = larger > 0.0 ? std::atan2(smaller, larger) * 2.0 / std::numbers::pi : 0.0;
  if (x < y) phi = 1.0 - phi;
  double v = phi * r, u = r - v;
  if (d.z < 0.0) {
    std::swap(u, v);
    u = 1.0 - u;
    v = 1.0 - v;
  }
  return {0.5 * (std::copysign(u, d.x) + 1.0), 0.5 * (std::copysign(v, d.y) + 1.0)};
}

// An envmap of Mitsuba has y up and begins at -z; pbrt's environments have z up and begin at +x.
Transform envmap_of_pbrt() {
  Transform t;
  t.m = {0, 0, -1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1};
  return t;
}

// A picture by latitude and longitude, as Mitsuba has it, of one by equal areas.
Image unfold(const Image& in, const std::string& file) {
  const MemoryScope scope;
  const int height = std::max(in.height, 2), width = 2 * height;
  ask_memory(static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height) * 12, file);
  Image out(width, height, {"R", "G", "B"});
  const std::vector<int> from = color_channels(in);
  const Transform turn = envmap_of_pbrt();
  for (int y = 0; y < height; ++y) {
    const double theta = (y + 0.5) / height * std::numbers::pi;
    for (int x = 0; x < width; ++x) {
      const double phi = (x + 0.5) / width * 2.0 * std::numbers::pi;
      // Mitsuba: u = atan2(x, -z) / 2 pi, v = acos(y) / pi.
      const Vec3d d{std::sin(phi) * std::sin(theta), std::cos(theta), -std::cos(phi) * std::sin(theta)};
      const Vec2<double> uv = equal_area_square(turn.vector(d));
      for (int c = 0; c < 3; ++c) {
        // Pixels beyond the edge are the edge's: the square is folded there.
        const auto at = [&](int px, int py) {
          return linear_value(in, in.at(std::clamp(px, 0, in.width - 1), std::clamp(py, 0, in.height - 1),
                                        from[static_cast<std::size_t>(c)]));
        };
        out.at(x, y, c) = static_cast<float>(between_pixels(uv.x * in.width, uv.y * in.height, at));
      }
    }
  }
  return out;
}

void add_infinite(const PbrtObject& l, const Transform& ctm, bool old, PbrtMaterials& materials,
                  Description& description, SceneReport& report) {
  const Location where = l.location();
  Vec3d factor = materials.strength(l, "L");
  const char* name = l.has("mapname") ? "mapname" : "filename";
  if (l.text(name, "").empty()) {  // also as exporters write it where there is none
    // Of radiance 1 everywhere a surface receives pi.
    if (l.has("illuminance")) factor = factor * (l.number("illuminance", 1.0, 0.0) / std::numbers::pi);
    for (const auto& known : description.root->children) {
      if (known->tag != "emitter" || known->get("type") != "constant") continue;
      Element& radiance = *known->child("radiance");  // several add up
      const auto sum = parse_numbers(radiance.get("value"));
      radiance.set("value", three_numbers(factor + Vec3d((*sum)[0], (*sum)[1], (*sum)[2])));
      return;
    }
    Element& e = add_element(*description.root, where, "emitter", {{"type", "constant"}});
    add_pbrt_value(e, where, "rgb", "radiance", three_numbers(factor));
    return;
  }
  if (l.has("illuminance"))
    fail(l.where("illuminance"), "the illuminance of a picture of the sky is not supported; give its scale");
  const std::string file = absolute_path(description.resolve(l.text(name, ""), l.where(name)));
  Element& e = add_element(*description.root, where, "emitter", {{"type", "envmap"}});
  if (factor.x != factor.y || factor.x != factor.z) {
    report.assume(where, "the colour L of a light with a picture is read as its mean");
    factor = Vec3d(channel_mean(factor));
  }
  // Version 4 maps a square by equal areas; version 3 has latitude and longitude.
  BuiltPicture built;
  built.read = [file] {
    const Image in = read_image(file);
    if (in.width != in.height) return in;
    return unfold(in, file);
  };
  std::string picture = file;
  if (!old) picture = materials.build_picture("environment " + file, std::move(built));
  add_pbrt_value(e, l.where(name), "string", "filename", picture);
  add_pbrt_value(e, where, "float", "scale", number_text(factor.x));
  Transform turn = ctm;
  for (int row = 0; row < 3; ++row) turn(row, 3) = 0.0;
  add_matrix(e, where, "to_world", turn * envmap_of_pbrt());
}

}  // namespace

void add_pbrt_light(const PbrtObject& l, const Transform& ctm, bool old, PbrtMaterials& materials,
                    Description& description, SceneReport& report) {
  const Location where = l.location();
  const std::string& type = l.type();
  const Vec3d from = l.point("from", Vec3d(0.0)), to = l.point("to", {0, 0, 1});
  l.ignore({"samples", "nsamples"});
  Element& root = *description.root;
  if (type == "infinite") {
    add_infinite(l, ctm, old, materials, description, report);
  } else if (type == "distant") {
    double factor = 1.0;
    if (l.has("illuminance")) factor = l.number("illuminance", 1.0, 0.0);
    const Vec3d direction = ctm.vector(to - from);
    if (!(length(direction) > 0.0)) fail(where, "the light has no direction");
    Element& e = add_element(root, where, "emitter", {{"type", "directional"}});
    add_pbrt_value(e, where, "rgb", "irradiance", three_numbers(materials.strength(l, "L") * factor));
    add_pbrt_value(e, where, "vector", "direction", three_numbers(normalize(direction)));
  } else if (type == "point" || type == "spot") {
    const double outer = l.number("coneangle", 30.0, 0.01, 179.9),
                 inner = std::max(outer - l.number("conedeltaangle", 5.0, 0.0, 180.0), 0.0);
    double factor = 1.0;
    if (l.has("power")) {
      // Of a light of intensity 1: 4 pi, or what the cone and its edge, which falls smoothly, let out.
      const double out = std::cos(outer / kPbrtDegrees), in = std::cos(inner / kPbrtDegrees);
      factor = l.number("power", 0.0, 0.0) /
               (type == "point" ? 4.0 * std::numbers::pi : 2.0 * std::numbers::pi * ((1.0 - in) + 0.5 * (in - out)));
    }
    Element& e = add_element(root, where, "emitter", {{"type", type}});
    add_pbrt_value(e, where, "rgb", "intensity", three_numbers(materials.strength(l, "I") * factor));
    if (type == "point") {
      add_matrix(e, where, "to_world", Transform::translate(old ? ctm.column(3) + from : ctm.point(from)));
    } else {
      const Vec3d p = ctm.point(from), q = ctm.point(to), axis = q - p;
      const Vec3d up = std::fabs(axis.x) > 0.9 * length(axis) ? Vec3d(0, 1, 0) : Vec3d(1, 0, 0);
      const auto view = Transform::look_at(p, q, up);
      if (!view) fail(where, "the light has no direction");
      add_matrix(e, where, "to_world", *view);
      add_pbrt_value(e, where, "float", "cutoff_angle", number_text(outer));
      add_pbrt_value(e, where, "float", "beam_width", number_text(inner));
      report.assume(where, "the light of a spot falls linearly with the angle between its cones, as in Mitsuba");
    }
  } else {
    fail(where, l.what() + " is not supported; supported: point, spot, distant, infinite");
  }
  l.note_unused(report);
}

}  // namespace octrad
