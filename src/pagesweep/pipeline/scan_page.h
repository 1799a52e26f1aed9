// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "pagesweep/base/progress.h"
#include "pagesweep/camera/rig.h"
#include "pagesweep/data/frames.h"
#include "pagesweep/data/page.h"
#include "pagesweep/data/page_surface.h"
#include "pagesweep/data/point_map.h"
#include "pagesweep/data/time_map.h"
#include "pagesweep/dewarping/dewarp.h"
#include "pagesweep/matching/match_epipolar.h"
#include "pagesweep/surfacing/fit_surface.h"
#include "pagesweep/timing/edge_correction.h"
#include "pagesweep/timing/estimate_times.h"
#include "pagesweep/triangulation/calibrate_light.h"
#include "pagesweep/triangulation/fuse_light.h"
#include "pagesweep/triangulation/triangulate.h"

namespace pagesweep {

/// What tells which pixels of the cameras see the same spot.
enum class Matcher {
  time,           ///< equal time values of the moving stripe (paper III.B)
  sequence,       ///< equal gray value sequences, of any patterns (paper III.A)
  light_section,  ///< nothing: each camera alone against the light plane of the rig (the paper's [8])
};
constexpr auto names_of(Matcher) { return std::array<std::string_view, 3>{"time", "sequence", "light-section"}; }

/// What tells where in its spot of paper a pixel's light came from. Over an edge of print the time value belongs to
/// the bright side (docs/derivations/edges.md).
enum class EdgeWitness {
  none,       ///< nothing: time values stay as they are
  amplitude,  ///< the camera's own amplitudes
  scan,       ///< the scan, seen through a first measurement; the amplitudes where there is none
};
constexpr auto names_of(EdgeWitness) { return std::array<std::string_view, 3>{"none", "amplitude", "scan"}; }

/// The options of all stations.
struct ScanOptions {
  Matcher matcher = Matcher::time;
  EdgeWitness edges = EdgeWitness::scan;
  bool fusion = true;
  TimingOptions timing;
  MatchOptions matching;
  TriangulationOptions triangulation;
  SurfaceOptions surface;
  DewarpOptions dewarp;
  /// Is shown a camera's points while they grow, without intensities; an exception ends the run.
  std::function<void(const PointMap&)> on_points = {};

  /// \see base/options.h
  template <class Visitor>
  void describe_measurement(Visitor&& visit) {
    visit("matcher", matcher, "", "what tells which pixels of the two cameras see the same spot");
    timing.describe(visit);
    visit("edges", edges, "", "what tells where the light of a pixel at an edge of print came from");
    matching.describe(visit);
    visit("fusion", fusion, "",
          "let the sheet of light, calibrated by the stereo points of the scan itself, have its say in every point");
    triangulation.describe(visit);
  }
  template <class Visitor>
  void describe_pages(Visitor&& visit) {
    surface.describe(visit);
    dewarp.describe(visit);
  }
};

/// What the cameras measured: one entry a camera, in the order of `cameras`.
struct Measurement {
  std::vector<Camera> cameras;
  std::vector<int> dropped_frames;
  std::vector<Image<std::uint8_t>> clipped_frames;  ///< in how many frames each pixel was clipped; empty: not known
  std::optional<Timing> timing;       ///< time maps, stripe profile, sensor noise; none for the sequence matcher
  std::vector<EdgeCorrection> edges;  ///< of the time maps; empty: not corrected
  std::optional<LightSweep> sweep;    ///< the sheet of light as the stereo points show it
  std::vector<FusionCounts> fusion;   ///< what it did to the points; empty: it had no say
  std::vector<PointMap> points;
};

/// A whole scan: the measured points, the surfaces through them and the flat pages.
struct Scan {
  Measurement measurement;
  std::vector<PageSurface> surfaces;  ///< from left to right
  std::vector<Page> pages;            ///< one a surface
};

/// Gives the scanner's picture. It is asked when the frames have been measured, as often as it is needed: until then
/// the scanner may be at work, and nobody needs the memory.
using ScanSource = std::function<const Picture&()>;

/// The first half of the way: frames to points.
/// \param scan  the scanner's picture, if there is one: it tells better than the frames what is printed where
/// \throws Error  (bad_input) if the rig lacks a camera of the source, or what the matcher needs
Measurement reconstruct(FrameSource& frames, const Rig& rig, const ScanOptions& options = {},
                        Progress& progress = no_progress(), const ScanSource& scan = {});

/// The second half: points to flat pages.
/// \param measurement  goes into what is returned, and is left as it was if this throws
/// \throws Error  (bad_input) if the rig has no scanner or the picture is not of its size; (no_result) if no page is
/// found
Scan flatten(Measurement&& measurement, const Picture& scan, const Rig& rig, const ScanOptions& options = {},
             Progress& progress = no_progress());

/// The whole way: frames, time values, correspondences, points, surface, pages.
Scan scan_page(FrameSource& frames, const Picture& scan, const Rig& rig, const ScanOptions& options = {},
               Progress& progress = no_progress());
Scan scan_page(FrameSource& frames, const ScanSource& scan, const Rig& rig, const ScanOptions& options = {},
               Progress& progress = no_progress());

}  // namespace pagesweep
