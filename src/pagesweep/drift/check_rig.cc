// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/drift/check_rig.h"

#include <algorithm>
#include <cmath>

namespace pagesweep {
namespace {

/// \param values  distances, sign or not
std::optional<Disagreement> summarise(std::vector<double> values) {
  if (values.empty()) return std::nullopt;
  double squares = 0;
  for (double& value : values) {
    squares += value * value;
    value = std::abs(value);
  }
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return Disagreement{std::sqrt(squares / static_cast<double>(values.size())), *middle,
                      static_cast<int>(values.size())};
}

}  // namespace

RigCheck check_rig(const SweepView& view, const DriftPriors& priors) {
  RigCheck check;
  check.ties = find_tie_points(view);
  check.correction = correct_poses(check.ties, view.first, view.second, view.rig, priors);
  std::vector<double> across, scan, light;
  for (const TiePoint& tie : check.ties) {
    across.push_back(tie.across_px);
    if (tie.scan) scan.push_back(tie.scan->shift_mm.norm());
    if (view.rig.light) light.push_back(view.rig.light->plane_at(tie.time).distance(tie.point));
  }
  check.across_px = summarise(std::move(across)).value_or(Disagreement{});
  check.scan_mm = summarise(std::move(scan));
  check.light_mm = summarise(std::move(light));
  return check;
}

}  // namespace pagesweep
