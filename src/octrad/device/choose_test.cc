// Requests for a device against machines that are made up.
#include "octrad/device/choose.h"

#include <gtest/gtest.h>

#include "octrad/base/error.h"
#include "octrad/base/folder_test_helper.h"

namespace octrad {
namespace {

DeviceSurvey machine(std::initializer_list<std::pair<int, int>> capabilities, const std::string& architectures = "90") {
  DeviceSurvey survey;
  for (const auto& [major, minor] : capabilities) {
    DeviceInfo device;
    device.index = static_cast<int>(survey.devices.size());
    device.name = "GPU";
    device.major = major;
    device.minor = minor;
    survey.devices.push_back(device);
  }
  survey.architectures = architectures;
  if (survey.devices.empty()) survey.why_none = "no NVIDIA driver is installed";
  return survey;
}

const DeviceSupport kBoth{"octrad train", true}, kCpuOnly{"octrad compare", false};

std::string error_of(const std::string& request, const DeviceSupport& support, const DeviceSurvey& survey) {
  try {
    choose_device(parse_device(request), support, survey);
  } catch (const DeviceError& error) {
    return error.what();
  }
  return "";
}

TEST(ChooseDevice, WordsOfTheOption) {
  EXPECT_EQ(parse_device("auto").kind, DeviceRequest::Kind::automatic);
  EXPECT_EQ(parse_device("cpu").kind, DeviceRequest::Kind::cpu);
  EXPECT_EQ(parse_device("cuda").index, -1);
  EXPECT_EQ(parse_device("cuda:12").index, 12);
  for (const char* bad :
       {"", "gpu", "CUDA", "cuda:", "cuda:-1", "cuda:+1", "cuda:1x", "cuda: 1", "cuda:99999999999", "cpu:0"}) {
    EXPECT_THROW(parse_device(bad), UsageError) << bad;
  }
}

TEST(ChooseDevice, AutomaticTakesTheFirstThatWorks) {
  const DeviceChoice first = choose_device({}, kBoth, machine({{9, 0}, {9, 0}}));
  EXPECT_TRUE(first.cuda);
  EXPECT_EQ(first.name, "cuda:0");
  const DeviceChoice second = choose_device({}, kBoth, machine({{8, 0}, {9, 0}}));
  EXPECT_EQ(second.name, "cuda:1");
  const DeviceChoice none = choose_device({}, kBoth, machine({}));
  EXPECT_FALSE(none.cuda);
  EXPECT_EQ(none.why, "no NVIDIA driver is installed");
  const DeviceChoice old = choose_device({}, kBoth, machine({{7, 5}}));
  EXPECT_EQ(old.name, "cpu");
  EXPECT_NE(old.why.find("compute capability 7.5"), std::string::npos) << old.why;
}

TEST(ChooseDevice, SaysWhyNot) {
  EXPECT_EQ(error_of("cuda", kBoth, machine({})), "--device cuda: no NVIDIA driver is installed");
  EXPECT_NE(error_of("cuda:2", kBoth, machine({{9, 0}, {9, 0}})).find("there is no device 2; there are 0 to 1"),
            std::string::npos);
  EXPECT_NE(error_of("cuda:0", kBoth, machine({{8, 0}, {9, 0}}))
                .find("has compute capability 8.0; this program was built for 90"),
            std::string::npos);
  EXPECT_EQ(error_of("cuda", kBoth, machine({{8, 0}, {9, 0}})), "");
}

TEST(ChooseDevice, WorkWithoutADevicePathStaysOnTheCpu) {
  const DeviceChoice choice = choose_device({}, kCpuOnly, machine({{9, 0}}));
  EXPECT_FALSE(choice.cuda);
  EXPECT_EQ(choice.why, "octrad compare runs on the CPU only");
  EXPECT_EQ(error_of("cuda", kCpuOnly, machine({{9, 0}})), "--device cuda: octrad compare runs on the CPU only");
  EXPECT_EQ(error_of("cuda", kCpuOnly, machine({})), "--device cuda: no NVIDIA driver is installed");
  EXPECT_EQ(choose_device(parse_device("cpu"), kBoth, machine({{9, 0}})).why, "asked for");
}

TEST(ChooseDevice, ArchitecturesThatRun) {
  EXPECT_TRUE(runs_on("90", 9, 0));
  EXPECT_TRUE(runs_on("90", 12, 0)) << "translated";
  EXPECT_FALSE(runs_on("90", 8, 9));
  EXPECT_TRUE(runs_on("80-real", 8, 6));
  EXPECT_FALSE(runs_on("86-real", 8, 0));
  EXPECT_FALSE(runs_on("80-real", 9, 0));
  EXPECT_TRUE(runs_on("75-real,80-virtual", 9, 0));
  EXPECT_FALSE(runs_on("75-real,80-real,86-real,89-real,90-real,120", 10, 0))
      << "between the last machine code and the first translatable";
  EXPECT_TRUE(runs_on("75-real,80-real,86-real,89-real,90-real,120", 12, 1));
  EXPECT_TRUE(runs_on("90a", 9, 0));
  EXPECT_FALSE(runs_on("90a", 10, 0));
  EXPECT_TRUE(runs_on("native", 8, 0));
}

TEST(ChooseDevice, ADriverThatIsHiddenIsNotCalledMissing) {
  const TestFolder root;
  EXPECT_EQ(why_no_driver(root.path().string()), "no NVIDIA driver is installed");
  std::filesystem::create_directories(root.path() / "dev");
  root.write("dev/nvidiactl", "");
  const std::string why = why_no_driver(root.path().string());
  EXPECT_NE(why.find("/dev/nvidiactl"), std::string::npos) << why;
  EXPECT_NE(why.find("libcuda.so.1 is not found"), std::string::npos) << why;
}

}  // namespace
}  // namespace octrad
