// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <nlohmann/json.hpp>

#include "pagesweep/acceptance/acceptance.h"
#include "pagesweep/io/json_file.h"

namespace pagesweep {
namespace {

using Json = nlohmann::ordered_json;

/// JSON knows no NaN, and text that is no UTF-8 would not be written at all.
Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }
std::string utf8(const std::string& text) {
  return Json::parse(Json(text).dump(-1, ' ', false, Json::error_handler_t::replace)).get<std::string>();
}
Json list(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Json to_json(const Artefact& artefact) {
  Json json{{"name", utf8(artefact.name)}};
  if (artefact.plate_mm) json["plate"]["size_mm"] = {artefact.plate_mm->x(), artefact.plate_mm->y()};
  for (const double diameter : artefact.sphere_diameters_mm) json["spheres"].push_back({{"diameter_mm", diameter}});
  if (artefact.spacing_mm) json["spacing_mm"] = *artefact.spacing_mm;
  return json;
}

Json to_json(const QualityParameter& parameter) {
  Json json{{"what", parameter.what}, {"unit", parameter.unit}, {"worst", number(parameter.worst())}};
  if (parameter.limit > 0) {
    json["limit"] = parameter.limit;
    json["kept"] = parameter.is_kept();
  }
  json["poses"] = Json::array();
  for (const double value : parameter.values) json["poses"].push_back(number(value));
  return json;
}

void add(Json& json, const Deviations& deviations) {
  json["rms_mm"] = number(deviations.rms_mm);
  json["claimed_rms_mm"] = number(deviations.claimed_rms_mm);
  json["rms_over_claim"] = number(deviations.rms_over_claim());
  json["range_of_all_points_mm"] = number(deviations.full_range_mm);
  json["points"] = deviations.points;
  json["discarded"] = deviations.discarded;
  json["far_points"] = deviations.far_points;
}

Json to_json(const PlateResult& plate) {
  Json json{{"flatness_mm", number(plate.deviations.range_mm)}};
  add(json, plate.deviations);
  json["middle_mm"] = list(plate.plate.middle);
  json["normal"] = list(plate.plate.plane.normal);
  return json;
}

Json to_json(const SphereResult& sphere) {
  Json json{{"probing_form_mm", number(sphere.deviations.range_mm)},
            {"probing_size_mm", sphere.size_error_mm()},
            {"diameter_mm", 2 * sphere.sphere.radius_mm}};
  add(json, sphere.deviations);
  json["center_mm"] = list(sphere.sphere.center);
  return json;
}

Json to_json(const PoseResult& pose) {
  Json json{{"name", utf8(pose.name)}};
  if (pose.plate) json["plate"] = to_json(*pose.plate);
  if (!pose.plate_reason.empty()) json["plate_reason"] = pose.plate_reason;
  for (const SphereResult& sphere : pose.spheres) json["spheres"].push_back(to_json(sphere));
  if (!pose.spheres_reason.empty()) json["spheres_reason"] = pose.spheres_reason;
  if (pose.spacing)
    json["spacing"] = {{"measured_mm", pose.spacing->measured_mm},
                       {"calibrated_mm", pose.spacing->calibrated_mm},
                       {"error_mm", pose.spacing->error_mm()},
                       {"noise_mm", number(pose.spacing->noise_mm)}};
  return json;
}

Json to_json(const std::vector<OptionValue>& options) {
  Json json = Json::object();
  for (const OptionValue& option : options)
    std::visit([&](const auto& value) { json[option.station][option.name] = value; }, option.value);
  return json;
}

}  // namespace

std::string format_acceptance_json(const Acceptance& acceptance, const AcceptanceReport& report) {
  Json json{{"format", "pagesweep-acceptance"}, {"version", 1}, {"program", report.program}};
  json["verdict"] = std::string(name_of(acceptance.verdict));
  json["headline"] = acceptance.headline;
  json["remarks"] = Json::array();
  for (const std::string& remark : acceptance.remarks) json["remarks"].push_back(utf8(remark));
  json["artefact"] = to_json(acceptance.artefact);
  json["parameters"] = Json::object();
  for (const QualityParameter& parameter : acceptance.parameters)
    json["parameters"][parameter.name] = to_json(parameter);
  json["poses"] = Json::array();
  for (const PoseResult& pose : acceptance.poses) json["poses"].push_back(to_json(pose));
  json["options"] = to_json(report.options);
  return format_json(json);
}

}  // namespace pagesweep
