#include "octrad/network/adam_device.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "octrad/base/bits.h"
#include "octrad/base/error.h"
#include "octrad/base/rng.h"
#include "octrad/device/feature_width.h"
#include "octrad/device/launch.h"
#include "octrad/network/approach_math.h"
#include "octrad/network/packed_moments_math.h"

namespace octrad {
namespace {

// Advances an optimiser to the next step: its correction and rate, and the entries that the step moves.
struct AdvanceAdam : Kernel {
  static constexpr unsigned kBlock = 32;
  AdamStep* step;
  double beta1, beta2, rate;
  const float* rate_scale;
  std::uint32_t* listed;  // entries of the list, which becomes empty; null: all of `entries` move
  std::uint32_t entries;
  unsigned long long* touched;  // null: of a network

  OCTRAD_HD void operator()(std::uint32_t) const {
    const std::int64_t count = ++step->count;
    const AdamCorrection correction = adam_correction(beta1, beta2, static_cast<double>(count));
    step->rate = static_cast<float>(rate) * *rate_scale;
    step->scaled_rate = static_cast<float>(rate * static_cast<double>(*rate_scale)) * correction.first;
    step->second = correction.second;
    step->random = mix64(static_cast<std::uint64_t>(count));
    std::uint32_t moved = entries;
    if (listed != nullptr) {
      moved = step->listed = *listed;
      *listed = 0;
    }
    if (touched != nullptr) atomic_add(touched, static_cast<unsigned long long>(moved));
  }
};

struct DenseStep : Kernel {
  float* parameters;
  const float* gradients;
  float* m;
  float* v;
  AdamConstants constants;
  const AdamStep* step;
  unsigned long long* non_finite;

  OCTRAD_HD void operator()(std::uint32_t i) const {
    float gradient = gradients[i];
    if (!adam_usable(gradient)) {
      gradient = 0.0f;
      atomic_add(non_finite, 1ull);
    }
    parameters[i] = adam_update(parameters[i], gradient, m[i], v[i], constants, step->scaled_rate, step->second);
  }
};

// Rows of C floats, accessed with vector loads and stores.
template <int C>
struct alignas(C >= 4 ? 16 : 8) Row {
  float v[C];
};
template <int C>
struct alignas(C >= 8 ? 16 : C * 2) HalfRow {
  std::uint32_t v[C / 2];
};

// The moments of entries, as floats or in half the bytes.
template <int C>
struct FloatMoments {
  float* data;  // [entries][2][C]

  OCTRAD_HD void load(std::uint32_t entry, Row<C>& m, Row<C>& v) const {
    const Row<C>* rows = reinterpret_cast<const Row<C>*>(data) + static_cast<std::uint64_t>(entry) * 2;
    m = rows[0];
    v = rows[1];
  }
  OCTRAD_HD void store(std::uint32_t entry, const Row<C>& m, const Row<C>& v) const {
    Row<C>* rows = reinterpret_cast<Row<C>*>(data) + static_cast<std::uint64_t>(entry) * 2;
    rows[0] = m;
    rows[1] = v;
  }
};
template <int C>
struct alignas(C >= 4 ? 16 : 8) WordRow {
  std::uint32_t v[C];
};
template <int C>
struct PackedMoments {
  std::uint32_t* data;   // [entries][C]
  const AdamStep* step;  // whose random bits round

  OCTRAD_HD void load(std::uint32_t entry, Row<C>& m, Row<C>& v) const {
    const WordRow<C> words = reinterpret_cast<const WordRow<C>*>(data)[entry];
    OCTRAD_UNROLL
    for (int c = 0; c < C; ++c) unpack_moments(words.v[c], m.v[c], v.v[c]);
  }
  OCTRAD_HD void store(std::uint32_t entry, const Row<C>& m, const Row<C>& v) const {
    WordRow<C> words;
    const std::uint64_t first = static_cast<std::uint64_t>(entry) * C;
    std::uint64_t four = 0;
    OCTRAD_UNROLL
    for (unsigned c = 0; c < C; ++c) {
      if (c % 4 == 0) four = four_roundings(step->random, first + c);
      words.v[c] = pack_moments(m.v[c], v.v[c], rounding_of(four, first + c));
    }
    reinterpret_cast<WordRow<C>*>(data)[entry] = words;
  }
};

template <int C, typename Moments = FloatMoments<C>>
struct TableArrays {
  float* values;
  Half* halves;  // null: look-ups read the values
  Moments moments;
  float* gradient;
  AdamConstants constants;
  unsigned long long* non_finite;

  // `touched`: the entry may have a gradient. One without, and without any moments, does not move.
  OCTRAD_HD void update(std::uint32_t entry, float scaled_rate, float second, bool touched = true) const {
    Row<C>& gradient_row = reinterpret_cast<Row<C>*>(gradient)[entry];
    Row<C> m, v, g{};
    moments.load(entry, m, v);
    if (touched) {
      g = gradient_row;
    } else {
      bool rests = true;
      OCTRAD_UNROLL
      for (int c = 0; c < C; ++c) rests = rests && m.v[c] == 0.0f && v.v[c] == 0.0f;
      if (rests) return;
    }
    Row<C> p = reinterpret_cast<const Row<C>*>(values)[entry];
    unsigned dropped = 0;
    OCTRAD_UNROLL
    for (int c = 0; c < C; ++c) {
      if (!adam_usable(g.v[c])) {
        g.v[c] = 0.0f;
        ++dropped;
      }
      p.v[c] = adam_update(p.v[c], g.v[c], m.v[c], v.v[c], constants, scaled_rate, second);
    }
    if (dropped > 0) atomic_add(non_finite, static_cast<unsigned long long>(dropped));
    reinterpret_cast<Row<C>*>(values)[entry] = p;
    moments.store(entry, m, v);
    if (touched) gradient_row = Row<C>{};
    if (halves != nullptr) {
      HalfRow<C> h;
      OCTRAD_UNROLL
      for (int c = 0; c < C; c += 2) h.v[c / 2] = pack_halves(p.v[c], p.v[c + 1]);
      reinterpret_cast<HalfRow<C>*>(halves)[entry] = h;
    }
  }
};

template <int C>
struct TouchedStep : Kernel {
  TableArrays<C> arrays;
  const AdamStep* step;
  const std::uint32_t* list;
  std::uint32_t* bits;
  std::uint16_t* counts;
  const AdamCorrection* corrections;
  std::uint32_t last_correction;

  OCTRAD_HD void operator()(std::uint32_t i) const {
    if (i >= step->listed) return;
    const std::uint32_t entry = list[i];
    const std::uint32_t count = counts[entry];
    const std::uint32_t now = count == 0xffffu ? count : count + 1;
    const AdamCorrection correction = corrections[now < last_correction ? now : last_correction];
    arrays.update(entry, step->rate * correction.first, correction.second);
    // Stores last: no load waits for them.
    counts[entry] = static_cast<std::uint16_t>(now);
    relaxed_store(&bits[entry >> 5], 0);  // every bit that is set there belongs to an entry of the list
  }
};

// The entries whose bits are set: those of a warp's words in order, so that their rows are near each other, for one
// atomic operation.
struct ListTouched : Kernel {
  const std::uint32_t* bits;
  std::uint32_t* list;
  std::uint32_t* count;

  OCTRAD_HD void operator()(std::uint32_t word) const {
    std::uint32_t left = bits[word], place = atomic_append_many(count, count_bits(left));
    for (; left != 0; left &= left - 1) list[place++] = word * 32 + lowest_bit(left);
  }
};

template <int C, typename Moments>
struct EveryStep : Kernel {
  TableArrays<C, Moments> arrays;
  const AdamStep* step;
  const std::uint32_t* touched;  // bits

  OCTRAD_HD void operator()(std::uint32_t entry) const {
    arrays.update(entry, step->scaled_rate, step->second, (touched[entry >> 5] >> (entry & 31u) & 1u) != 0);
  }
};

struct Numbers : Kernel {
  std::uint32_t* out;
  OCTRAD_HD void operator()(std::uint32_t i) const { out[i] = i; }
};

struct ToHalves : Kernel {
  const float* in;
  Half* out;
  OCTRAD_HD void operator()(std::uint32_t i) const { out[i] = to_half(in[i]); }
};

struct Approach : Kernel {
  float* values;
  const float* to;
  float share;
  Half* halves;  // of the values; may be null
  OCTRAD_HD void operator()(std::uint32_t i) const {
    const float value = values[i] = approached(values[i], to[i], share);
    if (halves != nullptr) halves[i] = to_half(value);
  }
};

// The item of the first of several equal rows sums all of them.
template <int C>
struct SumRun : Kernel {
  const std::uint32_t* rows;  // sorted
  const std::uint32_t* slots;
  const float* scales;
  std::uint32_t capacity, taps, n;
  const float* upstream;
  std::size_t stride;
  float* gradient;
  TouchedRows touched;

  OCTRAD_HD void operator()(std::uint32_t i) const {
    const std::uint32_t row = rows[i];
    if (row == kNoRow || (i > 0 && rows[i - 1] == row)) return;
    Row<C> sum = reinterpret_cast<const Row<C>*>(gradient)[row];
    for (std::uint32_t k = i; k < capacity && rows[k] == row; ++k) {
      const std::uint32_t slot = slots[k], item = slot / taps, level = item / n;
      const float scale = scales[slot];
      OCTRAD_UNROLL
      for (int c = 0; c < C; ++c)
        sum.v[c] += scale * upstream[(level * C + static_cast<std::uint32_t>(c)) * stride + (item - level * n)];
    }
    reinterpret_cast<Row<C>*>(gradient)[row] = sum;
    touched.touch(row);
  }
};

constexpr std::size_t kUploadPart = std::size_t{1} << 24;  // floats uploaded at a time, to be rounded on the device

// From moments [entries][2][features].
void upload_packed(Stream& stream, std::span<const float> moments, std::size_t features, std::uint32_t* to) {
  const std::size_t most = kUploadPart / features * features;
  std::vector<std::uint32_t> words;
  for (std::size_t begin = 0; begin < moments.size() / 2; begin += words.size()) {
    words.resize(std::min(most, moments.size() / 2 - begin));
    for (std::size_t i = 0; i < words.size(); ++i) {
      const float* row = moments.data() + (begin + i) / features * 2 * features + i % features;
      words[i] = pack_moments(row[0], row[features], 0x8000u);  // to nearest
    }
    stream.upload(to + begin, words.data(), words.size() * sizeof(std::uint32_t));
  }
}

// Words come into the upper half of what they become: a row is written where all words have been read, or over its own.
void download_packed(const DeviceArray<std::uint32_t>& from, std::span<float> moments, std::size_t features) {
  float* words = moments.data() + from.size();
  from.download(std::span<std::uint32_t>(reinterpret_cast<std::uint32_t*>(words), from.size()));
  for (std::size_t first = 0; first < from.size(); first += features) {
    std::array<std::uint32_t, 8> row;
    std::memcpy(row.data(), words + first, features * sizeof(std::uint32_t));
    for (std::size_t c = 0; c < features; ++c)
      unpack_moments(row[c], moments[2 * first + c], moments[2 * first + features + c]);
  }
}

bool packs_moments(const DeviceTableOptions& options) {
  return options.training && options.dense && options.half_moments;
}

bool keeps_floats(const DeviceTableOptions& options) { return options.training || options.masters || !options.halves; }

std::size_t list_capacity(std::size_t entries, const DeviceTableOptions& options) {
  return options.training && !options.dense ? std::min(entries, options.touches) : 0;
}

}  // namespace

DeviceDenseAdam::DeviceDenseAdam(Stream& stream, std::size_t parameters, const AdamOptions& options,
                                 const std::string& what)
    : options_(options),
      m_(stream, parameters, what + " optimiser"),
      v_(stream, parameters, what + " optimiser"),
      step_(stream, 1, what + " optimiser") {
  m_.fill(0);
  v_.fill(0);
  step_.fill(0);
}

void DeviceDenseAdam::upload(DenseAdam& from) {
  m_.upload(from.m());
  v_.upload(from.v());
  const AdamStep step{.count = from.count()};
  step_.upload(std::span<const AdamStep>(&step, 1));
}

void DeviceDenseAdam::download(DenseAdam& to) const {
  m_.download(to.m());
  v_.download(to.v());
  to.count() = step_.download()[0].count;
}

std::vector<MemoryPart> DeviceTable::memory(std::size_t entries, int features, const DeviceTableOptions& options,
                                            const std::string& what) {
  const std::uint64_t floats =
      static_cast<std::uint64_t>(entries) * static_cast<std::uint64_t>(features) * sizeof(float);
  std::vector<MemoryPart> parts;
  if (options.halves) parts.push_back({what + " (halves)", floats / 2});
  if (keeps_floats(options)) parts.push_back({what + " (floats)", floats});
  if (!options.training) return parts;
  parts.push_back(
      {what + " optimiser state", (packs_moments(options) ? 1 : 2) * floats + entries * sizeof(std::uint16_t)});
  parts.push_back({what + " gradient", floats + list_capacity(entries, options) * sizeof(std::uint32_t) + entries / 8});
  // Five words a contribution, and two more for the sort.
  if (options.sorted)
    parts.push_back({what + " contributions, sorted (--deterministic)", options.slots * 7 * sizeof(std::uint32_t)});
  return parts;
}

DeviceTable::DeviceTable(Stream& stream, std::size_t entries, int features, const DeviceTableOptions& options,
                         const std::string& what)
    : entries_(entries),
      features_(features),
      options_(options),
      capacity_(list_capacity(entries, options)) {
  const std::size_t floats = entries * static_cast<std::size_t>(features);
  if (keeps_floats(options) && floats > kMostItems)
    throw DeviceError(what + ": " + std::to_string(floats) + " numbers; a GPU can hold " + std::to_string(kMostItems));
  if (options.halves) halves_ = DeviceArray<Half>(stream, floats, what);
  if (keeps_floats(options)) values_ = DeviceArray<float>(stream, floats, what);
  if (!options.training) return;
  if (packs_moments(options)) packed_moments_ = DeviceArray<std::uint32_t>(stream, floats, what + " optimiser state");
  else moments_ = DeviceArray<float>(stream, 2 * floats, what + " optimiser state");
  counts_ = DeviceArray<std::uint16_t>(stream, entries, what + " optimiser state");
  gradient_ = DeviceArray<float>(stream, floats, what + " gradient");
  gradient_.fill(0);
  step_ = DeviceArray<AdamStep>(stream, 1, what + " optimiser state");
  bits_ = DeviceArray<std::uint32_t>(stream, (entries + 31) / 32, what + " gradient");
  bits_.fill(0);
  if (!options.dense) {
    list_ = DeviceArray<std::uint32_t>(stream, capacity_, what + " gradient");
    list_count_ = DeviceArray<std::uint32_t>(stream, 1, what + " gradient");
    list_count_.fill(0);
    // As SparseAdam: until both corrections have become exactly 1 in float, or the count saturates.
    std::vector<AdamCorrection> corrections{{0.0f, 0.0f}};
    do {
      corrections.push_back(
          adam_correction(options.adam.beta1, options.adam.beta2, static_cast<double>(corrections.size())));
    } while (corrections.size() <= 0xffff && (corrections.back().first > 1.0f || corrections.back().second > 1.0f));
    last_correction_ = static_cast<std::uint32_t>(corrections.size() - 1);
    corrections_ =
        DeviceArray<AdamCorrection>(stream, std::span<const AdamCorrection>(corrections), what + " optimiser state");
  }
  if (!options.sorted) return;
  const std::string sorting = what + " contributions";
  slot_rows_ = DeviceArray<std::uint32_t>(stream, options.slots, sorting);
  slot_numbers_ = DeviceArray<std::uint32_t>(stream, options.slots, sorting);
  sorted_rows_ = DeviceArray<std::uint32_t>(stream, options.slots, sorting);
  sorted_slots_ = DeviceArray<std::uint32_t>(stream, options.slots, sorting);
  slot_scales_ = DeviceArray<float>(stream, options.slots, sorting);
  workspace_ = SortWorkspace(stream, options.slots, sorting);
  launch(stream, options.slots, Numbers{{}, slot_numbers_.data()});
}

void DeviceTable::upload(Stream& stream, std::span<const float> values, SparseAdam* adam) {
  if (!values_.empty()) {
    values_.upload(values);
    if (!halves_.empty()) launch(stream, values_.size(), ToHalves{{}, values_.data(), halves_.data()});
  } else {
    const DeviceArray<float> part(stream, std::min(kUploadPart, values.size()), "a part of a feature table");
    for (std::size_t begin = 0; begin < values.size(); begin += kUploadPart) {
      const std::span<const float> some = values.subspan(begin, std::min(kUploadPart, values.size() - begin));
      stream.upload(part.data(), some.data(), some.size_bytes());
      launch(stream, some.size(), ToHalves{{}, part.data(), halves_.data() + begin});
      stream.synchronize();
    }
  }
  if (!options_.training) return;
  if (adam == nullptr) {
    moments_.fill(0);
    packed_moments_.fill(0);
    counts_.fill(0);
    step_.fill(0);
    return;
  }
  if (packed_moments_.empty()) moments_.upload(adam->moments());
  else upload_packed(stream, adam->moments(), static_cast<std::size_t>(features_), packed_moments_.data());
  counts_.upload(adam->counts());
  const AdamStep step{.count = adam->global_count()};
  step_.upload(std::span<const AdamStep>(&step, 1));
}

void DeviceTable::download(std::span<float> values, SparseAdam* adam) const {
  if (values_.empty()) throw DeviceError("a table of halves has no floats to give back");
  values_.download(values);
  if (adam == nullptr || !options_.training) return;
  if (packed_moments_.empty()) moments_.download(adam->moments());
  else download_packed(packed_moments_, adam->moments(), static_cast<std::size_t>(features_));
  counts_.download(adam->counts());
  adam->global_count() = step_.download()[0].count;
}

void DeviceTable::approach(Stream& stream, const DeviceTable& to, float share) {
  if (values_.empty() || to.values_.size() != values_.size())
    throw DeviceError("a table approaches one of the same size, and both have floats");
  launch(stream, values_.size(), Approach{{}, values_.data(), to.values_.data(), share, halves_.data()});
}

void approach(Stream& stream, DeviceArray<float>& values, const DeviceArray<float>& to, float share) {
  if (to.size() != values.size()) throw DeviceError("weights approach those of a network of the same size");
  launch(stream, values.size(), Approach{{}, values.data(), to.data(), share, nullptr});
}

TouchedRows DeviceTable::marked() const {
  if (options_.scan_touched) return {bits_.data(), nullptr, nullptr};
  return {bits_.data(), list_.data(), list_count_.data()};
}

AddNow DeviceTable::add() const { return {gradient_.data(), marked()}; }

void DeviceTable::begin_sorted(Stream&) { slot_rows_.fill(0xff); }

void DeviceTable::sum_sorted(Stream& stream, int taps, std::uint32_t n, int levels, const float* upstream,
                             std::size_t upstream_stride) {
  const std::size_t slots = static_cast<std::size_t>(taps) * n * static_cast<std::size_t>(levels);
  if (slots == 0) return;
  if (slots > options_.slots) throw DeviceError("more contributions to a feature table than there is memory for");
  sort_pairs(stream, workspace_, slots, slot_rows_.data(), sorted_rows_.data(), slot_numbers_.data(),
             sorted_slots_.data(), static_cast<int>(std::bit_width(entries_)));
  with_width(features_, [&](auto width) {
    constexpr int C = decltype(width)::value;
    launch(stream, slots,
           SumRun<C>{{},
                     sorted_rows_.data(),
                     sorted_slots_.data(),
                     slot_scales_.data(),
                     static_cast<std::uint32_t>(slots),
                     static_cast<std::uint32_t>(taps),
                     n,
                     upstream,
                     upstream_stride,
                     gradient_.data(),
                     marked()});
  });
}

void DeviceTable::step(Stream& stream, unsigned long long* non_finite) {
  const AdamOptions& adam = options_.adam;
  with_width(features_, [&](auto width) {
    constexpr int C = decltype(width)::value;
    const auto arrays = [&](const auto& moments) {
      return TableArrays<C, std::decay_t<decltype(moments)>>{values_.data(),
                                                             halves_.data(),
                                                             moments,
                                                             gradient_.data(),
                                                             adam_constants(adam.beta1, adam.beta2, adam.epsilon),
                                                             non_finite};
    };
    const FloatMoments<C> floats{moments_.data()};
    if (options_.dense) {
      const auto every = [&](const auto& moments) {
        using Moments = std::decay_t<decltype(moments)>;
        launch(stream, entries_, EveryStep<C, Moments>{{}, arrays(moments), step_.data(), bits_.data()});
      };
      if (packed_moments_.empty()) every(floats);
      else every(PackedMoments<C>{packed_moments_.data(), step_.data()});
      bits_.fill(0);
    } else {
      launch(stream, capacity_,
             TouchedStep<C>{{},
                            arrays(floats),
                            step_.data(),
                            list_.data(),
                            bits_.data(),
                            counts_.data(),
                            corrections_.data(),
                            last_correction_});
    }
  });
}

void DeviceOptimizers::add(DeviceDenseAdam& adam, float* parameters, const float* gradients, double rate) {
  networks_.push_back({&adam, parameters, gradients, rate});
}

void DeviceOptimizers::add(DeviceTable& table, double rate) { tables_.push_back({&table, rate}); }

void DeviceOptimizers::advance(Stream& stream, const float* network_scale, const float* table_scale,
                               unsigned long long* touched) const {
  std::vector<LaunchPart<AdvanceAdam>> parts;
  for (const Network& n : networks_) {
    const AdamOptions& adam = n.adam->options_;
    parts.push_back(
        {1, {{}, n.adam->step_.data(), adam.beta1, adam.beta2, n.rate, network_scale, nullptr, 0, nullptr}});
  }
  for (const auto& [table, rate] : tables_) {
    const AdamOptions& adam = table->options_.adam;
    if (table->options_.scan_touched && !table->options_.dense)
      launch(stream, table->bits_.size(),
             ListTouched{{}, table->bits_.data(), table->list_.data(), table->list_count_.data()});
    parts.push_back({1,
                     {{},
                      table->step_.data(),
                      adam.beta1,
                      adam.beta2,
                      rate,
                      table_scale,
                      table->list_count_.data(),
                      static_cast<std::uint32_t>(table->entries_),
                      touched}});
  }
  launch_parts(stream, parts.data(), parts.size());
}

void DeviceOptimizers::step_networks(Stream& stream, unsigned long long* non_finite) const {
  std::vector<LaunchPart<DenseStep>> parts;
  for (const Network& n : networks_) {
    const AdamOptions& adam = n.adam->options_;
    parts.push_back({n.adam->m_.size(),
                     {{},
                      n.parameters,
                      n.gradients,
                      n.adam->m_.data(),
                      n.adam->v_.data(),
                      adam_constants(adam.beta1, adam.beta2, adam.epsilon),
                      n.adam->step_.data(),
                      non_finite}});
  }
  launch_parts(stream, parts.data(), parts.size());
}

void DeviceOptimizers::step_tables(Stream& stream, unsigned long long* non_finite) const {
  for (const Table& t : tables_) t.table->step(stream, non_finite);
}

}  // namespace octrad
