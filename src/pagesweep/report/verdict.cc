// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/report/verdict.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pagesweep/report/html.h"
#include "pagesweep/report/report.h"

namespace pagesweep {
namespace {

std::string percent(double share) { return fmt::format("{:.1f} %", 100 * share); }

/// Measured share of all pages' area.
double measured_share(std::span<const Page> pages) {
  double measured = 0, area = 0;
  for (const Page& page : pages) {
    const double own = static_cast<double>(page.picture.width()) * page.picture.height();
    measured += own * page.measured_share;
    area += own;
  }
  return area > 0 ? measured / area : 0;
}

std::size_t point_count(const ReportInputs& inputs) {
  std::size_t count = 0;
  for (const CameraReport& camera : inputs.cameras)
    if (camera.points) count += count_status(camera.points->status)[static_cast<std::size_t>(PixelStatus::ok)];
  return count;
}

void worsen(Verdict& verdict, VerdictLevel level, std::string remark) {
  verdict.level = std::max(verdict.level, level);
  const auto place = level == VerdictLevel::scan_again ? verdict.remarks.begin() : verdict.remarks.end();
  verdict.remarks.insert(place, std::move(remark));
}

/// A page's own verdict counts as it is; both know the same three levels.
void judge_quality(std::span<const PageQuality> qualities, Verdict& verdict) {
  for (const PageQuality& quality : qualities) {
    if (quality.verdict == PageVerdict::good) continue;
    std::string reasons;
    for (const std::string& reason : quality.reasons) reasons += (reasons.empty() ? "" : "; ") + reason;
    worsen(verdict, quality.verdict == PageVerdict::scan_again ? VerdictLevel::scan_again : VerdictLevel::look,
           fmt::format("Page {}: {}.", quality.index, reasons));
  }
}

void judge_pages(const ReportInputs& inputs, Verdict& verdict) {
  const VerdictOptions& limits = inputs.verdict;
  if (inputs.pages_expected && inputs.pages.empty())
    worsen(verdict, VerdictLevel::scan_again, "No page was found in what the cameras measured.");
  if (!inputs.quality.empty()) return judge_quality(inputs.quality, verdict);
  for (const Page& page : inputs.pages) {
    const std::string what =
        fmt::format("Only {} of page {} rests on measured points", percent(page.measured_share), page.index);
    if (page.measured_share < limits.usable_share)
      worsen(verdict, VerdictLevel::scan_again, what + ": the rest follows the model of its surroundings.");
    else if (page.measured_share < limits.good_share)
      worsen(verdict, VerdictLevel::look, what + "; look at the status map for where and why.");
  }
}

void judge_points(const ReportInputs& inputs, Verdict& verdict) {
  const VerdictOptions& limits = inputs.verdict;
  const double sigma = typical_sigma(inputs.cameras);
  if (point_count(inputs) == 0)
    worsen(verdict, VerdictLevel::scan_again, "No point was measured; the status map says why.");
  else if (sigma > limits.usable_sigma_mm)
    worsen(verdict, VerdictLevel::scan_again, "The points are too uncertain: the stripe is too dark or too fast.");
  else if (sigma > limits.good_sigma_mm)
    worsen(verdict, VerdictLevel::look, "The points are less certain than usual: the stripe is dark or fast.");
}

/// Reasons that the operator can do something about.
struct Remedy {
  PixelStatus status;
  const char* what;
};
constexpr Remedy remedies[] = {
    {PixelStatus::saturated, "of what {} sees is overexposed: expose shorter"},
    {PixelStatus::truncated,
     "of what {} sees was lit while no frames were taken: begin to record before the stripe "
     "comes and end after it has gone"},
    {PixelStatus::bad_fit, "of what {} sees does not follow the stripe: gloss, or something moved during the sweep"},
};

/// Whether every page has what it needs. What is lost beside the pages then harms nobody.
bool pages_are_complete(const ReportInputs& inputs) {
  return !inputs.pages.empty() && std::all_of(inputs.pages.begin(), inputs.pages.end(), [&](const Page& page) {
    return page.measured_share >= inputs.verdict.good_share;
  });
}

void judge_camera(const CameraReport& camera, const ReportInputs& inputs, Verdict& verdict) {
  const VerdictOptions& limits = inputs.verdict;
  if (camera.frames > 0 && camera.dropped > limits.most_dropped * camera.frames)
    worsen(verdict, VerdictLevel::look,
           fmt::format("{} lost {} of {} frames: check its connection.", camera.name, camera.dropped, camera.frames));
  if (!camera.points || pages_are_complete(inputs)) return;
  const StatusCounts counts = count_status(camera.points->status);
  const auto ok = static_cast<double>(counts[static_cast<std::size_t>(PixelStatus::ok)]);
  for (const Remedy& remedy : remedies) {
    const auto lost = static_cast<double>(counts[static_cast<std::size_t>(remedy.status)]);
    if (lost > limits.most_spoilt * (ok + lost))
      worsen(verdict, VerdictLevel::look,
             percent(lost / (ok + lost)) + " " + fmt::format(fmt::runtime(remedy.what), camera.name) + ".");
  }
}

std::string headline_of(const ReportInputs& inputs) {
  const double sigma = typical_sigma(inputs.cameras);
  const std::string certainty =
      std::isfinite(sigma) ? fmt::format(", typical depth error {} mm", format_number(sigma)) : "";
  const std::size_t count = inputs.pages.size();
  if (count == 0 && point_count(inputs) == 0) return "Nothing could be measured";
  if (count == 0)
    return fmt::format("Surface measured: {} points{}", format_number(static_cast<double>(point_count(inputs))),
                       certainty);
  const std::string pages = count == 1 ? "One page" : count == 2 ? "Both pages" : fmt::format("{} pages", count);
  return fmt::format("{} measured: {} of the paper{}", pages, percent(measured_share(inputs.pages)), certainty);
}

}  // namespace

Verdict judge(const ReportInputs& inputs) {
  Verdict verdict;
  judge_points(inputs, verdict);
  judge_pages(inputs, verdict);
  for (const CameraReport& camera : inputs.cameras) judge_camera(camera, inputs, verdict);
  verdict.headline = headline_of(inputs);
  verdict.advice = verdict.level == VerdictLevel::good ? "No need to scan again."
                   : verdict.level == VerdictLevel::look
                       ? "Usable; have a look at the remarks before the book is put away."
                       : "Scan again.";
  return verdict;
}

}  // namespace pagesweep
