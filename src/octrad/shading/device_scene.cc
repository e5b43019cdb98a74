#include "octrad/shading/device_scene.h"

#include <cassert>
#include <cstring>
#include <limits>
#include <type_traits>
#include <vector>

#include "octrad/geometry/shape_view.h"

namespace octrad {
namespace {

constexpr std::size_t kAlignment = 64;  // of TexelTile, the strictest
constexpr std::size_t kAbsent = std::numeric_limits<std::size_t>::max();
constexpr std::size_t kStaging = std::size_t{1} << 20;  // bytes of one upload

// Offsets of arrays in one block of memory.
struct Layout {
  struct Piece {
    const void* from;
    std::size_t bytes, offset;
  };
  std::vector<Piece> pieces;
  std::size_t size = 0;

  // Reserves space for a table that is filled in later; returns the index of its piece.
  template <typename T>
  std::size_t reserve(std::size_t count) {
    static_assert(std::is_trivially_copyable_v<T> && alignof(T) <= kAlignment);
    place(nullptr, count * sizeof(T));
    return pieces.size() - 1;
  }
  // kAbsent for null, so that it stays null.
  template <typename T>
  std::size_t add(const T* from, std::size_t count) {
    static_assert(std::is_trivially_copyable_v<T> && alignof(T) <= kAlignment);
    return from == nullptr || count == 0 ? kAbsent : place(from, count * sizeof(T));
  }
  std::size_t place(const void* from, std::size_t bytes) {
    const std::size_t offset = size;
    pieces.push_back({from, bytes, offset});
    size = (offset + bytes + kAlignment - 1) / kAlignment * kAlignment;
    return offset;
  }
};

// Every array of a scene and its offset.
struct Plan {
  struct Mesh {
    std::size_t positions, normals, uvs, triangles;
  };
  struct Image {
    std::size_t pixels, tiles, palette;
  };
  struct MeshLight {
    std::size_t triangles, cdf, grid;
  };
  Layout layout;
  std::size_t nodes, primitives;
  std::vector<Mesh> meshes;
  std::size_t spheres;
  std::vector<Image> images;               // of the textures, by index
  std::vector<std::size_t> transmittance;  // of the materials
  std::vector<std::size_t> measured;       // of the scene
  std::vector<MeshLight> lights;
  std::size_t environment_pixels = kAbsent, environment_sines = kAbsent, environment_rows = kAbsent,
              environment_cells = kAbsent, environment_densities = kAbsent, environment_parts = kAbsent;
  std::size_t delta_lights = kAbsent, light_cdf = kAbsent, placements = kAbsent;
  std::size_t elements = kAbsent, cumulative = kAbsent, guide = kAbsent, placed_meshes = kAbsent;
  std::vector<std::size_t> placed_areas;
  // Pieces of tables that point to the above.
  std::size_t shapes, textures, records, area_lights;

  explicit Plan(const SceneTables& t) {
    nodes = layout.add(t.bvh.nodes.data(), t.bvh.nodes.size());
    primitives = layout.add(t.bvh.primitives.data(), t.bvh.primitives.size());
    for (const TriangleMesh& m : t.scene.meshes) {
      meshes.push_back({layout.add(m.positions.data(), m.positions.size()),
                        layout.add(m.normals.data(), mesh_view(m).normals != nullptr ? m.normals.size() : 0),
                        layout.add(m.uvs.data(), m.uvs.size()), layout.add(m.triangles.data(), m.triangles.size())});
    }
    spheres = layout.add(t.scene.spheres.data(), t.scene.spheres.size());
    for (std::size_t i = 0; i < t.materials.texture_count(); ++i) {
      const TextureView& v = t.materials.view().textures[i];
      const auto width = static_cast<std::size_t>(v.width), height = static_cast<std::size_t>(v.height);
      Image image{kAbsent, kAbsent, kAbsent};
      if (v.tiles != nullptr) {
        image.tiles = layout.add(v.tiles, (height + 3) / 4 * static_cast<std::size_t>(v.columns));
        image.palette = layout.add(v.palette, kPaletteSize);
      } else if (v.kind == TextureSettings::Kind::bitmap) {
        image.pixels = layout.add(v.pixels, width * height);
      }
      images.push_back(image);
    }
    for (std::size_t i = 0; i < t.materials.size(); ++i) {
      const float* table = t.materials.view().records[i].constant.external_transmittance;
      transmittance.push_back(layout.add(table, kTransmittanceResolution));
    }
    for (const MeasuredMaterial& m : t.scene.measured) measured.push_back(layout.add(m.data.data(), m.data.size()));
    const LightsView& l = t.lights.view();
    for (int i = 0; i < l.area_count; ++i) {
      const auto count = static_cast<std::size_t>(l.area[i].triangle_count);
      const auto side = static_cast<std::size_t>(l.area[i].grid_side);
      lights.push_back({layout.add(l.area[i].triangles, count), layout.add(l.area[i].cdf, count),
                        layout.add(l.area[i].grid, side * side)});
    }
    delta_lights = layout.add(l.delta, static_cast<std::size_t>(l.delta_count));
    light_cdf = layout.add(l.cdf, static_cast<std::size_t>(l.count));
    placements = layout.add(t.scene.placements.data(), t.scene.placements.size());
    const EnvironmentView& e = l.environment;
    if (l.has_environment()) {
      const auto width = static_cast<std::size_t>(e.width), height = static_cast<std::size_t>(e.height);
      environment_pixels = layout.add(e.pixels, width * height);
      environment_sines = layout.add(e.sines, height);
      environment_rows = layout.add(e.rows, kEnvironmentColumns * (height - 1));
      environment_cells = layout.add(e.cells, width * (height - 1));
      const auto places = static_cast<std::size_t>(e.places.count());
      environment_parts = layout.add(e.parts, places * kEnvironmentParts);
      environment_densities = layout.add(e.densities, places * kEnvironmentParts);
    }
    if (t.surfaces != nullptr) {
      const SurfaceSamplerView& s = t.surfaces->view();
      elements = layout.add(s.elements, s.count);
      cumulative = layout.add(s.cumulative, s.count);
      guide = layout.add(s.guide, std::size_t{s.count} + 1);
      for (std::uint32_t i = 0; i < s.placed_count; ++i)
        placed_areas.push_back(layout.add(s.placed[i].areas, static_cast<std::size_t>(s.placed[i].count)));
      placed_meshes = layout.reserve<PlacedMesh>(s.placed_count);
    }
    shapes = layout.reserve<ShapeView>(t.scene.shapes.size());
    textures = layout.reserve<TextureView>(t.materials.texture_count());
    records = layout.reserve<MaterialRecord>(t.materials.size());
    area_lights = layout.reserve<LightRecord>(lights.size());
  }
};

// Pointers into the block at `base`.
struct Block {
  unsigned char* base;
  template <typename T>
  const T* at(std::size_t offset) const {
    return offset == kAbsent ? nullptr : reinterpret_cast<const T*>(base + offset);
  }
};

std::vector<ShapeView> place_shapes(const Scene& scene, const Plan& plan, const Block& block) {
  std::vector<ShapeView> views;
  for (const Shape& shape : scene.shapes) {
    const auto geometry = static_cast<std::size_t>(shape.geometry);
    ShapeView v;
    if (shape.kind == Shape::Kind::sphere) {
      v.sphere = block.at<Sphere>(plan.spheres) + geometry;
    } else {
      const Plan::Mesh& m = plan.meshes[geometry];
      v.mesh = {block.at<Vec3f>(m.positions), block.at<Vec3f>(m.normals),          block.at<Vec2f>(m.uvs),
                block.at<Vec3i>(m.triangles), scene.meshes[geometry].flip_normals, nullptr};
      if (shape.placement >= 0) v.mesh.placement = block.at<Placement>(plan.placements) + shape.placement;
    }
    v.material = shape.material;
    v.emitter = shape.emitter;
    views.push_back(v);
  }
  return views;
}

std::vector<TextureView> place_textures(const Materials& materials, const Plan& plan, const Block& block) {
  std::vector<TextureView> views(materials.view().textures, materials.view().textures + materials.texture_count());
  for (std::size_t i = 0; i < views.size(); ++i) {
    views[i].pixels = block.at<Vec3f>(plan.images[i].pixels);
    views[i].tiles = block.at<TexelTile>(plan.images[i].tiles);
    views[i].palette = block.at<float>(plan.images[i].palette);
  }
  return views;
}

// `tables`: where they and the textures will be.
std::vector<MaterialRecord> place_records(const Scene& scene, const Materials& materials, const Plan& plan,
                                          const Block& block, const MaterialsView& tables) {
  std::vector<MaterialRecord> records(materials.view().records, materials.view().records + materials.size());
  for (std::size_t i = 0; i < records.size(); ++i) {
    MaterialRecord& r = records[i];
    r.constant.external_transmittance = block.at<float>(plan.transmittance[i]);
    r.tables = tables;
    if (const int m = scene.materials[i].measured; m >= 0)
      r.measured.data = block.at<float>(plan.measured[static_cast<std::size_t>(m)]);
    if (r.constant.record != nullptr) r.constant.record = tables.records + i;
  }
  return records;
}

std::vector<LightRecord> place_lights(const LightsView& lights, const std::vector<ShapeView>& shapes, const Plan& plan,
                                      const Block& block) {
  std::vector<LightRecord> records(lights.area, lights.area + lights.area_count);
  for (std::size_t i = 0; i < records.size(); ++i) {
    records[i].shape = shapes[static_cast<std::size_t>(records[i].shape_index)];
    records[i].triangles = block.at<LightTriangle>(plan.lights[i].triangles);
    records[i].cdf = block.at<CdfEntry>(plan.lights[i].cdf);
    records[i].grid = block.at<CdfEntry>(plan.lights[i].grid);
  }
  return records;
}

// Uploads the pieces in order of their offsets, small ones together.
void upload(Stream& stream, const Layout& layout, unsigned char* base) {
  std::vector<unsigned char> staging;
  std::size_t start = 0;
  const auto flush = [&] {
    if (!staging.empty()) stream.upload(base + start, staging.data(), staging.size());
    staging.clear();
  };
  for (const Layout::Piece& piece : layout.pieces) {
    if (piece.bytes == 0) continue;
    if (piece.bytes >= kStaging) {
      flush();
      stream.upload(base + piece.offset, piece.from, piece.bytes);
      continue;
    }
    if (piece.offset + piece.bytes - start > kStaging) flush();
    if (staging.empty()) start = piece.offset;
    staging.resize(piece.offset + piece.bytes - start);
    std::memcpy(staging.data() + (piece.offset - start), piece.from, piece.bytes);
  }
  flush();
}

}  // namespace

std::size_t DeviceScene::bytes(const SceneTables& tables) { return Plan(tables).layout.size; }

DeviceScene::DeviceScene(Stream& stream, const SceneTables& tables) : stream_(&stream) {
  Plan plan(tables);
  memory_ = DeviceArray<unsigned char>(stream, plan.layout.size, "the scene");
  const Block block{memory_.data()};
  const std::vector<ShapeView> shapes = place_shapes(tables.scene, plan, block);
  const std::vector<TextureView> textures = place_textures(tables.materials, plan, block);
  const auto place = [&plan](std::size_t piece) { return plan.layout.pieces[piece].offset; };
  world_.materials = {block.at<MaterialRecord>(place(plan.records)), block.at<TextureView>(place(plan.textures))};
  world_.plain = true;
  for (const Material& m : tables.scene.materials) world_.plain = world_.plain && !is_extended(m.type);
  for (const DeltaLight& l : tables.scene.delta_lights) world_.plain = world_.plain && !l.through_masks;
  const std::vector<MaterialRecord> records =
      place_records(tables.scene, tables.materials, plan, block, world_.materials);
  const std::vector<LightRecord> lights = place_lights(tables.lights.view(), shapes, plan, block);
  plan.layout.pieces[plan.shapes].from = shapes.data();
  plan.layout.pieces[plan.textures].from = textures.data();
  plan.layout.pieces[plan.records].from = records.data();
  plan.layout.pieces[plan.area_lights].from = lights.data();
  std::vector<PlacedMesh> placed;
  if (tables.surfaces != nullptr) {
    const SurfaceSamplerView& s = tables.surfaces->view();
    placed.assign(s.placed, s.placed + s.placed_count);
    for (std::size_t i = 0; i < placed.size(); ++i) placed[i].areas = block.at<CdfEntry>(plan.placed_areas[i]);
    plan.layout.pieces[plan.placed_meshes].from = placed.data();
  }
  upload(stream, plan.layout, memory_.data());

  world_.hidden_emitters = tables.scene.hide_emitters;
  world_.bvh = tables.bvh.view();
  world_.bvh.nodes = block.at<Bvh8Node>(plan.nodes);
  world_.bvh.primitives = block.at<Bvh8Primitive>(plan.primitives);
  world_.shapes = block.at<ShapeView>(place(plan.shapes));
  world_.lights = tables.lights.view();
  world_.lights.area = block.at<LightRecord>(place(plan.area_lights));
  world_.lights.textures = block.at<TextureView>(place(plan.textures));
  world_.lights.delta = block.at<DeltaLight>(plan.delta_lights);
  world_.lights.cdf = block.at<CdfEntry>(plan.light_cdf);
  world_.lights.environment.pixels = block.at<Vec3f>(plan.environment_pixels);
  world_.lights.environment.sines = block.at<float>(plan.environment_sines);
  world_.lights.environment.rows = block.at<AliasEntry>(plan.environment_rows);
  world_.lights.environment.cells = block.at<AliasEntry>(plan.environment_cells);
  world_.lights.environment.densities = block.at<float>(plan.environment_densities);
  world_.lights.environment.parts = block.at<AliasEntry>(plan.environment_parts);
  if (tables.surfaces != nullptr) {
    world_.surfaces = tables.surfaces->view();
    world_.surfaces.elements = block.at<SurfaceElement>(plan.elements);
    world_.surfaces.cumulative = block.at<double>(plan.cumulative);
    world_.surfaces.guide = block.at<std::uint32_t>(plan.guide);
    world_.surfaces.shapes = world_.shapes;
    world_.surfaces.placed = block.at<PlacedMesh>(place(plan.placed_meshes));
  }
}

void DeviceScene::update(const SceneTables& tables) {
  const Plan plan(tables);
  assert(plan.layout.size == memory_.bytes());
  const Block block{memory_.data()};
  const LightsView& l = tables.lights.view();
  const std::vector<MaterialRecord> records =
      place_records(tables.scene, tables.materials, plan, block, world_.materials);
  const std::vector<LightRecord> lights = place_lights(l, place_shapes(tables.scene, plan, block), plan, block);
  const auto put = [&](std::size_t offset, const void* from, std::size_t bytes) {
    if (offset != kAbsent && bytes > 0) stream_->upload(memory_.data() + offset, from, bytes);
  };
  put(plan.layout.pieces[plan.records].offset, records.data(), records.size() * sizeof(MaterialRecord));
  put(plan.layout.pieces[plan.area_lights].offset, lights.data(), lights.size() * sizeof(LightRecord));
  put(plan.delta_lights, l.delta, static_cast<std::size_t>(l.delta_count) * sizeof(DeltaLight));
  for (std::size_t i = 0; i < records.size(); ++i) {
    put(plan.transmittance[i], tables.materials.view().records[i].constant.external_transmittance,
        kTransmittanceResolution * sizeof(float));
  }
}

}  // namespace octrad
