// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/capture_file.h"

#include <chrono>
#include <thread>

#include "pagesweep/base/parallel.h"
#include "pagesweep/io/files_testing.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/io/recording_file.h"
#include "pagesweep/io/rig_file.h"

namespace pagesweep {
namespace {

using test::error_of;
using test::read_text;
using test::replaced;
using test::TestFolder;
using testing::AllOf;
using testing::HasSubstr;

constexpr int side = 24;
constexpr int frame_count = 20;

Image<std::uint8_t> frame_of(int camera, int i) {
  Image<std::uint8_t> image(side, side);
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x) image(x, y) = static_cast<std::uint8_t>(camera * 100 + i + x + y);
  return image;
}

Rig some_rig() {
  Camera camera{"cam1", side, side, 40, 40, 11.5, 11.5, {}, {}};
  Rig rig;
  rig.cameras.push_back(camera);
  camera.name = "cam2";
  rig.cameras.push_back(camera);
  return rig;
}

/// A whole capture of two cameras on disk.
Capture make_capture(const TestFolder& folder) {
  const Rig rig = some_rig();
  write_rig(folder / "rig.json", rig);
  Capture capture;
  capture.folder = folder.path();
  capture.notes = "made by a test";
  for (int c = 0; c < 2; ++c) {
    SequenceFiles& files = capture.sequences.emplace_back();
    files.camera = rig.cameras[static_cast<std::size_t>(c)].name;
    files.frames = files.camera + "/%06d.png";
    files.first = 3;
    files.count = frame_count;
    files.black_level = 2;
    for (int i = 0; i < frame_count; ++i) write_gray_png(capture.frame_path(files, i), frame_of(c, i).view());
  }
  capture.scan = "scan.png";
  write_capture(capture);
  return capture;
}

std::vector<Frames> read_frames(const Capture& capture) {
  return read_all(*open_capture(capture, read_capture_rig(capture)));
}

TEST(CaptureFile, KeepsWhatWasWritten) {
  const TestFolder folder;
  const Capture written = make_capture(folder);
  for (const auto& path : {folder.path(), folder / "capture.json"}) {
    const Capture back = read_capture(path);
    EXPECT_EQ(back.folder, folder.path());
    EXPECT_EQ(back.scan_path(), folder / "scan.png");
    EXPECT_EQ(back.notes, written.notes);
    ASSERT_EQ(back.sequences.size(), 2u);
    const SequenceFiles &a = back.sequences[1], &b = written.sequences[1];
    EXPECT_EQ(std::tuple(a.camera, a.frames, a.first, a.count, a.bit_depth, a.black_level, a.saturation),
              std::tuple(b.camera, b.frames, b.first, b.count, b.bit_depth, b.black_level, b.saturation));
  }
}

TEST(CaptureFile, TellsTheCamerasSizesWithoutARig) {
  const TestFolder folder;
  const Capture capture = make_capture(folder);
  std::filesystem::remove(folder / "rig.json");
  std::filesystem::remove(capture.frame_path(capture.sequences[0], 0));  // a dropped frame tells nothing
  const Rig sizes = read_camera_sizes(capture);
  ASSERT_EQ(sizes.cameras.size(), 2u);
  EXPECT_EQ(sizes.cameras[1].name, "cam2");
  EXPECT_EQ(sizes.cameras[0].width, side);
  EXPECT_EQ(sizes.cameras[0].height, side);
  const auto frames = read_all(*open_capture(capture, sizes));
  EXPECT_EQ(frames[0].dropped(), 1);
}

TEST(CaptureFile, YieldsAllFramesInOrderWhateverTheThreads) {
  const TestFolder folder;
  const Capture capture = make_capture(folder);
  for (const int threads : {1, 2}) {
    const ThreadLimit limit(threads);
    const auto frames = read_frames(capture);
    ASSERT_EQ(frames.size(), 2u);
    for (int c = 0; c < 2; ++c) {
      EXPECT_EQ(frames[static_cast<std::size_t>(c)].dropped(), 0);
      for (int i = 0; i < frame_count; ++i) {
        const auto& image = std::get<Image<std::uint8_t>>(frames[static_cast<std::size_t>(c)].frame(i));
        EXPECT_TRUE(std::ranges::equal(image.pixels(), frame_of(c, i).pixels())) << c << " " << i;
      }
    }
  }
}

TEST(CaptureFile, CountsMissingFilesAsDroppedFrames) {
  const TestFolder folder;
  const Capture capture = make_capture(folder);
  for (const int i : {0, 7, 8, 19}) std::filesystem::remove(capture.frame_path(capture.sequences[0], i));
  const auto frames = read_frames(capture);
  EXPECT_EQ(frames[0].dropped(), 4);
  EXPECT_FALSE(frames[0].has(7));
  EXPECT_TRUE(frames[1].has(7));
}

TEST(CaptureFile, RefusesACameraWithoutAnyFrame) {
  const TestFolder folder;
  const Capture capture = make_capture(folder);
  for (int i = 0; i < frame_count; ++i) std::filesystem::remove(capture.frame_path(capture.sequences[1], i));
  EXPECT_THAT(error_of([&] { read_frames(capture); }),
              AllOf(HasSubstr("000003.png"), HasSubstr("none of the 20 frames"), HasSubstr("\"first\"")));
}

TEST(CaptureFile, RefusesACameraThatTheRigLacks) {
  const TestFolder folder;
  Capture capture = make_capture(folder);
  capture.sequences[1].camera = "cam9";
  EXPECT_THAT(error_of([&] { read_frames(capture); }),
              AllOf(HasSubstr("capture.json"), HasSubstr("\"cam9\" is not in the rig"), HasSubstr("rig.json")));
}

TEST(CaptureFile, RefusesFramesOfAnotherSize) {
  const TestFolder folder;
  const Capture capture = make_capture(folder);
  const auto file = capture.frame_path(capture.sequences[0], 11);
  write_gray_png(file, Image<std::uint8_t>(side + 1, side).view());
  EXPECT_THAT(error_of([&] { read_frames(capture); }),
              AllOf(HasSubstr(file.string()), HasSubstr("expected 24 x 24 pixels as in the rig, found 25 x 24")));
}

TEST(CaptureFile, RefusesFramesOfAnotherDepth) {
  const TestFolder folder;
  Capture capture = make_capture(folder);
  const auto file = capture.frame_path(capture.sequences[0], 4);
  write_gray_png(file, Image<std::uint16_t>(side, side).view());
  EXPECT_THAT(
      error_of([&] { read_frames(capture); }),
      AllOf(HasSubstr(file.string()), HasSubstr("expected 8 bit samples for the bit_depth 8"), HasSubstr("16")));
  capture.sequences.resize(1);
  capture.sequences[0].bit_depth = 12;
  EXPECT_THAT(error_of([&] { read_frames(capture); }), HasSubstr("expected 16 bit samples for the bit_depth 12"));
  for (int i = 0; i < frame_count; ++i)
    write_gray_png(capture.frame_path(capture.sequences[0], i), Image<std::uint16_t>(side, side, 4095).view());
  EXPECT_EQ(error_of([&] { read_frames(capture); }), "");
  write_gray_png(file, Image<std::uint16_t>(side, side, 4096).view());
  EXPECT_THAT(error_of([&] { read_frames(capture); }),
              AllOf(HasSubstr(file.string()), HasSubstr("below 4096"), HasSubstr("found 4096")));
}

TEST(CaptureFile, ReportsTheFirstOfSeveralBadFrames) {
  const TestFolder folder;
  const Capture capture = make_capture(folder);
  for (const int i : {7, 6, 2, 5}) write_bytes(capture.frame_path(capture.sequences[1], i), "nonsense");
  for (int run = 0; run < 5; ++run) EXPECT_THAT(error_of([&] { read_frames(capture); }), HasSubstr("000005.png"));
}

TEST(CaptureFile, NamesFileFieldAndWhatWasExpected) {
  const TestFolder folder;
  make_capture(folder);
  const std::string sound = read_text(folder / "capture.json");
  struct Damage {
    std::string from, to, place, hint;
  };
  const Damage damages[] = {
      {"pagesweep-capture", "pagesweep-rig", "format", "expected \"pagesweep-capture\""},
      {"\"rig\": \"rig.json\"", "\"rig\": \"\"", "rig", "expected a file's path"},
      {"\"rig\": \"rig.json\",", "", "rig", "is missing"},
      {"\"sequences\": [", "\"sequences\": [], \"x\": [", "sequences", "at least one sequence"},
      {"\"count\": 20", "\"count\": 19", "sequences[1].count", "expected 19"},
      {"\"count\": 20", "\"count\": 0", "sequences[0].count", "from 1"},
      {"\"count\": 20", "\"count\": 1e9", "sequences[0].count", "from 1"},
      {"\"first\": 3", "\"first\": -1", "sequences[0].first", "from 0"},
      {"\"bit_depth\": 8", "\"bit_depth\": 17", "sequences[0].bit_depth", "from 1 to 16"},
      {"\"black_level\": 2.0", "\"black_level\": -1", "sequences[0].black_level", "from 0"},
      {"\"saturation\": 255.0", "\"saturation\": 2", "sequences[0].saturation", "more than black_level"},
      {"\"saturation\": 255.0", "\"saturation\": 300", "sequences[0].saturation", "from 0 to 256"},
      {"\"saturation\": 255.0", "\"saturated\": 300", "sequences[0].saturation", "is missing"},
      {"\"camera\": \"cam2\"", "\"camera\": \"cam1\"", "sequences[1].camera", "a sequence of \"cam1\" already"},
      {"cam1/%06d.png", "cam1/%s.png", "sequences[0].frames", "one %d or %06d"},
      {"cam1/%06d.png", "cam1/%06d%n.png", "sequences[0].frames", "no other %"},
      {"cam1/%06d.png", "cam1/%d%%.png", "sequences[0].frames", "no other %"},
      {"cam1/%06d.png", "cam1/%*d.png", "sequences[0].frames", "one %d"},
      {"cam1/%06d.png", "cam1/%099999999999d.png", "sequences[0].frames", "one %d"},
      {"cam1/%06d.png", "cam1/%099d.png", "sequences[0].frames", "one %d"},
      {"cam1/%06d.png", "cam1/%6d.png", "sequences[0].frames", "one %d"},
      {"cam1/%06d.png", "cam1/1.png", "sequences[0].frames", "one %d"},
      {"cam1/%06d.png", "cam1/%", "sequences[0].frames", "one %d"},
      {"\"scan\": {\"image\": \"scan.png\"}", "\"scan\": \"scan.png\"", "scan", "expected an object, found a string"},
      {"\"image\": \"scan.png\"", "\"image\": 4", "scan.image", "expected a string"},
      {"\"notes\": \"made by a test\"", "\"notes\": 4", "notes", "expected a string"},
  };
  for (const Damage& damage : damages) {
    test::put(folder / "capture.json", replaced(sound, damage.from, damage.to));
    EXPECT_THAT(error_of([&] { read_capture(folder.path()); }),
                AllOf(HasSubstr("capture.json: " + damage.place + ": "), HasSubstr(damage.hint)))
        << damage.from << " -> " << damage.to;
  }
  EXPECT_THAT(error_of([&] { read_capture(folder / "nowhere"); }), HasSubstr("nowhere: cannot be read"));
}

TEST(CaptureFile, KeepsExposuresAndRepeatsThem) {
  const TestFolder folder;
  Capture capture = make_capture(folder);
  capture.sequences[0].exposure_ms = {2, 8};
  capture.sequences[1].exposure_ms = {4};
  write_capture(capture);
  const Capture back = read_capture(folder.path());
  EXPECT_EQ(back.sequences[0].exposure_ms, (std::vector{2.0, 8.0}));
  EXPECT_EQ(back.sequences[1].exposure_ms, std::vector{4.0});
  const auto frames = read_frames(back);
  EXPECT_EQ(frames[0].sequence().exposure(0), 0.25);
  EXPECT_EQ(frames[0].sequence().exposure(frame_count - 1), 1);
  EXPECT_EQ(frames[1].sequence().exposure(0), 1);
}

TEST(CaptureFile, RefusesExposuresThatAreNone) {
  const TestFolder folder;
  make_capture(folder);
  const std::string sound = read_text(folder / "capture.json");
  const std::string all_but_one = "[1" + [] {
    std::string rest;
    for (int i = 2; i < frame_count; ++i) rest += ", 2";
    return rest;
  }() + "]";
  const std::tuple<std::string, std::string, std::string> damages[] = {
      {"0", "exposure_ms", "a time above 0"},
      {"-3", "exposure_ms", "a time above 0"},
      {"\"4 ms\"", "exposure_ms", "expected a number, found a string"},
      {"[2, 0]", "exposure_ms[1]", "a time above 0"},
      {"[]", "exposure_ms", "one time a frame (20), or 1 to 10 that repeat, found 0"},
      {all_but_one, "exposure_ms", "or 1 to 10 that repeat, found 19"},
      {"[0.001, 80]", "exposure_ms", "none is more than 10000 times another"},
  };
  for (const auto& [value, place, hint] : damages) {
    test::put(folder / "capture.json", replaced(sound, "\"count\": 20", "\"count\": 20, \"exposure_ms\": " + value));
    EXPECT_THAT(error_of([&] { read_capture(folder.path()); }),
                AllOf(HasSubstr("capture.json: sequences[0]." + place + ": "), HasSubstr(hint)))
        << value;
  }
}

/// The capture of make_capture() with the first camera's frames in a recording, some of them dropped.
Capture make_recording(const TestFolder& folder, const std::vector<int>& dropped) {
  Capture capture = make_capture(folder);
  SequenceFiles& files = capture.sequences[0];
  files.recording = "recordings/cam1.tiff";
  files.frames.clear();
  files.first = 0;
  files.dropped = dropped;
  RecordingWriter writer(folder / "recordings/cam1.tiff", {side, side}, 8, frame_count);
  for (int i = 0; i < frame_count; ++i)
    if (!std::ranges::binary_search(dropped, i)) writer.append(frame_of(0, i));
  writer.commit();
  write_capture(capture);
  return capture;
}

TEST(CaptureFile, ReadsRecordingsAndKnowsTheirDroppedFrames) {
  const TestFolder folder;
  const std::vector<int> dropped = {0, 7, 8, 19};
  make_recording(folder, dropped);
  const Capture back = read_capture(folder.path());
  EXPECT_EQ(back.sequences[0].recording, "recordings/cam1.tiff");
  EXPECT_EQ(back.sequences[0].dropped, dropped);
  EXPECT_THROW(back.frame_path(back.sequences[0], 3), std::invalid_argument);
  const auto frames = read_frames(back);
  EXPECT_EQ(frames[0].dropped(), 4);
  EXPECT_EQ(frames[1].dropped(), 0);
  for (int i = 0; i < frame_count; ++i) {
    ASSERT_EQ(frames[0].has(i), !std::ranges::binary_search(dropped, i));
    if (!frames[0].has(i)) continue;
    const auto& image = std::get<Image<std::uint8_t>>(frames[0].frame(i));
    EXPECT_TRUE(std::ranges::equal(image.pixels(), frame_of(0, i).pixels())) << i;
  }
}

TEST(CaptureFile, RefusesRecordingsThatAreNotWhatCaptureJsonSays) {
  const TestFolder folder;
  Capture capture = make_recording(folder, {7});
  capture.sequences[0].dropped = {};
  EXPECT_THAT(
      error_of([&] { read_frames(capture); }),
      AllOf(HasSubstr("cam1.tiff: expected 20 pages for \"count\" 20 and 0 \"dropped\""), HasSubstr("found 19")));
  capture.sequences[0].dropped = {7};
  capture.sequences[0].bit_depth = 5;
  EXPECT_THAT(error_of([&] { read_frames(capture); }), AllOf(HasSubstr("cam1.tiff: page 0: "), HasSubstr("below 32")));
  capture.sequences[0].bit_depth = 12;
  EXPECT_THAT(error_of([&] { read_frames(capture); }), HasSubstr("expected 16 bit samples for the bit_depth 12"));
}

TEST(CaptureFile, SaysWhatIsWrongWithARecordingsFields) {
  const TestFolder folder;
  make_recording(folder, {3, 7});
  const std::string sound = read_text(folder / "capture.json");
  const std::string list = sound.substr(sound.find("\"dropped\""), sound.find(']') + 1 - sound.find("\"dropped\""));
  const std::tuple<std::string, std::string, std::string, std::string> damages[] = {
      {list, "\"dropped\": [7, 3]", "sequences[0].dropped[1]", "a frame after 7, found 3"},
      {list, "\"dropped\": [7, 7]", "sequences[0].dropped[1]", "a frame after 7, found 7"},
      {list, "\"dropped\": [20]", "sequences[0].dropped[0]", "from 0 to 19"},
      {list, "\"dropped\": [-1]", "sequences[0].dropped[0]", "from 0 to 19"},
      {list, "\"dropped\": 3", "sequences[0].dropped", "expected an array"},
      {list, "\"frames\": \"a/%d.png\"", "sequences[0].frames", "either \"frames\" or \"recording\""},
      {"\"recordings/cam1.tiff\"", "\"\"", "sequences[0].recording", "expected a file's path"},
      {"\"first\": 3", "\"dropped\": [3]", "sequences[1].dropped", "beside \"recording\" only"},
  };
  for (const auto& [from, to, place, hint] : damages) {
    test::put(folder / "capture.json", replaced(sound, from, to));
    EXPECT_THAT(error_of([&] { read_capture(folder.path()); }),
                AllOf(HasSubstr("capture.json: " + place + ": "), HasSubstr(hint)))
        << to;
  }
}

TEST(CaptureFile, DeliversAllInstantsBeforeABadOneAndThenItsErrorForEver) {
  const TestFolder folder;
  const Capture capture = make_capture(folder);
  write_bytes(capture.frame_path(capture.sequences[1], 13), "nonsense");
  const auto source = open_capture(capture, read_capture_rig(capture));
  for (int i = 0; i < 13; ++i) {
    const auto set = source->next();
    ASSERT_TRUE(set);
    EXPECT_EQ(set->index, i);
  }
  for (int again = 0; again < 3; ++again)
    EXPECT_THAT(error_of([&] { source->next(); }), HasSubstr("000016.png"));  // frame 0 is file 3
}

TEST(CaptureFile, EndsWithoutBeingReadToItsEnd) {
  const TestFolder folder;
  const Capture capture = make_capture(folder);
  const Rig rig = read_capture_rig(capture);
  for (int fetched = 0; fetched < frame_count; fetched += 3) {
    const auto source = open_capture(capture, rig);
    for (int i = 0; i < fetched; ++i) ASSERT_TRUE(source->next());
  }
  const auto source = open_capture(capture, rig);
  for (int i = 0; i < frame_count; ++i) ASSERT_TRUE(source->next());
  for (int again = 0; again < 3; ++again) EXPECT_FALSE(source->next());
}

TEST(CaptureFile, ReadsAtMost16InstantsAhead) {
  const TestFolder folder;
  const Capture capture = make_capture(folder);
  const auto source = open_capture(capture, read_capture_rig(capture));
  ASSERT_TRUE(source->next());
  std::this_thread::sleep_for(std::chrono::milliseconds(100));  // for a reader without bounds, to betray itself
  write_gray_png(capture.frame_path(capture.sequences[0], 18), Image<std::uint8_t>(side, side, 99).view());
  for (int i = 1; i < 18; ++i) ASSERT_TRUE(source->next());
  const auto set = source->next();
  EXPECT_EQ(std::get<Image<std::uint8_t>>(*set->images[0])(5, 5), 99);
}

TEST(CaptureFile, NumbersFramesWithAndWithoutPadding) {
  Capture capture;
  capture.folder = "here";
  EXPECT_EQ(capture.frame_path({"a", "a/%d.png", 9, 3}, 1), "here/a/10.png");
  EXPECT_EQ(capture.frame_path({"a", "a/%03d.tif", 9, 3}, 1), "here/a/010.tif");
  EXPECT_EQ(capture.frame_path({"a", "/abs/%01d", 0, 3}, 12), "/abs/12");
  EXPECT_THROW(capture.frame_path({"a", "a/%s", 0, 3}, 12), std::invalid_argument);
}

}  // namespace
}  // namespace pagesweep
