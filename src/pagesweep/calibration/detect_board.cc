// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/calibration/detect_board.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <stdexcept>

#include "pagesweep/calibration/dictionary_internal.h"
#include "pagesweep/calibration/fit_corner.h"

namespace pagesweep {
namespace {

/// A marker out of its place by more than this part of a square is misread, or on another board.
constexpr double most_displacement = 0.3;
/// Markers no farther away, in squares, tell where a corner should be.
constexpr double neighbourhood = 2.6;
constexpr std::size_t fewest_markers = 3;

cv::Mat matrix_of(ImageView<const std::uint8_t> image) {
  return {image.height(), image.width(), CV_8U, const_cast<std::uint8_t*>(&image(0, 0)),
          static_cast<std::size_t>(image.stride())};
}

cv::Point2f cv_point(const Eigen::Vector2d& p) { return {static_cast<float>(p.x()), static_cast<float>(p.y())}; }

/// Pairs of board and picture places, in squares and px.
struct Pairs {
  std::vector<cv::Point2f> squares, pixels;
};

struct Marker {
  MarkerPlace place;
  std::array<cv::Point2f, 4> squares, pixels;  ///< its corners
  double distance_squares(const Eigen::Vector2d& at) const {
    return std::hypot(place.column + 0.5 - at.x(), place.row + 0.5 - at.y());
  }
};

/// Markers as the picture shows them.
struct SeenMarkers {
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> numbers;
};

SeenMarkers read_markers(const cv::Mat& picture, const std::string& dictionary) {
  const auto parameters = cv::aruco::DetectorParameters::create();
  parameters->adaptiveThreshWinSizeMax = 43;  // also for markers of a few hundred px
  parameters->minMarkerPerimeterRate = 0.01;  // and boards of several hundred squares
  SeenMarkers seen;
  cv::aruco::detectMarkers(picture, dictionary_named(dictionary), seen.corners, seen.numbers, parameters);
  return seen;
}

/// Where a board has the markers. Whether that is plausible is the caller's question: a marker may be misread.
std::vector<Marker> place_markers(const SeenMarkers& seen, const Board& board) {
  const auto places = marker_places(board);
  const float margin = static_cast<float>(0.5 * (1 - board.marker_mm / board.square_mm));
  std::vector<Marker> markers;
  for (std::size_t k = 0; k < seen.numbers.size(); ++k) {
    const int number = seen.numbers[k];
    if (number < 0 || static_cast<std::size_t>(number) >= places.size()) continue;
    Marker marker{places[std::size_t(number)], {}, {}};
    const auto left = float(marker.place.column) + margin, low = float(marker.place.row) + margin;
    const auto right = left + 1 - 2 * margin, high = low + 1 - 2 * margin;
    marker.squares = {cv::Point2f(left, high), {right, high}, {right, low}, {left, low}};  // clockwise as printed
    std::copy_n(seen.corners[k].begin(), 4, marker.pixels.begin());
    markers.push_back(marker);
  }
  return markers;
}

Pairs pairs_of(const std::vector<Marker>& markers) {
  Pairs pairs;
  for (const Marker& marker : markers) {
    pairs.squares.insert(pairs.squares.end(), marker.squares.begin(), marker.squares.end());
    pairs.pixels.insert(pairs.pixels.end(), marker.pixels.begin(), marker.pixels.end());
  }
  return pairs;
}

/// The markers that lie where the board has them.
std::vector<Marker> consistent_markers(const std::vector<Marker>& markers) {
  if (markers.size() < fewest_markers) return {};
  const Pairs pairs = pairs_of(markers);
  const cv::Mat squares_from_px = cv::findHomography(pairs.pixels, pairs.squares, cv::RANSAC, most_displacement);
  if (squares_from_px.empty()) return {};
  std::vector<cv::Point2f> found;
  cv::perspectiveTransform(pairs.pixels, found, squares_from_px);
  std::vector<Marker> consistent;
  for (std::size_t k = 0; k < markers.size(); ++k) {
    double farthest = 0;
    for (std::size_t c = 4 * k; c < 4 * k + 4; ++c)
      farthest = std::max(farthest, cv::norm(found[c] - pairs.squares[c]));
    if (farthest < most_displacement) consistent.push_back(markers[k]);
  }
  return consistent;
}

/// A plane's picture near a place, from what is known around it.
class LocalView {
 public:
  explicit LocalView(const Pairs& pairs) : px_from_squares_(cv::findHomography(pairs.squares, pairs.pixels)) {}
  bool empty() const { return px_from_squares_.empty(); }

  CornerGuess guess_at(const Eigen::Vector2d& squares) const {
    const double step = 0.25;
    const auto at = [&](double dx, double dy) { return image(squares + Eigen::Vector2d(dx, dy)); };
    CornerGuess guess;
    guess.pixel = at(0, 0);
    guess.right_px = (at(step, 0) - at(-step, 0)) / (2 * step);
    guess.up_px = (at(0, step) - at(0, -step)) / (2 * step);
    return guess;
  }

 private:
  Eigen::Vector2d image(const Eigen::Vector2d& p) const {
    const auto& h = px_from_squares_;
    const auto row = [&](int i) {
      return h.at<double>(i, 0) * p.x() + h.at<double>(i, 1) * p.y() + h.at<double>(i, 2);
    };
    return Eigen::Vector2d(row(0), row(1)) / row(2);
  }
  cv::Mat px_from_squares_;
};

struct FittedCorner {
  int number;
  CornerFit fit;
};

double median_of(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// A corner is refused whose edges look other than the picture's other corners': half covered, or on a highlight.
BoardView view_of(std::vector<FittedCorner> found) {
  constexpr double most_misfit_ratio = 4, least_contrast_ratio = 0.25, most_blur_ratio = 2.5;
  const auto median = [&](double CornerFit::* member) {
    std::vector<double> values;
    for (const FittedCorner& corner : found) values.push_back(corner.fit.*member);
    return median_of(values);
  };
  BoardView view;
  view.corners_seen = static_cast<int>(found.size());
  view.blur_px = median(&CornerFit::blur_px);
  view.contrast = median(&CornerFit::contrast);
  const double misfit = std::max(0.01, median(&CornerFit::misfit));
  double clipped = 0;
  for (const auto& [number, fit] : found) {
    clipped += fit.clipped / static_cast<double>(found.size());
    if (fit.misfit < most_misfit_ratio * misfit && fit.contrast > least_contrast_ratio * view.contrast &&
        fit.blur_px < most_blur_ratio * view.blur_px)
      view.corners.push_back({number, fit.pixel});
  }
  view.clipped = clipped;
  return view;
}

BoardView fit_charuco(ImageView<const std::uint8_t> image, const Board& board, const std::vector<Marker>& markers) {
  std::vector<FittedCorner> found;
  for (int number = 0; number < board.corner_count(); ++number) {
    const int column = number % (board.columns - 1) + 1, row = number / (board.columns - 1) + 1;
    const Eigen::Vector2d place(column, row);
    std::vector<Marker> near;
    int touching = 0;
    for (const Marker& marker : markers) {
      const double distance = marker.distance_squares(place);
      if (distance < neighbourhood) near.push_back(marker);
      touching += distance < 1;
    }
    if (touching == 0 || near.size() < 2) continue;
    const LocalView local(pairs_of(near));
    if (local.empty()) continue;
    CornerGuess guess = local.guess_at(place);
    guess.upper_right_is_black = board.is_black(column, row);
    guess.margin = 0.5 * (1 - board.marker_mm / board.square_mm);
    if (const auto fit = fit_corner(image, guess)) found.push_back({number, *fit});
  }
  return view_of(std::move(found));
}

// ---- why a ChArUco board is not found ----

std::size_t count_markers(const cv::Mat& picture, const std::string& dictionary) {
  return read_markers(picture, dictionary).numbers.size();
}

/// The number of squares across with which most of the markers found lie where they should; 0 if there is none.
int columns_that_fit(const SeenMarkers& seen, const Board& board) {
  Board other = board;
  for (other.columns = 3; other.columns <= 60; ++other.columns) {
    other.rows = std::max(board.rows, 2 * 1000 / other.columns);  // only the numbering from the top matters
    if ((other.rows - board.rows) % 2 != 0) ++other.rows;         // which begins with the square's colour
    if (consistent_markers(place_markers(seen, other)).size() * 10 >= seen.numbers.size() * 8) return other.columns;
  }
  return 0;
}

/// Other explanations of a picture without the board's markers compete by the number of markers that they find: small
/// markers are seen by chance in anything.
std::string why_no_markers(const cv::Mat& picture, const Board& board, bool& wrong_board) {
  cv::Mat mirrored;
  cv::flip(picture, mirrored, 1);
  std::string best =
      "the picture is mirrored: its markers can be read only in a mirror; switch off what flips the camera's pictures";
  std::size_t most = count_markers(mirrored, board.dictionary);
  for (const std::string& name : dictionary_names()) {
    const std::size_t count = name == board.dictionary ? 0 : count_markers(picture, name);
    if (count <= most) continue;  // a small dictionary is the beginning of a larger one and comes first
    most = count;
    best = fmt::format("its markers are of {}, and the board's definition says {}", name, board.dictionary);
  }
  wrong_board = most >= fewest_markers;
  return wrong_board
             ? best
             : fmt::format("no marker of {} is seen: is the board in the picture, in focus and lit?", board.dictionary);
}

std::string why_inconsistent(const SeenMarkers& seen, const Board& board) {
  const int columns = columns_that_fit(seen, board);
  const std::string what =
      fmt::format("its markers do not lie as on a board of {} x {} squares", board.columns, board.rows);
  return columns > 0 && columns != board.columns ? fmt::format("{} but as on one of {} squares across", what, columns)
                                                 : what;
}

BoardView unusable(std::string problem, bool wrong_board = false) {
  BoardView view;
  view.problem = std::move(problem);
  view.wrong_board = wrong_board;
  return view;
}

/// Both kinds of boards number their markers almost alike, so some fit the wrong kind, but more fit the right one.
bool is_of_other_pattern(const SeenMarkers& seen, Board board, std::size_t consistent) {
  if (board.rows % 2 != 0) return false;
  board.legacy_pattern = !board.legacy_pattern;
  return consistent_markers(place_markers(seen, board)).size() > consistent + consistent / 100;
}

BoardView detect_charuco(ImageView<const std::uint8_t> image, const Board& board) {
  const cv::Mat picture = matrix_of(image);
  const SeenMarkers seen = read_markers(picture, board.dictionary);
  bool wrong = false;
  if (seen.numbers.size() < fewest_markers) {
    const std::string why = why_no_markers(picture, board, wrong);
    return unusable(why, wrong);
  }
  const auto consistent = consistent_markers(place_markers(seen, board));
  if (is_of_other_pattern(seen, board, consistent.size()))
    return unusable(fmt::format("the board's upper left square has the other colour: OpenCV changed its boards with "
                                "version 4.6; set \"legacy_pattern\" to {} in the board's definition",
                                !board.legacy_pattern),
                    true);
  if (consistent.size() < fewest_markers || 2 * consistent.size() < seen.numbers.size())
    return unusable(why_inconsistent(seen, board), true);
  return fit_charuco(image, board, consistent);
}

// ---- boards without numbers ----

/// Where OpenCV found the corners of a whole board, in its own order.
BoardView fit_grid(ImageView<const std::uint8_t> image, const Board& board, const std::vector<cv::Point2f>& pixels) {
  std::vector<FittedCorner> found;
  Pairs all;
  for (int number = 0; number < board.corner_count(); ++number) {
    all.squares.push_back(cv_point(board.corner_mm(number) / board.square_mm));
    all.pixels.push_back(pixels[std::size_t(number)]);
  }
  const LocalView view(all);
  if (view.empty()) return unusable("its corners do not lie in a plane");
  for (int number = 0; number < board.corner_count(); ++number) {
    CornerGuess guess = view.guess_at(board.corner_mm(number) / board.square_mm);
    guess.pixel = {all.pixels[std::size_t(number)].x, all.pixels[std::size_t(number)].y};
    guess.margin = 1;
    const int across = board.columns - 1;
    guess.upper_right_is_black = board.is_black(number % across + 1, number / across + 1);
    const double radius_px = 0.25 * board.marker_mm / board.square_mm * (guess.right_px.norm() + guess.up_px.norm());
    const auto fit =
        board.type == BoardType::circles ? fit_disc(image, guess.pixel, radius_px) : fit_corner(image, guess);
    if (fit) found.push_back({number, *fit});
  }
  return view_of(std::move(found));
}

double gray_near(const cv::Mat& picture, const cv::Point2f& at) {
  cv::Mat patch;
  cv::getRectSubPix(picture, cv::Size(3, 3), at, patch);
  return cv::mean(patch)[0];
}

/// OpenCV numbers corners from any of a chessboard's ends; the square beyond the first one tells which.
void put_in_order(const cv::Mat& picture, const Board& board, std::vector<cv::Point2f>& pixels) {
  const auto across = static_cast<std::size_t>(board.columns - 1);
  const auto rows = pixels.size() / across;
  const auto at = [&](std::size_t i, std::size_t j) { return pixels[j * across + i]; };
  const auto middle_of = [&](std::size_t i, std::size_t j) {
    return 0.25f * (at(i, j) + at(i + 1, j) + at(i, j + 1) + at(i + 1, j + 1));
  };
  // Rows from bottom to top: x to the right and y up, so the picture's v, which points down, makes the turn negative.
  const cv::Point2f right = at(1, 0) - at(0, 0), up = at(0, 1) - at(0, 0);
  if (right.cross(up) > 0)
    for (std::size_t j = 0; j < rows / 2; ++j)
      std::swap_ranges(pixels.begin() + std::ptrdiff_t(j * across), pixels.begin() + std::ptrdiff_t((j + 1) * across),
                       pixels.begin() + std::ptrdiff_t((rows - 1 - j) * across));
  double black = 0, white = 0;
  for (std::size_t j = 0; j + 1 < rows; ++j)
    for (std::size_t i = 0; i + 1 < across; ++i)
      ((i + j) % 2 == 0 ? black : white) += gray_near(picture, middle_of(i, j));
  if (black > white) std::reverse(pixels.begin(), pixels.end());  // half a turn
}

BoardView detect_chessboard(ImageView<const std::uint8_t> image, const Board& board) {
  const cv::Mat picture = matrix_of(image);
  std::vector<cv::Point2f> pixels;
  const cv::Size size(board.columns - 1, board.rows - 1);
  if (!cv::findChessboardCornersSB(picture, size, pixels) &&
      !cv::findChessboardCornersSB(picture, size, pixels, cv::CALIB_CB_EXHAUSTIVE))
    return unusable(fmt::format("no whole chessboard of {} x {} squares is seen", board.columns, board.rows));
  put_in_order(picture, board, pixels);
  return fit_grid(image, board, pixels);
}

BoardView detect_circles(ImageView<const std::uint8_t> image, const Board& board) {
  const cv::Mat picture = matrix_of(image);
  std::vector<cv::Point2f> pixels;
  cv::SimpleBlobDetector::Params blobs;
  blobs.minArea = 20;
  blobs.maxArea = 0.02f * float(image.width()) * float(image.height());
  blobs.minDistBetweenBlobs = 3;
  const auto detector = cv::SimpleBlobDetector::create(blobs);
  const cv::Size size(board.columns, board.rows);
  // Clustering bears tilts, the other way a cluttered surrounding.
  if (!cv::findCirclesGrid(picture, size, pixels, cv::CALIB_CB_ASYMMETRIC_GRID | cv::CALIB_CB_CLUSTERING, detector) &&
      !cv::findCirclesGrid(picture, size, pixels, cv::CALIB_CB_ASYMMETRIC_GRID, detector))
    return unusable(fmt::format("no whole grid of {} x {} circles is seen", board.columns, board.rows));
  // OpenCV's rows count downwards; the pattern is its own picture in a mirror along x.
  const auto across = static_cast<std::size_t>(board.columns);
  std::vector<cv::Point2f> upwards;
  for (std::size_t j = pixels.size() / across; j-- > 0;)
    upwards.insert(upwards.end(), pixels.begin() + std::ptrdiff_t(j * across),
                   pixels.begin() + std::ptrdiff_t((j + 1) * across));
  return fit_grid(image, board, upwards);
}

BoardView detect_any(ImageView<const std::uint8_t> image, const Board& board) {
  switch (board.type) {
    case BoardType::chessboard:
      return detect_chessboard(image, board);
    case BoardType::circles:
      return detect_circles(image, board);
    case BoardType::charuco:
      break;
  }
  return detect_charuco(image, board);
}

std::string problem_of(const BoardView& view, const DetectionOptions& options) {
  if (view.clipped > options.most_clipped)
    return fmt::format(
        "overexposed: {:.0f} % of the board's white has the highest gray value, and edges in its glare are "
        "out of place; shorten the exposure",
        100 * view.clipped);
  if (view.blur_px > options.most_blur_px)
    return fmt::format("blurred: its edges have a standard deviation of {:.1f} px; focus, or keep the board still",
                       view.blur_px);
  if (static_cast<int>(view.corners.size()) < options.fewest_corners)
    return fmt::format("shows only {} of the board's corners, and {} are needed", view.corners.size(),
                       options.fewest_corners);
  return "";
}

}  // namespace

BoardView detect_board(ImageView<const std::uint8_t> image, const Board& board, const DetectionOptions& options) {
  if (const std::string problem = pagesweep::problem_of(board); !problem.empty())
    throw std::invalid_argument("the board " + problem);
  if (image.width() < 32 || image.height() < 32) return unusable("smaller than 32 x 32 px");
  BoardView view;
  try {
    view = detect_any(image, board);
  } catch (const cv::Exception& e) {  // degenerate geometry that OpenCV's own checks refuse
    return unusable(fmt::format("cannot be searched: {}", e.err));
  }
  if (!view.problem.empty()) return view;
  view.problem = problem_of(view, options);
  if (!view.problem.empty()) view.corners.clear();
  return view;
}

}  // namespace pagesweep
