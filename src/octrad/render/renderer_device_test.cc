// Pictures of a stream against pictures of the CPU.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "octrad/base/error.h"
#include "octrad/base/rng.h"
#include "octrad/base/sanitized_test_helper.h"
#include "octrad/device/stream_test_helper.h"
#include "octrad/device/tuning_keys.h"
#include "octrad/geometry/bvh8.h"
#include "octrad/geometry/voxelize.h"
#include "octrad/image/metrics.h"
#include "octrad/render/renderer.h"
#include "octrad/scene/load.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad {
namespace {

// A lit box with a glossy and a mirror ball. The CPU walks the same tree as the device.
struct Box {
  PreparedScene prepared;
  const Scene& scene = prepared.scene();
  Config config = preset("cpu");
  std::unique_ptr<RadianceField> field;

  explicit Box(const std::string& filter = "gaussian", int levels = 3, const std::string& name = "octaoctree")
      : prepared(load(filter), PreparedScene::CpuTree::bvh8) {
    config.field = name;
    config.octree_levels = levels;
    config.disparity_log2_table = 10;
    config.ncr_log2_table = config.ncr_cone_log2_table = 12;
    const Domain box = scene_domain(scene.bounds, config.octree_box == OctreeBox::cube);
    field = make_field(config, {box.origin, box.size, occupied_cells(scene, box, octree_levels(config))});
    field->set_target_scale(1.0f);
    // Something to see: a few steps towards a made-up radiance.
    Rng rng(7, RngPurpose::test, 0);
    std::vector<SurfacePoint> points(256);
    std::vector<Vec3f> targets(256);
    for (int step = 0; step < 20; ++step) {
      for (std::size_t i = 0; i < points.size(); ++i) {
        const Vec2f u = rng.uniform2();
        points[i].x = {2.0f * u.x - 1.0f, 2.0f * u.y - 1.0f, 1.0f};
        points[i].n = {0, 0, -1};
        points[i].wo = {0, 0, -1};
        points[i].albedo = {0.5f, 0.5f, 0.5f};
        points[i].alpha = i % 2 == 0 ? 1.0f : 0.1f;
        points[i].lobe[i % kHitClusters] = {2.0f * u.x, 0.1f * u.y, 0.7f};
        targets[i] = Vec3f(0.5f + u.x, 0.5f, 0.2f + u.y);
      }
      field->train(points, targets, 0.05, 1.0);
    }
  }
  static Scene load(const std::string& filter) {
    const auto file =
        std::filesystem::temp_directory_path() / ("octrad_device_picture_" + std::to_string(::getpid()) + ".xml");
    std::ofstream(file)
        << R"(<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="80"/><transform name="to_world">
      <lookat origin="0,0,-0.9" target="0,0,1" up="0,1,0"/></transform><film type="hdrfilm"><integer name="width" value="40"/><integer name="height" value="28"/>
      <rfilter type=")"
        << filter
        << R"("/></film></sensor><shape type="cube"><boolean name="flip_normals" value="true"/><bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf></shape>
      <shape type="rectangle"><transform name="to_world"><scale value="0.3"/><rotate x="1" angle="90"/><translate y="0.99"/></transform>
      <emitter type="area"><rgb name="radiance" value="8"/></emitter></shape>
      <shape type="sphere"><float name="radius" value="0.3"/><point name="center" x="-0.4" y="0" z="0.2"/><bsdf type="roughconductor"><float name="alpha" value="0.1"/></bsdf></shape>
      <shape type="sphere"><float name="radius" value="0.3"/><point name="center" x="0.4" y="0" z="0.2"/><bsdf type="conductor"/></shape></scene>)";
    Scene scene = load_scene(file.string());
    std::filesystem::remove(file);
    return scene;
  }
  RenderSettings settings(int spp) const {
    RenderSettings settings;
    settings.film = scene.film;
    settings.max_depth = 6;
    settings.seed = 5;
    settings.expected_spp = spp;
    return settings;
  }
  // On the CPU where `stream` is null.
  std::unique_ptr<Renderer> renderer(const std::string& integrator, int spp, Stream* stream, std::uint64_t memory = 0,
                                     const Crop& crop = {}) {
    RenderSettings limited = settings(spp);
    limited.max_memory = memory;
    auto made =
        make_renderer(prepared, integrator, limited, integrator == "path" ? nullptr : field.get(), config, stream);
    made->set_view({scene.cameras.front(), 40, 28, crop});
    return made;
  }
  RenderResult picture(const std::string& integrator, int spp, Stream* stream, const Crop& crop = {}) {
    return render(*renderer(integrator, spp, stream, 0, crop), {spp});
  }
};

double difference(const Image& a, const Image& b, const char* channel) {
  const int c = a.channel(channel);
  double sum = 0.0, scale = 0.0;
  for (int y = 0; y < a.height; ++y) {
    for (int x = 0; x < a.width; ++x) {
      sum += static_cast<double>(std::abs(a.at(x, y, c) - b.at(x, y, c)));
      scale += static_cast<double>(std::abs(b.at(x, y, c)));
    }
  }
  return sum / (scale + 1e-9);
}

class RenderOnStream : public testing::StreamTest {
 protected:
  // On a GPU a ray that passes an edge within a rounding may end on the other side of it.
  void expect_queries(long long got, long long expected, const std::string& what) const {
    const double share = stream->on_device() ? 1e-3 : 0.0;
    EXPECT_NEAR(static_cast<double>(got), static_cast<double>(expected),
                share * static_cast<double>(expected) + (stream->on_device() ? 1.0 : 0.0))
        << what;
  }
};

// Some channels are those of the whole picture, on the CPU and on streams.
TEST_P(RenderOnStream, PartsOfThePictureAreThoseOfTheWhole) {
  Box box("gaussian");
  for (Stream* where : {static_cast<Stream*>(nullptr), stream.get()}) {
    const auto renderer = box.renderer("path", 2, where);
    render(*renderer, {2});
    const Image whole = renderer->image();
    ASSERT_EQ(whole.channels, picture_channels());
    for (const auto& [layer, first] :
         {std::pair{"", 0}, {"albedo", 3}, {"normal", 6}, {"depth", 9}, {"roughness", 10}}) {
      const ChannelRange channels = channels_of(layer);
      EXPECT_EQ(channels.first, first) << layer;
      const Image part = renderer->image(channels);
      ASSERT_EQ(part.channel_count(), channels.count) << layer;
      for (int c = 0; c < channels.count; ++c) {
        EXPECT_EQ(whole.channel(part.channels[static_cast<std::size_t>(c)]), first + c);
        for (int y = 0; y < part.height; ++y) {
          for (int x = 0; x < part.width; ++x) ASSERT_EQ(part.at(x, y, c), whole.at(x, y, first + c)) << layer;
        }
      }
    }
    EXPECT_EQ(renderer->image(channels_of("training points")).data, whole.data);
  }
}

// Every alternative of DeviceTuning gives the same sums.
TEST_P(RenderOnStream, TuningChangesNoPicture) {
  Box box("box");
  const auto sums = [&](const char* integrator, int spp) {
    const auto renderer = box.renderer(integrator, spp, stream.get());
    render(*renderer, {spp});
    return renderer->sums();
  };
  for (const auto& [integrator, spp] : {std::pair{"lhs", 2}, {"rhs", 1}, {"path", 2}}) {
    stream->tuning = {};
    const std::vector<double> expected = sums(integrator, spp);
    for (const auto& [key, value] : {std::pair{"pixel_tiles", "0"},
                                     {"cast_dynamic", "0"},
                                     {"cast_warps", "1"},
                                     {"cast_share", "1"},
                                     {"cast_refill", "1"},
                                     {"cast_refill", "32"},
                                     {"block", "32"},
                                     {"frame_samples", "100"}}) {
      stream->tuning = {};
      set(stream->tuning, key, value);
      EXPECT_TRUE(sums(integrator, spp) == expected) << integrator << ", " << key << "=" << value;
    }
  }
}

// In parts that end inside a pass. Sums are compared, because pictures of floats hide their last bits.
TEST_P(RenderOnStream, PicturesGoOnToTheSameBits) {
  for (const char* filter : {"box", "gaussian"}) {
    Box box(filter);
    for (Stream* where : {static_cast<Stream*>(nullptr), stream.get()}) {
      const auto at_once = box.renderer("path", 23, where);
      const RenderResult whole = render(*at_once, {23});
      const std::vector<double> sums = at_once->sums();
      FilmState state;
      for (const int spp : {3, 11, 23}) {
        const auto renderer = box.renderer("path", spp, where);  // as a new run: it knows the state alone
        const FilmState before = state;
        RenderBudget budget;
        budget.spp = spp;
        budget.from = before.samples > 0 ? &before : nullptr;
        budget.save = [&](const FilmState& saved) { state = saved; };
        const RenderResult part = render(*renderer, budget);
        EXPECT_EQ(part.spp, spp);
        EXPECT_LE(state.samples, spp);
        if (spp < 23) continue;
        EXPECT_TRUE(renderer->sums() == sums) << filter;
        EXPECT_TRUE(part.image.data == whole.image.data) << filter;
        EXPECT_EQ(part.samples, whole.samples);
        EXPECT_EQ(part.counts.rays, whole.counts.rays);
      }
      // Other passes give other bits where filters reach over pixels.
      at_once->clear();
      for (const int count : {3, 8, 12}) at_once->add_samples(count);
      EXPECT_EQ(at_once->sums() == sums, std::string(filter) == "box");
      state.largest_pass = 3;
      EXPECT_THROW(at_once->restore(state), InputError) << "other passes";
      state.sums.pop_back();
      EXPECT_THROW(at_once->restore(state), InputError) << "another size";
    }
  }
}

TEST_P(RenderOnStream, ASeedThatIsSetIsThatOfANewRenderer) {
  Box box("box");
  for (const char* integrator : {"path", "rhs"}) {
    for (Stream* where : {static_cast<Stream*>(nullptr), stream.get()}) {
      const auto renderer = box.renderer(integrator, 2, where);
      const Image first = render(*renderer, {2}).image;
      renderer->set_seed(6);
      const Image second = render(*renderer, {2}).image;
      EXPECT_FALSE(first.data == second.data);
      renderer->set_seed(5);
      EXPECT_TRUE(render(*renderer, {2}).image.data == first.data) << integrator;
    }
  }
}

TEST_P(RenderOnStream, PathTracedPictureIsThatOfTheCpu) {
  for (const char* filter : {"box", "gaussian", "tent"}) {
    Box box(filter);
    const RenderResult cpu = box.picture("path", 9, nullptr), device = box.picture("path", 9, stream.get());
    EXPECT_EQ(device.spp, 9);
    EXPECT_EQ(device.samples, cpu.samples);
    ASSERT_EQ(device.image.width, cpu.image.width);
    ASSERT_EQ(device.image.height, cpu.image.height);
    for (const char* channel : {"R", "albedo.G", "normal.X", "depth.Z", "roughness.Y"}) {
      EXPECT_LT(difference(device.image, cpu.image, channel), stream->on_device() ? 2e-2 : 1e-5)
          << filter << " " << channel;
    }
    EXPECT_NEAR(static_cast<double>(device.counts.rays), static_cast<double>(cpu.counts.rays),
                1e-3 * static_cast<double>(cpu.counts.rays));
    // A crop is that part of the picture; little memory means many small jobs and the same picture.
    const Image crop = box.picture("path", 9, stream.get(), {10, 5, 20, 11}).image;
    ASSERT_EQ(crop.width, 20);
    for (int x = 0; x < 20; ++x)
      EXPECT_NEAR(crop.at(x, 3, 0), device.image.at(x + 10, 8, 0), 1e-4f * (1.0f + crop.at(x, 3, 0)));
  }
}

// As many samples as the CPU takes, of the pixels that the mask needs, in jobs of any size; what it leaves out is 0.
TEST_P(RenderOnStream, MaskedPicturesArePartsOfTheWhole) {
  constexpr int kSpp = 5;
  const int large = DeviceTuning().frame_samples;
  const struct {
    Crop crop;
    int step, frame_samples;  // each step-th pixel; of a pass on the device
  } parts[] = {{{}, 37, large}, {{}, 37, 100}, {{10, 5, 20, 11}, 37, large}, {{10, 5, 20, 11}, 37, 100},
               {{}, 1, large},  {{}, 1, 100}};
  for (const char* filter : {"box", "gaussian"}) {
    if (testing::sanitized() && std::string_view(filter) == "box") continue;  // the other reaches over pixels
    Box box(filter);
    for (const char* integrator : {"path", "lhs", "disparity"}) {
      for (const auto& [crop, step, samples] : parts) {
        auto mask = std::make_shared<std::vector<std::uint8_t>>(40 * 28);
        for (std::size_t p = 0; p < mask->size(); p += static_cast<std::size_t>(step)) (*mask)[p] = 1;
        stream->tuning.frame_samples = samples;
        const Image whole = box.picture(integrator, kSpp, stream.get(), crop).image;
        RenderResult results[2];
        for (Stream* where : {static_cast<Stream*>(nullptr), stream.get()}) {
          const auto renderer = box.renderer(integrator, kSpp, where, 0, crop);
          View view = renderer->view();
          const int largest = renderer->largest_pass();
          view.mask = mask;
          renderer->set_view(view);
          results[where != nullptr] = render(*renderer, {kSpp});
          if (where == nullptr) continue;
          // The few pixels of a mask are sampled as often at once as a job allows, if the film lets them.
          if (step > 1 && std::string(filter) == "box") EXPECT_GT(renderer->largest_pass(), largest);
          else EXPECT_LE(renderer->largest_pass(), largest);
          if (!renderer->passes_matter()) {  // so that a picture goes on with less memory, too
            const FilmState state{kSpp, 3, 0.0, results[1].counts, renderer->sums()};
            renderer->restore(state);
            EXPECT_TRUE(renderer->sums() == state.sums);
          }
          const Image& image = results[1].image;
          const PixelRect part = view.part();
          for (int y = part.y0; y < part.y1; ++y) {
            for (int x = part.x0; x < part.x1; ++x) {
              const float expected = view.wants(x, y) ? whole.at(x - part.x0, y - part.y0, 0) : 0.0f;
              ASSERT_EQ(image.at(x - part.x0, y - part.y0, 0), expected)
                  << filter << " " << integrator << " " << x << " " << y;
            }
          }
          // The mask does not stay.
          view.mask = nullptr;
          renderer->set_view(view);
          EXPECT_GT(render(*renderer, {1}).samples, part.width() * part.height() - 1);
        }
        EXPECT_EQ(results[1].samples, results[0].samples);
        EXPECT_NEAR(static_cast<double>(results[1].counts.rays), static_cast<double>(results[0].counts.rays),
                    1e-3 * static_cast<double>(results[0].counts.rays));
      }
    }
  }
  stream->tuning = {};
}

// Views have a test of their own.
TEST_P(RenderOnStream, PicturesOfAllIntegratorsAreThoseOfTheCpu) {
  for (const char* field : {"octaoctree", "ncr"}) {
    Box box("gaussian", 3, field);
    for (const std::string& name : integrator_names(box.field.get())) {
      const IntegratorInfo& info = *find_integrator(name).info;
      if (!info.recordable || info.make_device == nullptr) continue;
      for (const DeltaSurfaces delta : {DeltaSurfaces::cache, DeltaSurfaces::trace}) {
        box.config.render_delta = delta;
        // Glossy surfaces by a bounce, perfect mirrors from the cache, in one picture.
        box.config.render_highlights = delta == DeltaSurfaces::cache ? Highlights::bounce : Highlights::cache;
        box.config.render_bounce_below = 0.5;
        const RenderResult cpu = box.picture(name, 4, nullptr), device = box.picture(name, 4, stream.get());
        for (const char* channel : {"R", "G", "B", "roughness.Y"}) {
          EXPECT_LT(difference(device.image, cpu.image, channel), stream->on_device() ? 2e-2 : 5e-3)
              << field << " " << name << " " << get(box.config, "render.delta") << " " << channel;
        }
        expect_queries(device.counts.queries, cpu.counts.queries, name + " " + get(box.config, "render.delta"));
        EXPECT_NEAR(static_cast<double>(device.counts.rays), static_cast<double>(cpu.counts.rays),
                    1e-3 * static_cast<double>(cpu.counts.rays));
      }
    }
  }
}

TEST_P(RenderOnStream, ViewsAreThoseOfTheCpu) {
  Box box, cones("gaussian", 3, "ncr");
  EXPECT_LT(
      difference(cones.picture("features2", 1, stream.get()).image, cones.picture("features2", 1, nullptr).image, "R"),
      3e-2);
  for (const std::string& view : integrator_names(box.field.get())) {
    if (find_integrator(view).info->recordable) continue;  // not a view
    for (const bool cropped : {false, true}) {
      const Crop crop = cropped ? Crop{10, 5, 20, 11} : Crop{};
      const auto renderer = box.renderer(view, 2, stream.get(), 0, crop);
      const RenderResult cpu = box.picture(view, 2, nullptr, crop), device = render(*renderer, {2});
      ASSERT_EQ(device.image.width, cpu.image.width);
      EXPECT_EQ(device.spp, cpu.spp) << view;
      expect_queries(device.counts.queries, cpu.counts.queries, view);
      for (const char* channel : {"R", "G", "B", "roughness.Y"}) {
        EXPECT_LT(difference(device.image, cpu.image, channel), stream->on_device() ? 3e-2 : 1e-2)
            << view << " " << channel;
      }
      double brightness = 0.0;
      for (int y = 0; y < cpu.image.height; ++y) {
        for (int x = 0; x < cpu.image.width; ++x) brightness += static_cast<double>(cpu.image.at(x, y, 0));
      }
      EXPECT_GT(brightness, 0.0) << view;
      EXPECT_THROW(renderer->time_frames(1, 1), UsageError);
    }
  }
  EXPECT_THROW(box.renderer("features9", 1, stream.get()), UsageError);
}

// One renderer through other views, sizes and models makes the pictures that new renderers make.
TEST_P(RenderOnStream, ViewAndModelCanChange) {
  Box box, other("gaussian", 2);
  for (Stream* const on : {static_cast<Stream*>(nullptr), stream.get()}) {
    const auto renderer = box.renderer("deferred", 2, on);
    const Image first = render(*renderer, {2}).image;
    View view = renderer->view();
    view.camera.origin.z += 0.2f;
    view.width = 60;
    view.height = 42;
    renderer->set_view(view);
    const Image moved = render(*renderer, {2}).image;
    EXPECT_EQ(moved.width, 60);
    renderer->set_model(*other.field, other.config);
    const Image changed = render(*renderer, {2}).image;
    EXPECT_NE(changed.data, moved.data);
    EXPECT_EQ(changed.data, [&] {
      const auto fresh = make_renderer(box.prepared, "deferred", box.settings(2), other.field.get(), other.config, on);
      fresh->set_view(view);
      return render(*fresh, {2}).image.data;
    }());
    renderer->set_model(*box.field, box.config);
    EXPECT_EQ(render(*renderer, {2}).image.data, moved.data);
    renderer->set_view(box.renderer("deferred", 2, nullptr)->view());
    EXPECT_EQ(render(*renderer, {2}).image.data, first.data);
    renderer->add_samples(3);
    EXPECT_EQ(renderer->samples(), 5);
    renderer->clear();
    EXPECT_EQ(renderer->samples(), 0);
    const Image empty = renderer->image();
    EXPECT_EQ(*std::max_element(empty.data.begin(), empty.data.end()), 0.0f);
  }
}

TEST(Renderer, RefusesIntegratorsAndModelsThatDoNotFit) {
  Box box;
  EXPECT_THROW(make_renderer(box.prepared, "lhs"), UsageError);
  EXPECT_THROW(make_renderer(box.prepared, "features4", {}, box.field.get(), box.config), UsageError);
  EXPECT_THROW(find_integrator("features0"), UsageError);
  EXPECT_THROW(find_integrator("features"), UsageError);
  try {
    find_integrator("deffered");
    FAIL();
  } catch (const UsageError& e) {
    EXPECT_NE(std::string(e.what()).find("did you mean \"deferred\""), std::string::npos) << e.what();
  }
}

// A copy of the scene is made once for a stream, and by whoever asks first.
TEST_P(RenderOnStream, SceneIsUploadedOnce) {
  Box box;
  const std::size_t scene = box.prepared.bytes_to_upload(*stream);
  EXPECT_GT(scene, 0u);
  box.prepared.world(*stream);
  EXPECT_EQ(box.prepared.bytes_to_upload(*stream), 0u);
  const std::size_t before = stream->allocated_bytes();
  box.renderer("path", 1, stream.get());
  EXPECT_EQ(stream->allocated_bytes(), before);
  box.prepared.release(*stream);
  EXPECT_EQ(stream->allocated_bytes() + scene, before);
}

TEST_P(RenderOnStream, FramesAreTimedByStage) {
  Box box, cones("box", 3, "ncr");
  EXPECT_GT(cones.renderer("deferred", 1, stream.get())->time_frames(2, 1).median, 0.0);
  const FrameTimes times = box.renderer("lhs", 1, stream.get())->time_frames(5, 1);
  EXPECT_GT(times.median, 0.0);
  EXPECT_GE(times.p95, times.median);
  ASSERT_GE(times.stages.size(), 7u);
  EXPECT_EQ(times.stages.front().first, "first rays");
  EXPECT_EQ(times.stages.back().first, "tone mapping");
}

TEST_P(RenderOnStream, LittleMemoryMeansSmallJobsAndThenAnError) {
  Box box;
  const std::size_t scene_and_film = 400'000;
  const auto small = box.renderer("path", 16, stream.get(), scene_and_film + 40 * 300),
             large = box.renderer("path", 16, stream.get());
  EXPECT_LT(difference(render(*small, {16}).image, render(*large, {16}).image, "R"), 1e-6);
  EXPECT_THROW(box.renderer("path", 16, stream.get(), 1000), MemoryError);
}

INSTANTIATE_TEST_SUITE_P(All, RenderOnStream, ::testing::Bool(), testing::stream_name);

}  // namespace
}  // namespace octrad
