// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "pagesweep/io/json_file.h"
#include "pagesweep/report/calibration_report.h"

namespace pagesweep {
namespace {

using Json = nlohmann::ordered_json;

constexpr double strong_correlation = 0.9;

/// JSON knows no NaN, and text that is no UTF-8 would not be written at all.
Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }
std::string utf8(const std::string& text) {
  return Json::parse(Json(text).dump(-1, ' ', false, Json::error_handler_t::replace)).get<std::string>();
}

std::string file_of(const CalibrationInput& input, const Observation& seen) {
  const auto& pictures = input.sensors[std::size_t(seen.sensor)].pictures;
  const auto found = std::ranges::find(pictures, seen.pose, &BoardPicture::pose);
  return found == pictures.end() ? "" : utf8(found->file);
}

Json parameters_of(const BundleSolution& solution, const std::string& owner) {
  Json list = Json::array();
  for (std::size_t k = 0; k < solution.parameters.size(); ++k) {
    const Parameter& p = solution.parameters[k];
    const auto i = static_cast<Eigen::Index>(k);
    if (p.owner == owner)
      list.push_back({{"name", p.name},
                      {"value", p.value},
                      {"sigma", number(std::sqrt(solution.covariance(i, i)))},
                      {"unit", p.unit}});
  }
  return list;
}

Json to_json(const SensorSummary& sensor, const CalibrationReport& report) {
  return {{"name", utf8(sensor.name)},
          {"pictures", sensor.pictures},
          {"usable", sensor.usable},
          {"corners_found", sensor.corners_found},
          {"corners_used", sensor.corners_used},
          {"rms_px", number(sensor.rms_px)},
          {"sigma_px", number(sensor.sigma_px)},
          {"tilted_poses", sensor.tilted_poses},
          {"farthest_radius", sensor.farthest_radius},
          {"empty_zones", sensor.empty_zones},
          {"parameters", parameters_of(report.calibration->solution, sensor.name)}};
}

Json poses_of(const CalibrationReport& report) {
  Json list = Json::array();
  const Calibration& calibration = *report.calibration;
  for (std::size_t k = 0; k < report.input->poses.size(); ++k) {
    Json pose{{"name", utf8(report.input->poses[k])}, {"on_table", static_cast<int>(k) == calibration.table_pose}};
    const Rigid3& p = calibration.bundle.rig_from_board[k];
    for (int i = 0; i < 9; ++i) pose["rotation"].push_back(p.rotation(i / 3, i % 3));
    for (int i = 0; i < 3; ++i) pose["translation"].push_back(p.translation[i]);
    if (!calibration.left_out_px.empty()) pose["left_out_rms_px"] = number(calibration.left_out_px[k]);
    list.push_back(pose);
  }
  return list;
}

Json outliers_of(const CalibrationReport& report) {
  Json list = Json::array();
  for (const Observation& seen : report.calibration->bundle.observations) {
    if (seen.used) continue;
    const Eigen::Vector2d error = report.calibration->bundle.residual(seen);
    list.push_back({{"picture", file_of(*report.input, seen)},
                    {"corner", seen.corner},
                    {"seen_px", {seen.pixel.x(), seen.pixel.y()}},
                    {"error_px", {number(error.x()), number(error.y())}}});
  }
  return list;
}

Json refused_of(const CalibrationInput& input) {
  Json list = Json::array();
  for (const SensorPictures& sensor : input.sensors)
    for (const BoardPicture& picture : sensor.pictures)
      if (!picture.view.problem.empty())
        list.push_back({{"picture", utf8(picture.file)}, {"problem", picture.view.problem}});
  return list;
}

std::string name_of(const Parameter& parameter) { return parameter.owner + "." + parameter.name; }

bool is_pose(const Parameter& parameter) { return parameter.owner.starts_with("pose "); }

void add_covariance(const BundleSolution& solution, Json& json) {
  Json names = Json::array(), rows = Json::array(), strong = Json::array();
  const auto& c = solution.covariance;
  for (Eigen::Index i = 0; i < c.rows() && !is_pose(solution.parameters[std::size_t(i)]); ++i) {
    names.push_back(utf8(name_of(solution.parameters[std::size_t(i)])));
    Json row = Json::array();
    for (Eigen::Index j = 0; j <= i; ++j) {
      row.push_back(number(c(i, j)));
      const double correlation = c(i, j) / std::sqrt(c(i, i) * c(j, j));
      if (j < i && std::abs(correlation) > strong_correlation)
        strong.push_back({{"between", {names[std::size_t(j)], names[std::size_t(i)]}}, {"correlation", correlation}});
    }
    rows.push_back(row);
  }
  json["strong_correlations"] = strong;
  json["covariance"] = {{"parameters", names}, {"lower_triangle", rows}};
}

Json to_json(const AccuracyMap& map) {
  const auto rows_of = [](const Image<float>& image) {
    Json rows = Json::array();
    for (int y = 0; y < image.height(); ++y) {
      Json row = Json::array();
      for (const float value : image.row(y)) row.push_back(number(double(value)));
      rows.push_back(row);
    }
    return rows;
  };
  Json json{{"height_mm", map.height_mm},
            {"low_mm", {number(map.low_mm.x()), number(map.low_mm.y())}},
            {"spacing_mm", map.spacing_mm},
            {"point_mm", rows_of(map.point_mm)}};
  if (!map.scan_px.empty()) json["scan_px"] = rows_of(map.scan_px);
  return json;
}

Json to_json(const std::vector<OptionValue>& options) {
  Json json = Json::object();
  for (const OptionValue& option : options)
    std::visit([&](const auto& value) { json[option.station][option.name] = value; }, option.value);
  return json;
}

}  // namespace

std::string format_calibration_json(const CalibrationReport& report) {
  const Calibration& calibration = *report.calibration;
  Json json{{"format", "pagesweep-calibration"}, {"version", 1}, {"program", report.program}};
  json["verdict"] = std::string(name_of(report.level));
  json["headline"] = report.headline;
  json["advice"] = report.advice;
  json["remarks"] = Json::array();
  for (const std::string& remark : report.remarks) json["remarks"].push_back(utf8(remark));
  json["left_out_rms_px"] = number(report.left_out_rms_px);
  json["redundancy"] = calibration.solution.redundancy;
  json["unit_sigma"] = calibration.solution.unit_sigma;
  for (const SensorSummary& sensor : report.sensors) json["sensors"].push_back(to_json(sensor, report));
  json["board"] = parameters_of(calibration.solution, "board");
  json["scanner_trials"] = Json::array();
  for (const ScannerTrial& trial : calibration.trials)
    json["scanner_trials"].push_back({{"model", std::string(name_of(trial.model))},
                                      {"left_out_rms_px", number(trial.rms_px)},
                                      {"chosen", trial.chosen}});
  json["poses"] = poses_of(report);
  json["refused"] = refused_of(*report.input);
  json["outliers"] = outliers_of(report);
  json["accuracy"] = Json::array();
  for (const AccuracyMap& map : report.accuracy) json["accuracy"].push_back(to_json(map));
  add_covariance(calibration.solution, json);
  json["options"] = to_json(report.options);
  return format_json(json);
}

}  // namespace pagesweep
