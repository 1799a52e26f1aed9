// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/opencv_rig.h"

#include <fmt/format.h>

#include <vector>

#include "pagesweep/io/files_testing.h"
#include "pagesweep/io/rig_testing.h"

namespace pagesweep {
namespace {

using test::Damage;
using test::error_of;
using test::expect_near;
using test::replaced;
using test::TestFolder;
using testing::AllOf;
using testing::HasSubstr;
using Files = std::vector<std::filesystem::path>;

/// As OpenCV's calibration sample leaves it: comments, flags and errors that do not matter to us, matrices over
/// several lines, numbers that end in a point.
constexpr const char* single = R"(%YAML:1.0
---
calibration_time: "Tue Mar  4 10:12:55 2025"
nframes: 20
image_width: 2048
image_height: 1500
board_width: 24
square_size: 7.5000000000000000e+00
# flags:  +fix_aspectRatio +zero_tangent_dist
flags: 2
fisheye_model: 0
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 7.2113125000000000e+03, 0., 1.0194000000000000e+03, 0.,
       7.2096000000000000e+03, 7.3320000000000000e+02, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -1.1000000000000000e-01, 3.1000000000000000e-01,
       5.9999999999999995e-04, -4.0000000000000002e-04, 0. ]
avg_reprojection_error: 1.5130000000000002e-01
)";

constexpr const char* intrinsics = R"(%YAML:1.0
---
M1: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1700., 0., 511.5, 0., 1701., 380., 0., 0., 1. ]
D1: !!opencv-matrix
   rows: 1
   cols: 14
   dt: d
   data: [ -0.1, 0.2, 1e-3, 2e-3, 0.3, 0., 0., 0., 0., 0., 0., 0., 0., 0. ]
M2: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1710., 0., 512.5, 0., 1711., 381., 0., 0., 1. ]
D2: !!opencv-matrix
   rows: 1
   cols: 4
   dt: d
   data: [ -0.2, 0.1, 3e-3, 4e-3 ]
)";

/// Camera 2 stands turned by 90 degrees about the optical axis; five digits.
constexpr const char* extrinsics = R"(%YAML:1.0
---
R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 0.00001, -1., 0., 1., 0.00001, 0., 0., 0., 1. ]
T: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ -12.5, 0.25, 1. ]
R1: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]
)";

Files put(const TestFolder& folder, const std::vector<std::string>& texts) {
  Files files;
  for (const auto& text : texts) {
    files.push_back(folder / fmt::format("{}.yml", files.size()));
    test::put(files.back(), text);
  }
  return files;
}

TEST(OpenCvRig, ReadsWhatTheCalibrationSampleWrites) {
  const TestFolder folder;
  const Rig rig = read_opencv_rig(put(folder, {single}));
  ASSERT_EQ(rig.cameras.size(), 1u);
  Camera expected = test::two_cameras().cameras[0];
  expected.cam_from_rig = {};
  expect_near(rig.cameras[0], expected);
}

TEST(OpenCvRig, ReadsWhatTheStereoSampleWritesInItsUnit) {
  const TestFolder folder;
  const Rig rig =
      read_opencv_rig(put(folder, {intrinsics, extrinsics}), {.mm_per_unit = 10, .width = 1024, .height = 768});
  ASSERT_EQ(rig.cameras.size(), 2u);
  Camera second{"cam2", 1024, 768, 1710, 1711, 512.5, 381, {-0.2, 0.1, 3e-3, 4e-3, 0}, {}};
  second.cam_from_rig.rotation << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  second.cam_from_rig.translation = {-125, 2.5, 10};
  expect_near(rig.cameras[0], {"cam1", 1024, 768, 1700, 1701, 511.5, 380, {-0.1, 0.2, 1e-3, 2e-3, 0.3}, {}});
  expect_near(rig.cameras[1], second, 2e-5);
  const Eigen::Matrix3d rotation = rig.cameras[1].cam_from_rig.rotation;
  EXPECT_LT((rotation.transpose() * rotation - Eigen::Matrix3d::Identity()).norm(), 1e-14) << "it was rounded";
}

TEST(OpenCvRig, ReadsTwoCamerasCalibratedAloneAndThenAgainstEachOther) {
  const TestFolder folder;
  const Rig rig = read_opencv_rig(put(folder, {single, replaced(single, "7.2113", "7.3113"), extrinsics}));
  ASSERT_EQ(rig.cameras.size(), 2u);
  EXPECT_EQ(rig.cameras[1].name, "cam2");
  EXPECT_EQ(rig.cameras[1].fx, 7311.3125);
  EXPECT_EQ(rig.cameras[1].cam_from_rig.translation, Eigen::Vector3d(-12.5, 0.25, 1));
}

TEST(OpenCvRig, IsWhatWasWritten) {
  const TestFolder folder;
  Rig rig = test::two_cameras();
  rig.cameras[0].distortion.k3 = -0.02;
  write_opencv_stereo(folder / "stereo", rig, 10);
  expect_near(
      read_opencv_rig(Files{folder / "stereo/intrinsics.yml", folder / "stereo/extrinsics.yml"}, {.mm_per_unit = 10}),
      rig);
  rig.cameras.push_back(rig.cameras[0]);
  rig.cameras[0].name = "right";
  rig.cameras[1].name = "a-camera_2";
  write_opencv_rig(folder / "three.yml", rig, 1000);
  expect_near(read_opencv_rig(Files{folder / "three.yml"}, {.mm_per_unit = 1000}), rig);
  rig.cameras = {test::two_cameras().cameras[0]};
  write_opencv_rig(folder / "one.yml", rig);
  expect_near(read_opencv_rig(Files{folder / "one.yml"}), rig);
}

TEST(OpenCvRig, WritesNumbersThatOpenCvTakesForReal) {
  const TestFolder folder;
  Rig rig;
  rig.cameras = {{"cam1", 64, 48, 1700, 1701, 31.5, 23.5, {1e-5, 0, 0, 0, 0}, {}}};
  write_opencv_rig(folder / "one.yml", rig);
  const std::string text = test::read_text(folder / "one.yml");
  EXPECT_THAT(text, testing::StartsWith("%YAML:1.0\n---\nimage_width: 64\n"));
  EXPECT_THAT(text, HasSubstr("camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 1700.0, "));
  EXPECT_THAT(text, HasSubstr("data: [ 1.0e-05, 0.0, 0.0, 0.0, 0.0 ]"));
}

TEST(OpenCvRig, NamesFileFieldAndWhatWasExpected) {
  const TestFolder folder;
  const Damage damages[] = {
      {"image_width: 2048\n", "", "image_width", "is missing"},
      {"image_width: 2048\nimage_height: 1500\n", "", "image_width", "--image-size"},
      {"image_width: 2048", "image_width: 0", "image_width", "whole number from 1"},
      {"image_width: 2048", "image_width: .nan", "image_width", "expected a number"},
      {"fisheye_model: 0", "fisheye_model: 1", "fisheye_model", "no fisheye"},
      {"camera_matrix", "K", "", "camera_matrix"},
      {"distortion_coefficients", "K", "distortion_coefficients", "is missing"},
      {"data: [ 7.2113125000000000e+03, 0.", "data: [ 0., 0.", "camera_matrix", "focal lengths above 0"},
      {"data: [ 7.2113125000000000e+03, 0.", "data: [ 7e3, 0.5", "camera_matrix", "no skew"},
      {"data: [ 7.2113125000000000e+03, 0.", "data: [ .Nan, 0.", "camera_matrix.data[0]", "expected a number"},
      {"data: [ 7.2113125000000000e+03, 0.", "data: [ 1e999, 0.", "camera_matrix.data[0]", "expected a number"},
      {"data: [ 7.2113125000000000e+03, 0.", "data: [ 0.", "camera_matrix.data", "expected 9 numbers"},
      {"   rows: 3", "   rows: 1000000", "camera_matrix.rows", "whole number"},
      {"   rows: 5", "   rows: 6", "distortion_coefficients.data", "expected 6 numbers"},
      {"   rows: 5\n   cols: 1\n   dt: d\n   data: [ -1.1000000000000000e-01, ",
       "   rows: 8\n   cols: 1\n   dt: d\n   data: [ 0., 0., 1e-3, -1.1000000000000000e-01, ",
       "distortion_coefficients", "CALIB_RATIONAL_MODEL"},
      {"   rows: 5\n   cols: 1\n   dt: d\n   data: [ -1.1000000000000000e-01, ",
       "   rows: 3\n   cols: 2\n   dt: d\n   data: [ 1e-3, -1.1000000000000000e-01, ", "distortion_coefficients",
       "a row or a column"},
      {"   rows: 5\n   cols: 1\n   dt: d\n   data: [ -1.1000000000000000e-01, ",
       "   rows: 6\n   cols: 1\n   dt: d\n   data: [ 1e-3, -1.1000000000000000e-01, ", "distortion_coefficients",
       "4, 5, 8, 12, 14 coefficients, found 6"},
      {"flags: 2", "flags: [2", "line ", "expected YAML"},
      {"%YAML:1.0", "<?xml version=\"1.0\"?>", "", "found XML"},
      {single, "just words", "", "expected a calibration of OpenCV"},
      {single, "", "", "expected a calibration of OpenCV"},
  };
  for (const Damage& damage : damages)
    EXPECT_THAT(error_of([&] { read_opencv_rig(put(folder, {replaced(single, damage.from, damage.to)})); }),
                AllOf(HasSubstr("0.yml: "), HasSubstr(damage.place), HasSubstr(damage.hint)))
        << damage.from << " -> " << damage.to;
}

TEST(OpenCvRig, NamesWhatIsWrongBetweenTwoCameras) {
  const TestFolder folder;
  const std::string sized = std::string(intrinsics) + "image_width: 1024\nimage_height: 768\n";
  const Damage damages[] = {
      {"R: !", "Q: !", "R", "is missing: expected the place of camera 2"},
      {"T: !", "Q: !", "T", "is missing"},
      {"[ 0.00001, -1., 0.", "[ 0.001, -1., 0.", "R", "expected a rotation matrix"},
      {"[ 0.00001, -1., 0.", "[ 0.00001, 1., 0.", "R", "reflection"},
      {"rows: 3\n   cols: 3\n   dt: d\n   data: [ 0.00001, -1., 0., 1., 0.00001, 0., 0., 0., 1. ]",
       "rows: 3\n   cols: 1\n   dt: d\n   data: [ 0.1, 0.2, 0.3 ]", "R", "expected a 3 x 3 matrix, found 3 x 1"},
      {"[ -12.5, 0.25, 1. ]", "[ -12.5, 0.25, 1e300 ]", "T", "1e9 mm"},
      {"rows: 3\n   cols: 1\n   dt: d\n   data: [ -12.5, ", "rows: 2\n   cols: 1\n   dt: d\n   data: [ ", "T",
       "expected 3 numbers, found 2"},
  };
  for (const Damage& damage : damages)
    EXPECT_THAT(error_of([&] { read_opencv_rig(put(folder, {sized, replaced(extrinsics, damage.from, damage.to)})); }),
                AllOf(HasSubstr("1.yml: "), HasSubstr(damage.place), HasSubstr(damage.hint)))
        << damage.from << " -> " << damage.to;
  EXPECT_THAT(error_of([&] { read_opencv_rig(put(folder, {single, single})); }), HasSubstr("R: is missing"));
  EXPECT_THAT(error_of([&] { read_opencv_rig(put(folder, {single, single, single, extrinsics})); }),
              HasSubstr("at most two cameras"));
  EXPECT_THAT(error_of([&] { read_opencv_rig(put(folder, {single}), {.width = 640, .height = 480}); }),
              HasSubstr("640 x 480 as was given, found 2048 x 1500"));
}

TEST(OpenCvRig, WantsToKnowWhereEachOfSeveralCamerasIs) {
  const TestFolder folder;
  write_opencv_rig(folder / "rig.yml", test::two_cameras());
  const std::string sound = test::read_text(folder / "rig.yml");
  const auto message = [&](const std::string& from, const std::string& to) {
    return error_of([&] { read_opencv_rig(put(folder, {replaced(sound, from, to)})); });
  };
  EXPECT_EQ(message("cameras: [ cam1, cam2 ]\n", ""), "");
  EXPECT_THAT(message("   rotation:", "   turned:"), HasSubstr("0.yml: cam1.rotation: is missing"));
  EXPECT_THAT(message("   translation:", "   shifted:"), HasSubstr("0.yml: cam1.translation: is missing"));
  EXPECT_THAT(message("[ cam1, cam2 ]", "[ cam1, cam3 ]"), HasSubstr("0.yml: cam3: is missing"));
  EXPECT_THAT(message("[ cam1, cam2 ]", "[ cam1, cam1 ]"), HasSubstr("0.yml: cameras: expected different names"));
}

TEST(OpenCvRig, WritesNothingThatItCannotHold) {
  const TestFolder folder;
  Rig rig = test::two_cameras();
  rig.cameras[1].name = "right eye";
  EXPECT_THAT(error_of([&] { write_opencv_rig(folder / "rig.yml", rig); }), HasSubstr("right eye"));
  rig.cameras[1].width = 640;
  EXPECT_THAT(error_of([&] { write_opencv_stereo(folder / "stereo", rig); }), HasSubstr("one size"));
  rig.cameras.pop_back();
  EXPECT_THAT(error_of([&] { write_opencv_stereo(folder / "stereo", rig); }), HasSubstr("hold two cameras"));
  EXPECT_EQ(folder.files(), 0u);
}

}  // namespace
}  // namespace pagesweep
