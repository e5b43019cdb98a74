#include "octrad/scene/measured.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <map>
#include <numbers>
#include <string_view>
#include <utility>

#include "octrad/base/input_file.h"
#include "octrad/base/memory_limit.h"
#include "octrad/scene/source.h"
#include "octrad/scene/spectrum.h"

namespace octrad {
namespace {

static_assert(std::endian::native == std::endian::little);

// An array of the file.
struct Tensor {
  std::size_t at = 0;  // of its description, for messages
  int type = 0;
  std::vector<std::uint64_t> shape;
  std::uint64_t count = 1, begin = 0;
};

constexpr int kByteTensor = 1, kFloatTensor = 10;  // types of a tensor's items
constexpr std::string_view kTensors[] = {"phi_i", "theta_i",   "ndf",      "sigma",       "vndf",
                                         "rgb",   "luminance", "jacobian", "wavelengths", "spectra"};
constexpr std::size_t kMostDimensions = 5;
constexpr std::uint64_t kMostFloats = std::uint64_t{1} << 28;
constexpr float kLargest = 1e10f;  // of what is measured: products of two stay finite
constexpr double kHalfTurn = std::numbers::pi;

class MeasuredReader {
 public:
  MeasuredReader(const std::string& name, const std::string& bytes) : name_(name), bytes_(bytes) { read_header(); }

  MeasuredMaterial read() {
    MeasuredMaterial m;
    MeasuredLayout& l = m.layout;
    const bool spectral = tensors_.count("wavelengths") > 0;
    const Tensor &phi = floats("phi_i", {0}), &theta = floats("theta_i", {0});
    const Tensor &normals = floats("ndf", {0, 0}), &area = floats("sigma", {0, 0});
    const std::uint64_t nodes_phi = phi.count, nodes_theta = theta.count;
    const Tensor& visible = floats("vndf", {nodes_phi, nodes_theta, 0, 0});
    const Tensor& luminance = floats("luminance", {nodes_phi, nodes_theta, 0, 0});
    const std::uint64_t side = luminance.shape[2];
    if (luminance.shape[3] != side) fail_at(luminance.at, "luminance must be as high as it is wide");
    const std::uint64_t channels = spectral ? floats("wavelengths", {0}).count : 3;
    const Tensor& colors = floats(spectral ? "spectra" : "rgb", {nodes_phi, nodes_theta, channels, side, side});
    const Tensor& jacobian = tensor("jacobian", kByteTensor, {1});
    // Densities have their integrals beside them.
    const auto with_integrals = [](const Tensor& t) { return 2 * t.count + t.count / t.shape.back(); };
    const std::uint64_t total = phi.count + theta.count + normals.count + area.count + with_integrals(visible) +
                                with_integrals(luminance) + colors.count / channels * 3;
    if (total > kMostFloats)
      fail_at(0, "the tables take " + std::to_string(total) + " numbers; at most " + std::to_string(kMostFloats));
    ask_memory(total * sizeof(float), name_);
    m.data.reserve(total);

    l.phi_count = static_cast<int>(phi.count);
    l.theta_count = static_cast<int>(theta.count);
    l.phi = add_nodes(m, phi, "phi_i");
    l.theta = add_nodes(m, theta, "theta_i");
    l.isotropic = phi.count <= 2;
    if (!l.isotropic) l.symmetry = symmetry_of(m, phi);
    l.is_density = bytes_[jacobian.begin] != 0;
    add_grid(m, normals, "ndf", l.normals);
    add_grid(m, area, "sigma", l.area);
    add_density(m, visible, "vndf", l.visible_normals);
    add_density(m, luminance, "luminance", l.luminance);
    l.rgb = place(m);
    if (spectral) append_spectra(m, colors);
    else append(m, colors, "rgb");
    return m;
  }

 private:
  [[noreturn]] void fail_at(std::size_t offset, const std::string& message) const {
    fail(name_, bytes_, offset, message);
  }

  void require(std::size_t bytes) const {
    if (bytes_.size() - next_ < bytes) fail_at(next_, "the file ends early");
  }

  template <typename T>
  T take() {
    require(sizeof(T));
    T value;
    std::memcpy(&value, bytes_.data() + next_, sizeof value);
    next_ += sizeof value;
    return value;
  }

  void read_header() {
    constexpr char kMagic[] = "tensor_file";  // with its zero
    if (bytes_.compare(0, sizeof kMagic, kMagic, sizeof kMagic) != 0)
      fail_at(0, "not a measured material: such files begin with \"tensor_file\"");
    next_ = sizeof kMagic;
    const int major = take<std::uint8_t>(), minor = take<std::uint8_t>();
    if (major != 1 || minor != 0)
      fail_at(sizeof kMagic, "tensor files of version " + std::to_string(major) + "." + std::to_string(minor) +
                                 " are not supported; supported: 1.0");
    const std::uint32_t count = take<std::uint32_t>();
    for (std::uint32_t i = 0; i < count; ++i) read_tensor();
  }

  // Keeps those that are read.
  void read_tensor() {
    Tensor t;
    t.at = next_;
    const std::size_t letters = take<std::uint16_t>();
    require(letters);
    const std::string_view name = std::string_view(bytes_).substr(next_, letters);
    next_ += letters;
    const std::size_t dimensions = take<std::uint16_t>();
    t.type = take<std::uint8_t>();
    t.begin = take<std::uint64_t>();
    const auto known = std::find(std::begin(kTensors), std::end(kTensors), name);
    if (known == std::end(kTensors) || dimensions > kMostDimensions) {
      require(dimensions * sizeof(std::uint64_t));
      next_ += dimensions * sizeof(std::uint64_t);
      if (known == std::end(kTensors)) return;
      fail_shape(t, std::string(name));
    }
    for (std::size_t i = 0; i < dimensions; ++i) {
      t.shape.push_back(take<std::uint64_t>());
      if (t.shape.back() == 0) fail_at(t.at, "a tensor is empty");
      if (t.shape.back() > bytes_.size() / t.count) fail_at(t.at, "a tensor is larger than the file");
      t.count *= t.shape.back();  // items, of a byte at least
    }
    tensors_[std::string(name)] = std::move(t);
  }

  [[noreturn]] void fail_shape(const Tensor& t, const std::string& name) const {
    fail_at(t.at, "the tensor \"" + name + "\" has a type or a shape that does not fit the others");
  }

  // The tensor `name`; its type and shape must be as given, where 0 is any number.
  const Tensor& tensor(const std::string& name, int type, const std::vector<std::uint64_t>& shape) const {
    const auto found = tensors_.find(name);
    if (found == tensors_.end()) fail_at(0, "the file has no tensor \"" + name + "\"");
    const Tensor& t = found->second;
    bool fits = t.type == type && t.shape.size() == shape.size();
    for (std::size_t i = 0; fits && i < shape.size(); ++i) fits = shape[i] == 0 || t.shape[i] == shape[i];
    if (!fits) fail_shape(t, name);
    const std::uint64_t size = t.count * (type == kFloatTensor ? sizeof(float) : 1);
    if (t.begin > bytes_.size() || bytes_.size() - t.begin < size)
      fail_at(t.at, "the tensor \"" + name + "\" is cut off");
    return t;
  }
  const Tensor& floats(const std::string& name, const std::vector<std::uint64_t>& shape) const {
    return tensor(name, kFloatTensor, shape);
  }

  static std::uint32_t place(const MeasuredMaterial& m) { return static_cast<std::uint32_t>(m.data.size()); }

  void require_measured(float value, const Tensor& t, const std::string& name) const {
    if (!(std::fabs(value) <= kLargest)) fail_at(t.at, "a value of \"" + name + "\" is not finite, or above 1e10");
  }

  // Its values; what noise leaves of negative ones is 0.
  void append(MeasuredMaterial& m, const Tensor& t, const std::string& name, bool may_be_negative = false) const {
    const std::size_t begin = m.data.size();
    m.data.resize(begin + t.count);
    std::memcpy(m.data.data() + begin, bytes_.data() + t.begin, t.count * sizeof(float));
    for (std::size_t i = begin; i < m.data.size(); ++i) {
      float& value = m.data[i];
      require_measured(value, t, name);
      if (!may_be_negative) value = std::max(value, 0.0f);
    }
  }

  // The colours of spectra under D65, as those of a surface are (scene/spectrum.h).
  void append_spectra(MeasuredMaterial& m, const Tensor& spectra) const {
    const Tensor& wavelengths = floats("wavelengths", {0});
    const std::size_t count = wavelengths.count, texels = spectra.shape[3] * spectra.shape[4];
    std::vector<float> nm(count);
    std::memcpy(nm.data(), bytes_.data() + wavelengths.begin, count * sizeof(float));
    for (std::size_t i = 0; i < count; ++i) {
      if (!std::isfinite(nm[i]) || (i > 0 && !(nm[i] > nm[i - 1])))
        fail_at(wavelengths.at, "the values of \"wavelengths\" must ascend");
    }
    if (count < 2) fail_at(wavelengths.at, "there must be two wavelengths at least");
    const std::vector<Vec3d> weights = rgb_weights(std::vector<double>(nm.begin(), nm.end()));
    std::vector<Vec3d> sums(texels);
    for (std::size_t node = 0; node < spectra.shape[0] * spectra.shape[1]; ++node) {
      std::fill(sums.begin(), sums.end(), Vec3d(0.0));
      for (std::size_t i = 0; i < count; ++i) {
        const char* from = bytes_.data() + spectra.begin + (node * count + i) * texels * sizeof(float);
        for (std::size_t texel = 0; texel < texels; ++texel) {
          float value;
          std::memcpy(&value, from + texel * sizeof value, sizeof value);
          require_measured(value, spectra, "spectra");
          sums[texel] += weights[i] * static_cast<double>(std::max(value, 0.0f));
        }
      }
      for (int c = 0; c < 3; ++c) {
        for (const Vec3d& sum : sums) m.data.push_back(static_cast<float>(std::max(sum[c], 0.0)));
      }
    }
  }

  std::uint32_t add_nodes(MeasuredMaterial& m, const Tensor& t, const std::string& name) const {
    const std::uint32_t begin = place(m);
    append(m, t, name, true);
    for (std::size_t i = begin + 1; i < m.data.size(); ++i) {
      if (!(m.data[i] > m.data[i - 1])) fail_at(t.at, "the values of \"" + name + "\" must ascend");
    }
    return begin;
  }

  int symmetry_of(const MeasuredMaterial& m, const Tensor& phi) const {
    const float* nodes = m.data.data() + m.layout.phi;
    const double first = static_cast<double>(nodes[0]), last = static_cast<double>(nodes[m.layout.phi_count - 1]);
    const double parts = std::rint(2.0 * kHalfTurn / (last - first));
    if ((parts != 1.0 && parts != 2.0 && parts != 4.0) || std::fabs(first + kHalfTurn) > 0.1)
      fail_at(phi.at, "the values of \"phi_i\" must cover a circle, half, or a quarter of it, from -pi on");
    return static_cast<int>(parts);
  }

  // The last two dimensions of a tensor.
  void set_size(const Tensor& t, const std::string& name, MeasuredGrid& grid) const {
    const std::uint64_t height = t.shape[t.shape.size() - 2], width = t.shape.back();
    if (height < 2 || width < 2) fail_at(t.at, "\"" + name + "\" must have two points along each side at least");
    grid.height = static_cast<int>(height);
    grid.width = static_cast<int>(width);
  }

  void add_grid(MeasuredMaterial& m, const Tensor& t, const std::string& name, MeasuredGrid& grid) const {
    set_size(t, name, grid);
    grid.values = place(m);
    append(m, t, name);
  }

  void add_density(MeasuredMaterial& m, const Tensor& t, const std::string& name, MeasuredDensity& density) const {
    add_grid(m, t, name, density);
    const auto width = static_cast<std::size_t>(density.width), height = static_cast<std::size_t>(density.height);
    const std::size_t nodes = t.count / (width * height);
    density.rows = place(m);
    m.data.resize(m.data.size() + nodes * height);
    density.columns = place(m);
    m.data.resize(m.data.size() + t.count);
    std::vector<double> columns(width * height), rows(height);
    for (std::size_t node = 0; node < nodes; ++node) {
      float* const values = m.data.data() + density.values + node * width * height;
      // Where nothing is reflected any direction will do.
      if (std::all_of(values, values + width * height, [](float v) { return v == 0.0f; }))
        std::fill(values, values + width * height, 1.0f);
      for (std::size_t y = 0; y < height; ++y) {
        double sum = 0.0;
        for (std::size_t x = 0; x < width; ++x) {
          const double value = values[y * width + x];
          if (x > 0) sum += 0.5 * (static_cast<double>(values[y * width + x - 1]) + value);
          columns[y * width + x] = sum;
        }
        rows[y] = y == 0 ? 0.0 : rows[y - 1] + 0.5 * (columns[y * width - 1] + columns[(y + 1) * width - 1]);
      }
      const double scale = 1.0 / rows.back();
      for (std::size_t i = 0; i < width * height; ++i) {
        values[i] = static_cast<float>(values[i] * scale);
        m.data[density.columns + node * width * height + i] = static_cast<float>(columns[i] * scale);
      }
      for (std::size_t y = 0; y < height; ++y)
        m.data[density.rows + node * height + y] = static_cast<float>(rows[y] * scale);
    }
  }

  const std::string& name_;
  const std::string& bytes_;
  std::size_t next_ = 0;
  std::map<std::string, Tensor> tensors_;
};

}  // namespace

MeasuredMaterial parse_measured(const std::string& name, const std::string& bytes) {
  return MeasuredReader(name, bytes).read();
}

MeasuredMaterial read_measured_file(const std::string& file) { return parse_measured(file, read_file(file)); }

}  // namespace octrad
