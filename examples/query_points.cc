// Asks a trained radiance cache what light leaves surface points towards the camera: those that a row of camera rays
// hits.
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

    const octrad::TransportContext context = scene.context();
    std::vector<octrad::SurfacePoint> points;
    constexpr int kRays = 9;
    for (int i = 0; i < kRays; ++i) {
      const octrad::Ray ray =
          scene.scene().cameras.front().generate({static_cast<float>(i) + 0.5f, 0.5f * kRays}, kRays, kRays);
      const octrad::Hit hit = context.intersect(ray.origin, ray.direction, 0.0f, ray.t_max);
      if (!hit.valid()) continue;
      const octrad::SurfaceInteraction surface = context.interact(hit, ray.origin, ray.direction);
      points.push_back(octrad::surface_point(context.shade(surface, -ray.direction)));
    }

    std::vector<octrad::Vec3f> radiance(points.size());
    model.field->radiance(points, radiance);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const octrad::Vec3f x = points[i].x, l = radiance[i];
      std::printf("at %.3f %.3f %.3f: %.4f %.4f %.4f\n", x.x, x.y, x.z, l.x, l.y, l.z);
    }
  } catch (const octrad::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return static_cast<int>(error.code());
  }
  return 0;
}
