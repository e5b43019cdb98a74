// Buffer views that EXT_meshopt_compression keeps small, as gltfpack and gltf-transform write them. Internal to the
// module.
//
// EXT_meshopt_compression, The Khronos Group 2021.
#pragma once

#include <string>
#include <string_view>

#include "octrad/scene/gltf_file.h"

namespace octrad {

// The content of a buffer view: `count` elements of `byteStride` bytes, as the object of the extension says. `packed`:
// the bytes that this object refers to. Broken data are an InputError, as is more than memory has room for.
std::string unpack_meshopt(const GltfObject& extension, std::string_view packed);

}  // namespace octrad
