#include "scene/fingerprint.h"

#include <cstdio>
#include <cstring>
#include <type_traits>
#include <vector>

#include "base/threads.h"

namespace octrad {
namespace {

__extension__ typedef unsigned __int128 Wide;

std::uint64_t fold(std::uint64_t a, std::uint64_t b) {
  const Wide product = static_cast<Wide>(a) * b;
  return static_cast<std::uint64_t>(product) ^ static_cast<std::uint64_t>(product >> 64);
}

constexpr std::uint64_t kOdd[4] = {0xa0761d6478bd642full, 0xe7037ed1a0b428dbull, 0x8ebc6af09c88c6e3ull, 0x589965cc75374cc3ull};

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
  std::uint64_t state() const { return state_; }

 private:
  std::uint64_t state_ = kOdd[0];
};

}  // namespace

std::uint64_t hash_bytes(const void* data, std::size_t bytes, std::uint64_t seed) {
  const auto* p = static_cast<const unsigned char*>(data);
  std::uint64_t a = fold(seed ^ kOdd[0], bytes ^ kOdd[1]), b = a ^ kOdd[2];
  std::size_t left = bytes;
  for (; left >= 32; left -= 32, p += 32) {
    a = fold(load64(p) ^ kOdd[1], load64(p + 8) ^ a);
    b = fold(load64(p + 16) ^ kOdd[2], load64(p + 24) ^ b);
  }
  unsigned char tail[32] = {};
  if (left > 0) std::memcpy(tail, p, left);
  a = fold(load64(tail) ^ kOdd[1], load64(tail + 8) ^ a);
  b = fold(load64(tail + 16) ^ kOdd[2], load64(tail + 24) ^ b);
  return fold(a ^ kOdd[3], b ^ kOdd[1]);
}

std::string scene_fingerprint(const Scene& scene) {
  std::vector<std::uint64_t> parts(scene.meshes.size() + scene.textures.size());
  parallel_for(parts.size(), [&](std::size_t i) {
    Hasher h;
    if (i < scene.meshes.size()) {
      const TriangleMesh& m = scene.meshes[i];
      h.add(m.positions).add(m.normals).add(m.uvs).add(m.triangles).add(m.flip_normals);
    } else {
      const Texture& t = scene.textures[i - scene.meshes.size()];
      h.add(t.kind).add(t.color0).add(t.color1).add(t.to_uv).add(t.filter).add(t.wrap).add(t.width).add(t.height).add(t.pixels);
    }
    parts[i] = h.state();
  });
  Hasher h;
  for (const std::uint64_t part : parts) h.add(part);
  for (const Sphere& s : scene.spheres) h.add(s.center).add(s.radius).add(s.flip_normals).add(s.to_local);
  for (const Shape& s : scene.shapes) h.add(s.kind).add(s.geometry).add(s.material).add(s.emitter);
  for (const Material& m : scene.materials) {
    h.add(m.type).add(m.two_sided).add(m.back).add(m.opacity).add(m.bump).add(m.bump_scale).add(m.reflectance).add(m.specular_reflectance);
    h.add(m.specular_transmittance).add(m.alpha_u).add(m.alpha_v).add(m.distribution).add(m.sample_visible).add(m.nonlinear);
    h.add(m.int_ior).add(m.ext_ior).add(m.eta).add(m.k);
  }
  for (const AreaLight& l : scene.area_lights) h.add(l.shape).add(l.radiance);
  for (const Environment& e : scene.environments) h.add(e.width).add(e.height).add(e.pixels).add(e.to_world);
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(h.state()));
  return text;
}

}  // namespace octrad
