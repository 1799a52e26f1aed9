// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/rig_file.h"

#include <Eigen/Geometry>
#include <limits>

#include "pagesweep/io/atomic_file.h"
#include "pagesweep/io/files_testing.h"

namespace pagesweep {
namespace {

using test::error_of;
using test::replaced;
using test::TestFolder;
using testing::AllOf;
using testing::HasSubstr;

Eigen::Matrix3d some_rotation(double angle) {
  return Eigen::AngleAxisd(angle, Eigen::Vector3d(1, 2, -3).normalized()).toRotationMatrix();
}

Camera some_camera(const std::string& name) {
  Camera camera{name, 1024, 768, 1700.25, 1699.5, 511.5, 383.5, {0.1, -0.02, 1e-4, -2e-4, 0.003}, {}};
  camera.cam_from_rig = {some_rotation(0.3), {1.5, -2.25, 700.125}};
  return camera;
}

std::vector<Scanner> all_scanners() {
  Pushbroom line{4961, 3508, 8268, 2480, -0.02, some_rotation(0.1), {5, 148, 700}, {0.0003, -0.0847, 0.0001}};
  RotatingLine mirror{4961, 3508, 8268, 2480, -0.02, some_rotation(0.2), {5, -4, 700}, 0.21, -1.2e-4};
  return {Scanner(some_camera("scanner")), Scanner(line), Scanner(mirror)};
}

void expect_same(const Camera& a, const Camera& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(std::tuple(a.width, a.height, a.fx, a.fy, a.cx, a.cy),
            std::tuple(b.width, b.height, b.fx, b.fy, b.cx, b.cy));
  const auto of = [](const BrownConrady& d) { return std::tuple(d.k1, d.k2, d.p1, d.p2, d.k3); };
  EXPECT_EQ(of(a.distortion), of(b.distortion));
  EXPECT_EQ(a.cam_from_rig.rotation, b.cam_from_rig.rotation);
  EXPECT_EQ(a.cam_from_rig.translation, b.cam_from_rig.translation);
}

TEST(RigFile, KeepsEveryScannerModelToTheLastBit) {
  const TestFolder folder;
  for (const Scanner& scanner : all_scanners()) {
    Rig rig;
    rig.cameras = {some_camera("cam1"), some_camera("left eye")};
    rig.scanner = scanner;
    write_rig(folder / "rig.json", rig);
    const Rig back = read_rig(folder / "rig.json");
    ASSERT_EQ(back.cameras.size(), 2u);
    expect_same(back.cameras[0], rig.cameras[0]);
    expect_same(back.cameras[1], rig.cameras[1]);
    ASSERT_EQ(back.scanner->model().index(), scanner.model().index());
    const auto ray = scanner.ray({1000, 700});
    const auto ray_back = back.scanner->ray({1000, 700});
    ASSERT_TRUE(ray && ray_back);
    EXPECT_EQ(ray_back->origin, ray->origin);
    EXPECT_EQ(ray_back->direction, ray->direction);
    EXPECT_FALSE(back.light);
  }
}

TEST(RigFile, KeepsEveryLightModelToTheLastBit) {
  const TestFolder folder;
  const Eigen::Vector3d normal = some_rotation(0.4).col(1);
  const Light moving(TranslatingPlane{normal, -150, 1.5});
  const Light turning(RotatingPlane{{1, 2, 3}, some_rotation(0.4).col(0), normal, 0.1, -0.01});
  const Light recorded(RecordedPlanes{5, {{normal, -140}, {some_rotation(0.41).col(1), -138.5}, {normal, -137}}});
  for (const Light& light : {moving, turning, recorded}) {
    Rig rig;
    rig.cameras = {some_camera("cam1")};
    rig.light = light;
    write_rig(folder / "rig.json", rig);
    const Rig back = read_rig(folder / "rig.json");
    ASSERT_TRUE(back.light);
    EXPECT_NEAR(back.light->plane_at(7).offset, light.plane_at(7).offset, 1e-12);
    EXPECT_LT((back.light->plane_at(7).normal - light.plane_at(7).normal).norm(), 1e-15);
  }
}

TEST(RigFile, KeepsTheSensorOfACameraThatHasOne) {
  const TestFolder folder;
  Rig rig;
  rig.cameras = {some_camera("cam1"), some_camera("cam2")};
  rig.cameras[1].sensor = CameraSensor{.gain = 0.025, .read_noise = 1.2, .psf_sigma_px = 0.7};
  write_rig(folder / "rig.json", rig);
  const Rig back = read_rig(folder / "rig.json");
  EXPECT_FALSE(back.cameras[0].sensor);
  ASSERT_TRUE(back.cameras[1].sensor);
  EXPECT_EQ(back.cameras[1].sensor->gain, 0.025);
  EXPECT_EQ(back.cameras[1].sensor->read_noise, 1.2);
  EXPECT_EQ(back.cameras[1].sensor->psf_sigma_px, 0.7);
}

TEST(RigFile, KeepsTheLampAndTheWhiteReference) {
  const TestFolder folder;
  Rig rig;
  rig.cameras = {some_camera("cam1")};
  rig.lamp = LampBar{612.5, 540, -3};
  rig.white = WhiteReference{1.5, 2, 3, std::vector<std::array<float, 3>>(6, {0.5f, 0.75f, 0.25f})};
  write_rig(folder / "rig.json", rig);
  const Rig back = read_rig(folder / "rig.json");
  ASSERT_TRUE(back.lamp && back.white);
  EXPECT_EQ(back.lamp->height_mm, 612.5);
  EXPECT_EQ(back.lamp->length_mm, 540);
  EXPECT_EQ(back.lamp->center_mm, -3);
  EXPECT_EQ(back.white->height_mm, 1.5);
  EXPECT_EQ(back.white->rows, 3);
  EXPECT_EQ(back.white->light, rig.white->light);
  std::string text = read_bytes(folder / "rig.json", 1 << 20);
  write_bytes(folder / "rig.json", replaced(text, "\"rows\": 3", "\"rows\": 4"));
  EXPECT_THAT(error_of([&] { read_rig(folder / "rig.json"); }), HasSubstr("white.light"));
}

TEST(RigFile, WritesNoNumberThatIsNotFinite) {
  const TestFolder folder;
  Rig rig;
  rig.cameras = {some_camera("cam1")};
  rig.cameras[0].cx = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(write_rig(folder / "rig.json", rig), std::invalid_argument);
  EXPECT_EQ(folder.files(), 0u);
}

/// A rig with one camera, a scanner and a light, as a person would write it.
constexpr const char* sound_rig = R"({
  "format": "pagesweep-rig", "version": 1,
  "cameras": [
    {"name": "cam1", "model": "brown-conrady", "width": 1024, "height": 1024, "fx": 1700, "fy": 1700, "cx": 511.5,
     "cy": 511.5, "k1": 0.0, "rotation": [1,0,0, 0,-1,0, 0,0,-1], "translation": [0, 0, 700],
     "sensor": {"gain": 0.025, "read_noise": 1.2, "psf_sigma_px": 0.7}},
    {"name": "cam2", "model": "brown-conrady", "width": 1024, "height": 1024, "fx": 1701, "fy": 1702, "cx": 510.5,
     "cy": 509.5, "rotation": [1,0,0, 0,1,0, 0,0,1], "translation": [0, 100, 701]}],
  "scanner": {"model": "pushbroom", "width": 4961, "height": 3508, "f": 8268, "cx": 2480, "k1": 0,
              "rotation": [1,0,0, 0,-1,0, 0,0,-1], "center": [5, 148, 700], "step": [0, -0.0847, 0]},
  "light": {"model": "translating-plane", "normal": [0, 1, 0], "offset": -150.0, "offset_per_frame": 1.5},
  "somebody": {"else's": "extension"}
})";

std::string message_about(const TestFolder& folder, const std::string& text) {
  test::put(folder / "rig.json", text);
  return error_of([&] { read_rig(folder / "rig.json"); });
}

TEST(RigFile, AcceptsTheSoundOneAndIgnoresUnknownFields) {
  const TestFolder folder;
  ASSERT_EQ(message_about(folder, sound_rig), "");
  const Rig rig = read_rig(folder / "rig.json");
  EXPECT_EQ(rig.cameras[1].cam_from_rig.translation, Eigen::Vector3d(0, 100, 701));
  EXPECT_EQ(rig.cameras[1].distortion.k1, 0);
}

struct Damage {
  std::string from, to;  ///< what is replaced in the sound rig
  std::string place;     ///< that the message must name
  std::string hint;      ///< what it must say
};

TEST(RigFile, NamesFileFieldAndWhatWasExpected) {
  const TestFolder folder;
  const Damage damages[] = {
      {"\"pagesweep-rig\"", "\"rig\"", "format", "expected \"pagesweep-rig\", found \"rig\""},
      {"\"version\": 1", "\"version\": 2", "version", "expected 1, found 2"},
      {"\"version\": 1,", "", "version", "is missing"},
      {"\"cameras\": [", "\"cameras\": [], \"x\": [", "cameras", "at least one camera"},
      {"\"cameras\": [", "\"cameras\": 3, \"x\": [", "cameras", "expected an array, found a number"},
      {"\"name\": \"cam2\"", "\"name\": \"cam1\"", "cameras[1].name", "a camera \"cam1\" already"},
      {"\"name\": \"cam2\"", "\"name\": \"../cam2\"", "cameras[1].name", "expected a name"},
      {"\"name\": \"cam2\"", "\"name\": \"\"", "cameras[1].name", "expected a name"},
      {"\"name\": \"cam2\"", "\"name\": 2", "cameras[1].name", "expected a string, found a number"},
      {"\"brown-conrady\"", "\"fisheye\"", "cameras[0].model", "expected \"brown-conrady\", found \"fisheye\""},
      {"\"fx\": 1701", "\"fx\": 0", "cameras[1].fx", "above 0"},
      {"\"fx\": 1701", "\"fx\": -5", "cameras[1].fx", "above 0"},
      {"\"fx\": 1701", "\"fx\": \"wide\"", "cameras[1].fx", "expected a number, found a string"},
      {"\"fx\": 1701", "\"fx\": null", "cameras[1].fx", "expected a value, found null"},
      {"\"fx\": 1701", "\"focal\": 1701", "cameras[1].fx", "is missing"},
      {"\"fx\": 1701", "\"fx\": NaN", "line 7", "expected JSON"},
      {"\"fx\": 1701", "\"fx\": 1e999", "", "finite"},
      {"\"width\": 1024", "\"width\": 0", "cameras[0].width", "whole number from 1"},
      {"\"width\": 1024", "\"width\": 1e7", "cameras[0].width", "whole number from 1"},
      {"\"height\": 1024", "\"height\": -3", "cameras[0].height", "whole number from 1"},
      {"\"height\": 1024", "\"height\": 10.5", "cameras[0].height", "whole number from 1"},
      {"\"k1\": 0.0", "\"k1\": [1]", "cameras[0].k1", "expected a number, found an array"},
      {"[1,0,0, 0,1,0, 0,0,1]", "[1,0,0, 0,1,0, 0,0]", "cameras[1].rotation", "9 numbers"},
      {"[1,0,0, 0,1,0, 0,0,1]", "[1,0,0, 0,1,0, 0,0,2]", "cameras[1].rotation", "expected a rotation matrix"},
      {"[1,0,0, 0,1,0, 0,0,1]", "[0,0,0, 0,0,0, 0,0,0]", "cameras[1].rotation", "expected a rotation matrix"},
      {"[1,0,0, 0,1,0, 0,0,1]", "[1e200,0,0, 0,1,0, 0,0,1]", "cameras[1].rotation", "expected a rotation matrix"},
      {"[1,0,0, 0,1,0, 0,0,1]", "[1,0,0, 0,1,0, 0,0,-1]", "cameras[1].rotation", "reflection"},
      {"[1,0,0, 0,1,0, 0,0,1]", "[1,0,0, 0,\"1\",0, 0,0,1]", "cameras[1].rotation[4]", "expected a number"},
      {"\"translation\": [0, 100, 701]", "\"translation\": [0, 100]", "cameras[1].translation", "3 numbers, found 2"},
      {"\"translation\": [0, 100, 701]", "\"translation\": [0, 1e12, 7]", "cameras[1].translation", "millimetres"},
      {"\"gain\": 0.025", "\"gain\": 0", "cameras[0].sensor.gain", "above 0"},
      {"\"gain\": 0.025,", "", "cameras[0].sensor.gain", "is missing"},
      {"\"read_noise\": 1.2", "\"read_noise\": -1", "cameras[0].sensor.read_noise", "from 0"},
      {"\"psf_sigma_px\": 0.7", "\"psf_sigma_px\": \"sharp\"", "cameras[0].sensor.psf_sigma_px", "expected a number"},
      {"{\"gain\": 0.025, \"read_noise\": 1.2, \"psf_sigma_px\": 0.7}", "7", "cameras[0].sensor", "expected an object"},
      {"\"pushbroom\"", "\"drone\"", "scanner.model", "\"rotating-line\", found \"drone\""},
      {"\"f\": 8268", "\"f\": 0", "scanner.f", "above 0"},
      {"\"step\": [0, -0.0847, 0]", "\"step\": [0, 0, 0]", "scanner.step", "expected a step across the sensor line"},
      {"\"step\": [0, -0.0847, 0]", "\"step\": [0.1, 0, 0]", "scanner.step", "expected a step across the sensor line"},
      {"\"pushbroom\"", "\"rotating-line\"", "scanner.angle0", "is missing"},
      {"\"model\": \"pushbroom\"", "\"model\": \"rotating-line\", \"angle0\": 0, \"angle_step\": 0",
       "scanner.angle_step", "other than 0"},
      {"\"translating-plane\"", "\"laser\"", "light.model",
       "\"rotating-plane\" or \"recorded-planes\", found \"laser\""},
      {"[0, 1, 0]", "[0, 2, 0]", "light.normal", "length 1, found length 2"},
      {"[0, 1, 0]", "[0, 0, 0]", "light.normal", "length 1, found length 0"},
      {"\"offset_per_frame\": 1.5", "\"offset_per_frame\": 0", "light.offset_per_frame", "other than 0"},
      {"\"model\": \"translating-plane\"",
       R"("model": "rotating-plane", "axis_point": [0,0,0], "axis": [1,0,0], "normal0": [0.6,0.8,0], "angle0": 0)",
       "light.normal0", "perpendicular to axis"},
      {"\"model\": \"translating-plane\"",
       R"("model": "rotating-plane", "axis_point": [0,0,0], "axis": [1,0,0], "normal0": [0,1,0], "angle0": 0,
          "angle_per_frame": 0)",
       "light.angle_per_frame", "other than 0"},
  };
  for (const Damage& damage : damages) {
    const std::string message = message_about(folder, replaced(sound_rig, damage.from, damage.to));
    EXPECT_THAT(message, AllOf(HasSubstr("rig.json: "), HasSubstr(damage.place), HasSubstr(damage.hint)))
        << damage.from << " -> " << damage.to;
  }
}

TEST(RigFile, SaysWhereTheJsonBreaks) {
  const TestFolder folder;
  EXPECT_THAT(message_about(folder, "{\n  \"format\": \"pagesweep-rig\",\n}"), HasSubstr("line 3, column 1"));
  EXPECT_THAT(message_about(folder, ""), HasSubstr("expected JSON"));
  EXPECT_THAT(message_about(folder, "[]"), HasSubstr("expected an object, found an array"));
  EXPECT_THAT(message_about(folder, std::string(100'000, '[')), HasSubstr("expected JSON"));
  EXPECT_THAT(error_of([&] { read_rig(folder / "absent.json"); }), HasSubstr("absent.json: cannot be read"));
  EXPECT_THAT(error_of([&] { read_rig(folder.path()); }), HasSubstr("it is a folder"));
}

TEST(RigFile, MakesARoundedRotationExact) {
  const TestFolder folder;
  // Seven digits, as many calibrations print them.
  const std::string rounded = "[0.9800666,-0.1986693,0, 0.1986693,0.9800666,0, 0,0,1]";
  test::put(folder / "rig.json", replaced(sound_rig, "[1,0,0, 0,1,0, 0,0,1]", rounded));
  const Eigen::Matrix3d rotation = read_rig(folder / "rig.json").cameras[1].cam_from_rig.rotation;
  EXPECT_LT((rotation.transpose() * rotation - Eigen::Matrix3d::Identity()).norm(), 1e-14);
  EXPECT_LT((rotation - Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitZ()).toRotationMatrix()).norm(), 1e-7);
}

}  // namespace
}  // namespace pagesweep
