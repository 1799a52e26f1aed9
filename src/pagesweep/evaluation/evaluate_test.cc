// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/evaluate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "pagesweep/base/error.h"
#include "pagesweep/io/capture_file.h"
#include "pagesweep/io/float_tiff.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/io/ply_file.h"
#include "pagesweep/io/rig_file.h"
#include "pagesweep/io/truth_file.h"
#include "pagesweep/sim/analytic_scene.h"

namespace pagesweep {
namespace {

namespace fs = std::filesystem;

double value_of(const std::vector<Figure>& figures, const std::string& group, const std::string& name) {
  for (const Figure& figure : figures)
    if (figure.group == group && figure.name == name) return figure.value;
  ADD_FAILURE() << "no figure " << group << "." << name;
  return NAN;
}

/// A capture folder with the truth of one page that lies flat, and a result folder that repeats it.
class EvaluateTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(testing::TempDir()) / (std::string("pagesweep_evaluate_") + test->name());
    fs::remove_all(folder_);
    fs::create_directories(truth());
    fs::create_directories(out());
    write_rig(capture() / "rig.json", rig_);
    Capture description;
    description.folder = capture();
    for (const Camera& camera : rig_.cameras) {
      SequenceFiles files;
      files.camera = camera.name;
      files.frames = camera.name + "/%06d.png";
      files.count = 200;
      description.sequences.push_back(files);
    }
    write_capture(description);
    for (const Camera& camera : rig_.cameras) write_camera(camera);
    Truth description_of_truth;
    description_of_truth.folder = truth();
    description_of_truth.pages.push_back({.index = 1, .pixels_per_mm = 2, .points_subsampling = 1, .text = ""});
    write_truth(description_of_truth);
    write_page(truth(), 1);
    write_page(out(), 1);
  }
  void TearDown() override { fs::remove_all(folder_); }

  void write_camera(const Camera& camera) {
    const PointMap points = surface_.points(camera, 0.05);
    const TimeMap times = surface_.times(camera, *rig_.light);
    const auto xyz = {points.x.view(), points.y.view(), points.z.view()};
    using Views = std::vector<ImageView<const float>>;
    write_float_tiff(truth() / (camera.name + "_points.tiff"), Views(xyz.begin(), xyz.end()));
    write_float_tiff(out() / (camera.name + "_points.tiff"), Views(xyz.begin(), xyz.end()));
    write_float_tiff(out() / (camera.name + "_point_sigma.tiff"), Views{points.sigma.view()});
    write_float_tiff(out() / (camera.name + "_times.tiff"),
                     Views{times.time.view(), times.sigma.view(), times.amplitude.view(), times.residual.view()});
    Image<std::uint8_t> status(camera.width, camera.height);
    for (std::size_t i = 0; i < status.size(); ++i)
      status.data()[i] = static_cast<std::uint8_t>(points.status.data()[i]);
    write_gray_png(out() / (camera.name + "_status.png"), std::as_const(status).view());
  }
  void write_page(const fs::path& folder, int index) {
    ScanMap map(240, 200);
    for (int y = 0; y < map.height(); ++y)
      for (int x = 0; x < map.width(); ++x) {
        map.u(x, y) = 100 + 5 * static_cast<float>(x);
        map.v(x, y) = 50 + 5 * static_cast<float>(y);
      }
    const std::string name = "page_" + std::to_string(index);
    write_scan_map(folder / (name + "_scanmap.tiff"), map);
    Picture picture = make_picture(map.width(), map.height(), 1, 8);
    picture.pixels_per_mm = 2;
    write_picture(folder / (name + ".png"), picture);
  }
  fs::path capture() const { return folder_ / "capture"; }
  fs::path truth() const { return capture() / "truth"; }
  fs::path out() const { return folder_ / "out"; }

  fs::path folder_;
  Rig rig_ = sim::make_test_rig(96);
  sim::AnalyticScene surface_{
      .height = [](double x, double y) { return std::abs(x) < 100 && std::abs(y) < 80 ? 5 : NAN; }};
};

TEST_F(EvaluateTest, ATruthfulResultHasNoErrors) {
  const Evaluation evaluation = evaluate(out(), truth());
  const auto figures = figures_of(evaluation);
  EXPECT_LT(value_of(figures, "points", "max"), 1e-6);
  EXPECT_EQ(value_of(figures, "points", "completeness"), 100);
  EXPECT_LT(value_of(figures, "times", "p95"), 1e-4);
  // The page's resolution is stored in whole pixels a metre or in a float: good to 1e-5.
  EXPECT_LT(value_of(figures, "page_1", "max"), 2e-3);
  EXPECT_EQ(value_of(figures, "page_1", "covered"), 100);
  EXPECT_EQ(value_of(figures, "pages", "missing"), 0);
  EXPECT_EQ(maps_of(evaluation).size(), 3u) << "two cameras, one page";
}

TEST_F(EvaluateTest, WhatIsMissingHasItsReason) {
  fs::remove(out() / "page_1_scanmap.tiff");
  fs::remove(out() / "cam1_times.tiff");
  fs::remove(out() / "cam2_times.tiff");
  fs::remove(out() / "cam1_points.tiff");
  const Evaluation evaluation = evaluate(out(), truth());
  for (const Figure& figure : figures_of(evaluation))
    EXPECT_NE(std::isfinite(figure.value), !figure.reason.empty()) << figure.group << "." << figure.name;
  EXPECT_THAT(evaluation.times_reason, testing::HasSubstr("no time maps"));
  EXPECT_THAT(evaluation.points_reason, testing::HasSubstr("points.ply"));
  ASSERT_EQ(evaluation.pages.size(), 1u);
  EXPECT_THAT(evaluation.pages[0].reason, testing::HasSubstr("does not have this page"));
  EXPECT_EQ(value_of(figures_of(evaluation), "pages", "missing"), 1);
}

TEST_F(EvaluateTest, FallsBackToTheCloud) {
  std::vector<PointMap> maps;
  for (const Camera& camera : rig_.cameras) {
    maps.push_back(surface_.points(camera, 0.05));
    for (float& z : maps.back().z.pixels()) z += 0.1f;
  }
  write_ply(out() / "points.ply", maps);
  fs::remove(out() / "cam2_points.tiff");
  const Evaluation evaluation = evaluate(out(), truth());
  EXPECT_TRUE(evaluation.points_from_cloud);
  const auto figures = figures_of(evaluation);
  EXPECT_NEAR(value_of(figures, "points", "rms"), 0.1, 1e-4) << "the page lies flat, all points are 0.1 mm too high";
  EXPECT_NEAR(value_of(figures, "points", "bias"), 0.1, 1e-4);
  EXPECT_TRUE(std::isnan(value_of(figures, "points", "completeness")));
}

TEST_F(EvaluateTest, PagesThatNobodyPrintedAreCounted) {
  write_page(out(), 2);
  const Evaluation evaluation = evaluate(out(), truth());
  EXPECT_THAT(evaluation.unexpected_pages, testing::ElementsAre(2));
}

TEST_F(EvaluateTest, BrokenFilesAreNamed) {
  Image<std::uint8_t> status(96, 96, 200);
  write_gray_png(out() / "cam1_status.png", std::as_const(status).view());
  try {
    evaluate(out(), truth());
    FAIL() << "status 200 does not exist";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("cam1_status.png"));
  }
  EXPECT_THROW(evaluate(folder_ / "nowhere", truth()), Error);
  EXPECT_THROW(evaluate(out(), out()), Error);
}

TEST_F(EvaluateTest, TableAndJsonSayTheSame) {
  const std::vector<Figure> figures{{"points", "rms", "distance, rms", 0.08125, "mm", ""},
                                    {"points", "false", "false points", 12, "points", ""},
                                    {"page_1", "max", "largest error", NAN, "mm", "the page is missing"}};
  const std::string table = format_table(figures);
  EXPECT_THAT(table, testing::HasSubstr("0.0813 mm"));
  EXPECT_THAT(table, testing::HasSubstr("(the page is missing)"));
  const std::string json = format_figures_json(figures);
  EXPECT_THAT(json, testing::HasSubstr("0.08125"));
  EXPECT_THAT(json, testing::HasSubstr("null"));
}

}  // namespace
}  // namespace pagesweep
