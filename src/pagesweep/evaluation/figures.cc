// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "pagesweep/evaluation/evaluate.h"
#include "pagesweep/io/json_file.h"

namespace pagesweep {
namespace {

/// Appends figures of one group to a list; what is NaN gets the group's reason.
class Group {
 public:
  Group(std::vector<Figure>& figures, std::string name, std::string reason)
      : figures_(figures), name_(std::move(name)), reason_(std::move(reason)) {}

  void add(const std::string& name, const std::string& what, double value, const std::string& unit = "") {
    figures_.push_back({name_, name, what, value, unit, std::isfinite(value) ? "" : reason_});
    if (!std::isfinite(value)) figures_.back().value = ErrorSummary::none;
  }
  void add_share(const std::string& name, const std::string& what, double share) { add(name, what, 100 * share, "%"); }

 private:
  std::vector<Figure>& figures_;
  std::string name_, reason_;
};

void add_counts(const PointErrors& errors, Group& group) {
  group.add_share("completeness", "page pixels that two cameras see and that have a point", errors.completeness());
  group.add_share("measured_of_page", "page pixels that have a point", errors.measured_of_page());
  group.add("page_pixels", "page pixels", static_cast<double>(errors.page_pixels), "px");
  group.add("false_points", "points where there is no page", static_cast<double>(errors.false_points), "points");
  for (std::size_t s = 0; s < status_count; ++s)
    if (errors.missing[s] > 0) {
      const std::string name(names_of(PixelStatus{})[s]);
      group.add("missing_" + name, "missing although two cameras see them: " + name,
                static_cast<double>(errors.missing[s]), "px");
    }
}

void add_points(const Evaluation& evaluation, std::vector<Figure>& figures) {
  const std::string reason = evaluation.points                  ? "nothing of this kind was measured"
                             : evaluation.points_reason.empty() ? "not evaluated"
                                                                : evaluation.points_reason;
  const PointErrors errors = evaluation.points ? evaluation.points->all : PointErrors{};
  Group group(figures, "points", reason);
  group.add("rms", "distance to the true surface, rms", errors.distance.rms, "mm");
  group.add("median", "distance to the true surface, median", errors.distance.median, "mm");
  group.add("p95", "distance that 95 % of the points keep", errors.distance.p95, "mm");
  group.add("p999", "distance that 99.9 % of the points keep", errors.distance.p999, "mm");
  group.add("max", "largest distance", errors.distance.max, "mm");
  group.add("bias", "median with its sign, positive towards the cameras", errors.distance.bias, "mm");
  group.add("rms_along_ray", "distance along the viewing ray, rms", errors.along_ray.rms, "mm");
  group.add("claimed_rms", "rms distance that the points claim themselves", errors.claimed_rms, "mm");
  group.add("error_over_claim", "rms distance over what the points claim", errors.error_over_claim());
  group.add("normalised_rms", "distance over each point's claim, rms", errors.normalised.rms);
  Group fits(figures, "points", evaluation.points_from_cloud ? "a cloud has no pixels to look around in" : reason);
  fits.add("fitted_rms", "local fit to the true surface, rms", errors.fitted.rms, "mm");
  fits.add("fitted_p95", "distance that 95 % of the local fits keep", errors.fitted.p95, "mm");
  if (evaluation.points_from_cloud) {
    fits.add_share("completeness", "page pixels that two cameras see and that have a point", ErrorSummary::none);
    fits.add("false_points", "points where there is no page", static_cast<double>(errors.false_points), "points");
  } else {
    add_counts(errors, group);
  }
  if (!evaluation.points) return;
  Group clipped(
      figures, "points_clipped",
      evaluation.clipped_points ? "no page pixel was clipped" : "the result does not tell which were clipped");
  const ErrorSummary of_clipped = evaluation.clipped_points.value_or(ErrorSummary{});
  clipped.add("count", "points of pixels that were clipped in some frame", static_cast<double>(of_clipped.count),
              "points");
  clipped.add("rms", "their distance to the true surface, rms", of_clipped.rms, "mm");
  clipped.add("p95", "distance that 95 % of them keep", of_clipped.p95, "mm");
  for (std::size_t c = 0; c < evaluation.points->cameras.size(); ++c) {
    const PointErrors& own = evaluation.points->cameras[c];
    Group camera(figures, "points_" + evaluation.cameras[c], reason);
    camera.add("rms", "distance to the true surface, rms", own.distance.rms, "mm");
    camera.add("fitted_rms", "local fit to the true surface, rms", own.fitted.rms, "mm");
    add_counts(own, camera);
  }
}

void add_kinds(const Evaluation& evaluation, std::vector<Figure>& figures) {
  if (!evaluation.kinds) return;
  const auto add = [&](const std::string& kind, const std::string& where, const PointsOfKind& points) {
    if (points.distance.count == 0) return;
    Group group(figures, "points_" + kind, "");
    Group bound(figures, "points_" + kind, "no profile and sensor in the truth, or exposures that differ");
    group.add("rms", "distance to the true surface " + where + ", rms", points.distance.rms, "mm");
    group.add("p95", "distance that 95 % of them keep", points.distance.p95, "mm");
    group.add("error_over_claim", "rms over what they claim", points.error_over_claim());
    bound.add("error_over_bound", "rms over what the Cramér-Rao bound predicts", points.error_over_bound());
  };
  add("blank", "away from print", evaluation.kinds->blank);
  add("print", "in printed areas", evaluation.kinds->print);
  add("bright_print", "in printed areas, bright pixels", evaluation.kinds->bright_print);
  add("near_gutter", "within 15 mm of the gutter", evaluation.kinds->near_gutter);
  add("elsewhere", "farther from the gutter", evaluation.kinds->elsewhere);
}

void add_times(const Evaluation& evaluation, std::vector<Figure>& figures) {
  const TimeComparison times = evaluation.times.value_or(TimeComparison{});
  Group group(figures, "times", evaluation.times ? "there are no pixels of this kind" : evaluation.times_reason);
  Group bound(
      figures, "times",
      evaluation.times ? "no profile and sensor in the truth, or exposures that differ" : evaluation.times_reason);
  const auto add = [&](const std::string& prefix, const std::string& which, const TimeErrors& errors) {
    group.add(prefix + "rms", "error" + which + ", rms", errors.error.rms, "frames");
    group.add(prefix + "p95", "error that 95 % keep" + which, errors.error.p95, "frames");
    group.add(prefix + "error_over_claim", "rms over what the time values claim" + which, errors.error_over_claim());
    group.add(prefix + "normalised_rms", "error over each value's claim, rms" + which, errors.normalised_rms);
    bound.add(prefix + "error_over_bound", "rms over the Cramér-Rao bound" + which, errors.error_over_bound());
  };
  add("", "", times.all);
  add("bright_", " on bright pixels", times.bright);
  add("dark_", " on dark pixels", times.dark);
  add("blank_", " inside one tone", times.blank);
  add("print_edge_", " at print edges", times.print_edges);
  group.add("offset", "the estimator's middle of the stripe against the true one", times.offset_frames, "frames");
}

/// How many percent more of the characters are wrong than on the flat truth.
double excess_of(const TextEvaluation& text) { return text.result.rate - text.flat_truth.rate; }

void add_look(const PageEvaluation& page, std::vector<Figure>& figures) {
  const std::string name = fmt::format("page_{}", page.index);
  Group picture(figures, name,
                page.errors ? "there is no picture of the printed page, or too little of it" : page.reason);
  picture.add("ms_ssim", "multi-scale structural similarity to the printed page", page.picture.ms_ssim);
  picture.add("ms_ssim_same_exposure", "the same after the best gain and offset", page.picture.ms_ssim_same_exposure);
  Group text(figures, name, page.text_reason);
  const TextEvaluation evaluation = page.text.value_or(TextEvaluation{});
  text.add_share("cer", "character error rate", evaluation.result.rate);
  text.add_share("cer_of_truth", "character error rate on the printed page", evaluation.flat_truth.rate);
  text.add_share("cer_excess", "character error rate minus that of the printed page", excess_of(evaluation));
}

void add_page(const PageEvaluation& page, std::vector<Figure>& figures) {
  const PageErrors errors = page.errors.value_or(PageErrors{});
  Group group(figures, fmt::format("page_{}", page.index),
              page.errors ? "too little of the page is there to tell" : page.reason);
  constexpr double degrees = 180 / M_PI;
  group.add("rms", "dewarping error, rms", errors.displacement.rms, "mm");
  group.add("p95", "dewarping error that 95 % of the page keep", errors.displacement.p95, "mm");
  group.add("p99", "dewarping error that 99 % of the page keep", errors.displacement.p99, "mm");
  group.add("max", "largest dewarping error", errors.displacement.max, "mm");
  group.add_share("scale_error", "scale error", errors.scale_error);
  group.add_share("scale_error_x", "scale error along the lines", errors.scale_error_x);
  group.add_share("scale_error_y", "scale error across the lines", errors.scale_error_y);
  group.add("line_rms", "text lines against straight lines, rms", errors.line_deviation.rms, "mm");
  group.add("line_max", "largest deviation within a window of a text line", errors.line_deviation_in_window, "mm");
  group.add("rotation", "askew by", errors.rotation_rad * degrees, "deg");
  group.add_share("covered", "visible part of the true page that is on the result",
                  page.errors ? errors.covered : ErrorSummary::none);
  add_look(page, figures);
}

void add_all_pages(const Evaluation& evaluation, std::vector<Figure>& figures) {
  double rms = 0, p99 = 0, max = 0, scale = 0, ms_ssim = 1, excess = -1;
  std::size_t missing = 0;
  for (const PageEvaluation& page : evaluation.pages) {
    missing += !page.errors;
    if (!page.errors) continue;
    rms = std::max(rms, page.errors->displacement.rms);
    p99 = std::max(p99, page.errors->displacement.p99);
    max = std::max(max, page.errors->displacement.max);
    ms_ssim = std::min(ms_ssim, page.picture.ms_ssim);
    if (page.text) excess = std::max(excess, excess_of(*page.text));
    scale = std::max(scale, std::abs(page.errors->scale_error));
  }
  const bool none = missing == evaluation.pages.size();
  Group group(figures, "pages", "no page could be compared");
  group.add("worst_rms", "dewarping error of the worst page, rms", none ? ErrorSummary::none : rms, "mm");
  group.add("worst_p99", "dewarping error that 99 % of the worst page keep", none ? ErrorSummary::none : p99, "mm");
  group.add("worst_max", "largest dewarping error of all pages", none ? ErrorSummary::none : max, "mm");
  group.add_share("worst_scale_error", "largest scale error of all pages", none ? ErrorSummary::none : scale);
  group.add("missing", "pages of the truth that could not be compared", static_cast<double>(missing), "pages");
  group.add("unexpected", "pages that the truth does not have", static_cast<double>(evaluation.unexpected_pages.size()),
            "pages");
  Group looks(figures, "pages", "no page could be compared, or no language was given");
  looks.add("worst_ms_ssim", "least structural similarity of all pages", none ? ErrorSummary::none : ms_ssim);
  looks.add_share("worst_cer_excess", "largest excess of the character error rate",
                  excess < -0.5 ? ErrorSummary::none : excess);
}

/// Three significant digits, or all of a count.
std::string format_value(const Figure& figure) {
  if (!std::isfinite(figure.value)) return "-";
  if (figure.value == std::round(figure.value) && std::abs(figure.value) < 1e15)
    return fmt::format("{:.0f}", figure.value);
  const int digits = std::clamp(2 - static_cast<int>(std::floor(std::log10(std::abs(figure.value)))), 0, 6);
  return fmt::format("{:.{}f}", figure.value, digits);
}

}  // namespace

std::vector<Figure> figures_of(const Evaluation& evaluation) {
  std::vector<Figure> figures;
  add_points(evaluation, figures);
  add_kinds(evaluation, figures);
  add_times(evaluation, figures);
  add_all_pages(evaluation, figures);
  for (const PageEvaluation& page : evaluation.pages) add_page(page, figures);
  return figures;
}

std::vector<FigureMap> maps_of(const Evaluation& evaluation) {
  std::vector<FigureMap> maps;
  for (std::size_t c = 0; evaluation.points && c < evaluation.points->error_maps.size(); ++c)
    maps.push_back({"points_" + evaluation.cameras[c],
                    "Points of " + evaluation.cameras[c] + " against the true surface",
                    "Distance of each measured point to the true surface, positive towards the camera. Fine grain is "
                    "noise; anything with a shape is a systematic error.",
                    "mm", evaluation.points->error_maps[c], true});
  for (const PageEvaluation& page : evaluation.pages) {
    if (!page.errors) continue;
    Image<float> lengths(page.errors->displacements.width(), page.errors->displacements.height());
    for (std::size_t i = 0; i < lengths.size(); ++i) lengths.data()[i] = page.errors->displacements.data()[i].norm();
    maps.push_back({fmt::format("page_{}", page.index), fmt::format("Page {} against the printed page", page.index),
                    "How far each spot of the flat page is from where it was printed, after the best rotation and "
                    "shift of the whole page.",
                    "mm", std::move(lengths), false});
  }
  return maps;
}

std::string format_table(std::span<const Figure> figures) {
  std::string table, group;
  for (const Figure& figure : figures) {
    if (figure.group != group) table += fmt::format("{}{}\n", table.empty() ? "" : "\n", figure.group);
    group = figure.group;
    const std::string reason = figure.reason.empty() ? "" : "(" + figure.reason + ")";
    std::string line = fmt::format("  {:<62} {:>10} {:<7}{}", figure.what, format_value(figure), figure.unit, reason);
    line.erase(line.find_last_not_of(' ') + 1);
    table += line + "\n";
  }
  return table;
}

std::string format_figures_json(std::span<const Figure> figures) {
  nlohmann::ordered_json groups = nlohmann::ordered_json::object();
  for (const Figure& figure : figures) {
    nlohmann::ordered_json& entry = groups[figure.group][figure.name];
    entry["value"] = nullptr;
    if (std::isfinite(figure.value)) entry["value"] = figure.value;
    entry["unit"] = figure.unit;
    entry["what"] = figure.what;
    if (!figure.reason.empty()) entry["reason"] = figure.reason;
  }
  return format_json({{"format", "pagesweep-evaluation"}, {"version", 1}, {"figures", std::move(groups)}});
}

}  // namespace pagesweep
