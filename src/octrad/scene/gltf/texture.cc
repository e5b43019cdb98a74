// Textures of glTF: pictures as they are, or made of what a material takes of them, and how they lie on the surface.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "octrad/base/input_file.h"
#include "octrad/base/lower_case.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/number_text.h"
#include "octrad/image/io.h"
#include "octrad/scene/gltf/reader.h"
#include "octrad/scene/gltf/specular_glossiness.h"
#include "octrad/scene/picture_values.h"

namespace octrad {

GltfObject GltfMaterials::texture_of(const GltfObject& info) const {
  const int index = info.index("index", "textures");
  if (index < 0) info.fail("needs the index of a texture");
  return file_->item("textures", index);
}

int GltfMaterials::image_of(const GltfObject& info) {
  const GltfObject texture = texture_of(info);
  int source = texture.extension("EXT_texture_webp").index("source", "images");
  if (source < 0) source = texture.index("source", "images");
  if (source < 0) {
    std::string way = "has no source";
    for (const std::string& extension : texture.object("extensions").keys())
      if (extension != "EXT_texture_webp") way = extension + " is not supported; save its picture as PNG or JPEG";
    report_.refuse(texture.location(), way);
  }
  return source;
}

GltfMaterials::Placing GltfMaterials::placing(const GltfObject& info) {
  const GltfObject texture = texture_of(info);
  Placing placing;
  enum { kNearest = 9728, kClamp = 33071, kMirror = 33648, kRepeat = 10497 };
  if (const int index = texture.index("sampler", "samplers"); index >= 0) {
    const GltfObject sampler = file_->item("samplers", index);
    const int u = sampler.integer("wrapS", kRepeat, kRepeat, kMirror),
              v = sampler.integer("wrapT", kRepeat, kRepeat, kMirror);
    if (u != v) report_.assume(sampler.location(), "textures that wrap in two ways are wrapped as wrapS says");
    placing.wrap = u == kClamp ? "clamp" : u == kMirror ? "mirror" : "repeat";
    placing.nearest = sampler.integer("magFilter", 0, 0, 9999) == kNearest;
  }
  // As KHR_texture_transform: scaled, turned, moved; v runs down, so that a turn is the other way round.
  const GltfObject t = info.extension("KHR_texture_transform");
  placing.moved = t.exists();
  const std::vector<double> offset = t.numbers("offset", {0, 0}), scale = t.numbers("scale", {1, 1});
  const double angle = t.number("rotation", 0.0), c = std::cos(angle), s = std::sin(angle);
  placing.turned = angle != 0.0 || scale[0] < 0.0 || scale[1] < 0.0;
  placing.to_uv.m = {
      c * scale[0], s * scale[1], 0, offset[0], -s * scale[0], c * scale[1], 0, offset[1], 0, 0, 1, 0, 0, 0, 0, 1};
  return placing;
}

bool GltfMaterials::add_texture(Element& parent, const std::string& name, const GltfObject& info,
                                const Recipe& recipe) {
  const int source = image_of(info);
  if (source < 0) return false;
  std::string file;
  bool encoded = false;
  const GltfObject image = file_->item("images", source);
  if (!report_.attempt(image.location(), [&] { file = picture(image, recipe, encoded); })) return false;
  const Placing place = placing(info);
  if (recipe.what == Recipe::What::normal && place.turned)
    report_.assume(info.location(), "KHR_texture_transform moves a normal map, but does not turn or mirror its slopes");
  add_bitmap(parent, name, info, place, file, !(encoded && recipe.what == Recipe::What::color));
  return true;
}

void GltfMaterials::add_bitmap(Element& parent, const std::string& name, const GltfObject& info, const Placing& place,
                               const std::string& file, bool raw) {
  std::string key = file + (place.nearest ? "n" : "b") + place.wrap + (raw ? "r" : "s");
  if (place.moved) {
    for (const double v : place.to_uv.m) key.append(" ").append(number_text(v));
  }
  const auto [at, inserted] = textures_.try_emplace(key, "texture" + std::to_string(textures_.size()));
  if (inserted) {
    const Location where = texture_of(info).location();
    // Before what refers to it, for readers who go from the top.
    Element& e = add_element(*description_.root, where, "texture", {{"type", "bitmap"}, {"id", at->second}});
    description_.ids.emplace(at->second, &e);
    add_element(e, where, "string", {{"name", "filename"}, {"value", file}});
    add_element(e, where, "string", {{"name", "filter_type"}, {"value", place.nearest ? "nearest" : "bilinear"}});
    add_element(e, where, "string", {{"name", "wrap_mode"}, {"value", place.wrap}});
    add_element(e, where, "boolean", {{"name", "raw"}, {"value", raw ? "true" : "false"}});
    if (place.moved) add_matrix(e, where, "to_uv", place.to_uv);
  }
  add_element(parent, info.location(), "ref", {{"id", at->second}, {"name", name}});
}

GltfMaterials::Source GltfMaterials::source_of(const GltfObject& image) const {
  const std::string* uri = &image.long_text("uri");  // of the file that `bytes` below keeps
  const int view = image.index("bufferView", "bufferViews");
  if (uri->empty() == (view < 0)) image.fail("needs a uri or a bufferView, and not both");
  Source source;
  if (!uri->empty() && !GltfFile::is_data(*uri)) source.file = file_->resolve(*uri, image);
  // The file is kept as long as something reads from it.
  source.bytes = [uri, view, file = source.file, image, keep = file_] {
    return !file.empty()  ? read_file(file)
           : uri->empty() ? std::string(keep->view(view))
                          : GltfFile::decode(*uri, image);
  };
  source.place = image.location().text();
  source.read = [place = source.place, bytes = source.bytes] { return parse_image(place, bytes()); };
  return source;
}

// The name of a file, or of a picture that is made of one. `encoded`: its values are what the file says, to be decoded.
std::string GltfMaterials::picture(const GltfObject& image, const Recipe& recipe, bool& encoded) {
  using What = Recipe::What;
  const Source source = source_of(image);
  const bool unit = recipe.factor.x == 1.0 && recipe.factor.y == 1.0 && recipe.factor.z == 1.0;
  encoded =
      unit && !recipe.mirrored && recipe.alpha < 0.0 && (recipe.what == What::color || recipe.what == What::normal);
  // It is looked for once more. Of WebP, which Mitsuba does not read, `convert` makes a PNG.
  if (encoded && !source.file.empty() && ending_of(source.file) != ".webp")
    return std::filesystem::absolute(source.file).string();

  std::string key = image.path();
  if (!encoded) {
    key.append(" ").append(std::to_string(static_cast<int>(recipe.what)));
    key.append(" ").append(std::to_string(recipe.channel));
    key.append(" ").append(three_numbers(recipe.factor));
    key.append(" ")
        .append(number_text(recipe.alpha))
        .append(" ")
        .append(number_text(recipe.cutoff))
        .append(recipe.mirrored ? " mirrored" : "");
  }
  const auto [at, inserted] = pictures_.try_emplace(key, "picture" + std::to_string(pictures_.size()));
  if (!inserted) return at->second;
  BuiltPicture& built = description_.built->pictures[at->second];
  if (encoded) {
    built.read = source.read;
    built.encoded = source.bytes;
    return at->second;
  }
  built.read = [read = source.read, place = source.place, recipe] {
    const MemoryScope scope;
    const Image in = read();
    const std::vector<int> from = color_channels(in);
    const LinearValues linear(in);
    const bool colors = recipe.what == What::color || recipe.what == What::normal;
    ask_memory(in.pixel_count() * (colors ? 3 : 1) * sizeof(float), place);
    Image out(in.width, in.height, colors ? std::vector<std::string>{"R", "G", "B"} : std::vector<std::string>{"Y"});
    const std::size_t stride = in.channels.size();
    for (std::size_t i = 0; i < in.pixel_count(); ++i) {
      const float* pixel = in.data.data() + i * stride;
      const auto value = [&](int c) { return pixel[from[static_cast<std::size_t>(c)]]; };
      const auto alpha = [&](double factor) { return (from[3] >= 0 ? static_cast<double>(value(3)) : 1.0) * factor; };
      const auto covers = [&](double factor) {
        const double a = alpha(factor);
        return recipe.cutoff < 0.0 ? a : a >= recipe.cutoff ? 1.0 : 0.0;
      };
      const double share = recipe.alpha < 0.0 ? 1.0 : covers(recipe.alpha);
      switch (recipe.what) {
        case What::color:
          for (int c = 0; c < 3; ++c)
            out.data[3 * i + static_cast<std::size_t>(c)] =
                static_cast<float>(linear(value(c)) * recipe.factor[c] * share);
          break;
        case What::channel:
          out.data[i] = static_cast<float>(static_cast<double>(value(recipe.channel)) * recipe.factor.x);
          break;
        case What::glossiness:
          out.data[i] = static_cast<float>(1.0 - std::clamp(alpha(recipe.factor.x), 0.0, 1.0));
          break;
        case What::alpha: out.data[i] = static_cast<float>(covers(recipe.factor.x)); break;
        case What::normal: {
          Vec3d n;
          for (int c = 0; c < 3; ++c) n[c] = 2.0 * static_cast<double>(value(c)) - 1.0;
          n.x *= recipe.factor.x;
          n.y *= recipe.factor.y * (recipe.mirrored ? -1.0 : 1.0);
          const double l = length(n);
          for (int c = 0; c < 3; ++c)
            out.data[3 * i + static_cast<std::size_t>(c)] = static_cast<float>(l > 0.0 ? 0.5 + 0.5 * n[c] / l : 0.5);
          break;
        }
      }
    }
    return out;
  };
  return at->second;
}

std::string GltfMaterials::metal_picture(int diffuse_image, int specular_image, GltfSpecularPictures pictures,
                                         bool metallic) {
  std::string key = "metal " + three_numbers(pictures.diffuse) + " " + three_numbers(pictures.specular);
  key.append(metallic ? " share" : " base").append(pictures.repeats ? " " : " ends ");
  key.append(std::to_string(diffuse_image)).append(" ").append(std::to_string(specular_image));
  if (const auto known = pictures_.find(key); known != pictures_.end()) return known->second;
  for (const auto& [index, picture] :
       {std::pair{diffuse_image, &pictures.diffuse_picture}, std::pair{specular_image, &pictures.specular_picture}}) {
    if (index < 0) continue;
    const Source source = source_of(file_->item("images", index));
    *picture = source.read;
    pictures.name = source.place;
  }
  const std::string name = "picture" + std::to_string(pictures_.size());
  pictures_.emplace(key, name);
  description_.built->pictures[name].read = [pictures, metallic] { return picture_of_metal(pictures, metallic); };
  return name;
}

}  // namespace octrad
