// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pagesweep/base/progress.h"
#include "pagesweep/data/figure.h"
#include "pagesweep/evaluation/compare_kinds.h"
#include "pagesweep/evaluation/compare_pages.h"
#include "pagesweep/evaluation/compare_pictures.h"
#include "pagesweep/evaluation/compare_points.h"
#include "pagesweep/evaluation/compare_text.h"
#include "pagesweep/evaluation/compare_times.h"

namespace pagesweep {

struct EvaluationOptions {
  std::string rig;
  std::string ocr;
  PointComparisonOptions points;
  TimeComparisonOptions times;
  PageComparisonOptions pages;

  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("rig", rig, "", "rig file; empty: the one of the capture beside the truth's folder");
    visit("ocr", ocr, "",
          "language of the printed text, such as eng: tells the character error rate; empty: it does not");
    points.describe(visit);
    times.describe(visit);
    pages.describe(visit);
  }
};

/// What Tesseract reads on a page, against what is printed there.
struct TextEvaluation {
  TextErrors result;      ///< on the result
  TextErrors flat_truth;  ///< on the picture of the true page: what is not the flattening's fault
};

/// One page of the truth, or of the result, or of both.
struct PageEvaluation {
  int index = 1;                     ///< from left to right, 1 first
  std::optional<PageErrors> errors;  ///< nothing: see reason
  std::string reason;                ///< why there are none
  PictureErrors picture;             ///< NaN where there are none
  std::optional<TextEvaluation> text;
  std::string text_reason;  ///< why there is none
};

/// A result against the truth. What could not be compared says why.
struct Evaluation {
  std::vector<std::string> cameras;  ///< those with a truth, in the rig's order
  std::optional<PointComparison> points;
  std::optional<ErrorSummary>
      clipped_points;                   ///< [mm] of pixels that were clipped in some frame; if the result says which
  bool points_from_cloud = false;       ///< from points.ply, without knowing the pixels; only points->all holds figures
  std::string points_reason;            ///< why there are none
  std::optional<KindComparison> kinds;  ///< if there are points and time values
  std::optional<TimeComparison> times;
  std::string times_reason;
  std::vector<PageEvaluation> pages;  ///< the truth's
  std::vector<int> unexpected_pages;  ///< pages of the result that the truth does not have
};

/// Compares a result folder with the truth of its capture (docs/evaluation.md).
/// \param out    the folder that a run wrote
/// \param truth  the folder with truth.json
/// \throws Error  if truth or rig cannot be read or a file of the result is broken; a missing one is a reason instead
Evaluation evaluate(const std::filesystem::path& out, const std::filesystem::path& truth,
                    const EvaluationOptions& options = {}, Progress& progress = no_progress());

/// Every number of an evaluation, in a fixed order; a number that is missing stays in the list with its reason.
std::vector<Figure> figures_of(const Evaluation& evaluation);

/// Error maps: per camera the points' distances, per page the lengths of the displacements.
std::vector<FigureMap> maps_of(const Evaluation& evaluation);

/// A table for people: group, quantity, value, unit.
std::string format_table(std::span<const Figure> figures);

/// {"format": "pagesweep-evaluation", "version": 1, "figures": {group: {name: {"value", "unit", "what"}}}}; a missing
/// value is null and has a "reason".
std::string format_figures_json(std::span<const Figure> figures);

}  // namespace pagesweep
