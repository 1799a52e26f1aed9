// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/triangulation/calibrate_light.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include "pagesweep/base/b_spline.h"
#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

/// A point and when the light passed it.
struct Crossing {
  Eigen::Vector3d point;              ///< [mm] rig frame, later along (e, f, z)
  double time;                        ///< [frames]
  double weight;                      ///< [1/mm^2]
  double relative = 0;                ///< the time from -1 to 1
  int first = 0;                      ///< of the four splines at that time,
  std::array<double, 4> spline = {};  ///< and their values
};

/// Direction over the table in which time grows, from a straight line fit of time to place.
Eigen::Vector3d sweep_direction(const std::vector<Crossing>& crossings) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const Crossing& s : crossings) {
    const Eigen::Vector3d row(s.point.x(), s.point.y(), 1);
    normal += row * row.transpose();
    right += row * s.time;
  }
  const Eigen::Vector3d slope = normal.ldlt().solve(right);
  return Eigen::Vector3d(slope.x(), slope.y(), 0).normalized();
}

/// e . X = d(t) - (a0 + a1 s) f . X - (b0 + b1 s) z, with s the time from -1 to 1.
class SweepFit {
 public:
  SweepFit(std::vector<Crossing> crossings, double begin, double end, const Eigen::Vector3d& along)
      : crossings_(std::move(crossings)), begin_(begin), end_(end), splines_(breaks(begin, end)), along_(along) {
    const Eigen::Vector3d across = Eigen::Vector3d::UnitZ().cross(along_);
    for_each_crossing([&](std::size_t k) {
      Crossing& s = crossings_[k];
      s.point = {along_.dot(s.point), across.dot(s.point), s.point.z()};
      s.relative = relative(s.time);
      const BSplineRow row = splines_.at(s.time);
      s.first = row.first;
      std::copy_n(row.value.begin(), 4, s.spline.begin());
    });
  }

  /// Robust fit: Tukey's weights on the residual over a scale from its median.
  void solve() {
    std::vector<double> robust(crossings_.size(), 1.0);
    for (int pass = 0; pass < 4; ++pass) {
      solve(robust);
      scale_ = 1.4826 * median_residual();
      const double limit = 4.7 * std::max(scale_, 1e-6);
      for_each_crossing([&](std::size_t k) {
        const double part = residual(crossings_[k]) / limit;
        robust[k] = std::abs(part) < 1 ? std::pow(1 - part * part, 2) : 0;
      });
    }
    used_ = std::count_if(robust.begin(), robust.end(), [](double w) { return w > 0; });
  }

  LightSweep describe() const {
    LightSweep sweep;
    const int first = static_cast<int>(std::floor(begin_)), last = static_cast<int>(std::ceil(end_));
    RecordedPlanes planes{first, {}};
    std::vector<double> ways;
    for (int i = first; i <= last; ++i) {
      planes.planes.push_back(plane_at(i));
      ways.push_back(way_at(i));
    }
    const auto count = static_cast<double>(ways.size());
    double st = 0, stt = 0, sw = 0, stw = 0;
    for (std::size_t i = 0; i < ways.size(); ++i) {
      const auto t = static_cast<double>(i);
      st += t;
      stt += t * t;
      sw += ways[i];
      stw += t * ways[i];
    }
    sweep.mm_per_frame = (count * stw - st * sw) / (count * stt - st * st);
    const double start = (sw - sweep.mm_per_frame * st) / count;
    double squares = 0;
    for (std::size_t i = 0; i < ways.size(); ++i) {
      const double off = ways[i] - start - sweep.mm_per_frame * static_cast<double>(i);
      squares += off * off;
      sweep.unevenness_max_mm = std::max(sweep.unevenness_max_mm, std::abs(off));
    }
    sweep.unevenness_rms_mm = std::sqrt(squares / count);
    sweep.misfit_mm = scale_;
    sweep.points = used_;
    sweep.light = Light(std::move(planes));
    return sweep;
  }

 private:
  static std::vector<double> breaks(double begin, double end) {
    const int intervals = std::max(2, static_cast<int>((end - begin) / 4));
    std::vector<double> values;
    for (int i = 0; i <= intervals; ++i) values.push_back(begin + i * (end - begin) / intervals);
    return values;
  }
  /// On all threads.
  template <class Body>
  void for_each_crossing(const Body& body) const {
    parallel_ranges(static_cast<int>(crossings_.size()), at_once, [&](int begin, int end) {
      for (int k = begin; k < end; ++k) body(static_cast<std::size_t>(k));
    });
  }
  double relative(double time) const { return 2 * (time - begin_) / (end_ - begin_) - 1; }
  int spline_count() const { return splines_.size(); }

  /// Least squares: normal unknowns = right; of the matrix, the lower half.
  struct Equations {
    Eigen::MatrixXd normal;
    Eigen::VectorXd right;
  };
  static void add(const Crossing& s, double weight, Equations& equations);
  Equations sum(const std::vector<double>& robust) const;
  void solve(const std::vector<double>& robust);
  double way_at(double time) const {
    const BSplineRow row = splines_.at(time);
    double way = 0;
    for (int k = 0; k < 4; ++k) way += row.value[static_cast<std::size_t>(k)] * unknowns_[4 + row.first + k];
    return way;
  }
  double residual(const Crossing& s) const {
    double way = 0;
    for (int k = 0; k < 4; ++k) way += s.spline[static_cast<std::size_t>(k)] * unknowns_[4 + s.first + k];
    return s.point.x() + (unknowns_[0] + s.relative * unknowns_[1]) * s.point.y() +
           (unknowns_[2] + s.relative * unknowns_[3]) * s.point.z() - way;
  }
  double median_residual() const {
    std::vector<double> misses(crossings_.size());
    for_each_crossing([&](std::size_t k) { misses[k] = std::abs(residual(crossings_[k])); });
    const auto middle = misses.begin() + static_cast<std::ptrdiff_t>(misses.size() / 2);
    std::nth_element(misses.begin(), middle, misses.end());
    return *middle;
  }
  Plane plane_at(double time) const {
    const double r = relative(time);
    const Eigen::Vector3d across = Eigen::Vector3d::UnitZ().cross(along_);
    const Eigen::Vector3d normal = along_ + (unknowns_[0] + r * unknowns_[1]) * across +
                                   (unknowns_[2] + r * unknowns_[3]) * Eigen::Vector3d::UnitZ();
    return {normal.normalized(), way_at(time) / normal.norm()};
  }

  static constexpr int at_once = 4096;  ///< crossings

  std::vector<Crossing> crossings_;
  double begin_, end_;
  CubicBSplines splines_;
  Eigen::Vector3d along_;
  Eigen::VectorXd unknowns_;  ///< a0, a1, b0, b1, spline coefficients of d
  double scale_ = 0;          ///< [mm]
  std::int64_t used_ = 0;
};

void SweepFit::add(const Crossing& s, double weight, Equations& equations) {
  std::array<double, 8> value{-s.point.y(), -s.relative * s.point.y(), -s.point.z(), -s.relative * s.point.z()};
  std::array<int, 8> place{0, 1, 2, 3};
  for (std::size_t j = 0; j < 4; ++j) {
    value[4 + j] = s.spline[j];
    place[4 + j] = 4 + s.first + static_cast<int>(j);
  }
  for (std::size_t i = 0; i < 8; ++i) {
    equations.right[place[i]] += weight * value[i] * s.point.x();
    for (std::size_t j = 0; j <= i; ++j) equations.normal(place[i], place[j]) += weight * value[i] * value[j];
  }
}

/// Parts are summed side by side, and then in their order.
SweepFit::Equations SweepFit::sum(const std::vector<double>& robust) const {
  const int count = 4 + spline_count(), crossings = static_cast<int>(crossings_.size());
  const Equations none{Eigen::MatrixXd::Zero(count, count), Eigen::VectorXd::Zero(count)};
  std::vector<Equations> parts(static_cast<std::size_t>((crossings + at_once - 1) / at_once), none);
  parallel_ranges(crossings, at_once, [&](int begin, int end) {
    Equations& part = parts[static_cast<std::size_t>(begin / at_once)];
    for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k)
      if (robust[k] != 0) add(crossings_[k], robust[k] * crossings_[k].weight, part);
  });
  Equations all = none;
  for (const Equations& part : parts) {
    all.normal += part.normal;
    all.right += part.right;
  }
  return all;
}

void SweepFit::solve(const std::vector<double>& robust) {
  const int count = 4 + spline_count();
  auto [normal, right] = sum(robust);
  // A slope of about 1 is as good as known beforehand; frames without points take their neighbours' speed.
  for (int i = 0; i < 4; ++i) normal(i, i) += 10;
  const std::vector<double> weights(splines_.breaks().size() - 1, 1.0);
  normal.bottomRightCorner(count - 4, count - 4) += splines_.bending(weights);
  unknowns_ = normal.selfadjointView<Eigen::Lower>().ldlt().solve(right);
}

}  // namespace

LightCalibration::LightCalibration(std::size_t pixels) {
  // More points would not change the planes by a micrometre.
  constexpr std::size_t enough = 100000;
  stride_ = std::max<std::size_t>(1, pixels / enough);
}

void LightCalibration::add(const PointMap& points, const TimeMap& times, const PixelSet* only) {
  if (points.width() != times.width() || points.height() != times.height())
    throw std::invalid_argument("calibrate_light: points and times differ in size");
  for (std::size_t i = 0; i < points.x.size(); i += stride_) {
    if (only && only->data()[i] == 0) continue;
    const float sigma = points.sigma.data()[i];
    if (points.status.data()[i] != PixelStatus::ok || times.status.data()[i] != PixelStatus::ok || !(sigma > 0))
      continue;
    sightings_.push_back(
        {{points.x.data()[i], points.y.data()[i], points.z.data()[i]}, times.time.data()[i], 1 / (sigma * sigma)});
  }
}

std::optional<LightSweep> LightCalibration::fit() {
  fitted_ = sightings_.size();
  std::vector<Crossing> crossings;
  for (const Sighting& s : sightings_)
    crossings.push_back({.point = s.point.cast<double>(), .time = s.time, .weight = s.weight});
  if (crossings.size() < 1000) return std::nullopt;
  const auto [begin, end] = std::ranges::minmax(crossings, {}, &Crossing::time);
  if (!(end.time - begin.time >= 10)) return std::nullopt;
  const Eigen::Vector3d along = sweep_direction(crossings);
  SweepFit fit(std::move(crossings), begin.time, end.time, along);
  fit.solve();
  return fit.describe();
}

std::optional<LightSweep> calibrate_light(std::span<const PointMap> points, std::span<const TimeMap> times) {
  if (points.size() != times.size()) throw std::invalid_argument("calibrate_light: as many points as times, please");
  std::size_t pixels = 0;
  for (const PointMap& map : points) pixels += map.x.size();
  LightCalibration calibration(pixels);
  for (std::size_t c = 0; c < points.size(); ++c) calibration.add(points[c], times[c]);
  return calibration.fit();
}

}  // namespace pagesweep
