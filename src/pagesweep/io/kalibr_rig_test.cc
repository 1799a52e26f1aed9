// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/kalibr_rig.h"

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

constexpr const char* camchain = R"(cam0:
  T_cam_imu:
  - [0.017, 0.999, -0.018, 0.07]
  - [-0.999, 0.018, 0.008, -0.017]
  - [0.009, 0.018, 0.999, 0.004]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.27, 0.067, 0.0008, 0.0001]
  distortion_model: radtan
  intrinsics: [461.6, 460.2, 362.7, 246.0]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
  timeshift_cam_imu: -8.1e-05
cam1:
  T_cn_cnm1:
  - [0.0, -1.0, 0.0, -0.11]
  - [1.0, 0.0, 0.0, 0.0004]
  - [0.0, 0.0, 1.0, 0.002]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [0]
  camera_model: pinhole
  distortion_coeffs: []
  distortion_model: none
  intrinsics: [458.6, 457.2, 367.2, 248.3]
  resolution: [752, 480]
  rostopic: /cam1/image_raw
)";

Rig read(const TestFolder& folder, const std::string& text) {
  test::put(folder / "camchain.yaml", text);
  return read_kalibr_rig(folder / "camchain.yaml");
}

TEST(KalibrRig, ReadsAChainInMetres) {
  const TestFolder folder;
  const Rig rig = read(folder, camchain);
  ASSERT_EQ(rig.cameras.size(), 2u);
  expect_near(rig.cameras[0], {"cam0", 752, 480, 461.6, 460.2, 362.7, 246, {-0.27, 0.067, 0.0008, 0.0001, 0}, {}});
  Camera second{"cam1", 752, 480, 458.6, 457.2, 367.2, 248.3, {}, {}};
  second.cam_from_rig.rotation << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  second.cam_from_rig.translation = {-110, 0.4, 2};
  expect_near(rig.cameras[1], second);
}

TEST(KalibrRig, PlacesEachCameraAgainstTheOneBefore) {
  const TestFolder folder;
  const std::string second = std::string(camchain).substr(std::string(camchain).find("cam1:"));
  const Rig rig = read(folder, camchain + replaced(second, "cam1:", "cam2:"));
  ASSERT_EQ(rig.cameras.size(), 3u);
  const Rigid3 step = rig.cameras[1].cam_from_rig, both = step * step;
  EXPECT_LT((rig.cameras[2].cam_from_rig.rotation - both.rotation).norm(), 1e-12);
  EXPECT_LT((rig.cameras[2].cam_from_rig.translation - both.translation).norm(), 1e-9);
}

TEST(KalibrRig, IsWhatWasWrittenExceptForNames) {
  const TestFolder folder;
  Rig rig = test::two_cameras();
  write_kalibr_rig(folder / "camchain.yaml", rig);
  rig.cameras[0].name = "cam0";
  rig.cameras[1].name = "cam1";
  expect_near(read_kalibr_rig(folder / "camchain.yaml"), rig);
  const std::string text = test::read_text(folder / "camchain.yaml");
  EXPECT_THAT(text, HasSubstr("distortion_coeffs: [-0.12, 0.35, -3.0e-05, 0.0002]")) << "3e-05 is a text in YAML 1.1";
}

TEST(KalibrRig, NamesFileFieldAndWhatWasExpected) {
  const TestFolder folder;
  const Damage damages[] = {
      {"distortion_model: radtan", "distortion_model: equidistant", "cam0.distortion_model",
       "found \"equidistant\", a distortion that our cameras do not have: calibrate with --models pinhole-radtan"},
      {"camera_model: pinhole", "camera_model: omni", "cam0.camera_model", "expected \"pinhole\", found \"omni\""},
      {"  camera_model: pinhole\n", "", "cam0.camera_model", "is missing"},
      {"[-0.27, 0.067, 0.0008, 0.0001]", "[-0.27, 0.067]", "cam0.distortion_coeffs", "expected 4 numbers, found 2"},
      {"[461.6, 460.2, 362.7, 246.0]", "[461.6, 460.2]", "cam0.intrinsics", "fu, fv, pu, pv, found 2"},
      {"[461.6, 460.2, 362.7, 246.0]", "[-1, 460.2, 362.7, 246.0]", "cam0.intrinsics[0]", "above 0"},
      {"[461.6, 460.2, 362.7, 246.0]", "[.inf, 460.2, 362.7, 246.0]", "cam0.intrinsics[0]", "expected a number"},
      {"[752, 480]", "[752.5, 480]", "cam0.resolution[0]", "whole number"},
      {"[752, 480]", "[752]", "cam0.resolution", "width and height"},
      {"  T_cn_cnm1:", "  T_cam:", "cam1.T_cn_cnm1", "is missing"},
      {"  - [1.0, 0.0, 0.0, 0.0004]\n", "", "cam1.T_cn_cnm1", "expected 4 rows, found 3"},
      {"[1.0, 0.0, 0.0, 0.0004]", "[1.0, 0.0, 0.0]", "cam1.T_cn_cnm1[1]", "expected 4 numbers, found 3"},
      {"[1.0, 0.0, 0.0, 0.0004]", "[1.001, 0.0, 0.0, 0.0004]", "cam1.T_cn_cnm1", "expected a rotation matrix"},
      {"[1.0, 0.0, 0.0, 0.0004]", "[-1.0, 0.0, 0.0, 0.0004]", "cam1.T_cn_cnm1", "reflection"},
      {"[1.0, 0.0, 0.0, 0.0004]", "[1.0, 0.0, 0.0, 1e7]", "cam1.T_cn_cnm1", "expected metres"},
      {"0.002]\n  - [0.0, 0.0, 0.0, 1.0]", "0.002]\n  - [0.0, 0.0, 0.0, 2.0]", "cam1.T_cn_cnm1[3]", "0, 0, 0, 1"},
      {"cam1:", "cam2:", "cam1", "is missing"},
      {camchain, "imu0: {}", "cam0", "is missing"},
      {camchain, "7", "", "expected an object"},
      {"cam_overlaps: [1]", "cam_overlaps: &a [*a]", "", "in a circle"},
  };
  for (const Damage& damage : damages)
    EXPECT_THAT(error_of([&] { read(folder, replaced(camchain, damage.from, damage.to)); }),
                AllOf(HasSubstr("camchain.yaml: "), HasSubstr(damage.place), HasSubstr(damage.hint)))
        << damage.from << " -> " << damage.to;
}

TEST(KalibrRig, WritesNothingThatItCannotHold) {
  const TestFolder folder;
  Rig rig = test::two_cameras();
  rig.cameras[1].distortion.k3 = 0.1;
  EXPECT_THAT(error_of([&] { write_kalibr_rig(folder / "camchain.yaml", rig); }), HasSubstr("cam2 has k3 = 0.1"));
  EXPECT_EQ(folder.files(), 0u);
}

}  // namespace
}  // namespace pagesweep
