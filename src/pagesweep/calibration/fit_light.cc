// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/calibration/fit_light.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>

#include "pagesweep/base/error.h"
#include "pagesweep/base/median.h"

namespace pagesweep {
namespace {

constexpr std::size_t least_sightings = 100;
constexpr double least_frames = 10;

std::vector<double> misses(std::span<const LightSighting> sightings, const Light& light) {
  std::vector<double> values;
  for (const LightSighting& seen : sightings) values.push_back(light.plane_at(seen.time).distance(seen.point));
  return values;
}

/// Tukey's biweights for residuals whose scale is their median's.
std::vector<double> robust_weights(const std::vector<double>& residuals) {
  std::vector<double> sizes;
  for (const double residual : residuals) sizes.push_back(std::abs(residual));
  const double limit = 4.7 * std::max(1.4826 * median(sizes), 1e-6);
  std::vector<double> weights;
  for (const double size : sizes) weights.push_back(size < limit ? std::pow(1 - size * size / (limit * limit), 2) : 0);
  return weights;
}

/// The moving plane as x e = o + s t - a x f - c z, linear in o, s, a, c; e along the sweep over the table, f across.
struct Moving {
  Light light;
  double tilt_sigma = 0;
};

/// Direction over the table in which time grows.
Eigen::Vector3d direction_of_sweep(std::span<const LightSighting> sightings) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const LightSighting& seen : sightings) {
    const Eigen::Vector3d row(seen.point.x(), seen.point.y(), 1);
    normal += row * row.transpose();
    right += row * seen.time;
  }
  const Eigen::Vector3d slope = normal.ldlt().solve(right);
  return Eigen::Vector3d(slope.x(), slope.y(), 0).normalized();
}

Moving fit_moving(std::span<const LightSighting> sightings, const std::vector<double>& weights) {
  const Eigen::Vector3d along = direction_of_sweep(sightings), across = Eigen::Vector3d::UnitZ().cross(along);
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  double squares = 0, count = 0;
  for (std::size_t i = 0; i < sightings.size(); ++i) {
    const auto& [point, time] = sightings[i];
    const Eigen::Vector4d row(1, time, -across.dot(point), -point.z());
    const double place = along.dot(point);
    normal += weights[i] * row * row.transpose();
    right += weights[i] * place * row;
    squares += weights[i] * place * place;
    count += weights[i];
  }
  // A slope of about 1 against z is as good as known beforehand, against what a sighting scatters by.
  constexpr double usual_scatter_mm = 0.1;
  normal(3, 3) += usual_scatter_mm * usual_scatter_mm;
  const Eigen::Vector4d solution = normal.ldlt().solve(right);
  const double variance = std::max(0.0, squares - solution.dot(right)) / std::max(1.0, count - 4);
  const Eigen::Vector3d direction = along + solution(2) * across + solution(3) * Eigen::Vector3d::UnitZ();
  const double length = direction.norm();
  const double scatter = std::max(variance, usual_scatter_mm * usual_scatter_mm);
  return {Light(TranslatingPlane{direction / length, solution(0) / length, solution(1) / length}),
          std::sqrt(scatter * normal.inverse()(3, 3))};
}

Moving fit_moving(std::span<const LightSighting> sightings) {
  std::vector<double> weights(sightings.size(), 1.0);
  Moving moving;
  for (int pass = 0; pass < 6; ++pass) {
    moving = fit_moving(sightings, weights);
    weights = robust_weights(misses(sightings, moving.light));
  }
  return moving;
}

/// A plane that turns: its axis as a direction and a point, and the plane's angle at time 0 and by frame.
class Turning {
 public:
  static constexpr int unknowns = 6;
  using Change = Eigen::Matrix<double, unknowns, 1>;

  /// \return nothing if the sightings give no hint of an axis
  static std::optional<Turning> start(std::span<const LightSighting> sightings) {
    auto [first, last] = std::ranges::minmax(sightings, {}, &LightSighting::time);
    const double begin = first.time, end = last.time, third = (end - begin) / 3;
    const auto part = [&](double from) {
      std::vector<LightSighting> some;
      for (const LightSighting& seen : sightings)
        if (seen.time >= from && seen.time <= from + third) some.push_back(seen);
      return some;
    };
    const auto early = part(begin), late = part(end - third);
    if (early.size() < least_sightings / 4 || late.size() < least_sightings / 4) return std::nullopt;
    const double t0 = begin + 0.5 * third, t1 = end - 0.5 * third;
    const Plane a = fit_moving(early).light.plane_at(t0), b = fit_moving(late).light.plane_at(t1);
    const Eigen::Vector3d axis = a.normal.cross(b.normal);
    const double sine = axis.norm();
    if (sine < 1e-4) return std::nullopt;  // an axis kilometres away
    Turning turning;
    turning.axis_ = axis / sine;
    Eigen::Matrix3d planes;
    planes << a.normal.transpose(), b.normal.transpose(), turning.axis_.transpose();
    turning.point_ = planes.inverse() * Eigen::Vector3d(a.offset, b.offset, 0);
    turning.rate_ = std::asin(std::min(1.0, sine)) / (t1 - t0);
    turning.normal_ = Eigen::AngleAxisd(-turning.rate_ * t0, turning.axis_) * a.normal;
    return turning;
  }

  Light light() const { return Light(RotatingPlane{point_, axis_, normal_, 0, rate_}); }

  /// Changed by small turns of the axis (2), shifts of its point (2), of the angle and of its rate.
  Turning changed(const Change& by) const {
    const Eigen::Vector3d u = axis_.unitOrthogonal(), v = axis_.cross(u);
    Turning next = *this;
    const Eigen::Vector3d turn = by(0) * u + by(1) * v;
    const Eigen::Matrix3d rotation = turn.norm() > 0
                                         ? Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix()
                                         : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
    next.axis_ = (rotation * axis_).normalized();
    next.normal_ = (Eigen::AngleAxisd(by(4), next.axis_) * (rotation * normal_)).normalized();
    next.point_ = point_ + by(2) * u + by(3) * v;
    next.rate_ = rate_ + by(5);
    return next;
  }

  /// Levenberg-Marquardt with derivatives by differences.
  void refine(std::span<const LightSighting> sightings) {
    const Change steps{1e-6, 1e-6, 1e-3, 1e-3, 1e-6, 1e-8};
    double damping = 1e-3;
    for (int i = 0; i < 40; ++i) {
      const std::vector<double> here = misses(sightings, light()), weights = robust_weights(here);
      Eigen::MatrixXd jacobian(static_cast<Eigen::Index>(here.size()), unknowns);
      for (int k = 0; k < unknowns; ++k) {
        const std::vector<double> there = misses(sightings, changed(steps(k) * Change::Unit(k)).light());
        for (std::size_t s = 0; s < here.size(); ++s)
          jacobian(static_cast<Eigen::Index>(s), k) = (there[s] - here[s]) / steps(k);
      }
      const Eigen::Map<const Eigen::VectorXd> miss(here.data(), static_cast<Eigen::Index>(here.size()));
      const Eigen::Map<const Eigen::VectorXd> weight(weights.data(), miss.size());
      Eigen::MatrixXd normal = jacobian.transpose() * weight.asDiagonal() * jacobian;
      normal.diagonal() *= 1 + damping;
      const Change change = normal.ldlt().solve(-(jacobian.transpose() * weight.asDiagonal() * miss));
      const Turning next = changed(change);
      const double before = cost(here, weights), after = cost(misses(sightings, next.light()), weights);
      if (after < before) *this = next;
      damping = after < before ? damping / 5 : damping * 10;
      if (after < before && before - after < 1e-9 * before) break;
    }
  }

 private:
  static double cost(const std::vector<double>& miss, const std::vector<double>& weights) {
    double sum = 0;
    for (std::size_t i = 0; i < miss.size(); ++i) sum += weights[i] * miss[i] * miss[i];
    return sum;
  }

  Eigen::Vector3d axis_, point_, normal_;  ///< normal_ at time 0
  double rate_ = 0;                        ///< [rad/frame]
};

/// Robust rms, and how many sightings take part in it.
std::pair<double, std::size_t> scatter(std::span<const LightSighting> sightings, const Light& light) {
  const std::vector<double> miss = misses(sightings, light), weights = robust_weights(miss);
  double squares = 0;
  std::size_t used = 0;
  for (std::size_t i = 0; i < miss.size(); ++i) {
    if (!(weights[i] > 0)) continue;
    squares += miss[i] * miss[i];
    ++used;
  }
  return {std::sqrt(squares / static_cast<double>(std::max<std::size_t>(1, used))), used};
}

std::vector<LightSighting> every_other(std::span<const LightSighting> sightings, std::size_t from) {
  std::vector<LightSighting> some;
  for (std::size_t i = from; i < sightings.size(); i += 2) some.push_back(sightings[i]);
  return some;
}

std::optional<Light> fit_turning(std::span<const LightSighting> sightings) {
  auto turning = Turning::start(sightings);
  if (!turning) return std::nullopt;
  turning->refine(sightings);
  return turning->light();
}

bool turning_predicts_better(std::span<const LightSighting> sightings) {
  constexpr double clearly = 0.9;
  const auto taught = every_other(sightings, 0), asked = every_other(sightings, 1);
  const auto turning = fit_turning(taught);
  return turning && scatter(asked, *turning).first < clearly * scatter(asked, fit_moving(taught).light).first;
}

}  // namespace

LightFit fit_light(std::span<const LightSighting> sightings) {
  if (sightings.size() < least_sightings)
    throw Error(ErrorKind::no_result,
                fmt::format("the light was seen at {} places of the board only, {} are needed: let the sweep cross it",
                            sightings.size(), least_sightings));
  const auto [first, last] = std::ranges::minmax(sightings, {}, &LightSighting::time);
  if (last.time - first.time < least_frames)
    throw Error(ErrorKind::no_result,
                fmt::format("the light crosses the board within {:.1f} frames, {:g} are needed: take frames more often",
                            last.time - first.time, least_frames));
  LightFit fit;
  const Moving moving = fit_moving(sightings);
  fit.light = moving.light;
  fit.tilt_sigma = moving.tilt_sigma;
  if (turning_predicts_better(sightings)) {
    fit.light = *fit_turning(sightings);
    fit.turns = true;
  }
  std::tie(fit.rms_mm, fit.used) = scatter(sightings, fit.light);
  return fit;
}

}  // namespace pagesweep
