// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/compare_pictures.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

#include "pagesweep/base/catmull_rom.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/data/gray_picture.h"
#include "pagesweep/evaluation/structural_similarity.h"

namespace pagesweep {
namespace {

/// Which pixel position of the true page belongs to one of the result.
class TruthFromResult {
 public:
  TruthFromResult(const Picture& result, const Picture& truth, const PageErrors& alignment)
      : turn_(Eigen::Rotation2Dd(-alignment.rotation_rad).toRotationMatrix()),
        shift_mm_(alignment.shift_mm),
        result_mm_per_px_(1 / result.pixels_per_mm),
        truth_px_per_mm_(truth.pixels_per_mm) {}

  Eigen::Vector2d operator()(double x, double y) const {
    const Eigen::Vector2d result_mm = (Eigen::Vector2d(x, y).array() + 0.5) * result_mm_per_px_;
    return ((turn_ * result_mm + shift_mm_) * truth_px_per_mm_).array() - 0.5;
  }

 private:
  Eigen::Matrix2d turn_;
  Eigen::Vector2d shift_mm_;
  double result_mm_per_px_, truth_px_per_mm_;
};

/// Pixels of the result: left and top belong to it, right and bottom no longer do.
struct Rectangle {
  int left = 0, top = 0, right = 0, bottom = 0;
};

/// Cuts the edges off until all four corners can be looked up on the true page.
Rectangle find_overlap(const Picture& result, const Picture& truth, const TruthFromResult& truth_from_result) {
  Rectangle r{0, 0, result.width(), result.height()};
  const auto places = [&](int x0, int y0, int x1, int y1) {
    return std::array{truth_from_result(x0, y0), truth_from_result(x1, y1)};
  };
  const auto beyond = [](const auto& two, int axis, double low, double high) {
    return std::ranges::any_of(two, [&](const Eigen::Vector2d& p) { return p[axis] < low || p[axis] > high; });
  };
  const double last_x = truth.width() - 3, last_y = truth.height() - 3;
  while (r.left < r.right && beyond(places(r.left, r.top, r.left, r.bottom - 1), 0, 1, last_x)) ++r.left;
  while (r.left < r.right && beyond(places(r.right - 1, r.top, r.right - 1, r.bottom - 1), 0, 1, last_x)) --r.right;
  while (r.top < r.bottom && beyond(places(r.left, r.top, r.right - 1, r.top), 1, 1, last_y)) ++r.top;
  while (r.top < r.bottom && beyond(places(r.left, r.bottom - 1, r.right - 1, r.bottom - 1), 1, 1, last_y)) --r.bottom;
  return r;
}

float sample(const Image<float>& image, const Eigen::Vector2d& place) {
  const double fx = std::floor(place.x()), fy = std::floor(place.y());
  const int x = static_cast<int>(fx), y = static_cast<int>(fy);
  if (!image.contains(x - 1, y - 1) || !image.contains(x + 2, y + 2)) return 255;
  const auto wx = catmull_rom_weights(place.x() - fx), wy = catmull_rom_weights(place.y() - fy);
  double sum = 0;
  for (int j = 0; j < 4; ++j)
    for (int i = 0; i < 4; ++i) sum += wy[std::size_t(j)] * wx[std::size_t(i)] * double(image(x + i - 1, y + j - 1));
  return static_cast<float>(std::clamp(sum, 0.0, 255.0));
}

/// Gives `image` the gain and offset with which it comes closest to `goal`.
void adjust_tone(Image<float>& image, const Image<float>& goal) {
  const auto n = static_cast<double>(image.size());
  double x = 0, y = 0, xx = 0, xy = 0;
  for (std::size_t i = 0; i < image.size(); ++i) {
    const double p = double(image.data()[i]), q = double(goal.data()[i]);
    x += p / n;
    y += q / n;
    xx += p * p / n;
    xy += p * q / n;
  }
  const double gain = xx - x * x > 0 ? (xy - x * y) / (xx - x * x) : 1;
  for (float& value : image.pixels()) value = static_cast<float>(y + gain * (double(value) - x));
}

}  // namespace

PictureErrors compare_pictures(const Picture& result, const Picture& truth, const PageErrors& alignment) {
  const TruthFromResult truth_from_result(result, truth, alignment);
  const Rectangle overlap = find_overlap(result, truth, truth_from_result);
  if (overlap.left >= overlap.right || overlap.top >= overlap.bottom) return {};
  const Image<float> result_gray = gray_picture(result), truth_gray = gray_picture(truth);
  Image<float> seen(overlap.right - overlap.left, overlap.bottom - overlap.top), printed = seen;
  parallel_rows(seen.height(), [&](int y) {
    for (int x = 0; x < seen.width(); ++x) {
      seen(x, y) = result_gray(overlap.left + x, overlap.top + y);
      printed(x, y) = sample(truth_gray, truth_from_result(overlap.left + x, overlap.top + y));
    }
  });
  PictureErrors errors;
  errors.ms_ssim = ms_ssim(std::as_const(seen).view(), std::as_const(printed).view());
  adjust_tone(seen, printed);
  errors.ms_ssim_same_exposure = ms_ssim(std::as_const(seen).view(), std::as_const(printed).view());
  return errors;
}

}  // namespace pagesweep
