// What libFuzzer's own changes hardly ever make: a value of text that is another number, an element of XML or a value
// of JSON in another place, and files that still fit after a change (lengths, check sums, compressed parts).
#include <zlib.h>

#include <cstdint>
#include <cstring>
#include <iterator>
#include <random>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mutate.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

namespace octrad::fuzz {
namespace {

using Random = std::minstd_rand;
using Span = std::pair<std::size_t, std::size_t>;  // first byte, and the one after the last

constexpr std::string_view kNumbers[] = {"0",
                                         "-0",
                                         "1",
                                         "-1",
                                         "2",
                                         "3",
                                         "0.5",
                                         "-0.5",
                                         "1e-6",
                                         "1e-30",
                                         "1e-45",
                                         "1e18",
                                         "1e38",
                                         "1e39",
                                         "1e-310",
                                         "1e308",
                                         "1e400",
                                         "nan",
                                         "inf",
                                         "-inf",
                                         "7",
                                         "16",
                                         "255",
                                         "256",
                                         "1000",
                                         "4096",
                                         "65535",
                                         "65536",
                                         "131072",
                                         "1000000",
                                         "1e7",
                                         "99999999",
                                         "360",
                                         "180",
                                         "2147483647",
                                         "2147483648",
                                         "-2147483648",
                                         "4294967295",
                                         "4294967296",
                                         "9007199254740993",
                                         "9223372036854775807",
                                         "18446744073709551615",
                                         "0x10",
                                         "1,2",
                                         "1 2 3"};

std::size_t below(Random& random, std::size_t count) { return random() % count; }

std::string fuzzed(std::string bytes, std::size_t room) {
  const std::size_t size = bytes.size();
  if (size + room == 0) return bytes;
  bytes.resize(size + room);
  bytes.resize(LLVMFuzzerMutate(reinterpret_cast<std::uint8_t*>(bytes.data()), size, bytes.size()));
  return bytes;
}

bool is_json(const std::string& text) {
  const std::size_t start = text.find_first_not_of(" \t\r\n");
  return start != std::string::npos && (text[start] == '{' || text[start] == '[');
}

// Elements of XML, values of JSON in brackets; of other text its lines.
std::vector<Span> parts(const std::string& text) {
  std::vector<Span> spans;
  std::vector<std::size_t> open;
  const bool json = is_json(text), xml = !json && text.find('<') != std::string::npos;
  for (std::size_t i = 0, line = 0; i < text.size(); ++i) {
    const char c = text[i], next = i + 1 < text.size() ? text[i + 1] : '\0';
    std::size_t end = 0;
    if (json && c == '"') {
      for (++i; i < text.size() && text[i] != '"'; ++i) i += text[i] == '\\';
    } else if (json ? c == '{' || c == '[' : xml && c == '<' && next >= 'A') {
      open.push_back(i);
    } else if (json ? c == '}' || c == ']' : xml && c == '/' && next == '>') {
      end = json ? i + 1 : i + 2;
    } else if (xml && c == '<' && next == '/') {
      end = text.find('>', i) + 1;  // 0 if there is none
    } else if (!json && !xml && c == '\n') {
      spans.push_back({line, i + 1});
      line = i + 1;
    }
    if (end == 0 || open.empty()) continue;
    spans.push_back({open.back(), end});
    open.pop_back();
  }
  return spans;
}

// Numbers if `quoted` is not set, else what is between quotes.
std::vector<Span> values(const std::string& text, bool quoted) {
  std::vector<Span> spans;
  for (std::size_t i = 0; i < text.size(); ++i) {
    std::size_t end = i;
    if (quoted && text[i] == '"') {
      end = text.find('"', ++i);
      if (end == std::string::npos) break;
    } else if (!quoted && std::strchr("-0123456789", text[i]) != nullptr && text[i] != '\0') {
      end = text.find_first_not_of("0123456789+-.eE", i);
      end = end == std::string::npos ? text.size() : end;
    } else {
      continue;
    }
    spans.push_back({i, end});
    i = end;
  }
  return spans;
}

// `from` lends what is put into `text`; both may be the same.
std::string changed_text(std::string text, const std::string& from, Random& random) {
  const auto replace = [&](const Span& place, std::string_view by) {
    text.replace(place.first, place.second - place.first, by);
  };
  const std::size_t how = below(random, 8);
  if (how < 4) {
    const bool quoted = how == 3;
    const std::vector<Span> places = values(text, quoted), others = values(from, quoted);
    if (places.empty() || others.empty()) return text;
    const Span other = others[below(random, others.size())];
    const std::string copy = from.substr(other.first, other.second - other.first);
    const bool odd = how < 2;
    replace(places[below(random, places.size())], odd ? kNumbers[below(random, std::size(kNumbers))] : copy);
    return text;
  }
  const std::vector<Span> places = parts(text), others = parts(from);
  if (places.empty() || others.empty()) return text;
  const Span place = places[below(random, places.size())], other = others[below(random, others.size())];
  const std::string copy = from.substr(other.first, other.second - other.first);
  if (how == 4) replace(place, "");
  else if (how == 5) replace(place, copy);
  else replace({place.first, place.first}, is_json(text) ? copy + "," : copy);
  return text;
}

std::string changed(std::string bytes, const std::string& from, std::size_t room, Random& random) {
  return below(random, 2) == 0 ? fuzzed(std::move(bytes), room) : changed_text(std::move(bytes), from, random);
}

template <typename T>
T number(const std::string& bytes, std::size_t at) {
  T value{};
  if (at + sizeof value <= bytes.size()) std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

template <typename T>
void set_number(std::string& bytes, std::size_t at, T value) {
  if (at + sizeof value <= bytes.size()) std::memcpy(bytes.data() + at, &value, sizeof value);
}

// A header whose length, 32 bits, lies at `length_at`: of safetensors, and the JSON of a binary glTF file.
std::string changed_header(const std::string& bytes, std::size_t length_at, std::size_t start, const std::string& from,
                           std::size_t room, Random& random) {
  const std::size_t length = number<std::uint32_t>(bytes, length_at);
  if (bytes.size() < start || length > bytes.size() - start || below(random, 8) == 0) return fuzzed(bytes, room);
  std::string header = bytes.substr(start, length), rest = bytes.substr(start + length);
  if (!rest.empty() && below(random, 4) == 0) rest = fuzzed(std::move(rest), room);
  else header = changed(std::move(header), from, room, random);
  std::string out = bytes.substr(0, start) + header + rest;
  set_number(out, length_at, static_cast<std::uint32_t>(header.size()));
  return out;
}

// libpng reads no chunk whose check sum is wrong.
void mend_png(std::string& bytes) {
  for (std::size_t at = 8; at + 12 <= bytes.size();) {
    const std::uint64_t length = __builtin_bswap32(number<std::uint32_t>(bytes, at));
    if (length > bytes.size() - at - 12) return;
    const uLong sum = crc32(0, reinterpret_cast<const Bytef*>(bytes.data() + at + 4), static_cast<uInt>(length + 4));
    set_number<std::uint32_t>(bytes, at + 8 + length, __builtin_bswap32(static_cast<std::uint32_t>(sum)));
    at += 12 + length;
  }
}

// The first mesh of a serialized file unpacked, changed and packed without compression; it becomes the only one.
std::string changed_serialized(const std::string& bytes, std::size_t room) {
  if (bytes.size() < 4) return fuzzed(bytes, room);
  std::string inside(std::size_t{1} << 16, '\0');
  z_stream stream{};
  if (inflateInit(&stream) != Z_OK) return bytes;
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data() + 4));
  stream.avail_in = static_cast<uInt>(bytes.size() - 4);
  stream.next_out = reinterpret_cast<Bytef*>(inside.data());
  stream.avail_out = static_cast<uInt>(inside.size());
  inflate(&stream, Z_FINISH);
  inside.resize(stream.total_out);
  inflateEnd(&stream);
  if (inside.empty()) return fuzzed(bytes, room);
  inside = fuzzed(inside, room);
  uLongf size = compressBound(inside.size());
  std::string packed(size, '\0');
  compress2(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(inside.data()),
            inside.size(), 0);
  packed.resize(size);
  const bool wide = bytes[2] != 3;
  return bytes.substr(0, 4) + packed + std::string(wide ? 8 : 4, '\0') + std::string("\1\0\0\0", 4);
}

}  // namespace

std::string changed_file(std::string_view target, const std::string& bytes, const std::string& from, std::size_t room,
                         unsigned seed) {
  Random random(seed);
  if (bytes.starts_with("glTF")) {
    std::string out = changed_header(bytes, 12, 20, from, room, random);
    set_number(out, 8, static_cast<std::uint32_t>(out.size()));
    return out;
  }
  if (target == "model" || target == "state") return changed_header(bytes, 0, 8, from, room, random);
  if (target == "serialized" && below(random, 2) == 0) return changed_serialized(bytes, room);
  for (const char* other : {"serialized", "png", "jpeg", "webp", "exr", "hdr", "pfm", "bmp", "tga"}) {
    if (target != other) continue;
    std::string out = fuzzed(bytes, room);
    if (target == "png" && below(random, 8) != 0) mend_png(out);
    return out;
  }
  return changed(bytes, from, room, random);
}

}  // namespace octrad::fuzz
