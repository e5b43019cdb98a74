// Asks a trained radiance cache what light leaves surface points towards the camera: those that the rays through a row
// of pixels meet first. The integrator `lhs` asks as pictures do: it follows mirrors and rays through masks, asks for
// the lobes of coated surfaces one by one, traces the distances that look-ups take, and adds emission.
//   query_points MODEL.octrad SCENE.xml
#include <octrad/octrad.h>

#include <cstdio>
#include <vector>

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: query_points MODEL.octrad SCENE.xml\n");
    return 1;
  }
  try {
    const octrad::Model model = octrad::load_model(argv[1]);
    const octrad::PreparedScene scene(octrad::load_scene(argv[2]));
    octrad::check_scene(argv[1], model.info, argv[2], scene.scene().fingerprint, /*force=*/false);

    // The first sample of each pixel in the middle of a picture of 9 x 9; other rays do as well.
    constexpr int kPixels = 9;
    const octrad::CameraView camera = scene.scene().cameras.front().view(kPixels, kPixels);
    std::vector<octrad::CameraSample> rays;
    for (int x = 0; x < kPixels; ++x)
      rays.push_back(octrad::camera_sample(camera, /*seed=*/0, x, kPixels / 2, /*i=*/0));

    const octrad::IntegratorChoice lhs = octrad::find_integrator("lhs");
    const auto integrator =
        lhs.info->make({.scene = scene, .choice = lhs, .field = model.field.get(), .config = model.info.config});
    std::vector<octrad::PixelSample> seen(rays.size());
    integrator->sample(rays, seen);

    for (std::size_t i = 0; i < rays.size(); ++i) {
      const octrad::Ray& ray = rays[i].ray;
      const octrad::Vec3f x = ray.origin + ray.direction * seen[i].depth, l = seen[i].radiance;
      if (seen[i].depth > 0.0f) std::printf("at %.3f %.3f %.3f: ", x.x, x.y, x.z);
      else std::printf("no point: ");
      std::printf("%.6g %.6g %.6g\n", l.x, l.y, l.z);
    }
  } catch (const octrad::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return static_cast<int>(error.code());
  }
  return 0;
}
