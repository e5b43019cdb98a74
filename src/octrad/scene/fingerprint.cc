#include "octrad/scene/fingerprint.h"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <numeric>
#include <type_traits>
#include <vector>

#include "octrad/base/rng.h"
#include "octrad/base/threads.h"

namespace octrad {
namespace {

// Mixes one word into the state. For a fixed state this is a bijection of the word, and for a fixed word one of the
// state, so that two inputs that differ in one word never collide in a lane.
std::uint64_t absorb(std::uint64_t state, std::uint64_t word) {
  return ((state << 27 | state >> 37) ^ mix64(word + 0x9e3779b97f4a7c15ull)) * 0xe7037ed1a0b428dbull + 1;
}

std::uint64_t load64(const unsigned char* p) {
  std::uint64_t v;
  std::memcpy(&v, p, 8);
  return v;
}

class Hasher {
 public:
  template <typename T>
  Hasher& add(const T& value) {
    static_assert(std::is_arithmetic_v<T> || std::is_enum_v<T>, "structs may have padding");
    state_ = hash_bytes(&value, sizeof value, state_);
    return *this;
  }
  Hasher& add(Vec3f v) { return add(v.x).add(v.y).add(v.z); }
  template <typename T>
  Hasher& add(const std::vector<T>& values) {
    static_assert(sizeof(T) == 4 * (sizeof(T) / 4) && alignof(T) == 4, "arrays of packed 32-bit numbers only");
    state_ = hash_bytes(values.data(), values.size() * sizeof(T), state_ ^ values.size());
    return *this;
  }
  template <std::size_t N>
  Hasher& add(const float (&values)[N]) {
    state_ = hash_bytes(values, sizeof values, state_);
    return *this;
  }
  Hasher& add(Vec2f v) { return add(v.x).add(v.y); }
  std::uint64_t state() const { return state_; }
  std::string text() const {
    char digits[17];
    std::snprintf(digits, sizeof digits, "%016llx", static_cast<unsigned long long>(state_));
    return digits;
  }

 private:
  std::uint64_t state_ = 0;
};

}  // namespace

std::uint64_t hash_bytes(const void* data, std::size_t bytes, std::uint64_t seed) {
  const auto* p = static_cast<const unsigned char*>(data);
  // Four independent lanes keep the multipliers busy.
  std::uint64_t lanes[4];
  for (std::uint64_t i = 0; i < 4; ++i) lanes[i] = mix64(seed + i + 1);
  std::size_t left = bytes;
  for (; left >= 32; left -= 32, p += 32) {
    for (std::size_t i = 0; i < 4; ++i) lanes[i] = absorb(lanes[i], load64(p + 8 * i));
  }
  unsigned char tail[32] = {};
  if (left > 0) std::memcpy(tail, p, left);
  for (std::size_t i = 0; i < 4; ++i) lanes[i] = absorb(lanes[i], load64(tail + 8 * i));
  std::uint64_t hash = absorb(seed, bytes);
  for (const std::uint64_t lane : lanes) hash = absorb(hash, lane);
  return mix64(hash);
}

std::string scene_fingerprint(const Scene& scene) {
  const std::size_t textures_end = scene.meshes.size() + scene.textures.size();
  std::vector<std::uint64_t> parts(textures_end + scene.measured.size());
  parallel_for(parts.size(), [&](std::size_t i) {
    Hasher h;
    if (i < scene.meshes.size()) {
      const TriangleMesh& m = scene.meshes[i];
      h.add(m.positions).add(m.normals).add(m.uvs).add(m.triangles).add(m.flip_normals);
      if (m.one_sided) h.add(m.one_sided);
    } else if (i >= textures_end) {
      const MeasuredMaterial& m = scene.measured[i - textures_end];
      const MeasuredLayout& l = m.layout;
      h.add(m.data).add(l.phi_count).add(l.theta_count).add(l.is_density);
      for (const MeasuredGrid& g : {l.normals, l.area, MeasuredGrid(l.visible_normals), MeasuredGrid(l.luminance)})
        h.add(g.width).add(g.height);
    } else {
      const Texture& t = scene.textures[i - scene.meshes.size()];
      h.add(t.kind).add(t.color0).add(t.color1).add(t.to_uv).add(t.filter).add(t.wrap).add(t.width).add(t.height).add(
          t.pixels);
    }
    parts[i] = h.state();
  });
  Hasher h;
  for (const std::uint64_t part : parts) h.add(part);
  for (const Sphere& s : scene.spheres) h.add(s.center).add(s.radius).add(s.flip_normals).add(s.to_local);
  for (const Shape& s : scene.shapes) h.add(s.kind).add(s.geometry).add(s.material).add(s.emitter);
  for (const Material& m : scene.materials) {
    // Names every member, so that one more does not compile before it is here.
    const auto& [id, type, two_sided, back, opacity, bump, bump_scale, reflectance, specular_reflectance,
                 specular_transmittance, alpha_u, alpha_v, distribution, sample_visible, nonlinear, int_ior, ext_ior,
                 eta, k, normal_map, bump_mirrored, bump_flips, bump_shadows, blended, measured, extra] = m;
    h.add(type).add(two_sided).add(back).add(opacity).add(bump).add(bump_scale);
    h.add(reflectance).add(specular_reflectance).add(specular_transmittance).add(alpha_u).add(alpha_v);
    h.add(distribution).add(sample_visible).add(nonlinear).add(int_ior).add(ext_ior).add(eta).add(k);
    // What came later, where it is used, so that the others keep their fingerprints.
    if (bump >= 0) h.add(normal_map).add(bump_mirrored).add(bump_flips).add(bump_shadows);
    if (measured >= 0) h.add(measured);
    if (needs_record(type)) {
      for (const int part : blended) h.add(part);
      for (int i = 0; i < ExtraParameter::count; ++i) {
        if (i < ExtraParameter::azimuthal_roughness || extra[i] >= 0) h.add(extra[i]);
      }
    }
  }
  for (const AreaLight& l : scene.area_lights) h.add(l.shape).add(l.radiance);
  // What came later counts only where it is used, so that the models of other scenes stay valid.
  for (const Placement& p : scene.placements) h.add(p.to_world);
  if (!scene.placements.empty()) {
    for (const Shape& s : scene.shapes) h.add(s.placement);
  }
  for (const DeltaLight& l : scene.delta_lights) {
    const auto& [kind, texture, position, axis, intensity, to_local, cos_cutoff, cos_beam, cutoff, inverse_transition,
                 sampling_weight, tan_x, tan_y, through_masks] = l;
    static_cast<void>(sampling_weight);  // changes no picture's mean
    h.add(kind).add(texture).add(position).add(axis).add(intensity).add(to_local).add(cos_cutoff).add(cos_beam);
    h.add(cutoff).add(inverse_transition).add(tan_x).add(tan_y);
    if (through_masks) h.add(through_masks);
  }
  for (const Environment& e : scene.environments) h.add(e.width).add(e.height).add(e.pixels).add(e.to_world);
  return h.text();
}

std::string sensors_fingerprint(const Scene& scene, const std::vector<Camera>& cameras) {
  Hasher h;
  for (const std::vector<Camera>* list : {&scene.cameras, &cameras}) {
    h.add(list->size());
    for (const Camera& c : *list) {
      // What comes later counts only where it is used, so that models can be trained on.
      const auto& [kind, origin, right, up, forward, fov_degrees, fov_axis, near_clip, far_clip, principal_point_offset,
                   crop_offset, crop_size, aperture_radius, focus_distance, half_size, film_width, film_height] = c;
      h.add(kind).add(origin).add(right).add(up).add(forward).add(fov_degrees).add(fov_axis).add(near_clip);
      h.add(far_clip).add(principal_point_offset).add(crop_offset).add(crop_size).add(aperture_radius);
      h.add(focus_distance).add(half_size);
      // Walks begin anywhere on the film: its shape counts, and not its pixels.
      const int common = std::max(1, std::gcd(film_width, film_height));
      h.add(film_width / common).add(film_height / common);
    }
  }
  return h.add(scene.sampling_weights()).text();
}

std::string picture_fingerprint(const Scene& scene) {
  return scene.fingerprint + (scene.hide_emitters ? " emitters hidden" : "");
}

}  // namespace octrad
