// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/scene.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <string>

#include "pagesweep/base/error.h"
#include "pagesweep/io/atomic_file.h"
#include "pagesweep/io/capture_file.h"
#include "pagesweep/io/float_tiff.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/io/truth_file.h"
#include "pagesweep/sim/simulate.h"

namespace pagesweep::sim {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class SceneTest : public testing::Test {
 protected:
  SceneTest() { fs::create_directories(folder_); }
  ~SceneTest() override { fs::remove_all(folder_); }

  Scene read(const std::string& fields) const {
    const fs::path file = folder_ / "scene.json";
    write_bytes(file, R"({"format": "pagesweep-scene", "version": 1, )" + fields + "}");
    return read_scene(file);
  }
  std::string problem_of(const std::string& fields) const {
    try {
      read(fields);
    } catch (const Error& error) {
      return error.what();
    }
    return "none";
  }

  const fs::path folder_ =
      fs::temp_directory_path() /
      ("pagesweep_scene_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()));
};

const std::string sheet =
    R"("width_mm": 60, "height_mm": 40, "shape": {"at_mm": [-30, 0, 2], "slopes_deg": [[0, 10], [60, -5]]})";

TEST_F(SceneTest, HasDefaultsForAllButTheSheet) {
  const Scene scene = read("\"pages\": [{" + sheet + "}]");
  ASSERT_EQ(scene.pages.size(), 1u);
  EXPECT_EQ(scene.rig.cameras.size(), 2u);
  EXPECT_EQ(scene.camera.frames, 200);
  EXPECT_NEAR(scene.pages[0].shape.slopes[1].slope_rad, -5 * M_PI / 180, 1e-12);
}

TEST_F(SceneTest, NamesWhatIsWrong) {
  EXPECT_THAT(problem_of(R"("pages": [])"), HasSubstr("nothing to scan"));
  EXPECT_THAT(problem_of(R"("pages": [{"width_mm": 60}])"), HasSubstr("pages[0].height_mm"));
  EXPECT_THAT(problem_of("\"pages\": [{" + sheet + R"(, "widht": 3}])"), HasSubstr("pages[0].widht"));
  EXPECT_THAT(problem_of("\"pages\": [{" + sheet + R"(}], "lamp": {"shape": "round"})"),
              HasSubstr("gaussian, flat-top"));
  EXPECT_THAT(problem_of("\"pages\": [{" + sheet + R"(}], "lamp": {"mm_per_frame": 0})"),
              HasSubstr("lamp.mm_per_frame"));
  EXPECT_THAT(problem_of("\"pages\": [{" + sheet + R"(}], "cameras": {"views": [{}]})"), HasSubstr("two cameras"));
  EXPECT_THAT(problem_of("\"pages\": [{" + sheet + R"(, "print": {"texts": ["none.txt"]}}])"), HasSubstr("none.txt"));
  EXPECT_THAT(problem_of("\"pages\": [{" + sheet + R"(}], "scanner": {"bit_depth": 12})"),
              HasSubstr("scanner.bit_depth"));
}

TEST_F(SceneTest, ReadsExposuresThatTakeTurns) {
  const auto with = [](const std::string& exposures) {
    return "\"pages\": [{" + sheet + R"(}], "cameras": {"exposures": )" + exposures + "}";
  };
  EXPECT_EQ(read(with("[1, 8]")).camera.exposures, (std::vector{1.0, 8.0}));
  EXPECT_THAT(problem_of(with("[]")), HasSubstr("cameras.exposures"));
  EXPECT_THAT(problem_of(with("[1, 0]")), HasSubstr("cameras.exposures[1]"));
}

TEST_F(SceneTest, PutsEveryScannerAboveTheTable) {
  for (const char* model : {"brown-conrady", "pushbroom", "rotating-line"}) {
    const Scene scene = read("\"pages\": [{" + sheet + R"(}], "scanner": {"model": ")" + model + "\"}");
    const auto middle = scene.rig.scanner->project({0, 0, 0});
    EXPECT_NEAR(middle->x(), 0.5 * (scene.rig.scanner->width() - 1), 1e-6) << model;
    EXPECT_NEAR(middle->y(), 0.5 * (scene.rig.scanner->height() - 1), 1e-6) << model;
    const Matrix23d scale = scene.rig.scanner->project_jacobian({0, 0, 0});
    EXPECT_NEAR(scale(0, 0), 300 / 25.4, 1e-6) << model;
    EXPECT_NEAR(scale(1, 1), -300 / 25.4, 1e-6) << model;
    const Scene preview = preview_of(scene);
    const auto smaller = preview.rig.scanner->project({50, 30, 0}), full = scene.rig.scanner->project({50, 30, 0});
    EXPECT_NEAR(smaller->x(), (full->x() + 0.5) / 3 - 0.5, 1e-6) << model;
    EXPECT_NEAR(smaller->y(), (full->y() + 0.5) / 3 - 0.5, 1e-6) << model;
  }
}

/// The scenes of the project: everything is within view of both cameras, of the scanner, and of the whole sweep.
TEST(Scenes, ShowTheirPagesToEveryInstrument) {
  for (const char* name : {"spread", "dent", "overexposed", "flat", "artefact", "artefact_across", "artefact_inclined",
                           "artefact_high", "folded", "exposure", "crumpled", "finger", "slip", "torn", "missing"}) {
    const Scene scene = read_scene(fs::path(PAGESWEEP_SCENES) / (std::string(name) + ".json"));
    const double margin_frames = 1.5 * scene.lamp.fwhm_mm / 1.7;
    for (const ScenePage& page : scene.pages) {
      const GridMesh mesh = bend_sheet(page.shape, 10).mesh;
      for (const Eigen::Vector3d& point : mesh.positions.pixels()) {
        EXPECT_GT(point.z(), 0) << name;
        EXPECT_LT(point.z(), 90) << name;
        for (const Camera& camera : scene.rig.cameras) EXPECT_TRUE(camera.sees(*camera.project(point))) << name;
        EXPECT_TRUE(scene.rig.scanner->sees(*scene.rig.scanner->project(point))) << name << " " << point.transpose();
        const double time = *scene.lamp.light.time_of(point);
        EXPECT_GT(time, margin_frames) << name;
        EXPECT_LT(time, scene.camera.frames - margin_frames) << name;
      }
    }
  }
}

TEST_F(SceneTest, BecomesACaptureFolderThatCanBeRead) {
  Scene scene = read("\"pages\": [{" + sheet + R"(}], "spheres": [{"center_mm": [60, 0, 10], "radius_mm": 10}])");
  scene.pages[0].print.footer = std::string("7");
  for (Camera& camera : scene.rig.cameras) camera.width = camera.height = 64;
  scene.camera.frames = 20;
  scene.camera.exposures = {1, 4};
  Pushbroom line = std::get<Pushbroom>(scene.rig.scanner->model());
  line.width = 300, line.height = 200;
  scene.rig.scanner = Scanner(line);
  simulate(scene, folder_ / "capture", {.preview = true, .seed = 3});

  const Capture capture = read_capture(folder_ / "capture");
  const Rig rig = read_capture_rig(capture);
  const auto frames = read_all(*open_capture(capture, rig));
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(frames[1].count(), 10);
  EXPECT_EQ(frames[1].width(), 16);
  EXPECT_EQ(frames[1].dropped(), 0);
  EXPECT_EQ(capture.sequences[0].exposure_ms, scene.camera.exposures);
  EXPECT_EQ(frames[1].sequence().exposure(8), 0.25);
  const Picture scan = read_picture(*capture.scan_path());
  EXPECT_EQ(scan.width(), 100);
  EXPECT_EQ(scan.channels, 3);
  EXPECT_NEAR(scan.pixels_per_mm, 100 / 25.4, 0.01);
  EXPECT_FALSE(scan.icc_profile.empty());

  const Truth truth = read_truth(folder_ / "capture" / "truth");
  ASSERT_EQ(truth.pages.size(), 1u);
  EXPECT_EQ(truth.pages[0].text, "page_1.txt");
  EXPECT_EQ(read_bytes(truth.folder / "page_1.txt", 100), "7\n");
  const Picture page = read_picture(truth.page_path(1));
  const ScanMap map = read_page_scan_map(truth, 1);
  EXPECT_EQ(page.width(), 236);
  EXPECT_EQ(map.width(), page.width());
  const auto points = read_page_points(truth, 1);
  EXPECT_EQ(points.width(), (page.width() + 3) / 4);
  EXPECT_EQ(read_camera_points(truth, "cam2").width(), 16);
  EXPECT_NEAR(truth.stripe->mm_per_frame, 3.4, 1e-9);
}

}  // namespace
}  // namespace pagesweep::sim
