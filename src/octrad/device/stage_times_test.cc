#include "octrad/device/stage_times.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace octrad {
namespace {

// A stream that does nothing but to say what time it is.
class MadeUpTime : public Stream {
 public:
  double now = 0.0;  // milliseconds

  std::unique_ptr<StreamEvent> record() override {
    auto event = std::make_unique<Event>();
    event->time = now;
    return event;
  }
  double milliseconds(StreamEvent& from, StreamEvent& to) override {
    return static_cast<Event&>(to).time - static_cast<Event&>(from).time;
  }

  bool on_device() const override { return false; }
  DeviceInfo info() const override { return {}; }
  void* allocate(std::size_t, const std::string&) override { return nullptr; }
  void release(void*) noexcept override {}
  std::size_t allocated_bytes() const override { return 0; }
  std::size_t peak_bytes() const override { return 0; }
  void upload(void*, const void*, std::size_t) override {}
  void download(void*, const void*, std::size_t) override {}
  void copy(void*, const void*, std::size_t) override {}
  void fill(void*, int, std::size_t) override {}
  void synchronize() override {}
  void replay(LaunchGraph&) override {}
  std::unique_ptr<Stream> sibling() override { return nullptr; }
  void wait(StreamEvent&) override {}

 private:
  struct Event : StreamEvent {
    double time = 0.0;
  };
  void begin_capture() override {}
  std::unique_ptr<LaunchGraph> end_capture() override { return nullptr; }
};

// Milliseconds that pass before each mark.
using Marks = std::vector<std::pair<const char*, double>>;

void mark_stages(MadeUpTime& stream, const Marks& marks) {
  for (const auto& [stage, ms] : marks) {
    stream.now += ms;
    stream.mark(stage);
  }
}

TEST(StageTimes, AreThoseBetweenMarks) {
  MadeUpTime stream;
  StageTimes times(stream);
  const auto pass = [&](const Marks& marks) {
    stream.mark("before");
    times.begin();
    mark_stages(stream, marks);
    times.end();
    stream.now += 100.0;
    stream.mark("after");
  };
  times.settle();
  EXPECT_TRUE(times.means().empty());
  pass({{"trace", 500.0}, {"forgotten", 500.0}});
  times.forget();
  times.settle();
  EXPECT_TRUE(times.means().empty());
  pass({{"trace", 2.0}, {"shade", 8.0}, {"trace", 1.0}});
  times.settle();
  pass({{"trace", 4.0}, {"shade", 0.0}});
  times.settle();
  pass({{"shade", 1.0}, {"trace", 32.0}, {"copy", 5.0}});
  times.settle();
  EXPECT_EQ(times.means(), (StageSplit{{"trace", 13.0}, {"shade", 3.0}, {"copy", 5.0}}));
  EXPECT_EQ(times.medians(), (StageSplit{{"trace", 4.0}, {"shade", 1.0}, {"copy", 5.0}}));
}

TEST(StageTimes, MayCountInPart) {
  MadeUpTime stream;
  StageTimes times(stream);
  times.begin();
  times.set_share(0.0);
  mark_stages(stream, {{"trace", 64.0}});
  times.set_share(0.25);
  mark_stages(stream, {{"trace", 8.0}, {"shade", 16.0}});
  times.set_share(2.0);
  mark_stages(stream, {{"trace", 3.0}});
  times.end();
  times.settle();
  EXPECT_EQ(times.means(), (StageSplit{{"trace", 8.0}, {"shade", 4.0}}));
  times.begin();  // counts in full again
  mark_stages(stream, {{"trace", 10.0}});
  times.end();
  times.settle();
  EXPECT_EQ(times.means()[0].second, 9.0);
}

TEST(StageTimes, Percentiles) {
  EXPECT_EQ(percentile({3.0, 1.0, 2.0}, 0.5), 2.0);
  EXPECT_EQ(percentile({3.0, 1.0, 2.0}, 0.99), 3.0);
}

}  // namespace
}  // namespace octrad
