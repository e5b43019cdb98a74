#include "octrad/scene/gltf/meshopt.h"

#include <meshoptimizer.h>

#include "octrad/base/memory_limit.h"
#include "octrad/scene/limits.h"

namespace octrad {
namespace {

constexpr std::size_t kMaxStride = 256;

// The library asserts these, which would end the program.
void check(const GltfObject& extension, const std::string& mode, const std::string& filter, std::uint64_t count,
           std::uint64_t stride) {
  if (count == 0 || count > kMostMeshElements * 3) extension.fail("the count is out of range");
  const bool attributes = mode == "ATTRIBUTES", triangles = mode == "TRIANGLES";
  if (!attributes && !triangles && mode != "INDICES")
    extension.fail("the mode must be ATTRIBUTES, TRIANGLES or INDICES, not \"" + mode + "\"");
  if (attributes ? stride == 0 || stride % 4 != 0 || stride > kMaxStride : stride != 2 && stride != 4)
    extension.fail("the byteStride does not fit the mode");
  if (triangles && count % 3 != 0) extension.fail("the count of TRIANGLES must be a multiple of 3");
  const bool fits = filter == "NONE" || (filter == "OCTAHEDRAL" && (stride == 4 || stride == 8)) ||
                    (filter == "QUATERNION" && stride == 8) || (filter == "EXPONENTIAL" && stride % 4 == 0);
  if (!fits || (filter != "NONE" && !attributes))
    extension.fail("the filter \"" + filter + "\" does not fit the mode and the byteStride");
}

}  // namespace

std::string decode_meshopt(const GltfObject& extension, std::string_view compressed) {
  const std::string mode = extension.text("mode", ""), filter = extension.text("filter", "NONE");
  const std::uint64_t count = extension.size("count", 0), stride = extension.size("byteStride", 0);
  check(extension, mode, filter, count, stride);
  const auto broken = [&] { extension.fail("the compressed data are broken"); };
  if (count * stride > kMeshoptRatio * compressed.size()) broken();
  ask_memory(count * stride, extension.location().text());
  std::string out(count * stride, '\0');
  const auto* in = reinterpret_cast<const unsigned char*>(compressed.data());
  const int failed = mode == "ATTRIBUTES" ? meshopt_decodeVertexBuffer(out.data(), count, stride, in, compressed.size())
                     : mode == "TRIANGLES"
                         ? meshopt_decodeIndexBuffer(out.data(), count, stride, in, compressed.size())
                         : meshopt_decodeIndexSequence(out.data(), count, stride, in, compressed.size());
  if (failed != 0) broken();
  if (filter == "OCTAHEDRAL") meshopt_decodeFilterOct(out.data(), count, stride);
  if (filter == "QUATERNION") meshopt_decodeFilterQuat(out.data(), count, stride);
  if (filter == "EXPONENTIAL") meshopt_decodeFilterExp(out.data(), count, stride);
  return out;
}

}  // namespace octrad
