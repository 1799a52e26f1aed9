// SPDX-License-Identifier: Apache-2.0
// What becomes of a recording if its disk is full or slow.
#include "pagesweep/live/record_capture.h"

#include <gmock/gmock.h>
#include <sched.h>
#include <sys/mount.h>

#include <fstream>

#include "pagesweep/base/error.h"
#include "pagesweep/io/recording_file.h"

namespace pagesweep {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

constexpr int width = 256, height = 128;  // 64 KiB a trigger of two cameras

std::vector<Sequence> sequences() {
  return {{.camera = "cam1", .width = width, .height = height}, {.camera = "cam2", .width = width, .height = height}};
}

/// Trigger `index`, all of one gray value.
FrameSet trigger(int index) {
  const Image<std::uint8_t> image(width, height, static_cast<std::uint8_t>(index % 251));
  return {index, {GrayImage(image), GrayImage(image)}};
}
std::vector<Timestamp> stamps(int index) { return {Timestamp(index * 1000), Timestamp(index * 1000 + 7)}; }

/// Adds triggers until one is refused.
/// \return how many were taken
int fill(CaptureRecorder& recorder, int most) {
  int taken = 0;
  while (taken < most && recorder.add(trigger(taken), stamps(taken))) ++taken;
  return taken;
}

/// Whether the files are whole and hold the first triggers, in their order, as many in each.
void expect_the_first_triggers(const fs::path& folder, const std::vector<SequenceFiles>& files) {
  ASSERT_EQ(files.size(), 2U);
  ASSERT_GT(files[0].count, 0);
  EXPECT_EQ(files[0].count, files[1].count);
  for (const SequenceFiles& own : files) {
    const RecordingReader reader(folder / own.recording);
    EXPECT_EQ(reader.pages(), own.count - static_cast<int>(own.dropped.size()));
    EXPECT_LE(own.dropped.size(), 1U);  // the one that found no room
    for (int page = 0; page < reader.pages(); ++page)
      EXPECT_EQ(std::get<Image<std::uint8_t>>(reader.read(page))(width / 2, height / 2), page % 251);
  }
}

/// A folder on a disk of its own.
class SmallDisk {
 public:
  explicit SmallDisk(const std::string& bytes) : folder_(fs::path(::testing::TempDir()) / "small_disk") {
    fs::create_directories(folder_);
    is_there_ = ::unshare(CLONE_NEWNS) == 0 && ::mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
                ::mount("tmpfs", folder_.c_str(), "tmpfs", 0, ("size=" + bytes).c_str()) == 0;
  }
  ~SmallDisk() {
    if (is_there_) ::umount2(folder_.c_str(), MNT_DETACH);
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;
  bool is_there() const { return is_there_; }
  const fs::path& folder() const { return folder_; }

 private:
  fs::path folder_;
  bool is_there_ = false;
};

fs::path fresh(const std::string& name) {
  const fs::path folder = fs::path(::testing::TempDir()) / name;
  fs::remove_all(folder);
  return folder;
}

TEST(CaptureRecorder, ADiskThatFillsUpKeepsWhatWasRecordedAndRoomForTheRest) {
  const SmallDisk disk("6m");
  if (!disk.is_there()) GTEST_SKIP() << "a disk of its own (mount) is not permitted here";
  RecorderLimits limits{.least_space = 1 << 20, .triggers_of_a_sweep = 10};
  limits.most_waiting = 1000;
  CaptureRecorder recorder(disk.folder(), sequences(), limits);
  fill(recorder, 200);  // 12 MiB
  const auto files = recorder.finish();
  EXPECT_THAT(recorder.trouble(), HasSubstr("the disk is full: make room"));
  expect_the_first_triggers(disk.folder(), files);
  EXPECT_GT(files[0].count, 60);
  EXPECT_GT(fs::space(disk.folder()).available, limits.least_space / 2);
  EXPECT_FALSE(recorder.add(trigger(0), stamps(0)));
}

TEST(CaptureRecorder, ADiskWithoutAnyRoomLeftGivesAWholeRecordingAsWell) {
  const SmallDisk disk("3m");
  if (!disk.is_there()) GTEST_SKIP() << "a disk of its own (mount) is not permitted here";
  RecorderLimits limits{.least_space = 0, .triggers_of_a_sweep = 0};
  limits.most_waiting = 1000;
  CaptureRecorder recorder(disk.folder(), sequences(), limits);
  fill(recorder, 200);
  const auto files = recorder.finish();
  EXPECT_THAT(recorder.trouble(), HasSubstr("frames.tiff: cannot be written"));
  expect_the_first_triggers(disk.folder(), files);
}

TEST(CaptureRecorder, ADiskWithoutRoomForASweepIsRefusedAndNothingIsLeft) {
  const fs::path folder = fresh("no_room");
  const auto available = fs::space(::testing::TempDir()).available;
  try {
    const CaptureRecorder recorder(folder, sequences(), {.least_space = 2 * available});
    FAIL() << "it was taken";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::cannot_write);
    EXPECT_THAT(error.what(), HasSubstr("a sweep needs some"));
  }
  EXPECT_TRUE(!fs::exists(folder) || fs::is_empty(folder));
}

TEST(CaptureRecorder, ADiskThatIsTooSlowEndsTheRecordingWithAWord) {
  const fs::path folder = fresh("slow_disk");
  RecorderLimits limits;
  limits.most_waiting = 5, limits.delay = std::chrono::milliseconds(30);
  CaptureRecorder recorder(folder, sequences(), limits);
  const int taken = fill(recorder, 2000);
  EXPECT_LT(taken, 2000);
  EXPECT_THAT(recorder.trouble(), HasSubstr("the disk is too slow for the frames"));
  const auto files = recorder.finish();
  EXPECT_LE(files[0].count, taken);
  expect_the_first_triggers(folder, files);
}

TEST(CaptureRecorder, ARecordingThatIsNotFinishedLeavesNoFile) {
  const fs::path folder = fresh("not_finished");
  {
    CaptureRecorder recorder(folder, sequences());
    fill(recorder, 20);
  }
  for (const auto& entry : fs::recursive_directory_iterator(folder)) EXPECT_TRUE(entry.is_directory()) << entry.path();
}

}  // namespace
}  // namespace pagesweep
