// Places of a job's samples in the picture.
#include "octrad/transport/camera_job.h"

#include <gtest/gtest.h>

#include <vector>

namespace octrad {
namespace {

CameraJob job(int width, int height, bool tiles) {
  CameraJob job;
  job.x0 = 3;
  job.y0 = 5;
  job.width = width;
  job.height = height;
  job.first = 7;
  job.count = 2;
  job.tiles = tiles;
  return job;
}

TEST(CameraJob, EverySampleOfTheWindowOnceAndFoundAgain) {
  for (const bool tiles : {false, true}) {
    for (const auto& [width, height] : {std::pair{16, 8}, {13, 7}, {1, 1}, {8, 4}, {5, 3}, {40, 1}, {1, 40}, {9, 5}}) {
      const CameraJob j = job(width, height, tiles);
      std::vector<int> seen(j.size());
      for (std::uint32_t k = 0; k < j.size(); ++k) {
        const CameraJob::Place p = j.place(k);
        ASSERT_TRUE(p.x >= 3 && p.x < 3 + width && p.y >= 5 && p.y < 5 + height && p.i >= 7 && p.i < 9) << k;
        ++seen[static_cast<std::size_t>(((p.y - 5) * width + p.x - 3) * 2 + p.i - 7)];
        ASSERT_EQ(j.pixel_number(p.x, p.y) * 2 + static_cast<std::uint32_t>(p.i - 7), k);
      }
      for (const int times : seen) ASSERT_EQ(times, 1) << width << " x " << height << (tiles ? ", tiles" : "");
    }
  }
}

TEST(CameraJob, AWarpOfPixelsIsATile) {
  const CameraJob j = job(32, 8, true), rows = job(32, 8, false);
  for (std::uint32_t warp = 0; warp < 8; ++warp) {
    for (std::uint32_t lane = 0; lane < 32; ++lane) {
      const CameraJob::Place p = j.place((warp * 32 + lane) * 2);
      EXPECT_EQ((p.x - 3) / 8, static_cast<int>(warp % 4));
      EXPECT_EQ((p.y - 5) / 4, static_cast<int>(warp / 4));
    }
  }
  EXPECT_EQ(rows.place(31 * 2).y, 5);
}

}  // namespace
}  // namespace octrad
