// Mitsuba's `serialized` meshes: several in a file, each a header of 4 bytes and a stream of zlib; at the end of the
// file where each begins and their number. Little-endian.
#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "octrad/base/input_file.h"
#include "octrad/base/memory_limit.h"
#include "octrad/scene/limits.h"
#include "octrad/scene/mesh.h"
#include "octrad/scene/source.h"

namespace octrad {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::uint16_t kMagic = 0x041c;
enum Flag : std::uint32_t { kNormals = 1, kTexcoords = 2, kColors = 8, kDouble = 0x2000 };
constexpr std::uint64_t kMostName = 1 << 16;    // read byte by byte
constexpr std::uint64_t kMostExpansion = 1100;  // of deflate, rounded up

class SerializedReader {
 public:
  SerializedReader(const std::string& name, const std::string& bytes) : name_(name), bytes_(bytes) {}
  ~SerializedReader() {
    if (open_) inflateEnd(&stream_);
  }
  SerializedReader(const SerializedReader&) = delete;
  SerializedReader& operator=(const SerializedReader&) = delete;

  RawMesh read(int index) {
    const std::uint16_t version = header(0);
    const auto [begin, end] = place_of(index, version);
    offset_ = begin;
    header(begin);
    start(begin + 4, end);
    const auto flags = inflated<std::uint32_t>();
    if (version == 4) {
      for (std::uint64_t length = 0; inflated<char>() != '\0'; ++length) {
        if (length == kMostName) fail_here("the mesh has a name of more than " + std::to_string(kMostName) + " bytes");
      }
    }
    const auto vertices = inflated<std::uint64_t>(), triangles = inflated<std::uint64_t>();
    const bool wide = (flags & kDouble) != 0;
    const std::uint64_t number = wide ? 8 : 4;
    const std::uint64_t vertex_bytes =
        number * (3u + (flags & kNormals ? 3u : 0u) + (flags & kTexcoords ? 2u : 0u) + (flags & kColors ? 3u : 0u));
    if (vertices > kMostMeshElements || triangles > kMostMeshElements)
      fail_here("the mesh has too many vertices or triangles: at most " + std::to_string(kMostMeshElements) + " each");
    if (triangles == 0) return {};
    if (vertices * vertex_bytes + triangles * 12 > (end - begin) * kMostExpansion) {
      fail_here("the mesh announces " + std::to_string(vertices) + " vertices and " + std::to_string(triangles) +
                " triangles, but only " + std::to_string(end - begin) + " compressed bytes follow");
    }
    ask_memory(vertices * 3 * sizeof(Vec3f) + triangles * sizeof(Vec3i), name_);
    RawMesh mesh;
    read_vectors(mesh.positions, vertices, wide);
    for (const Vec3f& p : mesh.positions) {
      if (!is_finite(p)) fail_here("a position is not finite");
    }
    if (flags & kNormals) read_vectors(mesh.normals, vertices, wide);
    if (flags & kTexcoords) read_vectors(mesh.uvs, vertices, wide);
    make_finite(mesh.normals);
    make_finite(mesh.uvs);
    if (flags & kColors) skip(vertices * 3 * number);
    mesh.triangles.resize(triangles);
    inflate_to(mesh.triangles.data(), triangles * sizeof(Vec3i));
    for (const Vec3i& triangle : mesh.triangles) {
      for (int i = 0; i < 3; ++i) {
        if (static_cast<std::uint32_t>(triangle[i]) >= vertices) {
          fail_here("a triangle refers to vertex " + std::to_string(static_cast<std::uint32_t>(triangle[i])) +
                    ", but there are " + std::to_string(vertices));
        }
      }
    }
    return mesh;
  }

 private:
  [[noreturn]] void fail_here(const std::string& message) const { fail(name_, bytes_, offset_, message); }

  template <typename T>
  T stored(std::uint64_t offset) const {
    T value;
    std::memcpy(&value, bytes_.data() + offset, sizeof value);
    return value;
  }

  std::uint16_t header(std::uint64_t offset) const {
    if (bytes_.size() < offset + 4 || stored<std::uint16_t>(offset) != kMagic)
      fail_here("not a serialized mesh: the first two bytes of a mesh must be 1c 04");
    const auto version = stored<std::uint16_t>(offset + 2);
    if (version != 3 && version != 4)
      fail_here("serialized meshes of version " + std::to_string(version) + " are not supported; supported: 3, 4");
    return version;
  }

  // First byte of mesh `index`, and the byte after its last.
  std::pair<std::uint64_t, std::uint64_t> place_of(int index, std::uint16_t version) {
    const std::uint64_t entry = version == 4 ? 8 : 4, size = bytes_.size();
    if (size < 8 + entry) fail_here("the file ends early");
    const std::uint64_t count = stored<std::uint32_t>(size - 4);
    if (count == 0 || count > (size - 8) / entry)
      fail_here("the file ends with no table of its meshes: it is cut off or of another kind");
    if (static_cast<std::uint64_t>(index) >= count) {
      fail_here("shape_index " + std::to_string(index) + ": the file holds " + std::to_string(count) +
                " meshes, numbered from 0");
    }
    const std::uint64_t table = size - 4 - count * entry;
    const auto begin_of = [&](std::uint64_t i) {
      return version == 4 ? stored<std::uint64_t>(table + i * 8) : std::uint64_t{stored<std::uint32_t>(table + i * 4)};
    };
    const auto i = static_cast<std::uint64_t>(index);
    const std::uint64_t begin = i == 0 ? 0 : begin_of(i);
    if (std::max(begin, begin_of(0)) > table - 4)
      fail_here("mesh " + std::to_string(index) + " begins outside of the file");
    return {begin, table};
  }

  void start(std::uint64_t begin, std::uint64_t end) {
    next_ = reinterpret_cast<const unsigned char*>(bytes_.data()) + begin;
    left_ = end - begin;
    if (inflateInit(&stream_) != Z_OK) fail_here("no memory to decompress the mesh");
    open_ = true;
  }

  void inflate_to(void* to, std::uint64_t bytes) {
    auto* out = static_cast<unsigned char*>(to);
    constexpr std::uint64_t kStep = 1 << 30;  // zlib counts in 32 bits
    while (bytes > 0) {
      if (stream_.avail_in == 0) {
        stream_.next_in = const_cast<unsigned char*>(next_);
        stream_.avail_in = static_cast<unsigned>(std::min(left_, kStep));
        next_ += stream_.avail_in;
        left_ -= stream_.avail_in;
      }
      const auto step = static_cast<unsigned>(std::min(bytes, kStep));
      stream_.next_out = out;
      stream_.avail_out = step;
      const int result = inflate(&stream_, Z_NO_FLUSH);
      const unsigned done = step - stream_.avail_out;
      out += done;
      bytes -= done;
      if (result != Z_OK && bytes > 0)
        fail_here(result == Z_STREAM_END || result == Z_BUF_ERROR ? "the compressed mesh ends early"
                                                                  : "the compressed mesh is damaged");
    }
  }

  template <typename T>
  T inflated() {
    T value;
    inflate_to(&value, sizeof value);
    return value;
  }

  void skip(std::uint64_t bytes) {
    char buffer[4096];
    for (; bytes > 0; bytes -= std::min<std::uint64_t>(bytes, sizeof buffer))
      inflate_to(buffer, std::min<std::uint64_t>(bytes, sizeof buffer));
  }

  template <typename Vector>
  void read_vectors(std::vector<Vector>& out, std::uint64_t count, bool wide) {
    out.resize(count);
    constexpr std::size_t kNumbers = sizeof(Vector) / sizeof(float);
    if (!wide) {
      inflate_to(out.data(), count * sizeof(Vector));
    } else {
      double row[kNumbers];
      for (Vector& v : out) {
        inflate_to(row, sizeof row);
        for (std::size_t i = 0; i < kNumbers; ++i) v[static_cast<int>(i)] = static_cast<float>(row[i]);
      }
    }
  }

  // Some exporters write nan where an edge has no length.
  template <typename Vector>
  static void make_finite(std::vector<Vector>& vectors) {
    for (Vector& v : vectors) {
      for (std::size_t i = 0; i < sizeof(Vector) / sizeof(float); ++i) {
        if (!std::isfinite(v[static_cast<int>(i)])) v = Vector{};
      }
    }
  }

  const std::string& name_;
  const std::string& bytes_;
  std::uint64_t offset_ = 0;  // of the mesh, for messages
  z_stream stream_{};
  bool open_ = false;
  const unsigned char* next_ = nullptr;
  std::uint64_t left_ = 0;
};

}  // namespace

RawMesh parse_serialized(const std::string& name, const std::string& bytes, int index) {
  return SerializedReader(name, bytes).read(index);
}

RawMesh read_serialized(const std::string& file, int index) { return parse_serialized(file, read_file(file), index); }

}  // namespace octrad
