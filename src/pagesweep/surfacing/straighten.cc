// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/straighten.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace pagesweep {
namespace {

constexpr double least_filled = 0.9;  // a corner may be torn off

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

/// Andrew's monotone chain.
std::vector<Eigen::Vector2d> convex_hull(std::vector<Eigen::Vector2d> places) {
  std::ranges::sort(places,
                    [](const auto& a, const auto& b) { return std::pair(a.x(), a.y()) < std::pair(b.x(), b.y()); });
  std::vector<Eigen::Vector2d> hull;
  const auto add_chain = [&](auto begin, auto end) {
    const std::size_t first = hull.size();
    for (auto place = begin; place != end; ++place) {
      while (hull.size() >= first + 2 && cross(hull.back() - hull.end()[-2], *place - hull.back()) <= 0)
        hull.pop_back();
      hull.push_back(*place);
    }
    hull.pop_back();  // the other chain begins with it
  };
  add_chain(places.begin(), places.end());
  add_chain(places.rbegin(), places.rend());
  return hull;
}

double area_of(const std::vector<Eigen::Vector2d>& polygon) {
  double twice = 0;
  for (std::size_t k = 0; k < polygon.size(); ++k) twice += cross(polygon[k], polygon[(k + 1) % polygon.size()]);
  return 0.5 * std::abs(twice);
}

double area_of_box(const std::vector<Eigen::Vector2d>& polygon, double angle_rad) {
  const Eigen::Rotation2Dd upright(-angle_rad);
  Eigen::AlignedBox2d box;
  for (const Eigen::Vector2d& corner : polygon) box.extend(upright * corner);
  return box.volume();
}

}  // namespace

double askew_rad(std::vector<Eigen::Vector2d> places) {
  if (places.size() < 3) return 0;
  const std::vector<Eigen::Vector2d> hull = convex_hull(std::move(places));
  double least = std::numeric_limits<double>::infinity(), angle = 0;
  for (std::size_t k = 0; k < hull.size(); ++k) {
    const Eigen::Vector2d side = hull[(k + 1) % hull.size()] - hull[k];
    const double direction = std::atan2(side.y(), side.x());
    if (const double area = area_of_box(hull, direction); area < least) {
      least = area;
      angle = direction;
    }
  }
  if (!(area_of(hull) > least_filled * least)) return 0;
  const double quarter = 0.5 * std::numbers::pi;
  return angle - quarter * std::ceil(angle / quarter - 0.5);
}

}  // namespace pagesweep
