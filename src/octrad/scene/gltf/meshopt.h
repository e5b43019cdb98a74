// Buffer views that EXT_meshopt_compression keeps small, as gltfpack and gltf-transform write them. Internal to the
// module.
//
// EXT_meshopt_compression, The Khronos Group 2021.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "octrad/scene/gltf/file.h"

namespace octrad {

// What no compressed data exceed: bytes that one byte stands for (64 vertices whose byte is that of the one before).
constexpr std::uint64_t kMeshoptRatio = 64;

// The content of a buffer view: `count` elements of `byteStride` bytes, as the object of the extension says.
// `compressed`: the bytes that this object refers to. Throws InputError where they are broken, MemoryError where there
// is no room for the content.
std::string decode_meshopt(const GltfObject& extension, std::string_view compressed);

}  // namespace octrad
