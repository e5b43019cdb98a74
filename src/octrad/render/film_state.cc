#include "octrad/render/film_state.h"

#include <fmt/format.h>

#include <climits>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "octrad/base/error.h"
#include "octrad/base/json_file.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/version.h"
#include "octrad/model/safetensors.h"

namespace octrad {
namespace {

constexpr const char* kFormat = "octrad-film";
constexpr const char* kVersionOfFormat = "1";

}  // namespace

void write_film_state(const std::string& file, const FilmState& state, const FilmIdentity& identity) {
  TensorWriter out;
  out.metadata("format", kFormat);
  out.metadata("version", kVersionOfFormat);
  out.metadata("program", kVersion);
  out.metadata("identity", json_text(identity));
  out.metadata("state", nlohmann::json{{"samples", state.samples},
                                       {"largest_pass", state.largest_pass},
                                       {"seconds", state.seconds},
                                       {"rays", state.counts.rays},
                                       {"queries", state.counts.queries},
                                       {"non_finite", state.counts.non_finite}}
                            .dump());
  const auto pixels = static_cast<std::int64_t>(state.sums.size() / kFilmNumbers);
  out.add("film.sums", DType::f64, {pixels, kFilmNumbers}, state.sums.data());
  out.write(file);
}

FilmState read_film_state(const std::string& file, const FilmIdentity& identity) {
  const std::string no_state =
      "damaged, or not the state of a picture that this program can continue; delete the file to start anew";
  std::optional<TensorReader> opened;
  try {
    opened.emplace(file);
  } catch (const InputError&) {
    throw InputError(fmt::format("{}: {}", file, no_state));
  }
  const TensorReader& in = *opened;
  const auto text = [&](const std::string& key) {
    const auto found = in.metadata().find(key);
    return found == in.metadata().end() ? std::string() : found->second;
  };
  if (text("format") != kFormat || text("version") != kVersionOfFormat)
    throw InputError(fmt::format("{}: {}", file, no_state));
  FilmState state;
  try {
    const auto saved = parse_json(text("identity"), file).get<FilmIdentity>();
    for (const auto& [key, value] : identity) {
      const auto found = saved.find(key);
      const std::string other = found == saved.end() ? "unknown" : found->second;
      if (other != value)
        throw InputError(
            fmt::format("{}: its picture cannot be continued with other settings: {} was {}, now it is {}; delete "
                        "the file to start anew",
                        file, key, other, value));
    }
    const nlohmann::json numbers = parse_json(text("state"), file);
    const auto count = [&](const char* key, long long low, long long high) {
      return whole_number(numbers.at(key), low, high, fmt::format("{}: broken: {}", file, key));
    };
    state.samples = static_cast<int>(count("samples", 1, 1 << 30));
    state.largest_pass = static_cast<int>(count("largest_pass", 1, 1 << 30));
    state.seconds = numbers.at("seconds").get<double>();
    state.counts.rays = count("rays", 0, LLONG_MAX);
    state.counts.queries = count("queries", 0, LLONG_MAX);
    state.counts.non_finite = count("non_finite", 0, LLONG_MAX);
  } catch (const nlohmann::json::exception&) {
    throw InputError(fmt::format("{}: broken: its metadata cannot be read", file));
  }
  if (!(state.seconds >= 0.0)) throw InputError(fmt::format("{}: broken: {} seconds", file, state.seconds));
  try {
    const TensorReader::Tensor sums = in.get("film.sums", DType::f64, {-1, kFilmNumbers});
    ask_memory(sums.bytes, file);
    state.sums.resize(static_cast<std::size_t>(sums.count));
    in.read(sums, state.sums.data());
  } catch (const InputError&) {
    throw InputError(fmt::format("{}: {}", file, no_state));
  }
  in.require_unchanged();
  for (const double v : state.sums) {
    if (!std::isfinite(v)) throw InputError(fmt::format("{}: broken: a sum is not finite", file));
  }
  return state;
}

}  // namespace octrad
