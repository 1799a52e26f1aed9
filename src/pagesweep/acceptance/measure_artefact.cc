// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/acceptance/measure_artefact.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <stdexcept>

#include "pagesweep/acceptance/find_spheres.h"
#include "pagesweep/base/error.h"

namespace pagesweep {
namespace {

constexpr double patch_mm = 2.5;        // of the surface around a point whose normal is sought
constexpr int most_oriented = 120'000;  // points with a normal, a camera
constexpr std::size_t fewest_points = 100;
constexpr double mm_per_cell = 1;  // of a map of deviations, unless that has too few points
constexpr double points_per_cell = 4;

/// Points that look at a part of the artefact.
struct Selection {
  std::vector<Eigen::Vector3d> positions;
  std::vector<double> sigmas;  ///< [mm] perpendicular to the part
  std::size_t far_points = 0;

  void add(const SeenPoint& point, double distance_mm, const Eigen::Vector3d& normal, double reach_mm) {
    if (!(std::abs(distance_mm) <= reach_mm)) {
      ++far_points;
      return;
    }
    positions.push_back(point.position);
    sigmas.push_back(point.sigma_mm * std::abs(normal.dot(point.ray().direction)));
  }
};

/// The points whose viewing ray meets the plate inside its rim.
Selection select_plate(std::span<const SeenPoint> points, const Plate& plate, const AcceptanceOptions& options) {
  const Eigen::Vector2d half = 0.5 * plate.size_mm - Eigen::Vector2d::Constant(options.plate_edge_mm);
  Selection selection;
  for (const SeenPoint& point : points)
    if (const auto hit = plate.plane.meet(point.ray());
        hit && (plate.place_of(*hit).array().abs() <= half.array()).all())
      selection.add(point, plate.plane.distance(point.position), plate.plane.normal, options.reach_mm);
  return selection;
}

/// Where a viewing ray meets the sphere first, as the normal there; nothing if it passes by.
std::optional<Eigen::Vector3d> normal_seen(const Sphere& sphere, const SeenPoint& point) {
  const Ray ray = point.ray();
  const double along = ray.direction.dot(sphere.center - ray.origin);
  const double squared = sphere.radius_mm * sphere.radius_mm - (sphere.center - ray.at(along)).squaredNorm();
  if (!(along > 0 && squared > 0)) return std::nullopt;
  return (ray.at(along - std::sqrt(squared)) - sphere.center) / sphere.radius_mm;
}

/// The points whose viewing ray meets the sphere where no camera sees it at a larger angle than the cap's.
Selection select_cap(std::span<const SeenPoint> points, const Sphere& sphere, std::span<const Camera> cameras,
                     const AcceptanceOptions& options) {
  const double least_cosine = std::cos(options.cap_deg * std::numbers::pi / 180);
  std::vector<Eigen::Vector3d> eyes;
  for (const Camera& camera : cameras) eyes.push_back(camera.center());
  Selection selection;
  for (const SeenPoint& point : points) {
    const auto normal = normal_seen(sphere, point);
    if (!normal) continue;
    const Eigen::Vector3d hit = sphere.center + sphere.radius_mm * *normal;
    if (std::all_of(eyes.begin(), eyes.end(),
                    [&](const auto& eye) { return normal->dot((eye - hit).normalized()) >= least_cosine; }))
      selection.add(point, sphere.distance(point.position), *normal, options.reach_mm);
  }
  return selection;
}

/// Takes away the share of the positions with the largest distances.
template <class Shape>
std::vector<Eigen::Vector3d> without_outliers(std::vector<Eigen::Vector3d> positions, const Shape& shape,
                                              double share) {
  const auto discarded = static_cast<std::ptrdiff_t>(share * static_cast<double>(positions.size()));
  std::nth_element(positions.begin(), positions.end() - discarded, positions.end(), [&](const auto& a, const auto& b) {
    return std::abs(shape.distance(a)) < std::abs(shape.distance(b));
  });
  positions.erase(positions.end() - discarded, positions.end());
  return positions;
}

template <class Shape>
double range_of(const Shape& shape, std::span<const Eigen::Vector3d> positions) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const Eigen::Vector3d& position : positions) {
    low = std::min(low, shape.distance(position));
    high = std::max(high, shape.distance(position));
  }
  return high - low;
}

template <class Shape>
Deviations deviations_from(const Shape& shape, const Selection& selection, double discarded_share) {
  Deviations deviations;
  const auto kept = without_outliers(selection.positions, shape, discarded_share);
  deviations.points = selection.positions.size();
  deviations.discarded = deviations.points - kept.size();
  deviations.far_points = selection.far_points;
  deviations.range_mm = range_of(shape, kept);
  deviations.full_range_mm = range_of(shape, selection.positions);
  double squares = 0, claimed = 0;
  for (std::size_t i = 0; i < deviations.points; ++i) {
    squares += std::pow(shape.distance(selection.positions[i]), 2);
    claimed += std::pow(selection.sigmas[i], 2);
  }
  deviations.rms_mm = std::sqrt(squares / static_cast<double>(deviations.points));
  deviations.claimed_rms_mm = std::sqrt(claimed / static_cast<double>(deviations.points));
  return deviations;
}

/// Means of the values in the cells of a plan of that size; `place_of` tells the place on the plan [mm] from its
/// middle, x to the right and y up.
template <class Shape, class PlaceOf>
Image<float> map_of(const Shape& shape, std::span<const Eigen::Vector3d> positions, const Eigen::Vector2d& size_mm,
                    const PlaceOf& place_of) {
  const double cell_mm =
      std::max(mm_per_cell, std::sqrt(points_per_cell * size_mm.prod() / static_cast<double>(positions.size())));
  Image<float> means(static_cast<int>(std::ceil(size_mm.x() / cell_mm)),
                     static_cast<int>(std::ceil(size_mm.y() / cell_mm)));
  Image<float> counts(means.width(), means.height());
  for (const Eigen::Vector3d& position : positions) {
    const Eigen::Vector2d place = place_of(position);
    const int x = static_cast<int>(std::floor((0.5 * size_mm.x() + place.x()) / cell_mm));
    const int y = static_cast<int>(std::floor((0.5 * size_mm.y() - place.y()) / cell_mm));
    if (!means.contains(x, y)) continue;
    means(x, y) += static_cast<float>(shape.distance(position));
    ++counts(x, y);
  }
  for (std::size_t i = 0; i < means.size(); ++i) means.data()[i] /= counts.data()[i];  // 0 / 0: NaN, no value
  return means;
}

/// The same plate on another plane.
Plate moved_to(Plane plane, const Plate& plate) {
  if (plane.normal.dot(plate.plane.normal) < 0) plane = {-plane.normal, -plane.offset};
  const Eigen::Vector3d along = plate.along - plane.normal.dot(plate.along) * plane.normal;
  return {plane, plate.middle - plane.distance(plate.middle) * plane.normal, along.normalized(), plate.size_mm};
}

/// Refits: which points count depends on where the plate is.
PlateResult measure_plate(std::span<const SeenPoint> points, Plate plate, const AcceptanceOptions& options) {
  Selection selection;
  for (int round = 0; round < 3; ++round) {
    selection = select_plate(points, plate, options);
    if (selection.positions.size() < fewest_points) break;
    for (int fit = 0; fit < 2; ++fit)
      plate = moved_to(fit_plane(without_outliers(selection.positions, plate.plane, options.discarded_share)), plate);
  }
  PlateResult result{plate, {}, {}};
  if (selection.positions.size() < fewest_points) return result;
  result.deviations = deviations_from(plate.plane, selection, options.discarded_share);
  result.map =
      map_of(plate.plane, selection.positions, plate.size_mm, [&](const auto& p) { return plate.place_of(p); });
  return result;
}

/// Directions to the right and up of a picture that looks at the sphere as the cameras do on average.
std::pair<Eigen::Vector3d, Eigen::Vector3d> axes_of_view(const Sphere& sphere, std::span<const Camera> cameras) {
  Eigen::Vector3d towards = Eigen::Vector3d::Zero();
  for (const Camera& camera : cameras) towards += (camera.center() - sphere.center).normalized();
  towards.normalize();
  const Eigen::Vector3d up = Eigen::Vector3d(towards.cross(Eigen::Vector3d::UnitX())).normalized();
  return {up.cross(towards), up};
}

SphereResult measure_sphere(std::span<const SeenPoint> points, std::span<const Camera> cameras, Sphere sphere,
                            double diameter_mm, const AcceptanceOptions& options, Eigen::Matrix4d& covariance) {
  Selection selection;
  for (int round = 0; round < 5; ++round) {
    selection = select_cap(points, sphere, cameras, options);
    if (selection.positions.size() < fewest_points) break;
    for (int fit = 0; fit < 2; ++fit)
      sphere = fit_sphere(without_outliers(selection.positions, sphere, options.discarded_share), sphere);
  }
  SphereResult result{sphere, diameter_mm, {}, {}};
  if (selection.positions.size() < fewest_points) return result;
  result.deviations = deviations_from(sphere, selection, options.discarded_share);
  const auto [right, up] = axes_of_view(sphere, cameras);
  result.map = map_of(sphere, selection.positions, Eigen::Vector2d::Constant(diameter_mm), [&](const auto& p) {
    return Eigen::Vector2d(right.dot(p - sphere.center), up.dot(p - sphere.center));
  });
  covariance = covariance_of(sphere, selection.positions, result.deviations.rms_mm);
  return result;
}

SpacingResult spacing_of(std::span<const SphereResult> spheres, std::span<const Eigen::Matrix4d> covariances,
                         double calibrated_mm) {
  const Eigen::Vector3d between = spheres[1].sphere.center - spheres[0].sphere.center;
  const Eigen::Vector3d direction = between.normalized();
  double variance = 0;
  for (const Eigen::Matrix4d& covariance : covariances)
    variance += direction.dot(covariance.topLeftCorner<3, 3>() * direction);
  return {between.norm(), calibrated_mm, std::sqrt(variance)};
}

void check(const AcceptanceOptions& options) {
  if (!(options.cap_deg > 0 && options.cap_deg < 90))
    throw std::invalid_argument("--cap: expected an angle from 0 to 90");
  if (!(options.plate_edge_mm >= 0)) throw std::invalid_argument("--plate-edge: expected a width of at least 0");
  if (!(options.reach_mm > 0)) throw std::invalid_argument("--reach: expected a distance above 0");
  if (!(options.discarded_share >= 0 && options.discarded_share <= 0.003))
    throw std::invalid_argument("--discard: expected a share from 0 to 0.003, which is what the guideline permits");
}

void add_plate(PoseResult& result, std::span<const OrientedPoint> oriented, std::span<const SeenPoint> points,
               const Eigen::Vector2d& size_mm, const AcceptanceOptions& options) {
  result.plate_reason = fmt::format("no flat rectangle of {:g} mm x {:g} mm", size_mm.x(), size_mm.y());
  const auto plate = find_plate(oriented, size_mm);
  if (!plate) return;
  PlateResult measured = measure_plate(points, *plate, options);
  result.plate_reason = "too few points on the plate";
  if (measured.deviations.points == 0) return;
  result.plate_reason.clear();
  result.plate = std::move(measured);
}

void add_spheres(PoseResult& result, const ArtefactPose& pose, std::span<const OrientedPoint> oriented,
                 std::span<const SeenPoint> points, const Artefact& artefact, const AcceptanceOptions& options) {
  const std::vector<double>& diameters = artefact.sphere_diameters_mm;
  result.spheres_reason =
      fmt::format("not {} of the calibrated diameter", diameters.size() == 2 ? "two spheres" : "a sphere");
  const std::vector<Sphere> found = find_spheres(oriented, diameters);
  if (found.empty()) return;
  std::vector<SphereResult> spheres;
  std::vector<Eigen::Matrix4d> covariances(found.size());
  for (std::size_t k = 0; k < found.size(); ++k)
    spheres.push_back(measure_sphere(points, pose.cameras, found[k], diameters[k], options, covariances[k]));
  result.spheres_reason = "too few points on a sphere's cap";
  if (std::any_of(spheres.begin(), spheres.end(), [](const auto& s) { return s.deviations.points == 0; })) return;
  result.spheres_reason.clear();
  if (artefact.spacing_mm) result.spacing = spacing_of(spheres, covariances, *artefact.spacing_mm);
  result.spheres = std::move(spheres);
}

}  // namespace

PoseResult measure_artefact(const ArtefactPose& pose, const Artefact& artefact, const AcceptanceOptions& options) {
  check(options);
  const std::vector<SeenPoint> points = seen_points_of(pose);
  const std::vector<OrientedPoint> oriented = oriented_points_of(pose, patch_mm, most_oriented);
  PoseResult result;
  result.name = pose.name;
  if (artefact.plate_mm) add_plate(result, oriented, points, *artefact.plate_mm, options);
  if (!artefact.sphere_diameters_mm.empty()) add_spheres(result, pose, oriented, points, artefact, options);
  if (!result.plate && result.spheres.empty())
    throw no_result(fmt::format("{}: the points show nothing of the artefact: {}{}{}", pose.name, result.plate_reason,
                                result.plate_reason.empty() || result.spheres_reason.empty() ? "" : ", and ",
                                result.spheres_reason));
  return result;
}

}  // namespace pagesweep
