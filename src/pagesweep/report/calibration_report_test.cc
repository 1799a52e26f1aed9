// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/report/calibration_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "pagesweep/io/files_testing.h"

namespace pagesweep {
namespace {

using testing::AllOf, testing::Contains, testing::HasSubstr, testing::Not;

/// A calibration of two cameras that see three poses of a small board in the left half of their pictures.
struct Sample {
  CalibrationInput input{{.columns = 6, .rows = 5, .square_mm = 30, .marker_mm = 22}, {"a", "b", "c"}, {}};
  Calibration calibration;

  Sample() {
    Bundle& bundle = calibration.bundle;
    bundle.board = input.board;
    bundle.rig_from_board.resize(3);
    bundle.pose_is_held.assign(3, false);
    for (int k = 0; k < 3; ++k) bundle.rig_from_board[std::size_t(k)].translation = {-200, -60, 30.0 * k};
    for (int s = 0; s < 2; ++s) {
      Camera camera;
      camera.name = s == 0 ? "cam1" : "cam<2>";
      camera.width = 800, camera.height = 600;
      camera.fx = camera.fy = 900, camera.cx = 400, camera.cy = 300;
      camera.cam_from_rig = {Eigen::Vector3d(1, -1, -1).asDiagonal(), {s == 0 ? 50.0 : -50.0, 0, 700}};
      calibration.rig.cameras.push_back(camera);
      bundle.sensors.push_back({camera.name, camera, 0.1});
      SensorPictures& pictures = input.sensors.emplace_back();
      pictures.name = camera.name, pictures.width = 800, pictures.height = 600;
      for (int k = 0; k < 3; ++k) {
        pictures.pictures.push_back({k, camera.name + "/" + input.poses[std::size_t(k)] + ".png", {}});
        for (int corner = 0; corner < input.board.corner_count(); ++corner)
          bundle.observations.push_back({s, k, corner, *bundle.predict(s, k, corner) + Eigen::Vector2d(0.1, 0)});
      }
    }
    bundle.observations[7].pixel.x() += 5;
    bundle.observations[7].used = false;
    input.sensors[1].pictures.push_back({0, "bad.png", {{}, "overexposed: 80 %"}});
    for (const auto& [owner, name, unit] :
         {std::tuple{"cam1", "fx", "px"}, {"cam1", "center_z", "mm"}, {"pose 1", "turn_x", "rad"}})
      calibration.solution.parameters.push_back({owner, name, unit, 900});
    calibration.solution.covariance = Eigen::Matrix3d::Identity();
    calibration.solution.covariance(0, 1) = calibration.solution.covariance(1, 0) = -0.95;
  }
};

TEST(CalibrationReport, SaysWhatToDoBetter) {
  const Sample sample;
  const CalibrationReport report = judge_calibration(sample.input, sample.calibration, {});
  EXPECT_EQ(report.level, VerdictLevel::look);
  EXPECT_THAT(report.headline, HasSubstr("cam1 to 0.100 px"));
  EXPECT_THAT(report.remarks, Contains(AllOf(HasSubstr("cam1: no corners lie in the"), HasSubstr("lower right"))));
  EXPECT_THAT(report.remarks, Contains(HasSubstr("tilted by more than 10 degrees in only 0 poses")));
  EXPECT_THAT(report.remarks, Contains(HasSubstr("only 3 pictures were usable")));
  EXPECT_EQ(report.sensors[0].corners_found, 60);
  EXPECT_EQ(report.sensors[0].corners_used, 59);
}

TEST(CalibrationReport, ProgramsGetParametersOutliersAndCovariance) {
  const Sample sample;
  const auto json =
      nlohmann::json::parse(format_calibration_json(judge_calibration(sample.input, sample.calibration, {})));
  EXPECT_EQ(json["format"], "pagesweep-calibration");
  EXPECT_EQ(json["sensors"][0]["parameters"][0]["name"], "fx");
  EXPECT_EQ(json["sensors"][0]["parameters"][0]["sigma"], 1);
  ASSERT_EQ(json["outliers"].size(), 1u);
  EXPECT_EQ(json["outliers"][0]["picture"], "cam1/a.png");
  EXPECT_EQ(json["outliers"][0]["corner"], 7);
  EXPECT_NEAR(json["outliers"][0]["error_px"][0].get<double>(), 5.1, 1e-9);
  EXPECT_EQ(json["refused"][0]["picture"], "bad.png");
  EXPECT_EQ(json["covariance"]["parameters"].size(), 2u) << "poses of the board are left out";
  EXPECT_NEAR(json["strong_correlations"][0]["correlation"].get<double>(), -0.95, 1e-12);
}

TEST(CalibrationReport, ThePageStandsForItselfAndNamesCannotBreakIt) {
  const test::TestFolder folder;
  const Sample sample;
  AccuracyMap map{0, {-100, -80}, 20, Image<float>(4, 3, 0.02F), Image<float>(4, 3, 0.1F)};
  write_calibration_report(folder.path(), judge_calibration(sample.input, sample.calibration, {map}));
  const std::string page = test::read_text(folder / "report.html");
  EXPECT_THAT(page, AllOf(HasSubstr("cam&lt;2&gt;"), Not(HasSubstr("cam<2>")), Not(HasSubstr("src=\"http"))));
  EXPECT_THAT(page, AllOf(HasSubstr("bad.png"), HasSubstr("overexposed"), HasSubstr("1 corners left out")));
  EXPECT_EQ(folder.files(), 2u);
}

}  // namespace
}  // namespace pagesweep
