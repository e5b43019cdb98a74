#include <array>
#include <charconv>
#include <cmath>
#include <map>

#include "octrad/base/input_file.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/read_decimal.h"
#include "octrad/scene/limits.h"
#include "octrad/scene/mesh.h"
#include "octrad/scene/source.h"

namespace octrad {
namespace {

class ObjReader {
 public:
  ObjReader(const std::string& name, const std::string& text)
      : name_(name),
        text_(text),
        p_(text.data()),
        end_(p_ + text.size()) {
    if (text.starts_with("\xef\xbb\xbf")) p_ += 3;  // says that the text is UTF-8
  }

  RawMesh read() {
    while (p_ < end_) {
      skip_blanks();
      if (p_ == end_) break;
      if (*p_ == 'v') {
        read_vertex();
      } else if (*p_ == 'f' && p_ + 1 < end_ && is_blank(p_[1])) {
        ++p_;
        read_face();
      }
      skip_line();
    }
    if (positions_.empty()) fail_at(text_.data(), "the OBJ file holds no vertex");
    if (!any_uv_) mesh_.uvs.clear();
    if (!any_normal_) mesh_.normals.clear();
    return std::move(mesh_);
  }

 private:
  struct Corner {
    int v, vt, vn;
  };  // from 0; -1: not given
  struct Known {
    int vt, vn, index, next;
  };
  struct Counts {
    std::size_t v = 0, vt = 0, vn = 0;
  };

  static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

  [[noreturn]] void fail_at(const char* where, const std::string& message) const {
    fail(name_, text_, static_cast<std::size_t>(where - text_.data()), message);
  }

  // Blanks within a statement; a backslash before the line's end continues it.
  void skip_blanks() {
    while (p_ < end_) {
      if (is_blank(*p_)) {
        ++p_;
      } else if (*p_ == '\\') {
        const char* q = p_ + 1;
        while (q < end_ && *q == '\r') ++q;
        if (q == end_ || *q != '\n') return;
        p_ = q + 1;
      } else {
        return;
      }
    }
  }

  void skip_line() {
    while (p_ < end_ && *p_ != '\n') ++p_;
    if (p_ < end_) ++p_;
  }

  bool at_line_end() {
    skip_blanks();
    return p_ == end_ || *p_ == '\n' || *p_ == '#';
  }

  float read_float(const char* what, bool finite = true) {
    skip_blanks();
    const char* begin = p_ < end_ && *p_ == '+' ? p_ + 1 : p_;
    float value = 0.0f;
    const auto result = read_decimal(begin, end_, value);
    if (result.ec != std::errc()) fail_at(p_, std::string(what) + ": expected a number");
    if (finite && !std::isfinite(value)) fail_at(p_, std::string(what) + ": the number is not finite");
    p_ = result.ptr;
    if (p_ < end_ && !is_blank(*p_) && *p_ != '\n' && *p_ != '\\' && *p_ != '#')
      fail_at(p_, std::string(what) + ": expected a blank after the number");
    return value;
  }

  Vec3f read_vec3(const char* what) {
    const float x = read_float(what), y = read_float(what);
    return {x, y, read_float(what)};
  }

  // A statement v, vt or vn. Those that the faces before them have had read already are only counted.
  void read_vertex() {
    const char kind = p_ + 1 < end_ ? p_[1] : '\n';
    if (is_blank(kind)) {
      p_ += 1;
      if (so_far_.v++ < positions_.size()) return;
      ask_to_grow(positions_, name_);
      positions_.push_back(read_vec3("vertex"));  // w and colours are skipped
      first_.push_back(-1);
      if (positions_.size() > kMostMeshElements) fail_at(p_, "the OBJ file has too many vertices");
    } else if (kind == 't' && p_ + 2 < end_ && is_blank(p_[2])) {
      p_ += 2;
      if (so_far_.vt++ < uvs_.size()) return;
      ask_to_grow(uvs_, name_);
      // Some exporters write nan where an edge has no length: 0.
      const auto coordinate = [&] {
        const float value = read_float("texture vertex", false);
        return std::isfinite(value) ? value : 0.0f;
      };
      const float u = coordinate();
      uvs_.push_back({u, at_line_end() ? 0.0f : coordinate()});
    } else if (kind == 'n' && p_ + 2 < end_ && is_blank(p_[2])) {
      p_ += 2;
      if (so_far_.vn++ < normals_.size()) return;
      ask_to_grow(normals_, name_);
      normals_.push_back(read_vec3("vertex normal"));
    }
  }

  // All that the rest of the file has, for a face that stands before its vertices.
  void read_vertices_ahead() {
    const char* const here = p_;
    const Counts counted = so_far_;
    for (skip_line(); p_ < end_; skip_line()) {
      skip_blanks();
      if (p_ < end_ && *p_ == 'v') read_vertex();
    }
    p_ = here;
    so_far_ = counted;
    all_read_ = true;
  }

  // Index as written (1 is the first, -1 the last so far) to a position in `list`; -1 for a 0, which some exporters
  // write for none, where it is `optional`.
  template <typename T>
  int read_index(const std::vector<T>& list, std::size_t so_far, const char* what, bool optional = false) {
    const char* begin = p_ < end_ && *p_ == '+' ? p_ + 1 : p_;
    int value = 0;
    const auto result = std::from_chars(begin, end_, value);
    if (result.ec != std::errc()) fail_at(p_, std::string("face: expected the index of a ") + what);
    const std::int64_t index =
        value < 0 ? static_cast<std::int64_t>(so_far) + value : static_cast<std::int64_t>(value) - 1;
    if (value == 0 && optional) {
      p_ = result.ptr;
      return -1;
    }
    if (index >= static_cast<std::int64_t>(list.size()) && !all_read_) read_vertices_ahead();
    if (value == 0 || index < 0 || index >= static_cast<std::int64_t>(list.size())) {
      fail_at(p_, std::string("face: there is no ") + what + " " + std::to_string(value) + " (the file has " +
                      std::to_string(list.size()) + (value < 0 ? ", " + std::to_string(so_far) + " so far)" : ")"));
    }
    p_ = result.ptr;
    return static_cast<int>(index);
  }

  // v, v/vt, v//vn or v/vt/vn.
  Corner read_corner() {
    Corner corner{read_index(positions_, so_far_.v, "vertex"), -1, -1};
    if (p_ < end_ && *p_ == '/') {
      ++p_;
      if (p_ < end_ && *p_ != '/' && !is_blank(*p_) && *p_ != '\n')
        corner.vt = read_index(uvs_, so_far_.vt, "texture vertex", true);
      if (p_ < end_ && *p_ == '/') {
        ++p_;
        if (p_ < end_ && !is_blank(*p_) && *p_ != '\n')
          corner.vn = read_index(normals_, so_far_.vn, "vertex normal", true);
      }
    }
    if (p_ < end_ && !is_blank(*p_) && *p_ != '\n' && *p_ != '\\' && *p_ != '#')
      fail_at(p_, "face: expected a blank after the corner");
    return corner;
  }

  // Vertex of the mesh for a combination of indices; each combination becomes one vertex.
  int vertex(const Corner& corner) {
    int& head = first_[static_cast<std::size_t>(corner.v)];
    int length = 0;
    for (int i = head; i >= 0; i = known_[static_cast<std::size_t>(i)].next, ++length) {
      const Known& known = known_[static_cast<std::size_t>(i)];
      if (known.vt == corner.vt && known.vn == corner.vn) return known.index;
    }
    const int index = static_cast<int>(mesh_.positions.size());
    const bool crowded = length >= kLongestList;
    if (crowded) {
      const auto [at, inserted] = crowd_.emplace(std::array{corner.v, corner.vt, corner.vn}, index);
      if (!inserted) return at->second;
    }
    meter_.add(crowded ? 160 : 80);
    mesh_.positions.push_back(positions_[static_cast<std::size_t>(corner.v)]);
    mesh_.uvs.push_back(corner.vt >= 0 ? uvs_[static_cast<std::size_t>(corner.vt)] : Vec2f{});
    mesh_.normals.push_back(corner.vn >= 0 ? normals_[static_cast<std::size_t>(corner.vn)] : Vec3f{});
    any_uv_ |= corner.vt >= 0;
    any_normal_ |= corner.vn >= 0;
    if (!crowded) {
      known_.push_back({corner.vt, corner.vn, index, head});
      head = static_cast<int>(known_.size()) - 1;
    }
    return index;
  }

  void read_face() {
    const char* begin = p_;
    int corners = 0, first = -1, last = -1;
    while (!at_line_end()) {
      const int index = vertex(read_corner());
      if (corners == 0) first = index;
      ask_to_grow(mesh_.triangles, name_);
      if (corners >= 2) mesh_.triangles.push_back({first, last, index});
      last = index;
      ++corners;
    }
    if (mesh_.triangles.size() > kMostMeshElements) fail_at(begin, "the OBJ file has too many faces");
  }

  const std::string& name_;
  const std::string& text_;
  const char* p_;
  const char* end_;
  std::vector<Vec3f> positions_, normals_;
  std::vector<Vec2f> uvs_;
  Counts so_far_;           // statements up to the current one
  bool all_read_ = false;   // those after it as well
  std::vector<int> first_;  // of positions_: head of its list in known_
  std::vector<Known> known_;
  // A position has a few combinations. Where it has many, a list would take time in their square: the rest is here.
  static constexpr int kLongestList = 32;
  std::map<std::array<int, 3>, int> crowd_;  // by v, vt, vn
  MemoryMeter meter_{name_};
  RawMesh mesh_;
  bool any_uv_ = false, any_normal_ = false;
};

}  // namespace

RawMesh parse_obj(const std::string& name, const std::string& text) { return ObjReader(name, text).read(); }

RawMesh read_obj(const std::string& file) { return parse_obj(file, read_file(file)); }

}  // namespace octrad
