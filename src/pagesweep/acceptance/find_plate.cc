// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/acceptance/find_plate.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "pagesweep/acceptance/shapes.h"
#include "pagesweep/base/image.h"

namespace pagesweep {
namespace {

constexpr int most_planes = 8;          // that are looked at
constexpr int hypotheses = 200;         // a plane
constexpr std::size_t judges = 3000;    // points that vote on a hypothesis
constexpr double normal_cosine = 0.94;  // 20 degrees: the normals are only for orientation
constexpr double first_reach_mm = 2;    // distance of a hypothesis' points: its normal is that of one patch
constexpr double last_reach_mm = 0.8;   // of a refined plane's points
constexpr double size_tolerance = 0.1;
constexpr double cells_along = 60;  // cells on the plate's longer side, for what is connected
constexpr std::size_t fewest_points = 50;

using Points = std::vector<OrientedPoint>;

bool is_on(const Plane& plane, const OrientedPoint& point, double reach_mm) {
  return std::abs(plane.distance(point.position)) <= reach_mm &&
         std::abs(plane.normal.dot(point.normal)) >= normal_cosine;
}

std::vector<Eigen::Vector3d> positions_on(const Plane& plane, const Points& points, double reach_mm) {
  std::vector<Eigen::Vector3d> positions;
  for (const OrientedPoint& point : points)
    if (is_on(plane, point, reach_mm)) positions.push_back(point.position);
  return positions;
}

/// The plane with most points near it.
Plane find_plane(const Points& points) {
  std::mt19937 random(1);  // its numbers are the same everywhere; those of std::uniform_int_distribution are not
  const std::size_t stride = std::max<std::size_t>(1, points.size() / judges);
  Plane best;
  std::size_t most = 0;
  for (int k = 0; k < hypotheses; ++k) {
    const OrientedPoint& one = points[random() % points.size()];
    const Plane plane{one.normal, one.normal.dot(one.position)};
    std::size_t count = 0;
    for (std::size_t i = 0; i < points.size(); i += stride) count += is_on(plane, points[i], first_reach_mm);
    if (count > most) best = plane, most = count;
  }
  for (const double reach_mm : {first_reach_mm, 1.5, 1.1, last_reach_mm, last_reach_mm})
    if (const auto near = positions_on(best, points, reach_mm); near.size() >= 3) best = fit_plane(near);
  return best;
}

/// Points on a plane in its own coordinates.
struct Patch {
  Eigen::Vector3d origin, u, v;
  std::vector<Eigen::Vector2d> places;
};

Patch patch_of(const Plane& plane, std::span<const Eigen::Vector3d> positions) {
  Patch patch{plane.offset * plane.normal, plane.normal.unitOrthogonal(), {}, {}};
  patch.v = plane.normal.cross(patch.u);
  for (const Eigen::Vector3d& position : positions)
    patch.places.emplace_back(patch.u.dot(position - patch.origin), patch.v.dot(position - patch.origin));
  return patch;
}

/// Number of the connected part that each occupied cell belongs to, from 1 on; 0: empty.
Image<int> label_parts(const Image<int>& counts) {
  Image<int> labels(counts.width(), counts.height());
  int label = 0;
  std::vector<Eigen::Vector2i> front;
  const auto visit = [&](int x, int y) {
    if (!counts.contains(x, y) || counts(x, y) == 0 || labels(x, y) != 0) return;
    labels(x, y) = label;
    front.emplace_back(x, y);
  };
  for (int y = 0; y < counts.height(); ++y)
    for (int x = 0; x < counts.width(); ++x) {
      if (counts(x, y) == 0 || labels(x, y) != 0) continue;
      ++label;
      for (visit(x, y); !front.empty();) {
        const Eigen::Vector2i at = front.back();
        front.pop_back();
        for (const auto& [dx, dy] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) visit(at.x() + dx, at.y() + dy);
      }
    }
  return labels;
}

/// Only the connected part of the patch with most points.
void keep_largest_part(Patch& patch, double cell_mm) {
  Eigen::Vector2d low = patch.places[0], high = low;
  for (const Eigen::Vector2d& place : patch.places) low = low.cwiseMin(place), high = high.cwiseMax(place);
  const Eigen::Vector2i size = ((high - low) / cell_mm).cast<int>() + Eigen::Vector2i::Ones();
  if (std::max(size.x(), size.y()) > 4000) return;  // points at infinity: no plate
  const auto cell = [&](const Eigen::Vector2d& place) -> Eigen::Vector2i {
    return ((place - low) / cell_mm).cast<int>();
  };
  Image<int> counts(size.x(), size.y());
  for (const Eigen::Vector2d& place : patch.places) ++counts(cell(place).x(), cell(place).y());
  const Image<int> labels = label_parts(counts);
  std::vector<int> sizes(labels.size() + 1);
  for (std::size_t i = 0; i < labels.size(); ++i) sizes[static_cast<std::size_t>(labels.data()[i])] += counts.data()[i];
  const auto largest = static_cast<int>(std::max_element(sizes.begin() + 1, sizes.end()) - sizes.begin());
  std::erase_if(patch.places, [&](const auto& place) { return labels(cell(place).x(), cell(place).y()) != largest; });
}

/// From the value that one in a thousand undercuts to the one that as many exceed: a stray point is no edge.
std::pair<double, double> extent_of(std::vector<double>& values) {
  const auto tail = static_cast<std::ptrdiff_t>(values.size() / 1000);
  std::nth_element(values.begin(), values.begin() + tail, values.end());
  const double low = values[static_cast<std::size_t>(tail)];
  std::nth_element(values.begin(), values.end() - 1 - tail, values.end());
  return {low, values[values.size() - 1 - static_cast<std::size_t>(tail)]};
}

/// The rectangle with the smallest area around the patch, to a quarter of a degree.
Plate rectangle_around(const Plane& plane, const Patch& patch) {
  Plate best{plane, {}, {}, {}};
  double smallest = std::numeric_limits<double>::infinity();
  std::vector<double> s(patch.places.size()), t(s.size());
  for (int quarter = 0; quarter < 360; ++quarter) {
    const double angle = quarter * std::numbers::pi / 720;
    const Eigen::Vector2d right(std::cos(angle), std::sin(angle)), up(-right.y(), right.x());
    for (std::size_t i = 0; i < s.size(); ++i) s[i] = right.dot(patch.places[i]), t[i] = up.dot(patch.places[i]);
    const auto [s0, s1] = extent_of(s);
    const auto [t0, t1] = extent_of(t);
    if (!((s1 - s0) * (t1 - t0) < smallest)) continue;
    smallest = (s1 - s0) * (t1 - t0);
    const bool is_long = s1 - s0 >= t1 - t0;
    const Eigen::Vector2d middle = 0.5 * (s0 + s1) * right + 0.5 * (t0 + t1) * up, longer = is_long ? right : up;
    best.middle = patch.origin + middle.x() * patch.u + middle.y() * patch.v;
    best.along = longer.x() * patch.u + longer.y() * patch.v;
    best.size_mm = {std::max(s1 - s0, t1 - t0), std::min(s1 - s0, t1 - t0)};
  }
  if (best.along.x() < 0) best.along = -best.along;
  return best;
}

bool has_size(const Plate& plate, const Eigen::Vector2d& size_mm) {
  return ((plate.size_mm - size_mm).array().abs() <= size_tolerance * size_mm.array()).all();
}

}  // namespace

std::optional<Plate> find_plate(std::span<const OrientedPoint> points, const Eigen::Vector2d& size_mm) {
  Points rest(points.begin(), points.end());
  for (int k = 0; k < most_planes && rest.size() >= fewest_points; ++k) {
    Plane plane = find_plane(rest);
    const std::vector<Eigen::Vector3d> near = positions_on(plane, rest, last_reach_mm);
    if (near.size() < fewest_points) return std::nullopt;
    const auto one =
        std::find_if(rest.begin(), rest.end(), [&](const auto& p) { return is_on(plane, p, last_reach_mm); });
    if (plane.normal.dot(one->normal) < 0)
      plane = {-plane.normal, -plane.offset};  // towards the cameras, as the points' are
    Patch patch = patch_of(plane, near);
    keep_largest_part(patch, size_mm.x() / cells_along);
    Plate plate = rectangle_around(plane, patch);
    if (has_size(plate, size_mm)) {
      plate.size_mm = size_mm;
      return plate;
    }
    std::erase_if(rest, [&](const auto& point) { return is_on(plane, point, first_reach_mm); });
  }
  return std::nullopt;
}

}  // namespace pagesweep
