// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/convert_capture.h"

#include "pagesweep/io/files_testing.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/io/rig_file.h"

namespace pagesweep {
namespace {

using test::error_of;
using test::read_text;
using test::TestFolder;
using testing::AllOf;
using testing::HasSubstr;

constexpr int width = 19, height = 11, frame_count = 21;

GrayImage frame_of(int camera, int i) {
  Image<std::uint8_t> of_8_bit(width, height);
  Image<std::uint16_t> of_12_bit(width, height);
  for (std::size_t k = 0; k < of_8_bit.size(); ++k) {
    of_8_bit.data()[k] = static_cast<std::uint8_t>(i * 40 + static_cast<int>(k));
    of_12_bit.data()[k] = static_cast<std::uint16_t>((i * 400 + static_cast<int>(k)) % 4096);
  }
  return camera == 0 ? GrayImage(std::move(of_8_bit)) : GrayImage(std::move(of_12_bit));
}

bool is_dropped(int camera, int i) { return camera == 0 ? i == 0 || i == 20 : i % 7 == 5; }

/// A capture of an 8 bit and a 12 bit camera whose rig and scan lie elsewhere, with gaps, exposures and a truth.
Capture make_capture(const TestFolder& folder) {
  Rig rig;
  for (const char* name : {"left", "right"}) rig.cameras.push_back({name, width, height, 40, 40, 9, 5, {}, {}});
  write_rig(folder / "rigs/of_today.json", rig);
  write_bytes(folder / "elsewhere/picture.tif", "a scan that nobody looks into");
  write_bytes(folder / "capture/truth/truth.json", "{}");
  write_bytes(folder / "capture/truth/deeper/points.tiff", "points");
  Capture capture;
  capture.folder = folder / "capture";
  capture.rig = "../rigs/of_today.json";
  capture.scan = folder / "elsewhere/picture.tif";
  capture.notes = "to be kept";
  capture.sequences = {{"left", "left/%d.png", 5, frame_count, 8, 2, 250, {2, 8}},
                       {"right", "right_%03d.png", 0, frame_count, 12, 30, 4095, {4}}};
  for (int c = 0; c < 2; ++c)
    for (int i = 0; i < frame_count; ++i)
      if (!is_dropped(c, i))
        write_gray_png(capture.frame_path(capture.sequences[static_cast<std::size_t>(c)], i), frame_of(c, i));
  write_capture(capture);
  return capture;
}

Capture convert(const Capture& capture, FrameFormat format, const std::filesystem::path& folder) {
  const auto frames = open_capture(capture, read_capture_rig(capture));
  return convert_capture(capture, *frames, folder, {format});
}

void expect_same_capture(const Capture& copy) {
  EXPECT_EQ(copy.notes, "to be kept");
  ASSERT_EQ(copy.sequences.size(), 2u);
  const SequenceFiles &left = copy.sequences[0], &right = copy.sequences[1];
  EXPECT_EQ(std::tuple(left.camera, left.count, left.bit_depth, left.black_level, left.saturation),
            std::tuple("left", frame_count, 8, 2, 250));
  EXPECT_EQ(std::tuple(right.camera, right.count, right.bit_depth, right.black_level, right.saturation),
            std::tuple("right", frame_count, 12, 30, 4095));
  EXPECT_EQ(left.exposure_ms, (std::vector{2.0, 8.0}));
  EXPECT_EQ(right.exposure_ms, std::vector{4.0});
  const auto frames = read_all(*open_capture(copy, read_capture_rig(copy)));
  for (int c = 0; c < 2; ++c)
    for (int i = 0; i < frame_count; ++i) {
      ASSERT_EQ(frames[static_cast<std::size_t>(c)].has(i), !is_dropped(c, i)) << c << " " << i;
      if (is_dropped(c, i)) continue;
      std::visit(
          [&](const auto& expected) {
            const auto& image = frames[static_cast<std::size_t>(c)].frame(i);
            ASSERT_TRUE(std::holds_alternative<std::decay_t<decltype(expected)>>(image));
            const auto& found = std::get<std::decay_t<decltype(expected)>>(image);
            EXPECT_TRUE(std::ranges::equal(found.pixels(), expected.pixels())) << c << " " << i;
          },
          frame_of(c, i));
    }
}

TEST(ConvertCapture, KeepsEveryFrameAndEveryGapThereAndBack) {
  const TestFolder folder;
  const Capture capture = make_capture(folder);
  for (const auto there : {FrameFormat::recording, FrameFormat::png, FrameFormat::tiff})
    for (const auto back : {FrameFormat::recording, FrameFormat::png, FrameFormat::tiff}) {
      convert(capture, there, folder / "there");
      convert(read_capture(folder / "there"), back, folder / "back");
      expect_same_capture(read_capture(folder / "there"));
      expect_same_capture(read_capture(folder / "back"));
      std::filesystem::remove_all(folder / "there");
      std::filesystem::remove_all(folder / "back");
    }
}

TEST(ConvertCapture, CopiesRigScanAndTruthByteByByte) {
  const TestFolder folder;
  const Capture capture = make_capture(folder);
  const Capture copy = convert(capture, FrameFormat::recording, folder / "deep/in/copy");
  EXPECT_EQ(copy.folder, folder / "deep/in/copy");
  EXPECT_EQ(copy.rig, "rig.json");
  EXPECT_EQ(copy.scan, "scan.tif");
  EXPECT_EQ(read_text(copy.rig_path()), read_text(capture.rig_path()));
  EXPECT_EQ(read_text(*copy.scan_path()), read_text(*capture.scan_path()));
  EXPECT_EQ(read_text(copy.folder / "truth/truth.json"), "{}");
  EXPECT_EQ(read_text(copy.folder / "truth/deeper/points.tiff"), "points");
}

TEST(ConvertCapture, NeverTouchesAFolderThatHoldsSomething) {
  const TestFolder folder;
  const Capture capture = make_capture(folder);
  const std::string before = read_text(folder / "capture/capture.json");
  const std::size_t files = folder.files();
  write_bytes(folder / "file", "mine");
  for (const char* there : {"capture", "rigs", "file"})
    EXPECT_THAT(error_of([&] { convert(capture, FrameFormat::recording, folder / there); }),
                AllOf(HasSubstr(there), HasSubstr("cannot be written"), HasSubstr("name a new folder")));
  EXPECT_EQ(folder.files(), files + 1);
  EXPECT_EQ(read_text(folder / "capture/capture.json"), before);
}

TEST(ConvertCapture, WritesNoCaptureJsonIfSomethingIsMissing) {
  const TestFolder folder;
  const Capture capture = make_capture(folder);
  std::filesystem::remove(folder / "elsewhere/picture.tif");
  EXPECT_THAT(error_of([&] { convert(capture, FrameFormat::png, folder / "copy"); }),
              AllOf(HasSubstr("picture.tif: cannot be read"), HasSubstr("no such file")));
  EXPECT_FALSE(std::filesystem::exists(folder / "copy/capture.json"));
  write_bytes(capture.frame_path(capture.sequences[0], 9), "nonsense");
  EXPECT_THAT(error_of([&] { convert(capture, FrameFormat::recording, folder / "copy2"); }), HasSubstr("left/14.png"));
  EXPECT_FALSE(std::filesystem::exists(folder / "copy2/capture.json"));
  EXPECT_FALSE(std::filesystem::exists(folder / "copy2/left/frames.tiff"));
}

}  // namespace
}  // namespace pagesweep
