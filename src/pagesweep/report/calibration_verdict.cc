// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>

#include "pagesweep/report/calibration_report.h"

namespace pagesweep {
namespace {

constexpr int zones = 3;  ///< a side of the picture
constexpr int fewest_corners_a_zone = 5;
constexpr double tilt_rad = 10 * std::numbers::pi / 180;
constexpr int fewest_tilted = 5;
constexpr int few_pictures = 10;
constexpr double good_rms_px = 0.3;
constexpr double most_outliers = 0.05;
constexpr double most_left_out_ratio = 1.15;
constexpr double good_point_mm = 0.05, usable_point_mm = 0.2;
constexpr double near_edge = 0.8;  ///< of half the diagonal

std::string zone_name(int column, int row) {
  static constexpr std::array<const char*, zones> rows{"upper", "middle", "lower"}, columns{"left", "middle", "right"};
  if (column == 1 && row == 1) return "middle";
  return std::string(rows[std::size_t(row)]) + " " + columns[std::size_t(column)];
}

/// Zones that hold no corners, and how far from the middle there are any.
void note_coverage(const Bundle& bundle, int sensor, SensorSummary& summary) {
  const Scanner model(bundle.sensors[std::size_t(sensor)].model);
  const Eigen::Vector2d size(model.width(), model.height());
  std::array<int, zones * zones> counts{};
  for (const Observation& seen : bundle.observations) {
    if (seen.sensor != sensor || !seen.used) continue;
    const Eigen::Vector2d place = (seen.pixel + Eigen::Vector2d(0.5, 0.5)).cwiseQuotient(size);
    const int column = std::clamp(int(place.x() * zones), 0, zones - 1),
              row = std::clamp(int(place.y() * zones), 0, zones - 1);
    ++counts[std::size_t(row * zones + column)];
    const double radius = (seen.pixel - 0.5 * size).norm() / (0.5 * size.norm());
    summary.farthest_radius = std::max(summary.farthest_radius, radius);
  }
  for (int k = 0; k < zones * zones; ++k)
    if (counts[std::size_t(k)] < fewest_corners_a_zone) summary.empty_zones.push_back(zone_name(k % zones, k / zones));
}

double count_tilted(const Bundle& bundle, int sensor) {
  std::set<int> poses;
  for (const Observation& seen : bundle.observations)
    if (seen.sensor == sensor && seen.used) poses.insert(seen.pose);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  const auto normal = [&](int pose) { return bundle.rig_from_board[std::size_t(pose)].rotation.col(2); };
  for (const int pose : poses) mean += normal(pose);
  mean.normalize();
  return double(std::ranges::count_if(poses, [&](int pose) { return normal(pose).dot(mean) < std::cos(tilt_rad); }));
}

SensorSummary summarise(const CalibrationInput& input, const Bundle& bundle, int sensor) {
  const SensorPictures& pictures = input.sensors[std::size_t(sensor)];
  SensorSummary summary;
  summary.name = pictures.name;
  summary.pictures = static_cast<int>(pictures.pictures.size());
  for (const BoardPicture& picture : pictures.pictures) summary.usable += picture.view.problem.empty();
  for (const Observation& seen : bundle.observations) {
    if (seen.sensor != sensor) continue;
    ++summary.corners_found;
    summary.corners_used += seen.used;
  }
  summary.rms_px = reprojection_rms(bundle, sensor);
  summary.sigma_px = bundle.sensors[std::size_t(sensor)].sigma_px;
  summary.tilted_poses = count_tilted(bundle, sensor);
  note_coverage(bundle, sensor, summary);
  return summary;
}

float median_of(const Image<float>& map) {
  std::vector<float> values;
  for (const float value : map.pixels())
    if (std::isfinite(value)) values.push_back(value);
  if (values.empty()) return std::numeric_limits<float>::quiet_NaN();
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

void remark_on(const SensorSummary& sensor, CalibrationReport& report) {
  auto& remarks = report.remarks;
  if (sensor.rms_px > good_rms_px)
    remarks.push_back(fmt::format(
        "{}: corners are {:.2f} px off where they should be. Is the board flat, and still while its picture is taken? "
        "--fit-bend estimates how it is bent.",
        sensor.name, sensor.rms_px));
  const double outliers = 1 - double(sensor.corners_used) / std::max(1, sensor.corners_found);
  if (outliers > most_outliers)
    remarks.push_back(
        fmt::format("{}: {:.0f} % of the corners contradict the others and were left out; the list below names "
                    "their pictures.",
                    sensor.name, 100 * outliers));
  if (sensor.usable < few_pictures)
    remarks.push_back(fmt::format("{}: only {} pictures were usable; 15 to 20 make the result steadier.", sensor.name,
                                  sensor.usable));
  if (sensor.tilted_poses < fewest_tilted)
    remarks.push_back(
        fmt::format("{}: the board is tilted by more than 10 degrees in only {:.0f} poses. Tilt it by 20 to 40 "
                    "degrees in at least {}, in different directions.",
                    sensor.name, sensor.tilted_poses, fewest_tilted));
  if (!sensor.empty_zones.empty())
    remarks.push_back(
        fmt::format("{}: no corners lie in the {} of the picture, so distortion is guessed there. Hold the "
                    "board there in a few pictures.",
                    sensor.name, fmt::join(sensor.empty_zones, ", ")));
  else if (sensor.farthest_radius < near_edge)
    remarks.push_back(
        fmt::format("{}: no corner lies farther out than {:.0f} % of half the diagonal. Hold the board into "
                    "the corners of the picture.",
                    sensor.name, 100 * sensor.farthest_radius));
}

void remark_on_whole(const Calibration& calibration, CalibrationReport& report) {
  double squares = 0, count = 0;
  for (std::size_t k = 0; k < report.sensors.size(); ++k) {
    squares += std::pow(report.sensors[k].rms_px, 2) * report.sensors[k].corners_used;
    count += report.sensors[k].corners_used;
  }
  const double within = std::sqrt(squares / std::max(1.0, count));
  if (report.left_out_rms_px > most_left_out_ratio * within)
    report.remarks.push_back(
        fmt::format("Poses left out are predicted to {:.3f} px rms, those used to {:.3f} px: the lens model says more "
                    "than the pictures "
                    "know. Take more pictures, or a simpler --lens.",
                    report.left_out_rms_px, within));
  for (const std::string& warning : calibration.warnings) report.remarks.push_back(warning + ".");
}

double left_out_rms(const std::vector<double>& rms) {
  double squares = 0;
  int count = 0;
  for (const double value : rms)
    if (std::isfinite(value)) squares += value * value, ++count;
  return count > 0 ? std::sqrt(squares / count) : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

double reprojection_rms(const Bundle& bundle, int sensor) {
  double squares = 0;
  int count = 0;
  for (const Observation& seen : bundle.observations) {
    if (seen.sensor != sensor || !seen.used) continue;
    squares += bundle.residual(seen).squaredNorm();
    ++count;
  }
  return count > 0 ? std::sqrt(squares / count) : std::numeric_limits<double>::quiet_NaN();
}

CalibrationReport judge_calibration(const CalibrationInput& input, const Calibration& calibration,
                                    std::vector<AccuracyMap> accuracy) {
  CalibrationReport report;
  report.calibration = &calibration;
  report.input = &input;
  report.accuracy = std::move(accuracy);
  report.left_out_rms_px = left_out_rms(calibration.left_out_px);
  for (int k = 0; k < static_cast<int>(calibration.bundle.sensors.size()); ++k) {
    report.sensors.push_back(summarise(input, calibration.bundle, k));
    remark_on(report.sensors.back(), report);
  }
  remark_on_whole(calibration, report);
  std::vector<std::string> parts;
  for (const SensorSummary& sensor : report.sensors)
    parts.push_back(fmt::format("{} to {:.3f} px", sensor.name, sensor.rms_px));
  report.headline = fmt::format("Corners fit {}", fmt::join(parts, ", "));
  const double point_mm = report.accuracy.empty() ? std::numeric_limits<double>::quiet_NaN()
                                                  : double(median_of(report.accuracy.front().point_mm));
  if (std::isfinite(point_mm))
    report.headline +=
        fmt::format("; the rig's share in a point's error is {:.3f} mm at half of the places on the table", point_mm);
  const bool bad_fit = std::ranges::any_of(report.sensors, [](const auto& s) { return s.rms_px > 3 * good_rms_px; });
  report.level = point_mm > usable_point_mm || bad_fit                 ? VerdictLevel::scan_again
                 : point_mm > good_point_mm || !report.remarks.empty() ? VerdictLevel::look
                                                                       : VerdictLevel::good;
  report.advice = report.level == VerdictLevel::good   ? "Nothing to do"
                  : report.level == VerdictLevel::look ? "Usable, and the remarks say what would make it better"
                                                       : "Calibrate again as the remarks say";
  return report;
}

std::string format_calibration_text(const CalibrationReport& report) {
  std::string text = fmt::format("{}.\n{}.\n\n{:<10} {:>8} {:>8} {:>8} {:>8} {:>9}\n", report.headline, report.advice,
                                 "sensor", "pictures", "usable", "corners", "used", "rms px");
  for (const SensorSummary& s : report.sensors)
    text += fmt::format("{:<10} {:>8} {:>8} {:>8} {:>7.1f}% {:>9.3f}\n", s.name, s.pictures, s.usable, s.corners_found,
                        100.0 * s.corners_used / std::max(1, s.corners_found), s.rms_px);
  if (std::isfinite(report.left_out_rms_px))
    text += fmt::format("Poses that were left out are predicted to {:.3f} px rms.\n", report.left_out_rms_px);
  for (const ScannerTrial& trial : report.calibration->trials)
    text += fmt::format("scanner as {}: pictures left out are predicted to {:.3f} px{}\n", name_of(trial.model),
                        trial.rms_px, trial.chosen ? " (chosen)" : "");
  for (const SensorPictures& sensor : report.input->sensors)
    for (const BoardPicture& picture : sensor.pictures)
      if (!picture.view.problem.empty()) text += fmt::format("{}: {}\n", picture.file, picture.view.problem);
  for (const std::string& remark : report.remarks) text += remark + "\n";
  return text;
}

}  // namespace pagesweep
