// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

#include "pagesweep/base/enum_names.h"
#include "pagesweep/data/figure.h"
#include "pagesweep/data/page.h"
#include "pagesweep/data/page_surface.h"
#include "pagesweep/data/picture.h"
#include "pagesweep/data/point_map.h"
#include "pagesweep/data/time_map.h"
#include "pagesweep/quality/page_quality.h"
#include "pagesweep/report/verdict.h"

namespace pagesweep {

/// One option as it was used.
struct OptionValue {
  std::string station;  ///< "timing", "matching", ...
  std::string name;
  std::variant<bool, int, double, std::string> value;
  std::string unit;
};

/// Appends the values of an options struct that describes itself (base/options.h). `describe` calls the struct's
/// describe with the visitor that it is given.
template <class Describe>
void add_options_of(std::vector<OptionValue>& values, const std::string& station, Describe&& describe) {
  describe([&](std::string_view name, const auto& field, std::string_view unit, std::string_view) {
    using Field = std::decay_t<decltype(field)>;
    OptionValue value{station, std::string(name), {}, std::string(unit)};
    if constexpr (std::is_enum_v<Field>)
      value.value = std::string(name_of(field));
    else
      value.value = field;
    values.push_back(std::move(value));
  });
}
template <class Options>
void add_options(std::vector<OptionValue>& values, const std::string& station, Options options) {
  add_options_of(values, station, [&](auto&& visit) { options.describe(visit); });
}

/// What one camera recorded and what came of it.
struct CameraReport {
  std::string name;
  int frames = 0;  ///< instants, dropped ones included
  int dropped = 0;
  const TimeMap* times = nullptr;    ///< may be absent
  const PointMap* points = nullptr;  ///< may be absent
  std::vector<Figure> figures;       ///< anything else worth knowing: the sensor's noise, ...
  std::string exposure = {};         ///< how well it was exposed, and what would be better; empty: not known
};

/// Light of the stripe over time at one spot.
struct ProfileSample {
  double time_frames = 0;
  double light = 0;  ///< 1 at the top
};

/// How long something took.
struct StationTime {
  std::string station;
  double seconds = 0;
};

/// Everything that a report tells. What is absent is left out of it.
struct ReportInputs {
  std::string title;    ///< of the scan: the capture's name
  std::string program;  ///< "pagesweep 0.1.0"
  std::vector<CameraReport> cameras;
  std::vector<ProfileSample> profile;
  std::span<const PageSurface> surfaces;
  std::span<const Page> pages;
  std::span<const PageQuality> quality;  ///< one a page, or none
  const Picture* scan = nullptr;
  bool pages_expected = true;  ///< false where only the surface was asked for
  std::vector<Figure> figures;
  std::vector<OptionValue> options;
  std::vector<StationTime> times;
  std::vector<std::string> warnings;
  VerdictOptions verdict;
};

/// Writes folder / "report.html" (one self-contained page) and then folder / "report.json" (the same for programs,
/// see docs/formats.md).
/// \throws Error  if a file cannot be written
void write_report(const std::filesystem::path& folder, const ReportInputs& inputs);

/// Adds the comparison with the truth to a report.html that write_report() made, in place of an earlier one.
/// \throws Error  if there is no such report or it cannot be written
void add_evaluation(const std::filesystem::path& folder, std::span<const Figure> figures,
                    std::span<const FigureMap> maps);

/// Number of pixels of each status.
using StatusCounts = std::array<std::size_t, names_of(PixelStatus{}).size()>;
StatusCounts count_status(const Image<PixelStatus>& status);

/// Median of the standard deviations of all points with status ok [mm]; NaN if there are none.
double typical_sigma(std::span<const CameraReport> cameras);

}  // namespace pagesweep
