// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/calibration/accuracy.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "pagesweep/camera/light.h"

namespace pagesweep {
namespace {

constexpr int cells = 24;  ///< of a map along its longer side
constexpr float nan = std::numeric_limits<float>::quiet_NaN();

/// Columns of the covariance that belong to a sensor, and the columns of parameter_jacobian() that they are.
struct Columns {
  std::vector<Eigen::Index> in_covariance, in_jacobian;
};

Columns columns_of(const Calibration& calibration, const Sensor& sensor) {
  Columns columns;
  const auto names = parameter_names(sensor.model);
  const auto& parameters = calibration.solution.parameters;
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    if (parameters[k].owner != sensor.name) continue;
    const auto place = std::ranges::find(names, parameters[k].name) - names.begin();
    columns.in_covariance.push_back(static_cast<Eigen::Index>(k));
    columns.in_jacobian.push_back(place);
  }
  return columns;
}

/// What each sensor of the calibration contributes.
struct Sensors {
  std::vector<Scanner> models;
  std::vector<Columns> columns;
};

/// d (pixel) / d (all parameters), for one sensor and point.
Eigen::MatrixXd wide_jacobian(const Calibration& calibration, const Sensors& sensors, std::size_t k,
                              const Eigen::Vector3d& point) {
  const Eigen::MatrixXd own = parameter_jacobian(sensors.models[k].model(), point);
  Eigen::MatrixXd wide = Eigen::MatrixXd::Zero(2, calibration.solution.covariance.cols());
  const Columns& columns = sensors.columns[k];
  for (std::size_t c = 0; c < columns.in_covariance.size(); ++c)
    wide.col(columns.in_covariance[c]) = own.col(columns.in_jacobian[c]);
  return wide;
}

bool sees(const Scanner& sensor, const Eigen::Vector3d& point) {
  const auto pixel = sensor.project(point);
  return pixel && sensor.sees(*pixel);
}

/// d (triangulated point) / d (all parameters): the least-squares point moves by -(A'A)^-1 A'B for A = d pixels / d
/// point, B = d pixels / d parameters. Empty where fewer than two cameras see it.
Eigen::MatrixXd point_jacobian(const Calibration& calibration, const Sensors& sensors, const Eigen::Vector3d& point) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(3, calibration.solution.covariance.cols());
  int seen = 0;
  for (std::size_t k = 0; k < calibration.rig.cameras.size(); ++k) {
    if (!sees(sensors.models[k], point)) continue;
    const Matrix23d a = sensors.models[k].project_jacobian(point);
    normal += a.transpose() * a;
    right += a.transpose() * wide_jacobian(calibration, sensors, k, point);
    ++seen;
  }
  return seen < 2 ? Eigen::MatrixXd() : Eigen::MatrixXd(-normal.ldlt().solve(right));
}

float deviation(const Eigen::MatrixXd& jacobian, const Eigen::MatrixXd& covariance) {
  return static_cast<float>(std::sqrt((jacobian * covariance).cwiseProduct(jacobian).sum()));
}

/// The part of the plane at a height that is in the pictures of two cameras, as a rectangle around it.
Eigen::AlignedBox2d common_view(const Calibration& calibration, double height_mm) {
  const Plane plane{Eigen::Vector3d::UnitZ(), height_mm};
  std::vector<Eigen::AlignedBox2d> views;
  for (const Camera& camera : calibration.rig.cameras) {
    Eigen::AlignedBox2d& view = views.emplace_back();
    for (const double u : {0.0, 0.5, 1.0})
      for (const double v : {0.0, 0.5, 1.0}) {
        const auto ray = camera.ray({u * (camera.width - 1), v * (camera.height - 1)});
        const auto point = ray ? plane.meet(*ray) : std::nullopt;
        if (point) view.extend(Eigen::Vector2d(point->head<2>()));
      }
  }
  Eigen::AlignedBox2d common;
  for (std::size_t a = 0; a < views.size(); ++a)
    for (std::size_t b = a + 1; b < views.size(); ++b) common.extend(views[a].intersection(views[b]));
  return common;
}

AccuracyMap predict_at(const Calibration& calibration, const Sensors& sensors, double height_mm) {
  const Eigen::AlignedBox2d view = common_view(calibration, height_mm);
  AccuracyMap map{height_mm, view.min(), 1, {}, {}};
  if (view.isEmpty()) return map;
  map.spacing_mm = view.sizes().maxCoeff() / cells;
  const auto count = [&](double length) { return 1 + static_cast<int>(length / map.spacing_mm); };
  const bool has_scanner = calibration.rig.scanner.has_value();
  map.point_mm = Image<float>(count(view.sizes().x()), count(view.sizes().y()), nan);
  if (has_scanner) map.scan_px = Image<float>(map.point_mm.width(), map.point_mm.height(), nan);
  for (int j = 0; j < map.point_mm.height(); ++j)
    for (int i = 0; i < map.point_mm.width(); ++i) {
      const Eigen::Vector2d place = map.low_mm + map.spacing_mm * Eigen::Vector2d(i, j);
      const Eigen::Vector3d point(place.x(), place.y(), height_mm);
      const Eigen::MatrixXd moves = point_jacobian(calibration, sensors, point);
      if (moves.size() == 0) continue;
      map.point_mm(i, j) = deviation(moves, calibration.solution.covariance);
      if (!has_scanner || !sees(sensors.models.back(), point)) continue;
      // What is looked up in the scan is the triangulated point, which errs together with the scanner.
      const Eigen::MatrixXd scan = wide_jacobian(calibration, sensors, sensors.models.size() - 1, point) +
                                   sensors.models.back().project_jacobian(point) * moves;
      map.scan_px(i, j) = deviation(scan, calibration.solution.covariance);
    }
  return map;
}

}  // namespace

std::vector<AccuracyMap> predict_accuracy(const Calibration& calibration, std::span<const double> heights_mm) {
  std::vector<AccuracyMap> maps;
  if (calibration.rig.cameras.size() < 2) return maps;
  Sensors sensors;
  for (const Sensor& sensor : calibration.bundle.sensors) {
    sensors.models.emplace_back(sensor.model);
    sensors.columns.push_back(columns_of(calibration, sensor));
  }
  for (const double height : heights_mm) maps.push_back(predict_at(calibration, sensors, height));
  return maps;
}

}  // namespace pagesweep
