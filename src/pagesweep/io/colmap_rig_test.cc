// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/colmap_rig.h"

#include <cmath>

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

constexpr const char* cameras = R"(# Camera list with one line of data per camera:
#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]
# Number of cameras: 2
2 SIMPLE_RADIAL 3072 2304 2559.69 1536 1152 -0.0218531
7 OPENCV 1024 768 1700 1701 512 384 -0.1 0.2 0.001 0.002
)";

/// The first with image points, the second without, as after a reconstruction from known poses.
constexpr const char* images = R"(# Image list with two lines of data per image:
#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME
#   POINTS2D[] as (X, Y, POINT3D_ID)
1 0.70710678 0 0 0.70710678 1.5 -2 0.25 7 left/0001.png
2362.39 248.498 58396 1784.7 268.254 59027 1784.7 268.254 -1
2 1 0 0 0 0 0 4 2 right.v2.jpg

)";

Rig read(const TestFolder& folder, const std::string& cameras_text, const std::string& images_text, double unit = 1) {
  test::put(folder / "cameras.txt", cameras_text);
  test::put(folder / "images.txt", images_text);
  return read_colmap_rig(folder / "cameras.txt", folder / "images.txt", unit);
}

TEST(ColmapRig, ReadsASparseModelAtItsScale) {
  const TestFolder folder;
  const Rig rig = read(folder, cameras, images, 200);
  ASSERT_EQ(rig.cameras.size(), 2u);
  Camera left{"left_0001", 1024, 768, 1700, 1701, 511.5, 383.5, {-0.1, 0.2, 0.001, 0.002, 0}, {}};
  left.cam_from_rig.rotation << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  left.cam_from_rig.translation = {300, -400, 50};
  expect_near(rig.cameras[0], left);
  Camera right{"right.v2", 3072, 2304, 2559.69, 2559.69, 1535.5, 1151.5, {-0.0218531, 0, 0, 0, 0}, {}};
  right.cam_from_rig.translation = {0, 0, 800};
  expect_near(rig.cameras[1], right);
}

TEST(ColmapRig, ImagesThePointOnTheAxisHalfAPixelLower) {
  // In COLMAP's coordinates a picture of 4 x 2 pixels spans 0 to 4 and 0 to 2, so that its middle is (2, 1); in ours
  // the middle lies between the pixels 1 and 2, and 0 and 1.
  const TestFolder folder;
  const Rig rig = read(folder, "1 PINHOLE 4 2 10 10 2 1\n", "1 1 0 0 0 0 0 0 1 a.png\n");
  const auto pixel = rig.cameras[0].project({0, 0, 5});
  ASSERT_TRUE(pixel);
  EXPECT_EQ(*pixel, Eigen::Vector2d(1.5, 0.5));
  write_colmap_rig(folder / "copy", rig);
  EXPECT_THAT(test::read_text(folder / "copy/cameras.txt"), HasSubstr("1 OPENCV 4 2 10 10 2 1 0 0 0 0\n"));
}

TEST(ColmapRig, KnowsEveryModelThatOursContains) {
  const TestFolder folder;
  const auto camera = [&](const std::string& model) {
    return read(folder, "1 " + model + "\n", "1 1 0 0 0 0 0 0 1 a.png\n").cameras.at(0);
  };
  expect_near(camera("SIMPLE_PINHOLE 8 6 10 4 3"), {"a", 8, 6, 10, 10, 3.5, 2.5, {}, {}});
  expect_near(camera("PINHOLE 8 6 10 11 4 3"), {"a", 8, 6, 10, 11, 3.5, 2.5, {}, {}});
  expect_near(camera("SIMPLE_RADIAL 8 6 10 4 3 0.1"), {"a", 8, 6, 10, 10, 3.5, 2.5, {0.1, 0, 0, 0, 0}, {}});
  expect_near(camera("RADIAL 8 6 10 4 3 0.1 0.2"), {"a", 8, 6, 10, 10, 3.5, 2.5, {0.1, 0.2, 0, 0, 0}, {}});
  expect_near(camera("OPENCV 8 6 10 11 4 3 0.1 0.2 0.3 0.4"),
              {"a", 8, 6, 10, 11, 3.5, 2.5, {0.1, 0.2, 0.3, 0.4, 0}, {}});
  expect_near(camera("FULL_OPENCV 8 6 10 11 4 3 0.1 0.2 0.3 0.4 0.5 0 0 0"),
              {"a", 8, 6, 10, 11, 3.5, 2.5, {0.1, 0.2, 0.3, 0.4, 0.5}, {}});
}

TEST(ColmapRig, IsWhatWasWritten) {
  const TestFolder folder;
  Rig rig = test::two_cameras();
  rig.cameras[0].name = "cam.1";
  rig.cameras[1].distortion.k3 = 0.7;
  write_colmap_rig(folder / "model", rig, 1000);
  expect_near(read_colmap_rig(folder / "model/cameras.txt", folder / "model/images.txt", 1000), rig);
  EXPECT_EQ(test::read_text(folder / "model/points3D.txt").front(), '#');
}

TEST(ColmapRig, NamesFileLineAndWhatWasExpected) {
  const TestFolder folder;
  const Damage of_cameras[] = {
      {"SIMPLE_RADIAL", "FOV", "line 4", "RADIAL or OPENCV, found FOV, a model that our cameras do not have"},
      {"SIMPLE_RADIAL", "OPENCV_FISHEYE", "line 4", "--ImageReader.camera_model OPENCV"},
      {"SIMPLE_RADIAL", "RADIAL", "line 4", "expected 5 parameters of RADIAL, found 4"},
      {"7 OPENCV", "2 OPENCV", "line 5", "there is a camera 2 already"},
      {"7 OPENCV 1024 768 1700 1701 512 384 -0.1 0.2 0.001 0.002",
       "7 FULL_OPENCV 1024 768 1700 1701 512 384 -0.1 0.2 0.001 0.002 0 0 0.1 0", "line 5", "k4 = k5 = k6 = 0"},
      {"1024 768", "1024.5 768", "line 5", "whole number"},
      {"1024 768", "0 768", "line 5", "whole number from 1"},
      {"1700", "-1700", "line 5", "focal length above 0"},
      {"1700", "nan", "line 5", "expected a number from -1e9 to 1e9, found \"nan\""},
      {"1700", "1e400", "line 5", "expected a number"},
      {"7 OPENCV 1024 768 1700", "7 OPENCV\n1700", "line 5", "CAMERA_ID MODEL WIDTH HEIGHT"},
  };
  for (const Damage& damage : of_cameras)
    EXPECT_THAT(error_of([&] { read(folder, replaced(cameras, damage.from, damage.to), images); }),
                AllOf(HasSubstr("cameras.txt: "), HasSubstr(damage.place), HasSubstr(damage.hint)))
        << damage.from << " -> " << damage.to;
  const Damage of_images[] = {
      {"0.70710678 0 0", "0.7 0 0", "line 4", "length 1, found length 0.99"},
      {"0.25 7 left", "0.25 3 left", "line 4", "expected a CAMERA_ID of cameras.txt, found 3"},
      {"0.25 7 left", "0.25 left", "line 4", "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME"},
      {"0.25 7", "inf 7", "line 4", "expected a number"},
      {"0.25 7", "1e9 7", "line 4", "expected lengths up to 1e9 mm"},
      {"right.v2.jpg", "left/0001.jpg", "line 6", "a camera \"left_0001\" already"},
      {"right.v2.jpg", ".hidden.jpg", "line 6", "no leading dot"},
      {"2362.39 248.498 58396 1784.7 268.254 59027 1784.7 268.254 -1\n", "", "line 5", "or an empty line"},
      {images, "# nothing\n", "", "at least one image"},
  };
  for (const Damage& damage : of_images)
    EXPECT_THAT(error_of([&] { read(folder, cameras, replaced(images, damage.from, damage.to), 2); }),
                AllOf(HasSubstr("images.txt: "), HasSubstr(damage.place), HasSubstr(damage.hint)))
        << damage.from << " -> " << damage.to;
}

TEST(ColmapRig, RefusesAReconstructionOfAWholeSequence) {
  const TestFolder folder;
  std::string sequence;
  for (int i = 0; i < 101; ++i) sequence += "1 1 0 0 0 0 0 0 7 frame" + std::to_string(i) + ".png\n\n";
  EXPECT_THAT(error_of([&] { read(folder, cameras, sequence); }),
              AllOf(HasSubstr("images.txt: line 201: "), HasSubstr("one image a camera")));
}

TEST(ColmapRig, WritesOverNoModelAndNoNameThatColmapWouldCut) {
  const TestFolder folder;
  Rig rig = test::two_cameras();
  test::put(folder / "points3D.bin", "precious");
  EXPECT_THAT(error_of([&] { write_colmap_rig(folder.path(), rig); }), HasSubstr("never overwritten"));
  rig.cameras[1].name = "right eye";
  EXPECT_THAT(error_of([&] { write_colmap_rig(folder / "new", rig); }), HasSubstr("right eye"));
  EXPECT_EQ(folder.files(), 1u);
}

}  // namespace
}  // namespace pagesweep
