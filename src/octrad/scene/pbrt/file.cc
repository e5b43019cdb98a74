#include "octrad/scene/pbrt/file.h"

#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "octrad/base/input_file.h"
#include "octrad/base/join.h"
#include "octrad/base/lower_case.h"
#include "octrad/base/read_decimal.h"

namespace octrad {
namespace {

constexpr std::size_t kLongestText = 4096, kLongestName = 200;  // messages repeat them

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n' || c == '\f' || c == '\v'; }

bool ends_word(char c) { return is_blank(c) || c == '"' || c == '[' || c == ']' || c == '#'; }

std::string shown(const PbrtToken& token) {
  constexpr std::size_t kLongest = 60;
  switch (token.kind) {
    case PbrtToken::Kind::end: return "the end of the file";
    case PbrtToken::Kind::open: return "[";
    case PbrtToken::Kind::close: return "]";
    default: return "\"" + std::string(token.text.substr(0, kLongest)) + "\"";
  }
}

// Of all members of the file; `begin`: what the content must begin with.
std::string inflated(const std::string& bytes, const std::string& file, std::uint64_t most, std::string_view begin) {
  z_stream stream{};
  if (inflateInit2(&stream, 16 + MAX_WBITS) != Z_OK) throw MemoryError(file + ": no memory to decompress");
  struct End {
    z_stream& s;
    ~End() { inflateEnd(&s); }
  } const end{stream};
  std::string out;
  constexpr std::size_t kStep = 1 << 20, kMostGiven = 1 << 30;
  std::size_t given = 0;
  int status = Z_OK;
  while (status == Z_OK) {
    if (stream.avail_in == 0) {
      const std::size_t next = std::min(bytes.size() - given, kMostGiven);
      if (next == 0) break;
      stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data() + given));
      stream.avail_in = static_cast<unsigned>(next);
      given += next;
    }
    const std::size_t before = out.size();
    if (before > most) throw InputError(file + ": more than " + std::to_string(most) + " bytes when decompressed");
    if (out.capacity() < before + kStep) {
      const std::size_t larger = std::max(2 * out.capacity(), before + kStep);
      ask_memory(larger, file);
      out.reserve(larger);
    }
    out.resize(before + kStep);
    stream.next_out = reinterpret_cast<Bytef*>(out.data() + before);
    stream.avail_out = kStep;
    status = inflate(&stream, Z_NO_FLUSH);
    out.resize(before + kStep - stream.avail_out);
    if (out.size() >= begin.size() && !out.starts_with(begin))
      throw InputError(file + ": what is compressed does not begin with \"" + std::string(begin) + "\"");
    if (status == Z_STREAM_END && (stream.avail_in > 0 || given < bytes.size())) status = inflateReset(&stream);
  }
  if (status != Z_STREAM_END) throw InputError(file + ": the gzip data is broken or cut off");
  return out;
}

}  // namespace

std::string read_pbrt_file(const std::string& file, std::uint64_t most, std::string_view begin) {
  std::string bytes = read_file(file);
  return ending_of(file) == ".gz" ? inflated(bytes, file, most, begin) : bytes;
}

std::string absolute_path(const std::string& file) {
  std::error_code code;
  const std::filesystem::path path = std::filesystem::absolute(file, code);
  return code ? file : path.string();
}

PbrtLexer::PbrtLexer(std::shared_ptr<const SourceFile> source) : source_(std::move(source)) {
  if (const std::size_t zero = source_->text().find('\0'); zero != std::string::npos)
    fail({source_, zero}, "the file is no text: it holds a byte 0");
  advance();
}

PbrtToken PbrtLexer::take() {
  const PbrtToken token = next_;
  if (token.kind != PbrtToken::Kind::end) advance();
  return token;
}

void PbrtLexer::advance() {
  const std::string& text = source_->text();
  while (at_ < text.size() && (is_blank(text[at_]) || text[at_] == '#')) {
    if (text[at_] != '#') ++at_;
    else at_ = std::min(text.find('\n', at_), text.size());
  }
  next_ = {};
  next_.offset = at_;
  if (at_ == text.size()) return;
  const char c = text[at_];
  if (c == '[' || c == ']') {
    next_.kind = c == '[' ? PbrtToken::Kind::open : PbrtToken::Kind::close;
    ++at_;
    return;
  }
  if (c == '"') {
    const std::size_t end = text.find_first_of("\"\n", at_ + 1);
    if (end == std::string::npos || text[end] != '"') fail({source_, at_}, "the quote is not closed on its line");
    next_.kind = PbrtToken::Kind::text;
    next_.text = std::string_view(text).substr(at_ + 1, end - at_ - 1);
    if (next_.text.size() > kLongestText) fail({source_, at_}, "a text of more than 4096 bytes");
    at_ = end + 1;
    return;
  }
  std::size_t end = at_;
  while (end < text.size() && !ends_word(text[end])) ++end;
  next_.text = std::string_view(text).substr(at_, end - at_);
  next_.kind = PbrtToken::Kind::word;
  if ((c >= '0' && c <= '9') || c == '-' || c == '+' || c == '.') {
    const char* begin = text.data() + at_ + (c == '+' ? 1 : 0);
    const auto result = read_decimal(begin, text.data() + end, next_.number);
    if (result.ec != std::errc() || result.ptr != text.data() + end || !std::isfinite(next_.number))
      fail({source_, at_}, shown(next_) + " is not a finite number");
    next_.kind = PbrtToken::Kind::number;
  }
  at_ = end;
}

double PbrtLexer::number(const char* what) {
  const PbrtToken token = take();
  if (token.kind != PbrtToken::Kind::number)
    fail(location(token), std::string("expected a number (") + what + "), not " + shown(token));
  return token.number;
}

std::vector<double> PbrtLexer::numbers(std::size_t count, const char* what) {
  const bool brackets = peek().kind == PbrtToken::Kind::open;
  if (brackets) take();
  std::vector<double> result;
  while (result.size() < count) result.push_back(number(what));
  if (brackets) {
    const PbrtToken token = take();
    if (token.kind != PbrtToken::Kind::close)
      fail(location(token), "expected ] after " + std::to_string(count) + " numbers, not " + shown(token));
  }
  return result;
}

std::string PbrtLexer::text(const char* what) {
  const PbrtToken token = take();
  if (token.kind != PbrtToken::Kind::text)
    fail(location(token), std::string("expected ") + what + " in quotes, not " + shown(token));
  return std::string(token.text);
}

PbrtParameters read_pbrt_parameters(PbrtLexer& lexer, MemoryMeter& meter) {
  using Kind = PbrtToken::Kind;
  PbrtParameters result;
  while (lexer.peek().kind == Kind::text) {
    const PbrtToken declaration = lexer.take();
    PbrtParameter p;
    p.where = lexer.location(declaration);
    const std::string_view words = declaration.text;
    const std::size_t begin = std::min(words.find_first_not_of(" \t"), words.size()),
                      end = std::min(words.find_first_of(" \t", begin), words.size()),
                      name = std::min(words.find_first_not_of(" \t", end), words.size());
    p.type = words.substr(begin, end - begin);
    p.name = words.substr(name, words.find_last_not_of(" \t") + 1 - name);
    if (p.type.size() + p.name.size() > kLongestName) fail(p.where, "the name of a parameter is longer than 200 bytes");
    if (p.type.empty() || p.name.empty())
      fail(p.where,
           "expected the type and the name of a parameter, such as \"float radius\", not " + shown(declaration));
    const bool flag = p.type == "bool";
    const auto value = [&](const PbrtToken& token) {
      const bool word = token.kind == Kind::word || token.kind == Kind::text;
      if (word && flag) {
        if (token.text != "true" && token.text != "false")
          fail(lexer.location(token), shown(token) + " is neither true nor false");
        ask_to_grow(p.numbers, p.where.file->name());
        p.numbers.push_back(token.text == "true" ? 1.0 : 0.0);
      } else if (token.kind == Kind::number && !flag) {
        ask_to_grow(p.numbers, p.where.file->name());
        p.numbers.push_back(token.number);
      } else if (token.kind == Kind::text) {
        p.texts.emplace_back(token.text);
        meter.add(sizeof(std::string) + token.text.size());
      } else {
        fail(lexer.location(token), "expected a value of the parameter \"" + p.name + "\", not " + shown(token));
      }
    };
    if (lexer.peek().kind == Kind::open) {
      lexer.take();
      while (lexer.peek().kind != Kind::close) value(lexer.take());
      lexer.take();
    } else {
      value(lexer.take());
    }
    if (!p.numbers.empty() && !p.texts.empty()) fail(p.where, "the parameter \"" + p.name + "\" has numbers and texts");
    meter.add(sizeof p + 64);
    result.push_back(std::move(p));
  }
  return result;
}

// The last of own ones counts, as in pbrt, then the last of the defaults.
template <typename Visit>
void PbrtObject::each(Visit&& visit) const {
  for (auto p = own_.rbegin(); p != own_.rend(); ++p) visit(*p);
  for (auto at = defaults_.rbegin(); at != defaults_.rend(); ++at) {
    for (auto p = (*at)->rbegin(); p != (*at)->rend(); ++p) visit(*p);
  }
}

const PbrtParameter* PbrtObject::find(std::string_view name) const {
  const PbrtParameter* found = nullptr;
  each([&](const PbrtParameter& p) {
    if (p.name != name) return;
    if (!found) found = &p;
    p.used = true;
  });
  return found;
}

const PbrtParameter* PbrtObject::find(std::string_view name, std::initializer_list<const char*> types) const {
  const PbrtParameter* p = find(name);
  if (!p) return nullptr;
  if (std::find(types.begin(), types.end(), p->type) == types.end()) {
    fail(p->where, "the parameter \"" + p->name + "\" of " + what() + " must be of the type " +
                       join(std::vector<std::string>(types.begin(), types.end()), " or ") + ", not " + p->type);
  }
  return p;
}

bool PbrtObject::has(std::string_view name) const {
  bool found = false;
  each([&](const PbrtParameter& p) { found |= p.name == name; });
  return found;
}

Location PbrtObject::where(std::string_view name) const {
  const PbrtParameter* p = find(name);
  return p ? p->where : where_;
}

double PbrtObject::number(std::string_view name, double fallback, double low, double high) const {
  const PbrtParameter* p = find(name, {"float", "integer"});
  if (!p) return fallback;
  if (p->numbers.size() != 1) fail(p->where, "the parameter \"" + p->name + "\" of " + what() + " must be one number");
  if (!(p->numbers[0] >= low && p->numbers[0] <= high)) {
    fail(p->where, "the parameter \"" + p->name + "\" of " + what() + " is out of range");
  }
  return p->numbers[0];
}

bool PbrtObject::flag(std::string_view name, bool fallback) const {
  const PbrtParameter* p = find(name, {"bool"});
  if (!p) return fallback;
  if (p->numbers.size() != 1)
    fail(p->where, "the parameter \"" + p->name + "\" of " + what() + " must be true or false");
  return p->numbers[0] != 0.0;
}

std::string PbrtObject::text(std::string_view name, const std::string& fallback) const {
  const PbrtParameter* p = find(name, {"string"});
  if (!p) return fallback;
  if (p->texts.size() != 1) fail(p->where, "the parameter \"" + p->name + "\" of " + what() + " must be one text");
  return p->texts[0];
}

Vec3d PbrtObject::point(std::string_view name, Vec3d fallback) const {
  const PbrtParameter* p = find(name, {"point", "point3", "vector", "vector3"});
  if (!p) return fallback;
  if (p->numbers.size() != 3)
    fail(p->where, "the parameter \"" + p->name + "\" of " + what() + " must be three numbers");
  return {p->numbers[0], p->numbers[1], p->numbers[2]};
}

void PbrtObject::ignore(std::initializer_list<const char*> names) const {
  for (const char* name : names) find(name);
}

PbrtObject PbrtObject::with_type(std::string kind, std::string type) const {
  return {std::move(kind), std::move(type), where_, own_, defaults_};
}

bool PbrtObject::has_textures() const {
  bool found = false;
  each([&](const PbrtParameter& p) { found |= p.type == "texture"; });
  return found;
}

void PbrtObject::note_unused(SceneReport& report) const {
  for (const PbrtParameter& p : own_) {
    if (!p.used) report.assume(p.where, "the parameter \"" + p.name + "\" of " + what() + " is left out");
  }
}

}  // namespace octrad
