// The film on streams against the CPU's.
#include "octrad/render/film_device.h"

#include <algorithm>
#include <cmath>

#include "octrad/base/random_inputs.h"
#include "octrad/device/stream_test_helper.h"
#include "octrad/render/checks.h"

namespace octrad {
namespace {

class DeviceFilms : public testing::StreamTest {};

TEST_P(DeviceFilms, SumUpWhatTheCpuSumsUp) {
  EXPECT_TRUE(testing::passed(check_film(*stream, 23, 17, 5, 1)));
  EXPECT_TRUE(testing::passed(check_film(*stream, 40, 30, 30, 2)));
}

TEST_P(DeviceFilms, ShowASampleAPixelWithoutSums) {
  CameraJob job;
  job.view = Camera().view(23, 17);
  job.width = 23;
  job.height = 17;
  job.count = 1;
  job.tiles = true;
  Film film;
  film.filter = Film::Filter::box;
  DeviceFilm sums(*stream, 0, 0, 23, 17, film);
  std::vector<float> numbers = testing::random_floats(job.size() * kSampleNumbers, 5);
  numbers[7] = std::nanf("");
  const DeviceArray<float> samples(*stream, std::span<const float>(numbers), "samples");
  const SamplePlanes planes{{samples.data(), job.size()}};
  const DeviceArray<CameraJob> there(*stream, std::span<const CameraJob>(&job, 1), "job");
  const DeviceArray<unsigned char> with(*stream, 4 * sums.pixels(), "screen"),
      without(*stream, 4 * sums.pixels(), "screen");
  sums.add(there.data(), planes);
  sums.show({}, with.data());
  sums.show_only(there.data(), planes, {}, without.data());
  const std::vector<unsigned char> expected = with.download();
  EXPECT_EQ(without.download(), expected);
  EXPECT_GT(*std::max_element(expected.begin(), expected.begin() + 3), 0);
}

INSTANTIATE_TEST_SUITE_P(All, DeviceFilms, ::testing::Bool(), testing::stream_name);

}  // namespace
}  // namespace octrad
