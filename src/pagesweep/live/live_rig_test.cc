// SPDX-License-Identifier: Apache-2.0
// The way from the network to a capture, against cameras that speak the real protocol.
#include <gmock/gmock.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "pagesweep/base/error.h"
#include "pagesweep/io/capture_file.h"
#include "pagesweep/io/rig_file.h"
#include "pagesweep/live/fake_rig.h"
#include "pagesweep/live/live_source.h"
#include "pagesweep/live/own_network_testing.h"
#include "pagesweep/live/record_capture.h"
#include "pagesweep/live/scan_picture.h"

namespace pagesweep {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int width = 96, height = 80, count = 45;

/// A stripe that moves down; every frame is unlike every other.
std::vector<Frames> make_frames() {
  std::vector<Frames> cameras;
  for (const std::string name : {"cam1", "cam2"}) {
    Frames frames({.camera = name, .width = width, .height = height, .count = count, .black_level = 3});
    for (int i = 0; i < count; ++i) {
      Image<std::uint8_t> image(width, height, 3);
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
          if (std::abs(y - 3 * i + 10) < 9)
            image(x, y) = static_cast<std::uint8_t>(100 + (x + i + cameras.size()) % 90);
      frames.set(i, std::move(image));
    }
    cameras.push_back(std::move(frames));
  }
  return cameras;
}

Rig make_rig() {
  Rig rig;
  for (const std::string name : {"cam1", "cam2"}) {
    Camera camera;
    camera.name = name, camera.width = width, camera.height = height;
    camera.fx = camera.fy = 100;
    rig.cameras.push_back(camera);
  }
  return rig;
}

DeviceSettings settings() {
  DeviceSettings settings;
  settings.width = width, settings.height = height;
  settings.packet_size = 1000;  // several packets a frame
  return settings;
}

std::unique_ptr<LiveSource> open_source(const LiveOptions& options = {}, const DeviceSettings& wanted = settings()) {
  std::vector<std::unique_ptr<GenicamCamera>> cameras;
  std::vector<Sequence> sequences;
  for (const auto& [name, address] : {std::pair("cam1", "127.0.0.1"), std::pair("cam2", "127.0.0.2")}) {
    cameras.push_back(std::make_unique<GenicamCamera>(name, address, wanted));
    sequences.push_back({.camera = name, .width = width, .height = height, .black_level = 3});
  }
  return std::make_unique<LiveSource>(std::move(cameras), std::move(sequences), options);
}

std::uint64_t checksum(const GrayImage& image) {
  std::uint64_t sum = 1469598103934665603ULL;
  for (const std::uint8_t gray : std::get<Image<std::uint8_t>>(image).pixels()) sum = (sum ^ gray) * 1099511628211ULL;
  return sum;
}

/// What a source gave, to be compared.
struct Given {
  int index;
  std::vector<float> late;
  std::vector<std::uint64_t> images;
  bool operator==(const Given&) const = default;
};
Given describe(const FrameSet& set) {
  Given given{set.index, set.late, {}};
  for (const auto& image : set.images) given.images.push_back(image ? checksum(*image) : 0);
  return given;
}

/// Records a sweep. \return what came
std::vector<Given> record(LiveSource& live, const fs::path& folder) {
  fs::remove_all(folder);
  fs::create_directories(folder);
  CaptureRecorder recorder(folder, live.sequences());
  RecordedSource source(live, recorder, true);
  std::vector<Given> given;
  while (const auto set = source.next()) given.push_back(describe(*set));
  write_rig(folder / "rig.json", make_rig());
  write_capture(describe_capture(folder, recorder.finish(), live));
  return given;
}

std::vector<Given> read(const fs::path& folder) {
  const Capture capture = read_capture(folder);
  const auto source = open_capture(capture, read_capture_rig(capture));
  std::vector<Given> given;
  while (const auto set = source->next()) given.push_back(describe(*set));
  return given;
}

class LiveRig : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!testing::enter_own_network()) GTEST_SKIP() << "a network of its own (unshare) is not permitted here";
  }
  fs::path folder() const {
    return fs::path(::testing::TempDir()) /
           (std::string("live_") + ::testing::UnitTest::GetInstance()->current_test_info()->name());
  }
  static FakeRigOptions slow_rig() {
    FakeRigOptions slow;
    slow.frame_rate = 100, slow.delay_s = 0.4;
    return slow;
  }
  FakeRigOptions options = slow_rig();
};

TEST_F(LiveRig, ARecordingGivesWhatTheLiveSweepGave) {
  const FakeRig rig(make_frames(), std::nullopt, options);
  const auto live = open_source();
  const std::vector<Given> given = record(*live, folder());
  EXPECT_EQ(live->ended_early(), "");
  EXPECT_GT(given.size(), 0.5 * count);
  EXPECT_EQ(read(folder()), given);
  // And it is what the cameras saw.
  const std::vector<Frames> frames = make_frames();
  int found = 0;
  for (const Given& set : given)
    for (int i = 0; i < count; ++i)
      if (set.images[0] == checksum(frames[0].frame(i)) && i >= 2) {
        EXPECT_TRUE(set.images[1] == checksum(frames[1].frame(i)) || set.images[1] == 0) << i;
        ++found;
      }
  EXPECT_GT(found, 0.3 * count);  // a loaded machine's fake cameras miss triggers
}

TEST_F(LiveRig, EveryDamagedFrameIsCounted) {
  options.packet_loss = 0.02;
  const FakeRig rig(make_frames(), std::nullopt, options);
  const auto live = open_source();
  record(*live, folder());
  const LiveStatus status = live->status();
  const auto sent = rig.counts();
  for (std::size_t c = 0; c < 2; ++c) {
    const FrameCounts& counts = status.cameras[c].counts;
    EXPECT_GT(counts.damaged, 0);
    // The last ones may still have been on their way when the sweep was over.
    EXPECT_NEAR(static_cast<double>(counts.received + counts.damaged + counts.lost), static_cast<double>(sent[c].sent),
                40);
    EXPECT_LE(counts.received + counts.damaged + counts.lost, sent[c].sent);
  }
}

TEST_F(LiveRig, ACameraThatDiesEndsTheSweepWhatThereIsIsKeptAndWhenItIsBackTheNextSweepIsWhole) {
  options.dead_camera = "cam2", options.dead_frame = 18, options.back_s = 0.2;
  const FakeRig rig(make_frames(), std::nullopt, options);
  {
    const auto live = open_source();
    EXPECT_GT(record(*live, folder()).size(), 10U);
    EXPECT_THAT(live->ended_early(), HasSubstr("cam2: it has stopped sending"));
    EXPECT_LT(Clock::now() - live->last_arrival(), std::chrono::seconds(2));
    EXPECT_GT(read(folder()).size(), 10U);
  }
  const auto live = open_source();
  EXPECT_GT(record(*live, folder()).size(), 0.5 * count);
  EXPECT_EQ(live->ended_early(), "");
}

TEST_F(LiveRig, ACameraThatSlowsDownIsNamedAndTheSweepGoesOn) {
  options.slow_camera = "cam2", options.delay_s = 1.2;
  options.slow_frame = -100;  // in the dark already
  const FakeRig rig(make_frames(), std::nullopt, options);
  const auto live = open_source();
  const std::vector<Given> given = record(*live, folder());
  EXPECT_EQ(live->ended_early(), "");
  EXPECT_GT(std::ranges::count_if(given, [](const Given& set) { return set.images[1] == 0; }), 0.2 * count);
  const LiveStatus status = live->status();
  EXPECT_THAT(status.remarks, Contains(HasSubstr("cam2: it has slowed down")));
  EXPECT_GT(status.cameras[0].counts.unpaired, 0.2 * count);
  EXPECT_EQ(read(folder()), given);
}

/// Frames of the source that show the stripe, by their number in the capture; -1: none of it.
std::vector<int> numbers_of(const std::vector<Given>& given, std::size_t camera) {
  const std::vector<Frames> frames = make_frames();
  std::vector<int> numbers;
  for (const Given& set : given) {
    numbers.push_back(-1);
    for (int i = 2; i < 32; ++i)
      if (set.images[camera] == checksum(frames[camera].frame(i))) numbers.back() = i;
  }
  return numbers;
}

/// Whether the stripe's frames come in their order, and both cameras usually show the same ones: on a loaded machine
/// fake cameras act late on a trigger now and then.
void expect_a_sweep(const std::vector<Given>& given) {
  const std::vector<int> first = numbers_of(given, 0), second = numbers_of(given, 1);
  int last = -1, seen = 0;
  std::vector<int> apart;
  for (std::size_t k = 0; k < given.size(); ++k) {
    if (first[k] < 0) continue;
    EXPECT_GE(first[k], last);  // where a trigger comes late, a picture may come twice
    last = first[k], ++seen;
    if (second[k] >= 0) apart.push_back(std::abs(second[k] - first[k]));
  }
  EXPECT_GT(seen, 10);
  ASSERT_FALSE(apart.empty());
  std::ranges::sort(apart);
  EXPECT_LE(apart[apart.size() / 2], 1);
}

TEST_F(LiveRig, CamerasAreTriggeredByTheComputer) {
  const FakeRig rig(make_frames(), std::nullopt, options);
  DeviceSettings wanted = settings();
  wanted.trigger = TriggerMode::software, wanted.frame_rate = 100;
  const auto live = open_source({}, wanted);
  expect_a_sweep(record(*live, folder()));
  EXPECT_EQ(live->ended_early(), "");
  EXPECT_TRUE(live->is_triggered());
  EXPECT_TRUE(read_capture(folder()).is_triggered);
}

TEST_F(LiveRig, CamerasThatRunFreelyHaveTimesOfOneClock) {
  const FakeRig rig(make_frames(), std::nullopt, options);
  DeviceSettings wanted = settings();
  wanted.trigger = TriggerMode::free_running, wanted.frame_rate = 100;
  const auto live = open_source({}, wanted);
  const std::vector<Given> given = record(*live, folder());
  expect_a_sweep(given);
  EXPECT_FALSE(live->is_triggered());
  EXPECT_NEAR(live->interval_ns(), 1e7, 1e6);
  // The rig's clocks are seconds apart: put on one, frames of an instant are.
  const Capture capture = read_capture(folder());
  EXPECT_FALSE(capture.is_triggered);
  const auto &first = capture.sequences[0].timestamps_ns, &second = capture.sequences[1].timestamps_ns;
  for (std::size_t k = 0; k < first.size(); ++k)
    if (first[k] != no_timestamp && second[k] != no_timestamp) {
      EXPECT_LT(std::abs(static_cast<double>(first[k] - second[k])), 0.5 * live->interval_ns()) << k;
    }
  EXPECT_EQ(read(folder()), given);
}

TEST_F(LiveRig, PacketsAreAsLargeAsTheNetworkCarriesAndSmallOnesAreTold) {
  const FakeRig rig(make_frames(), std::nullopt, options);
  DeviceSettings wanted = settings();
  wanted.packet_size = 0;
  {
    const GenicamCamera camera("cam1", "127.0.0.1", wanted);
    EXPECT_EQ(camera.settings().packet_size, 9000);
    EXPECT_THAT(camera.remarks(), ElementsAre(HasSubstr("1400 bytes are too small for the frames: set to 9000")));
  }
  if (!testing::set_loopback_mtu(1500)) GTEST_SKIP() << "the interface cannot be set here";
  {
    const GenicamCamera camera("cam2", "127.0.0.2", wanted);
    EXPECT_EQ(camera.settings().packet_size, 1500);
    EXPECT_THAT(camera.remarks(), Contains(HasSubstr("carries packets of 1500 bytes only")));
  }
  wanted.packet_size = 9000;
  EXPECT_THROW(GenicamCamera("cam2", "127.0.0.2", wanted), Error);
  testing::set_loopback_mtu(65536);
}

TEST_F(LiveRig, AStallIsAGapAndNoEnd) {
  options.stall_camera = "cam1", options.stall_frame = 12, options.stall_s = 0.3;
  const FakeRig rig(make_frames(), std::nullopt, options);
  const auto live = open_source();
  const std::vector<Given> given = record(*live, folder());
  EXPECT_EQ(live->ended_early(), "");
  EXPECT_GE(std::ranges::count_if(given, [](const Given& set) { return set.images[0] == 0; }), 8);
  EXPECT_EQ(read(folder()), given);
}

TEST_F(LiveRig, CamerasAreFoundAndRefusedWithAReason) {
  const FakeRig rig(make_frames(), std::nullopt, options);
  const auto found = find_cameras();
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].sensor_width, width);
  EXPECT_THAT(found[0].pixel_formats, Contains("Mono8"));
  const auto refusal = [](const std::string& address, const DeviceSettings& wanted) -> std::string {
    try {
      const GenicamCamera camera("cam1", address, wanted);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refusal("127.0.0.3", settings()), HasSubstr("does not answer"));
  DeviceSettings wanted = settings();
  wanted.width = 4000;
  EXPECT_THAT(refusal("127.0.0.1", wanted), HasSubstr("does not fit into the sensor"));
  wanted = settings();
  wanted.black_level = 3;
  EXPECT_THAT(refusal("127.0.0.1", wanted), HasSubstr("no feature to set the black level"));
  wanted = settings();
  wanted.trigger_line = "Line7";
  EXPECT_THAT(refusal("127.0.0.1", wanted), HasSubstr("cannot be triggered by \"Line7\""));
  const GenicamCamera taken("cam1", "127.0.0.1", settings());
  EXPECT_THAT(refusal("127.0.0.1", settings()), HasSubstr("another program"));
}

TEST_F(LiveRig, WithoutAStripeItGivesUp) {
  options.delay_s = 60;
  const FakeRig rig(make_frames(), std::nullopt, options);
  const auto live = open_source({.wait_s = 0.3, .longest_s = 60});
  EXPECT_THROW(live->next(), Error);
}

/// A sweep whose picture comes from the line camera; nothing if blocks of it were lost, as a loaded machine's fake
/// cameras do.
std::optional<Picture> take_line_picture(const DeviceSettings& line, int scan_height) {
  const auto live = open_source();
  const auto picture = take_lines(std::make_unique<GenicamCamera>("line", "127.0.0.3", line), scan_height);
  while (live->next()) {
  }
  try {
    return picture->finish(std::chrono::milliseconds(500));
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("blocks of 16 rows of the scan have not come whole"));
    return std::nullopt;
  }
}

TEST_F(LiveRig, TheLineCamerasRowsBecomeTheScanFromTheEndIfTheHeadMovesTheOtherWay) {
  Picture scan = make_picture(50, 70, 3, 8);
  auto& samples = std::get<Image<std::uint8_t>>(scan.samples);
  for (std::size_t i = 0; i < samples.size(); ++i) samples.data()[i] = static_cast<std::uint8_t>(i * 31 % 251);
  options.line_rows = 16;  // the last block has rows beyond the scan's end
  const FakeRig rig(make_frames(), scan, options);
  DeviceSettings line = rig.devices().of("line");
  line.width = 50, line.height = line.rows_a_buffer;
  line.is_reversed = true;
  std::optional<Picture> taken;
  for (int i = 0; i < 3 && !taken; ++i) taken = take_line_picture(line, 70);
  ASSERT_TRUE(taken);
  const auto& got = std::get<Image<std::uint8_t>>(taken->samples);
  ASSERT_EQ(got.size(), samples.size());
  for (int y = 0; y < 70; ++y) EXPECT_TRUE(std::ranges::equal(got.row(69 - y), samples.row(y))) << y;
}

}  // namespace
}  // namespace pagesweep
