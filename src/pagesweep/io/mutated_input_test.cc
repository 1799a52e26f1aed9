// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <functional>
#include <iterator>
#include <random>

#include "pagesweep/io/board_file.h"
#include "pagesweep/io/capture_file.h"
#include "pagesweep/io/colmap_rig.h"
#include "pagesweep/io/color_profile.h"
#include "pagesweep/io/files_testing.h"
#include "pagesweep/io/float_tiff.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/io/kalibr_rig.h"
#include "pagesweep/io/opencv_rig.h"
#include "pagesweep/io/page_metadata.h"
#include "pagesweep/io/pages_file.h"
#include "pagesweep/io/ply_file.h"
#include "pagesweep/io/recording_file.h"
#include "pagesweep/io/rig_file.h"
#include "pagesweep/io/rig_testing.h"
#include "pagesweep/io/truth_file.h"

namespace pagesweep {
namespace {

using test::TestFolder;

/// Changes a few places of a file as damage, or somebody with a plan, would.
std::string mutate(std::string bytes, std::mt19937& random) {
  const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random() % std::max<std::size_t>(1, n)); };
  static const std::string numbers[] = {
      {"\0\0\0\0", 4}, "\xff\xff\xff\xff", "\x7f\xff\xff\xff", {"\0\0\0\x80", 4}, "-1", "1e308", "null", "[", "}"};
  for (std::size_t changes = 1 + below(4); changes > 0 && !bytes.empty(); --changes) {
    const std::size_t at = below(bytes.size());
    const std::string& number = numbers[below(std::size(numbers))];
    switch (below(6)) {
      case 0:
        bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(8)));
        break;
      case 1:
        bytes[at] = static_cast<char>(below(256));
        break;
      case 2:
        bytes.replace(at, number.size(), number);
        break;
      case 3:
        bytes.erase(at, 1 + below(8));
        break;
      case 4:
        bytes.insert(at, bytes.substr(below(bytes.size()), 1 + below(30)));
        break;
      default:
        if (below(4) == 0) bytes.resize(at);
    }
  }
  return bytes;
}

struct Format {
  std::string name;                                         ///< of the file
  std::function<void(const std::filesystem::path&)> write;  ///< a sound one
  std::function<void(const std::filesystem::path&)> read;
};

Picture some_picture(int bit_depth) {
  Picture picture = make_picture(33, 20, 3, bit_depth);
  picture.pixels_per_mm = 12;
  std::visit(
      [](auto& samples) {
        int i = 0;
        for (auto& sample : samples.pixels()) sample = static_cast<std::uint8_t>(i++ * 37 % 251);
      },
      picture.samples);
  return picture;
}

Picture some_finished_page() {
  Picture page = some_picture(8);
  page.metadata["exif"] = make_exif({"", "Lumen", "XL 3", "", "2026:11:22 18:04:00", "", ""});
  complete_profile(page);
  complete_metadata(page, {"title", "source", "program"});
  return page;
}

Rig some_rig() {
  Rig rig;
  rig.cameras = {{"cam1", 32, 24, 40, 40, 15.5, 11.5, {0.1, 0, 0, 0, 0}, {}}};
  rig.cameras[0].sensor = CameraSensor{0.025, 1.2, 0.7};
  rig.scanner = Scanner(Pushbroom{100, 200, 300, 50, 0, {Eigen::Matrix3d::Identity()}, {0, 0, 700}, {0, 0.1, 0}});
  rig.light = Light(TranslatingPlane{{0, 1, 0}, -150, 1.5});
  return rig;
}

void write_capture_to(const std::filesystem::path& file) {
  Capture capture;
  capture.folder = file.parent_path();
  capture.sequences = {{"cam1", "cam1/%06d.png", 0, 9, 8, 2, 255}};
  capture.sequences.push_back({"cam2", "", 0, 9, 8, 2, 255, {}, "cam2.tiff", {3, 7}});
  capture.scan = "scan.png";
  write_capture(capture);
}

void write_truth_to(const std::filesystem::path& file) {
  Truth truth;
  truth.folder = file.parent_path();
  truth.pages = {{1, 11.8, 8, "page_1.txt"}};
  truth.stripe = {1.5, 12};
  truth.sensor = {40, 1.2};
  truth.profile = {-1, 0.5, {0, 1, 0}};
  write_truth(truth);
}

void write_ply_to(const std::filesystem::path& file) {
  std::vector<PointMap> maps(1, PointMap(5, 5));
  std::ranges::fill(maps[0].status.pixels(), PixelStatus::ok);
  write_ply(file, maps);
}

/// Small frames, so that most of the file says where they are.
void write_recording(const std::filesystem::path& file) {
  RecordingWriter writer(file, {5, 3}, 16, 6);
  for (int i = 0; i < 6; ++i) writer.append(Image<std::uint16_t>(5, 3, static_cast<std::uint16_t>(i)));
  writer.commit();
}

void read_recording(const std::filesystem::path& file) {
  const RecordingReader reader(file);
  for (int page = 0; page < reader.pages(); ++page) reader.read(page);
}

/// Rigs of other programs. Where two files make one, one of them is damaged.
std::vector<Format> foreign_rigs() {
  using Path = std::filesystem::path;
  const auto write_stereo = [](const Path& file) { write_opencv_stereo(file.parent_path(), test::two_cameras()); };
  const auto write_model = [](const Path& file) { write_colmap_rig(file.parent_path(), test::two_cameras()); };
  const auto read_opencv = [](const std::vector<Path>& files) { read_opencv_rig(files); };
  return {
      {"opencv.yml", [](const Path& file) { write_opencv_rig(file, test::two_cameras()); },
       [=](const Path& file) { read_opencv({file}); }},
      {"intrinsics.yml", write_stereo,
       [=](const Path& file) { read_opencv({file.parent_path() / "extrinsics.yml", file}); }},
      {"extrinsics.yml", write_stereo,
       [=](const Path& file) { read_opencv({file.parent_path() / "intrinsics.yml", file}); }},
      {"cameras.txt", write_model, [](const Path& file) { read_colmap_rig(file, file.parent_path() / "images.txt"); }},
      {"images.txt", write_model, [](const Path& file) { read_colmap_rig(file.parent_path() / "cameras.txt", file); }},
      {"camchain.yaml", [](const Path& file) { write_kalibr_rig(file, test::two_cameras()); },
       [](const Path& file) { read_kalibr_rig(file); }},
  };
}

std::vector<Format> all_formats() {
  using Path = std::filesystem::path;
  const auto write_page = [](const Path& file) { write_picture(file, some_finished_page()); };
  const auto read_page = [](const Path& file) {
    Picture page = read_picture(file);
    complete_profile(page);
    complete_metadata(page, {"title", "source", "program"});
  };
  const auto read_frame = [](const Path& file) { read_gray(file); };
  const auto write_ascii = [](const Path& file) {
    write_bytes(
        file,
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty list uchar int l\nproperty float y\n"
        "property float z\nend_header\n1 2 3 4 5 6\n7 0 8 9\n");
  };
  const auto write_map = [](const Path& file) {
    const Image<float> channel(30, 20, 1.5F);
    write_float_tiff(file, {channel.view(), channel.view()});
  };
  std::vector<Format> formats = {
      {"rig.json", [](const Path& file) { write_rig(file, some_rig()); }, [](const Path& file) { read_rig(file); }},
      {"board.json", [](const Path& file) { write_board(file, {}); }, [](const Path& file) { read_board(file); }},
      {"capture.json", write_capture_to, [](const Path& file) { read_capture(file); }},
      {"truth.json", write_truth_to, [](const Path& file) { read_truth(file); }},
      {"pages.json",
       [](const Path& file) { write_pages_file(file.parent_path(), {"book", {{1, "page_1.png", "left"}}}); },
       [](const Path& file) { read_pages_file(file.parent_path()); }},
      {"points.ply", write_ply_to, [](const Path& file) { read_ply(file); }},
      {"ascii.ply", write_ascii, [](const Path& file) { read_ply(file); }},
      {"map.tiff", write_map, [](const Path& file) { read_float_tiff(file); }},
      {"8.png", [](const Path& f) { write_gray_png(f, Image<std::uint8_t>(30, 20, 7).view()); }, read_frame},
      {"16.png", [](const Path& f) { write_gray_png(f, Image<std::uint16_t>(30, 20, 700).view()); }, read_frame},
      {"recording.tiff", write_recording, read_recording},
      {"frame.tif", [](const Path& f) { write_picture(f, make_picture(30, 20, 1, 16)); }, read_frame},
      {"page.png", write_page, read_page},
      {"page.tif", write_page, read_page},
      {"page.jpg", write_page, read_page},
      {"page.jp2", write_page, read_page},
  };
  std::ranges::move(foreign_rigs(), std::back_inserter(formats));
  return formats;
}

class MutatedInput : public testing::TestWithParam<int> {};

TEST_P(MutatedInput, IsReadOrRefusedAndNothingElse) {
  const Format format = all_formats()[static_cast<std::size_t>(GetParam())];
  const TestFolder folder;
  const auto file = folder / format.name;
  format.write(file);
  const std::string sound = test::read_text(file);
  std::mt19937 random(static_cast<unsigned>(GetParam()));
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  int refused = 0;
  for (int i = 0; i < 300; ++i) {
    std::string bytes = mutate(sound, random);
    if (format.name.ends_with(".png") && i % 8 != 0) bytes = test::with_checksums(std::move(bytes));
    test::put(file, bytes);
    try {
      format.read(file);
    } catch (const Error& e) {
      ++refused;
      EXPECT_THAT(e.what(), testing::HasSubstr(format.name));
    }
  }
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  EXPECT_GT(refused, 30) << "so few refusals mean that the mutations do not reach the reader";
}

INSTANTIATE_TEST_SUITE_P(All, MutatedInput, testing::Range(0, static_cast<int>(all_formats().size())),
                         [](const auto& test) {
                           std::string name = all_formats()[static_cast<std::size_t>(test.param)].name;
                           std::ranges::replace(name, '.', '_');
                           return name;
                         });

}  // namespace
}  // namespace pagesweep
