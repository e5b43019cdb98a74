// A hash of a scene's content, to check whether a model belongs to it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "octrad/scene/scene.h"

namespace octrad {

// 64-bit hash of `bytes` bytes, the same on every little-endian machine. Not for adversaries.
std::uint64_t hash_bytes(const void* data, std::size_t bytes, std::uint64_t seed);

// 16 hex digits over geometry, materials, textures, lights and environment; names, sensors and film do not count.
std::string scene_fingerprint(const Scene& scene);

// 16 hex digits over what trainings draw by beside that: the scene's sensors, `cameras`, and how likely each emitter is
// to be picked.
std::string sensors_fingerprint(const Scene& scene, const std::vector<Camera>& cameras);

// 16 hex digits over what cameras see: scene_fingerprint(), and whether they look through emitters, which caches do not
// depend on.
std::string picture_fingerprint(const Scene& scene);

}  // namespace octrad
