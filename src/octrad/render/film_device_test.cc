// The film on streams against the CPU's.
#include "octrad/render/film_device.h"

#include "octrad/device/stream_test_helper.h"
#include "octrad/render/checks.h"

namespace octrad {
namespace {

class DeviceFilms : public testing::StreamTest {};

TEST_P(DeviceFilms, SumUpWhatTheCpuSumsUp) {
  EXPECT_TRUE(testing::passed(check_film(*stream, 23, 17, 5, 1)));
  EXPECT_TRUE(testing::passed(check_film(*stream, 40, 30, 30, 2)));
}

INSTANTIATE_TEST_SUITE_P(All, DeviceFilms, ::testing::Bool(), testing::stream_name);

}  // namespace
}  // namespace octrad
