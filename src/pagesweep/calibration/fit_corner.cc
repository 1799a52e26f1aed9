// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/calibration/fit_corner.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace pagesweep {
namespace {

constexpr double reach = 0.45;        ///< of a square's side that edges are followed to both sides of a corner
constexpr double strip_share = 0.75;  ///< of the margin that samples are taken from
constexpr double least_contrast = 12;
constexpr double least_blur_px = 0.2;
constexpr double highest = 255;

struct Sample {
  double x, y, gray;
};

/// A model of the picture with parameters p: value(p, sample, gradient).
template <int count>
using Row = Eigen::Matrix<double, count, 1>;

template <int count>
struct Fit {
  Row<count> parameters;
  double rms = 0;
};

/// Levenberg-Marquardt over samples; one that is clipped, and would be by the model as well, says nothing.
template <int count, class Model>
std::optional<Fit<count>> fit(const std::vector<Sample>& samples, Row<count> parameters, const Model& model) {
  const auto evaluate = [&](const Row<count>& at, Eigen::Matrix<double, count, count>* normal, Row<count>* right) {
    double squares = 0;
    Row<count> gradient;
    for (const Sample& sample : samples) {
      const double predicted = model(at, sample, gradient);
      if (sample.gray >= highest && predicted >= highest) continue;
      const double error = sample.gray - predicted;
      squares += error * error;
      if (!normal) continue;
      normal->template selfadjointView<Eigen::Lower>().rankUpdate(gradient);
      *right += error * gradient;
    }
    return squares;
  };
  double damping = 1e-3;
  for (int i = 0; i < 30; ++i) {
    Eigen::Matrix<double, count, count> normal = Eigen::Matrix<double, count, count>::Zero();
    Row<count> right = Row<count>::Zero();
    const double squares = evaluate(parameters, &normal, &right);
    normal = normal.template selfadjointView<Eigen::Lower>();
    normal.diagonal() *= 1 + damping;
    const Row<count> step = normal.ldlt().solve(right);
    if (!step.allFinite()) return std::nullopt;
    const double tried = evaluate(parameters + step, nullptr, nullptr);
    const bool better = tried <= squares;
    if (better) parameters += step;
    damping = better ? damping * 0.2 : damping * 10;
    const bool still = step.template head<2>().norm() < 1e-4;
    if (still || damping > 1e6)
      return Fit<count>{parameters, std::sqrt(std::min(tried, squares) / static_cast<double>(samples.size()))};
  }
  return std::nullopt;
}

/// Pixels near the edges of a corner, and the levels of its black and white.
struct Neighbourhood {
  std::vector<Sample> samples;
  double black = 0, white = 0, clipped = 0;
};

void find_levels(Neighbourhood& around) {
  std::vector<double> grays;
  for (const Sample& sample : around.samples) grays.push_back(sample.gray);
  std::ranges::sort(grays);
  around.black = grays[grays.size() / 8];
  around.white = grays[grays.size() * 7 / 8];
  const auto clipped = std::ranges::count(grays, highest);
  around.clipped = 2.0 * static_cast<double>(clipped) / static_cast<double>(grays.size());
}

/// The samples that `wanted` of the pixels within `radius` around a position; nothing if the picture ends before.
template <class Wanted>
std::optional<Neighbourhood> gather(ImageView<const std::uint8_t> image, const Eigen::Vector2d& pixel, double radius,
                                    const Wanted& wanted) {
  if (!pixel.allFinite() || !(radius < 500)) return std::nullopt;
  const int left = static_cast<int>(std::floor(pixel.x() - radius)),
            top = static_cast<int>(std::floor(pixel.y() - radius));
  const int side = 2 * static_cast<int>(std::ceil(radius)) + 2;
  Neighbourhood around;
  for (int y = top; y < top + side; ++y)
    for (int x = left; x < left + side; ++x) {
      const Eigen::Vector2d offset = Eigen::Vector2d(x, y) - pixel;
      if (!wanted(offset)) continue;
      if (!image.contains(x, y)) return std::nullopt;
      around.samples.push_back({double(x), double(y), double(image(x, y))});
    }
  if (around.samples.size() < 30) return std::nullopt;
  find_levels(around);
  return around.white - around.black < least_contrast ? std::nullopt : std::optional(std::move(around));
}

/// Parameters: corner x, y; directions of the edges; blur; mean gray; relative growth of light along x and y; half the
/// signed contrast. Light multiplies: white shows how it varies, and black does not, which costs less certainty than a
/// slope added to both.
double corner_model(const Row<9>& p, const Sample& sample, Row<9>& gradient) {
  const double dx = sample.x - p[0], dy = sample.y - p[1];
  const double blur = std::max(std::abs(p[4]), least_blur_px), scale = 1 / (std::numbers::sqrt2 * blur);
  const double light = 1 + p[6] * dx + p[7] * dy;
  double value[2], slope[2], along[2], sine[2], cosine[2];
  for (int k = 0; k < 2; ++k) {
    sine[k] = std::sin(p[2 + k]), cosine[k] = std::cos(p[2 + k]);
    const double distance = (cosine[k] * dy - sine[k] * dx) * scale;
    along[k] = cosine[k] * dx + sine[k] * dy;
    value[k] = std::erf(distance);
    slope[k] = 2 / std::sqrt(std::numbers::pi) * std::exp(-distance * distance);
  }
  const double albedo = p[5] + p[8] * value[0] * value[1];
  gradient.setZero();
  for (int k = 0; k < 2; ++k) {
    const double by_distance = light * p[8] * slope[k] * value[1 - k] * scale;
    gradient[0] += by_distance * sine[k];
    gradient[1] -= by_distance * cosine[k];
    gradient[2 + k] = -by_distance * along[k];
    gradient[4] -= by_distance * (cosine[k] * dy - sine[k] * dx) / blur;
  }
  gradient[0] -= albedo * p[6];
  gradient[1] -= albedo * p[7];
  gradient[5] = light;
  gradient[6] = albedo * dx;
  gradient[7] = albedo * dy;
  gradient[8] = light * value[0] * value[1];
  return light * albedo;
}

/// Parameters: centre x, y; the symmetric matrix A that takes the ellipse to the unit circle; blur; white; contrast.
double disc_value(const Row<8>& p, const Sample& sample) {
  const Eigen::Vector2d d(sample.x - p[0], sample.y - p[1]);
  Eigen::Matrix2d a;
  a << p[2], p[3], p[3], p[4];
  const Eigen::Vector2d image = a * d;
  const double radius = std::max(image.norm(), 1e-6), steepness = std::max((a * image).norm(), 1e-9);
  const double distance = (radius - 1) * radius / steepness;  // to first order
  const double blur = std::max(std::abs(p[5]), least_blur_px);
  return p[6] - 0.5 * p[7] * std::erfc(distance / (std::numbers::sqrt2 * blur));
}

double disc_model(const Row<8>& p, const Sample& sample, Row<8>& gradient) {
  const double value = disc_value(p, sample);
  for (int k = 0; k < 8; ++k) {
    Row<8> moved = p;
    const double step = 1e-5 * std::max(1e-2, std::abs(p[k]));
    moved[k] += step;
    gradient[k] = (disc_value(moved, sample) - value) / step;
  }
  return value;
}

}  // namespace

std::optional<CornerFit> fit_corner(ImageView<const std::uint8_t> image, const CornerGuess& guess) {
  Eigen::Matrix2d px_from_square;
  px_from_square << guess.right_px, guess.up_px;
  if (!(std::abs(px_from_square.determinant()) > 16)) return std::nullopt;  // squares of less than 4 x 4 px
  const Eigen::Matrix2d square_from_px = px_from_square.inverse();
  const double strip = std::min(reach, strip_share * guess.margin);
  const auto is_near_edge = [&](const Eigen::Vector2d& offset) {
    const Eigen::Vector2d place = (square_from_px * offset).cwiseAbs();
    return place.maxCoeff() <= reach && place.minCoeff() <= strip;
  };
  const double radius = reach * (guess.right_px.norm() + guess.up_px.norm());
  const auto around = gather(image, guess.pixel, radius, is_near_edge);
  if (!around) return std::nullopt;
  const auto angle = [](const Eigen::Vector2d& v) { return std::atan2(v.y(), v.x()); };
  // Between the positive directions of both edges l1 and l2 have different signs.
  const double half = 0.5 * (around->white - around->black) * (guess.upper_right_is_black ? 1 : -1);
  Row<9> start;
  start << guess.pixel.x(), guess.pixel.y(), angle(guess.right_px), angle(guess.up_px), 0.8,
      0.5 * (around->white + around->black), 0, 0, half;
  const auto found = fit<9>(around->samples, start, corner_model);
  if (!found) return std::nullopt;
  const Row<9>& p = found->parameters;
  const double contrast = 2 * std::abs(p[8]), side = std::min(guess.right_px.norm(), guess.up_px.norm());
  const bool plausible = (p.head<2>() - guess.pixel).norm() < 0.3 * side && p[8] * half > 0 &&
                         contrast > least_contrast && std::abs(p[4]) < 0.3 * side;
  if (!plausible) return std::nullopt;
  return CornerFit{p.head<2>(), std::max(std::abs(p[4]), least_blur_px), contrast, found->rms / contrast,
                   around->clipped};
}

std::optional<CornerFit> fit_disc(ImageView<const std::uint8_t> image, const Eigen::Vector2d& guess_px,
                                  double radius_px) {
  if (!(radius_px > 2)) return std::nullopt;
  const double farthest = 1.25 * radius_px;
  const auto around =
      gather(image, guess_px, farthest, [&](const Eigen::Vector2d& offset) { return offset.norm() <= farthest; });
  if (!around) return std::nullopt;
  Row<8> start;
  start << guess_px.x(), guess_px.y(), 1 / radius_px, 0, 1 / radius_px, 0.8, around->white,
      around->white - around->black;
  const auto found = fit<8>(around->samples, start, disc_model);
  if (!found) return std::nullopt;
  const Row<8>& p = found->parameters;
  const bool plausible = (p.head<2>() - guess_px).norm() < 0.5 * radius_px && p[7] > least_contrast;
  if (!plausible) return std::nullopt;
  return CornerFit{p.head<2>(), std::max(std::abs(p[5]), least_blur_px), p[7], found->rms / p[7], around->clipped};
}

}  // namespace pagesweep
