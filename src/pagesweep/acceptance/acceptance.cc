// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/acceptance/acceptance.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <stdexcept>

namespace pagesweep {
namespace {

constexpr double none = Deviations::none;

// Positions that the guideline asks for.
constexpr std::size_t plate_poses = 6, sphere_poses = 10, spacing_poses = 7;

double worst_of(std::span<const double> values) {
  double worst = none;
  for (const double value : values)
    if (std::isfinite(value) && !(std::abs(value) <= std::abs(worst))) worst = value;
  return worst;
}

using OfPose = std::function<double(const PoseResult&)>;

OfPose of_plate(double (*value)(const Deviations&)) {
  return [value](const PoseResult& pose) { return pose.plate ? value(pose.plate->deviations) : none; };
}

OfPose of_spheres(double (*value)(const SphereResult&)) {
  return [value](const PoseResult& pose) {
    std::vector<double> values;
    for (const SphereResult& sphere : pose.spheres) values.push_back(value(sphere));
    return worst_of(values);
  };
}

double spacing_error(const PoseResult& pose) { return pose.spacing ? pose.spacing->error_mm() : none; }

std::vector<QualityParameter> parameters_of(const Artefact& artefact, std::span<const PoseResult> poses,
                                            const AcceptanceLimits& limits) {
  std::vector<QualityParameter> parameters;
  const auto add = [&](QualityParameter parameter, const OfPose& of_pose, double limit = 0) {
    for (const PoseResult& pose : poses) parameter.values.push_back(of_pose(pose));
    parameter.limit = limit;
    parameters.push_back(std::move(parameter));
  };
  if (artefact.plate_mm || limits.flatness_mm > 0) {
    add({"flatness", "F", "flatness measurement error", "mm", {}}, of_plate([](auto& d) { return d.range_mm; }),
        limits.flatness_mm);
    add({"flatness_rms", "", "flatness, rms", "mm", {}}, of_plate([](auto& d) { return d.rms_mm; }));
    add({"flatness_rms_over_claim", "", "flatness, rms over claim", "", {}},
        of_plate([](auto& d) { return d.rms_over_claim(); }));
  }
  if (!artefact.sphere_diameters_mm.empty() || limits.probing_form_mm > 0 || limits.probing_size_mm > 0) {
    add({"probing_form", "PF", "probing error form", "mm", {}},
        of_spheres([](auto& s) { return s.deviations.range_mm; }), limits.probing_form_mm);
    add({"probing_size", "PS", "probing error size", "mm", {}}, of_spheres([](auto& s) { return s.size_error_mm(); }),
        limits.probing_size_mm);
    add({"probing_rms_over_claim", "", "probing, rms over claim", "", {}},
        of_spheres([](auto& s) { return s.deviations.rms_over_claim(); }));
  }
  if (artefact.spacing_mm || limits.sphere_spacing_mm > 0)
    add({"sphere_spacing", "SD", "sphere spacing error", "mm", {}}, spacing_error, limits.sphere_spacing_mm);
  return parameters;
}

AcceptanceVerdict verdict_of(std::span<const QualityParameter> parameters) {
  const auto is_limited = [](const QualityParameter& p) { return p.limit > 0; };
  const auto is_kept = [](const QualityParameter& p) { return p.is_kept(); };
  if (std::none_of(parameters.begin(), parameters.end(), is_limited)) return AcceptanceVerdict::no_limits;
  return std::all_of(parameters.begin(), parameters.end(), is_kept) ? AcceptanceVerdict::passed
                                                                    : AcceptanceVerdict::failed;
}

std::string headline_of(const Acceptance& acceptance) {
  const std::string poses = fmt::format("{} pose{}", acceptance.poses.size(), acceptance.poses.size() == 1 ? "" : "s");
  std::vector<std::string> broken;
  for (const QualityParameter& parameter : acceptance.parameters)
    if (!parameter.is_kept())
      broken.push_back(std::isfinite(parameter.worst())
                           ? fmt::format("{} {:.3g} {}, more than {:g} {}", parameter.what, parameter.worst(),
                                         parameter.unit, parameter.limit, parameter.unit)
                           : fmt::format("{} limited, but nowhere measured", parameter.what));
  switch (acceptance.verdict) {
    case AcceptanceVerdict::passed:
      return "Passed: all limits are kept in " + poses;
    case AcceptanceVerdict::failed:
      return fmt::format("Failed: {}", fmt::join(broken, "; "));
    case AcceptanceVerdict::no_limits:
      break;
  }
  return "Measured in " + poses + "; no limits were given";
}

std::vector<std::string> remarks_of(std::span<const PoseResult> poses) {
  std::vector<std::string> remarks;
  std::size_t plates = 0, spheres = 0, spacings = 0;
  for (const PoseResult& pose : poses) {
    plates += pose.plate.has_value();
    spheres += pose.spheres.size();
    spacings += pose.spacing.has_value();
    for (const std::string& reason : {pose.plate_reason, pose.spheres_reason})
      if (!reason.empty()) remarks.push_back(fmt::format("{}: {} was found.", pose.name, reason));
  }
  const auto ask = [&](std::size_t found, std::size_t wanted, std::string_view what) {
    if (found > 0 && found < wanted)
      remarks.push_back(fmt::format("The guideline asks for {} positions of {} in the measuring volume; there are {}.",
                                    wanted, what, found));
  };
  ask(plates, plate_poses, "the plate");
  ask(spheres, sphere_poses, "a sphere");
  ask(spacings, spacing_poses, "the two spheres");
  return remarks;
}

}  // namespace

double QualityParameter::worst() const { return worst_of(values); }

Acceptance judge_acceptance(const Artefact& artefact, std::vector<PoseResult> poses, const AcceptanceLimits& limits) {
  for (const double limit :
       {limits.flatness_mm, limits.probing_form_mm, limits.probing_size_mm, limits.sphere_spacing_mm})
    if (!(limit >= 0)) throw std::invalid_argument("expected limits of at least 0");
  Acceptance acceptance{artefact, std::move(poses), {}, {}, {}, {}};
  acceptance.parameters = parameters_of(artefact, acceptance.poses, limits);
  acceptance.verdict = verdict_of(acceptance.parameters);
  acceptance.headline = headline_of(acceptance);
  acceptance.remarks = remarks_of(acceptance.poses);
  return acceptance;
}

std::string format_acceptance_table(const Acceptance& acceptance) {
  std::string table;
  for (const QualityParameter& parameter : acceptance.parameters) {
    const double worst = parameter.worst();
    std::string line = fmt::format("{:<2} {:<28} {:>9} {:<2}", parameter.symbol, parameter.what,
                                   std::isfinite(worst) ? fmt::format("{:.4f}", worst) : "-", parameter.unit);
    if (parameter.limit > 0)
      line +=
          fmt::format("  limit {:g} {} {}", parameter.limit, parameter.unit, parameter.is_kept() ? "kept" : "EXCEEDED");
    line.erase(line.find_last_not_of(' ') + 1);
    table += line + "\n";
  }
  table += acceptance.headline + ".\n";
  for (const std::string& remark : acceptance.remarks) table += "  " + remark + "\n";
  return table;
}

}  // namespace pagesweep
