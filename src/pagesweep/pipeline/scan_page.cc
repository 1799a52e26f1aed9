// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/pipeline/scan_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "pagesweep/base/error.h"
#include "pagesweep/camera/ray_table.h"
#include "pagesweep/data/linear_light.h"
#include "pagesweep/footprint/weigh_footprints.h"
#include "pagesweep/matching/match_sequences.h"
#include "pagesweep/pipeline/point_stream.h"
#include "pagesweep/timing/pairwise.h"
#include "pagesweep/timing/time_stream.h"
#include "pagesweep/triangulation/normals.h"
#include "pagesweep/triangulation/section_light.h"

namespace pagesweep {
namespace {

/// The rig's calibration of each camera of the source.
std::vector<Camera> cameras_of(const FrameSource& source, const Rig& rig, Matcher matcher) {
  std::vector<Camera> cameras;
  for (const Sequence& sequence : source.sequences()) {
    const Camera* camera = rig.find_camera(sequence.camera);
    if (!camera)
      throw Error(ErrorKind::bad_input,
                  fmt::format("the rig has no camera '{}', which the capture holds frames of: name it as the rig does",
                              sequence.camera));
    cameras.push_back(*camera);
  }
  if (matcher == Matcher::light_section) {
    if (!rig.light)
      throw Error(ErrorKind::bad_input,
                  "light sectioning needs the rig's \"light\": calibrate it, or match two cameras");
  } else if (cameras.size() != 2) {
    throw Error(ErrorKind::bad_input,
                fmt::format("matching needs two cameras and the capture has {}: use --matcher light-section for one",
                            cameras.size()));
  }
  return cameras;
}

/// What the stations work with: the cameras' rays are worked out once.
struct Stage {
  const Rig& rig;
  const ScanOptions& options;
  std::vector<Frames> frames;  ///< where they are needed as a whole
  const std::vector<RayTable> cameras;
};

MatchPair match(const Stage& stage, const Measurement& measurement, Progress& progress) {
  const auto& [rig, options, frames, cameras] = stage;
  if (options.matcher == Matcher::sequence)
    return match_sequences(frames[0], frames[1], cameras[0], cameras[1], options.matching, progress);
  const auto& times = measurement.timing->maps;
  MatchPair matches = match_times(times[0], times[1], cameras[0], cameras[1], options.matching, progress);
  if (options.timing.estimator == TimeEstimator::pairwise) {
    matches.from_first = shift_pairwise(matches.from_first, frames[0], frames[1], times[1], options.timing);
    matches.from_second = shift_pairwise(matches.from_second, frames[1], frames[0], times[0], options.timing);
  }
  return matches;
}

std::vector<PointMap> triangulate_both(const MatchPair& matches, const Stage& stage, const Measurement& measurement) {
  const auto intensity = [&](std::size_t c) {
    return measurement.timing ? measurement.timing->maps[c].amplitude : brightest(stage.frames[c]);
  };
  const auto& cameras = stage.cameras;
  const TriangulationOptions& options = stage.options.triangulation;
  return {triangulate(matches.from_first, intensity(0), cameras[0], cameras[1], options),
          triangulate(matches.from_second, intensity(1), cameras[1], cameras[0], options)};
}

std::vector<PointMap> section_each(const Stage& stage, const Measurement& measurement) {
  std::vector<PointMap> points;
  for (std::size_t c = 0; c < stage.cameras.size(); ++c)
    points.push_back(
        section_light(measurement.timing->maps[c], stage.cameras[c], *stage.rig.light, stage.options.triangulation));
  return points;
}

/// The stereo points calibrate the sheet of light, which then takes part in them.
void fuse(const MatchPair& matches, const Stage& stage, Measurement& measurement) {
  const auto& cameras = stage.cameras;
  const auto& times = measurement.timing->maps;
  measurement.fusion.clear();
  measurement.sweep = calibrate_light(measurement.points, times);
  if (!measurement.sweep) return;
  const Light& light = measurement.sweep->light;
  const TriangulationOptions& options = stage.options.triangulation;
  measurement.fusion = {fuse_light(measurement.points[0], matches.from_first, times[0], cameras[0], light, options),
                        fuse_light(measurement.points[1], matches.from_second, times[1], cameras[1], light, options)};
}

/// Whether points can be found while the stripe is on its way.
bool follows_stripe(const ScanOptions& options) {
  return options.matcher == Matcher::time && options.timing.estimator != TimeEstimator::pairwise;
}

PointStream::Times both(const std::vector<TimeMap>& times) { return {&times[0], &times[1]}; }

/// Points from the time maps; from the frames, for the sequence matcher. They have no normals yet.
void find_points(const Stage& stage, Measurement& measurement, Progress& progress) {
  if (stage.options.matcher == Matcher::light_section) {
    measurement.points = section_each(stage, measurement);
    return;
  }
  if (follows_stripe(stage.options)) {
    PointStream points(stage.cameras, stage.options, {.corrects_edges = false, .fits_normals = false});
    points.finish(both(measurement.timing->maps), measurement, progress);
    return;
  }
  const MatchPair matches = match(stage, measurement, progress);
  progress.begin("triangulating");
  measurement.points = triangulate_both(matches, stage, measurement);
  if (stage.options.fusion && measurement.timing) fuse(matches, stage, measurement);
}

/// Normals, and without the points that stand alone.
void finish_points(const Stage& stage, Measurement& measurement) {
  for (std::size_t c = 0; c < stage.cameras.size(); ++c)
    fit_normals(measurement.points[c], stage.cameras[c], stage.options.triangulation.normal_radius_px);
}

/// Each camera's times, moved to the pixels' centres by what its own amplitudes tell of the print.
void correct_by_amplitude(const std::vector<TimeMap>& seen, Measurement& measurement) {
  measurement.edges.clear();
  for (std::size_t c = 0; c < seen.size(); ++c) {
    const auto comparisons = compare_by_amplitude(seen[c]);
    measurement.edges.push_back(fit_edges(seen[c], comparisons));
    correct_edges(measurement.timing->maps[c], comparisons, measurement.edges[c]);
  }
}

/// Likewise by what the scan tells, where the first measurement can look it up, and only if it explains the times
/// better: a scan that does not lie where the rig says is no witness.
void correct_by_scan(const std::vector<TimeMap>& seen, const Scanner& scanner, const Picture& scan,
                     Measurement& measurement) {
  const Image<float> light = linear_light(scan);
  for (std::size_t c = 0; c < seen.size(); ++c) {
    const double spot_variance_px2 = measurement.edges[c].gain;
    if (!(spot_variance_px2 > 0)) continue;
    const SpotOffsets offsets = weigh_footprints(measurement.points[c], scanner, light, spot_variance_px2);
    const auto comparisons = compare_with_surroundings(seen[c], offsets);
    const EdgeCorrection correction = fit_edges(seen[c], comparisons);
    if (!(correction.after < measurement.edges[c].after)) continue;
    TimeMap& times = measurement.timing->maps[c];
    for (std::size_t i = 0; i < times.time.size(); ++i) {
      if (!std::isfinite(offsets.dx.data()[i])) continue;
      times.time.data()[i] = seen[c].time.data()[i];
      times.sigma.data()[i] = seen[c].sigma.data()[i];
    }
    correct_edges(times, comparisons, correction);
    measurement.edges[c] = correction;
  }
}

/// The direction, in the rig's xy plane, in which the scan's columns count: the reader's right.
double reading_direction(const Scanner& scanner) {
  const auto ray = scanner.ray({0.5 * (scanner.width() - 1), 0.5 * (scanner.height() - 1)});
  const auto middle = ray ? Plane{Eigen::Vector3d::UnitZ(), 0}.meet(*ray) : std::nullopt;
  if (!middle) throw Error(ErrorKind::bad_input, "the rig's scanner does not look at the table z = 0");
  const Matrix23d scan_from_table = scanner.project_jacobian(*middle);
  // Along it v stays and u grows.
  const Eigen::Vector2d along_row(scan_from_table(1, 1), -scan_from_table(1, 0));
  const bool rightward = scan_from_table.row(0).head<2>().dot(along_row) > 0;
  return rightward ? std::atan2(along_row.y(), along_row.x()) : std::atan2(-along_row.y(), -along_row.x());
}

/// All frames first, then what is measured from them.
std::vector<Frames> read_frames(FrameSource& source, const ScanOptions& options, Measurement& measurement,
                                Progress& progress) {
  std::vector<Frames> frames = read_all(source, progress);
  for (const Frames& sequence : frames) {
    measurement.dropped_frames.push_back(sequence.dropped());
    measurement.clipped_frames.push_back(count_clipped(sequence));
  }
  if (options.matcher != Matcher::sequence) measurement.timing = estimate_times(frames, options.timing, progress);
  return frames;
}

/// Time values while the frames come in; of the frames nothing is kept.
/// \param on_news  called after every instant
void follow_frames(FrameSource& source, const ScanOptions& options, Measurement& measurement, Progress& progress,
                   const std::function<void(const TimeStream&)>& on_news) {
  TimeStream times(source.sequences(), options.timing);
  progress.begin("measuring while the frames come in");
  while (auto set = source.next()) {
    const double part = (set->index + 1.0) / source.sequences()[0].count;
    times.add(*std::move(set));
    on_news(times);
    progress.advance(part);
  }
  measurement.timing = times.finish(progress, source.sequences()[0].count);
  for (std::size_t c = 0; c < source.sequences().size(); ++c) {
    measurement.dropped_frames.push_back(times.dropped_frames(c));
    measurement.clipped_frames.push_back(times.clipped_frames(c));
  }
}

/// Points that follow the stripe as well.
/// \return the time values as they were seen
std::vector<TimeMap> follow_stripe(FrameSource& source, const Stage& stage, const PointStream::Steps& steps,
                                   Measurement& measurement, Progress& progress) {
  std::optional<PointStream> points;
  const auto begin = [&] { points.emplace(stage.cameras, stage.options, steps); };
  follow_frames(source, stage.options, measurement, progress, [&](const TimeStream& times) {
    const double until = times.known_until();
    if (!std::isfinite(until)) return;
    if (!points) begin();
    points->follow({&times.so_far(0), &times.so_far(1)}, until);
    if (stage.options.on_points) stage.options.on_points(points->so_far(0));
  });
  if (!points) begin();
  std::vector<TimeMap> seen(2);
  seen.swap(measurement.timing->maps);
  points->finish(both(seen), measurement, progress);
  if (!steps.corrects_edges) measurement.timing->maps = seen;
  return seen;
}

/// A measurement whose frames, or the light of the rig, must be looked at as a whole.
std::vector<TimeMap> measure_at_the_end(FrameSource& source, Stage& stage, Measurement& measurement,
                                        Progress& progress) {
  const ScanOptions& options = stage.options;
  if (options.matcher == Matcher::light_section)
    follow_frames(source, options, measurement, progress, [](const TimeStream&) {});
  else
    stage.frames = read_frames(source, options, measurement, progress);
  std::vector<TimeMap> seen;
  if (measurement.timing) {
    seen = measurement.timing->maps;
    progress.begin("looking for print");
    if (options.edges != EdgeWitness::none) correct_by_amplitude(seen, measurement);
  }
  find_points(stage, measurement, progress);
  return seen;
}

/// The light of the scan: the rig's, or the sheet of light as the cameras saw it.
ScanLight light_of(const Measurement& measurement, const Rig& rig) {
  ScanLight light{rig.light, rig.lamp, rig.white};
  if (measurement.sweep) {
    light.sheet = measurement.sweep->light;
    if (measurement.timing)
      light.stripe_fwhm_mm =
          measurement.timing->profile.full_width_half_maximum() * std::abs(measurement.sweep->mm_per_frame);
  }
  return light;
}

}  // namespace

Measurement reconstruct(FrameSource& source, const Rig& rig, const ScanOptions& options, Progress& progress,
                        const ScanSource& scan) {
  Measurement measurement;
  measurement.cameras = cameras_of(source, rig, options.matcher);
  Stage stage{rig, options, {}, {measurement.cameras.begin(), measurement.cameras.end()}};
  const bool asks_scan = options.edges == EdgeWitness::scan && scan && rig.scanner;
  const PointStream::Steps steps{options.edges != EdgeWitness::none, !asks_scan};
  const std::vector<TimeMap> seen = follows_stripe(options) ? follow_stripe(source, stage, steps, measurement, progress)
                                                            : measure_at_the_end(source, stage, measurement, progress);
  if (asks_scan && measurement.timing) {
    progress.begin("looking up the print in the scan");
    correct_by_scan(seen, *rig.scanner, scan(), measurement);
    find_points(stage, measurement, progress);
  }
  if (asks_scan || !follows_stripe(options)) finish_points(stage, measurement);
  return measurement;
}

Scan flatten(Measurement&& measurement, const Picture& picture, const Rig& rig, const ScanOptions& options,
             Progress& progress) {
  if (!rig.scanner)
    throw Error(ErrorKind::bad_input, "the rig has no \"scanner\": without it no picture can be flattened");
  if (picture.width() != rig.scanner->width() || picture.height() != rig.scanner->height())
    throw Error(ErrorKind::bad_input,
                fmt::format("the scan has {} x {} pixels but the rig's scanner {} x {}: they do not belong together",
                            picture.width(), picture.height(), rig.scanner->width(), rig.scanner->height()));
  SurfaceOptions surface_options = options.surface;
  surface_options.reading_direction_rad = reading_direction(*rig.scanner);
  surface_options.straighten = options.dewarp.deskew;

  Scan scan;
  scan.surfaces = fit_surface(measurement.points, surface_options, progress);
  scan.pages = dewarp(scan.surfaces, picture, *rig.scanner, options.dewarp, progress, light_of(measurement, rig));
  scan.measurement = std::move(measurement);
  return scan;
}

Scan scan_page(FrameSource& frames, const ScanSource& scan, const Rig& rig, const ScanOptions& options,
               Progress& progress) {
  Measurement measurement = reconstruct(frames, rig, options, progress, scan);
  return flatten(std::move(measurement), scan(), rig, options, progress);
}

Scan scan_page(FrameSource& frames, const Picture& scan, const Rig& rig, const ScanOptions& options,
               Progress& progress) {
  return scan_page(frames, [&]() -> const Picture& { return scan; }, rig, options, progress);
}

}  // namespace pagesweep
