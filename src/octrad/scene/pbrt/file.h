// What a pbrt scene file is made of: tokens, and objects with typed parameters. The format is described in
// "pbrt-v4 Input File Format" and "pbrt-v3 Input File Format" (pbrt.org). Internal to pbrt*.cc.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "octrad/base/memory_limit.h"
#include "octrad/base/vec.h"
#include "octrad/scene/report.h"

namespace octrad {

struct PbrtToken {
  enum class Kind { end, word, text, number, open, close };
  Kind kind = Kind::end;
  std::string_view text;  // of a word, or of what stands between quotes
  double number = 0.0;
  std::size_t offset = 0;
};

class PbrtLexer {
 public:
  explicit PbrtLexer(std::shared_ptr<const SourceFile> source);  // reads the first token
  const PbrtToken& peek() const { return next_; }
  PbrtToken take();
  Location location(const PbrtToken& token) const { return {source_, token.offset}; }
  // Values between brackets or one without; `what` is for messages.
  double number(const char* what);
  std::vector<double> numbers(std::size_t count, const char* what);
  std::string text(const char* what);

 private:
  void advance();

  std::shared_ptr<const SourceFile> source_;
  std::size_t at_ = 0;
  PbrtToken next_;
};

struct PbrtParameter {
  std::string type, name;  // "float", "roughness"
  Location where;
  std::vector<double> numbers;
  std::vector<std::string> texts;
  std::size_t serial = 0;  // textures and named materials that were defined before it
  mutable bool used = false;
};
using PbrtParameters = std::vector<PbrtParameter>;

// The content of a file, decompressed where its name ends in .gz: then at most about `most` bytes that begin with
// `begin`. Throws IoError, InputError, MemoryError.
std::string read_pbrt_file(const std::string& file, std::uint64_t most, std::string_view begin = "");
// So that it is none of the names of what is built (built_files.h).
std::string absolute_path(const std::string& file);

// The parameters that follow in the file, up to the next word. `meter` counts their memory.
PbrtParameters read_pbrt_parameters(PbrtLexer& lexer, MemoryMeter& meter);

// A material, texture, light, shape, camera ... : its type, its parameters, and those that an Attribute directive has
// set for all objects of the kind. Functions throw SceneError at the parameter whose type or value is wrong.
class PbrtObject {
 public:
  using Defaults = std::vector<std::shared_ptr<const PbrtParameters>>;
  PbrtObject(std::string kind, std::string type, Location where, PbrtParameters own = {}, Defaults defaults = {})
      : kind_(std::move(kind)),
        type_(std::move(type)),
        where_(std::move(where)),
        own_(std::move(own)),
        defaults_(std::move(defaults)) {}

  const std::string& type() const { return type_; }
  const Location& location() const { return where_; }
  std::string what() const { return kind_ + " \"" + type_ + "\""; }

  // The last parameter of that name, or null; reading it counts as using it. The second: of one of these types.
  const PbrtParameter* find(std::string_view name) const;
  const PbrtParameter* find(std::string_view name, std::initializer_list<const char*> types) const;
  bool has(std::string_view name) const;  // does not count as using it
  Location where(std::string_view name) const;

  double number(std::string_view name, double fallback, double low = -1e30, double high = 1e30) const;
  bool flag(std::string_view name, bool fallback) const;
  std::string text(std::string_view name, const std::string& fallback) const;
  Vec3d point(std::string_view name, Vec3d fallback) const;
  void ignore(std::initializer_list<const char*> names) const;
  bool has_textures() const;

  // The same with another type: of a named material it is a parameter.
  PbrtObject with_type(std::string kind, std::string type) const;
  // Lists the parameters that nobody asked for as left out.
  void note_unused(SceneReport& report) const;

 private:
  template <typename Visit>
  void each(Visit&& visit) const;  // own ones first

  std::string kind_, type_;
  Location where_;
  PbrtParameters own_;
  Defaults defaults_;
};

}  // namespace octrad
