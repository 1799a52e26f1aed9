// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/calibration/detect_board.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "pagesweep/calibration/draw_board.h"
#include "pagesweep/calibration/simulated_corners_testing.h"
#include "pagesweep/sim/render_board.h"

namespace pagesweep {
namespace {

using testing::AllOf, testing::HasSubstr;

/// The simulator's first camera with half the pixels a side, so that a test takes less than a second.
Scanner small_camera() {
  Camera camera = sim::make_default_rig().cameras[0];
  camera.width = camera.height = 512;
  camera.fx = camera.fy = 740;
  camera.cx = camera.cy = 255;
  return Scanner(camera);
}

Board some_board(BoardType type = BoardType::charuco) {
  if (type == BoardType::circles) return {.type = type, .columns = 4, .rows = 11, .square_mm = 18, .marker_mm = 15};
  return {.type = type, .columns = 10, .rows = 7, .square_mm = 22, .marker_mm = 16};
}

/// A board turned and tilted above the middle of the table.
Rigid3 tilted(const Board& board, Eigen::Vector3d place = {0, 0, 60}) {
  Rigid3 pose;
  pose.rotation =
      (Eigen::AngleAxisd(0.35, Eigen::Vector3d(0.6, 0.8, 0)) * Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ()))
          .toRotationMatrix();
  pose.translation = place - pose.rotation * Eigen::Vector3d(board.middle_mm().x(), board.middle_mm().y(), 0);
  return pose;
}

Image<std::uint8_t> render(const Board& board, const Rigid3& pose, const sim::BoardRenderOptions& options = {}) {
  const BoardDrawing drawing = draw_board(board);
  return sim::render_board({&drawing, board.print_scale, pose, {}}, small_camera(), options, 1);
}

Image<std::uint8_t> mirrored(Image<std::uint8_t> image) {
  for (int y = 0; y < image.height(); ++y) std::ranges::reverse(image.row(y));
  return image;
}

/// The middle of a circle's picture is not the picture of its middle, so circles are compared with a bundle's
/// prediction.
double worst_error(const BoardView& view, const Board& board, const Rigid3& pose) {
  const Bundle truth{board, {}, {{"camera", small_camera().model()}}, {pose}, {false}, {}};
  double worst = 0;
  for (const BoardCorner& corner : view.corners)
    worst = std::max(worst, (corner.pixel - *truth.predict(0, 0, corner.number)).norm());
  return worst;
}

TEST(DetectBoard, AllCornersOfEachTypeAreFoundWhereTheyAre) {
  for (const BoardType type : {BoardType::charuco, BoardType::chessboard, BoardType::circles}) {
    const Board board = some_board(type);
    const Rigid3 pose = tilted(board);
    const BoardView view = detect_board(render(board, pose).view(), board);
    EXPECT_EQ(view.problem, "") << name_of(type);
    EXPECT_EQ(int(view.corners.size()), board.corner_count()) << name_of(type);
    // Noise of the sensor alone gives 0.01 px; the worst of 54 is three times as much.
    EXPECT_LT(worst_error(view, board, pose), 0.06) << name_of(type);
    EXPECT_NEAR(view.blur_px, 0.67, 0.15) << "the lens' 0.6 and the pixel's own 0.29";
  }
}

TEST(DetectBoard, APartOfACharucoBoardIsEnough) {
  const Board board = some_board();
  const Rigid3 pose = tilted(board, {150, 60, 60});
  const BoardView view = detect_board(render(board, pose).view(), board);
  EXPECT_EQ(view.problem, "");
  EXPECT_GT(view.corners.size(), 12u);
  EXPECT_LT(int(view.corners.size()), board.corner_count());
  EXPECT_LT(worst_error(view, board, pose), 0.06);
}

TEST(DetectBoard, UselessPicturesSayWhy) {
  const Board board = some_board();
  const Rigid3 pose = tilted(board);
  sim::BoardRenderOptions bright, blurred;
  bright.exposure = 1.6;
  const BoardView overexposed = detect_board(render(board, pose, bright).view(), board);
  EXPECT_THAT(overexposed.problem, HasSubstr("overexposed"));
  EXPECT_TRUE(overexposed.corners.empty());
  blurred.psf_sigma_px = 1.0;
  DetectionOptions strict;
  strict.most_blur_px = 0.9;
  EXPECT_THAT(detect_board(render(board, pose, blurred).view(), board, strict).problem, HasSubstr("blurred"));
  EXPECT_THAT(detect_board(Image<std::uint8_t>(512, 512, 90).view(), board).problem, HasSubstr("no marker"));
  EXPECT_THAT(detect_board(Image<std::uint8_t>(20, 900, 90).view(), board).problem, HasSubstr("smaller"));
}

TEST(DetectBoard, AWrongDefinitionIsNamed) {
  const Board board = some_board();
  const Image<std::uint8_t> picture = render(board, tilted(board));
  Board other = board;
  other.dictionary = "DICT_4X4_1000";
  const BoardView wrong_markers = detect_board(picture.view(), other);
  EXPECT_TRUE(wrong_markers.wrong_board);
  EXPECT_THAT(wrong_markers.problem, AllOf(HasSubstr("its markers are of DICT_5X5"), HasSubstr("says DICT_4X4_1000")));
  other = board;
  other.columns = 12;
  const BoardView wrong_size = detect_board(picture.view(), other);
  EXPECT_TRUE(wrong_size.wrong_board);
  EXPECT_THAT(wrong_size.problem, AllOf(HasSubstr("12 x 7"), HasSubstr("10 squares across")));
  const BoardView in_mirror = detect_board(mirrored(picture).view(), board);
  EXPECT_TRUE(in_mirror.wrong_board);
  EXPECT_THAT(in_mirror.problem, HasSubstr("mirrored"));
  Board even{.columns = 8, .rows = 6, .square_mm = 24, .marker_mm = 18};
  const Image<std::uint8_t> legacy = render(even, tilted(even));
  even.legacy_pattern = false;
  EXPECT_THAT(detect_board(legacy.view(), even).problem, HasSubstr("\"legacy_pattern\" to true"));
  other = board;
  other.dictionary = "DICT_9X9";
  EXPECT_THROW(detect_board(picture.view(), other), std::invalid_argument);
}

TEST(DetectBoard, NoisePicturesHarmNobody) {
  std::mt19937 random(3);
  for (const BoardType type : {BoardType::charuco, BoardType::chessboard, BoardType::circles}) {
    Image<std::uint8_t> noise(100, 80);
    for (std::uint8_t& pixel : noise.pixels()) pixel = static_cast<std::uint8_t>(random());
    EXPECT_NE(detect_board(noise.view(), some_board(type)).problem, "") << name_of(type);
  }
}

}  // namespace
}  // namespace pagesweep
