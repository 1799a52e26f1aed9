// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/pipeline/point_stream.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "pagesweep/base/parallel.h"
#include "pagesweep/triangulation/normals.h"

namespace pagesweep {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

// How far each step stays behind the one before, in pixels that the stripe takes to get there: what it looks at around
// a pixel, and a little more.
constexpr double to_correct_px = 30;  ///< planes through the times around, and beyond a step in depth
constexpr double to_match_px = 5;     ///< links between times
constexpr double to_confirm_px = 3;   ///< matches from the other side
constexpr double to_fuse_px = 16;     ///< lateness of the light,
constexpr double to_fuse = 12;        ///< [frames] and what makes the planes of the light sure: three of their knots
constexpr double to_finish_px = 4;    ///< the plane that gives the normal
// Parts, as a share of the picture's longer side. The first one has no older ones to learn from; if the others were
// smaller, what all together are asked for would be asked too often.
constexpr double first_part = 0.33, next_part = 0.1;

/// [frames] that the stripe takes from a pixel to the next, where it is slow: it has passed nine of ten pixels faster.
/// \return 0 if hardly any times are known
double slowest_passage(const TimeMap& times) {
  constexpr int stride = 7;
  std::vector<float> steps;
  for (int y = 0; y + 1 < times.height(); y += stride)
    for (int x = 0; x + 1 < times.width(); x += stride) {
      const float here = times.time(x, y);
      const float step = std::hypot(times.time(x + 1, y) - here, times.time(x, y + 1) - here);
      if (std::isfinite(step)) steps.push_back(step);
    }
  if (steps.size() < 50) return 0;
  const auto place = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() * 9 / 10);
  std::ranges::nth_element(steps, place);
  return *place;
}

/// But for the residual.
void copy_pixel(const TimeMap& from, int x, int y, TimeMap& to) {
  to.time(x, y) = from.time(x, y);
  to.sigma(x, y) = from.sigma(x, y);
  to.amplitude(x, y) = from.amplitude(x, y);
  to.status(x, y) = from.status(x, y);
}

}  // namespace

PointStream::PointStream(const std::vector<RayTable>& cameras, const ScanOptions& options, const Steps& steps)
    : cameras_(cameras),
      options_(options),
      steps_(steps),
      known_until_(-infinity),
      done_until_(-infinity),
      matching_(cameras[0], cameras[1], options.matching),
      calibration_(static_cast<std::size_t>(cameras[0].width()) * static_cast<std::size_t>(cameras[0].height()) +
                   static_cast<std::size_t>(cameras[1].width()) * static_cast<std::size_t>(cameras[1].height())) {
  parallel_ranges(static_cast<int>(sides_.size()), 1, [&](int begin, int) {  // getting the memory takes a while
    const auto c = static_cast<std::size_t>(begin);
    const int width = cameras[c].width(), height = cameras[c].height();
    Side& side = sides_[c];
    if (steps.corrects_edges) {
      side.corrected = TimeMap(width, height);
      side.corrected.residual = {};
    }
    side.taken = Image<float>(width, height, not_a_number);
    side.step = Image<std::uint8_t>(width, height, none);
    side.now = PixelSet(width, height);
    side.points = PointMap(width, height);
    side.points.intensity = {};
    if (!steps.fits_normals) side.points.nx = side.points.ny = side.points.nz = {};
  });
}

void PointStream::follow(const Times& seen, double known_until) {
  if (!(known_until > known_until_)) return;
  known_until_ = known_until;
  frames_a_pixel_ = std::max(slowest_passage(*seen[0]), slowest_passage(*seen[1]));
  if (!(frames_a_pixel_ > 0)) return;
  const double passage = frames_a_pixel_ * std::max(seen[0]->width(), seen[0]->height());  // [frames] over the picture
  if (done_until_ == -infinity) done_until_ = known_until + (first_part - next_part) * passage;
  if (known_until < done_until_ + next_part * passage) return;
  go_on(seen, known_until, no_progress());
  done_until_ = known_until;
}

void PointStream::finish(const Times& seen, Measurement& measurement, Progress& progress) {
  forget_changed(seen);
  go_on(seen, infinity, progress);
  measurement.points.clear();
  measurement.fusion.clear();
  measurement.sweep = sweep_;
  if (steps_.corrects_edges) measurement.edges.clear();
  for (std::size_t c = 0; c < sides_.size(); ++c) {
    Side& side = sides_[c];
    PointMap& points = side.points;
    points.intensity = seen[c]->amplitude;
    if (!steps_.fits_normals)
      points.nx = points.ny = points.nz = Image<float>(points.width(), points.height(), not_a_number);
    measurement.points.push_back(std::move(side.points));
    if (sweep_) measurement.fusion.push_back(side.fusion);
    if (!steps_.corrects_edges) continue;
    measurement.edges.push_back(side.correction);
    side.corrected.residual = seen[c]->residual;
    measurement.timing->maps[c] = std::move(side.corrected);
  }
}

void PointStream::go_on(const Times& seen, double until, Progress& progress) {
  seen_ = seen;
  const auto stay_behind = [&](double pixels) { return until -= pixels * frames_a_pixel_; };
  take_times(seen, stay_behind(to_correct_px));
  stay_behind(to_match_px);
  if (step_on(timed, until)) matching_.match(times(0), times(1), now(), progress);
  locate(stay_behind(to_confirm_px));
  stay_behind(to_fuse_px);
  fuse(until -= to_fuse);
  if (steps_.fits_normals) fit_normals(stay_behind(to_finish_px));
}

bool PointStream::step_on(Side& side, const TimeMap& times, Step from, double until) {
  // What has no time comes at the end, where no time is too late.
  const bool at_the_end = until == infinity;
  const auto too_late = static_cast<float>(until);
  std::vector<std::uint8_t> rows(static_cast<std::size_t>(times.height()));
  parallel_rows(times.height(), [&](int y) {
    const float* time = times.time.row(y).data();
    std::uint8_t *step = side.step.row(y).data(), *now = side.now.row(y).data(), any = 0;
    for (int x = 0; x < times.width(); ++x) {  // without branches: a whole picture is passed for a few pixels
      const auto steps_on = static_cast<std::uint8_t>((step[x] == from) & (at_the_end | (time[x] < too_late)));
      now[x] = steps_on;
      step[x] = static_cast<std::uint8_t>(step[x] + steps_on);
      any |= steps_on;
    }
    rows[static_cast<std::size_t>(y)] = any;
  });
  return std::ranges::find(rows, 1) != rows.end();
}

bool PointStream::step_on(Step from, double until) {
  const bool first = step_on(sides_[0], times(0), from, until);
  const bool second = step_on(sides_[1], times(1), from, until);
  return first || second;
}

void PointStream::take_times(const Times& seen, double until) {
  for (std::size_t c = 0; c < sides_.size(); ++c) {
    Side& side = sides_[c];
    if (!step_on(side, *seen[c], none, until)) continue;
    if (until == infinity) leave_dark(*seen[c], side);
    parallel_rows(side.now.height(), [&](int y) {
      const float* time = seen[c]->time.row(y).data();
      const std::uint8_t* now = side.now.row(y).data();
      float* taken = side.taken.row(y).data();
      for (int x = 0; x < side.now.width(); ++x) taken[x] = now[x] ? time[x] : taken[x];
    });
    if (steps_.corrects_edges) correct(*seen[c], side);
  }
}

void PointStream::leave_dark(const TimeMap& seen, Side& side) {
  parallel_rows(side.now.height(), [&](int y) {
    for (int x = 0; x < side.now.width(); ++x) {
      if (!side.now(x, y) || !std::isnan(seen.time(x, y)) || !std::isnan(side.taken(x, y))) continue;
      side.now(x, y) = 0;
      side.step(x, y) = finished;
      side.points.status(x, y) = seen.status(x, y);
      if (steps_.corrects_edges) copy_pixel(seen, x, y, side.corrected);
    }
  });
}

void PointStream::correct(const TimeMap& seen, Side& side) {
  parallel_rows(side.now.height(), [&](int y) {
    if (!any_takes_part(&side.now, y)) return;
    for (int x = 0; x < side.now.width(); ++x)
      if (side.now(x, y)) copy_pixel(seen, x, y, side.corrected);
  });
  const auto comparisons = compare_by_amplitude(seen, &side.now);
  side.edges.add(seen, comparisons);
  if (side.edges.has_news()) side.correction = side.edges.fit();
  correct_edges(side.corrected, comparisons, side.correction);
}

void PointStream::locate(double until) {
  if (!step_on(matched, until)) return;
  matching_.keep_agreeing(now());
  const MatchPair& matches = matching_.matches();
  triangulate(matches.from_first, cameras_[0], cameras_[1], options_.triangulation, sides_[0].points, &sides_[0].now);
  triangulate(matches.from_second, cameras_[1], cameras_[0], options_.triangulation, sides_[1].points, &sides_[1].now);
  for (std::size_t c = 0; c < sides_.size(); ++c) calibration_.add(sides_[c].points, times(c), &sides_[c].now);
  if (options_.fusion && calibration_.has_news()) sweep_ = calibration_.fit();
}

void PointStream::fuse(double until) {
  // Without the sheet of light, points wait for it until the end.
  if (options_.fusion && !sweep_ && until < infinity) return;
  std::array<PixelSet, 2> stereo;
  for (std::size_t c = 0; c < sides_.size(); ++c) {
    const Side& side = sides_[c];
    stereo[c] = PixelSet(side.now.width(), side.now.height());
    parallel_rows(side.now.height(), [&](int y) {
      std::ranges::transform(side.step.row(y), stereo[c].row(y).begin(),
                             [](std::uint8_t step) { return step == located; });
    });
  }
  if (!step_on(located, until) || !sweep_) return;
  const MatchPair& matches = matching_.matches();
  for (std::size_t c = 0; c < sides_.size(); ++c)
    sides_[c].fusion += fuse_light(sides_[c].points, c == 0 ? matches.from_first : matches.from_second, times(c),
                                   cameras_[c], sweep_->light, options_.triangulation, &sides_[c].now, &stereo[c]);
}

void PointStream::fit_normals(double until) {
  if (!step_on(fused, until)) return;
  for (std::size_t c = 0; c < sides_.size(); ++c)
    pagesweep::fit_normals(sides_[c].points, cameras_[c], options_.triangulation.normal_radius_px, &sides_[c].now);
}

void PointStream::forget_changed(const Times& seen) {
  constexpr int reach_px = 3;                            // of what a pixel's way depends on
  constexpr float little = 0.1f;                         // standard deviations: less is worth nothing
  std::array<std::vector<std::vector<int>>, 2> changed;  // of each camera's rows
  for (std::size_t c = 0; c < sides_.size(); ++c) {
    const Side& side = sides_[c];
    changed[c].resize(static_cast<std::size_t>(side.step.height()));
    parallel_rows(side.step.height(), [&](int y) {
      const float *time = seen[c]->time.row(y).data(), *sigma = seen[c]->sigma.row(y).data();
      const float* taken = side.taken.row(y).data();
      const std::uint8_t* step = side.step.row(y).data();
      const auto has_changed = [&](int x) {
        return (step[x] != none) & !(std::abs(time[x] - taken[x]) < little * sigma[x]);
      };
      int any = 0;
      for (int x = 0; x < side.step.width(); ++x) any |= has_changed(x);  // hardly ever
      for (int x = 0; any && x < side.step.width(); ++x)
        if (has_changed(x)) changed[c][static_cast<std::size_t>(y)].push_back(x);
    });
  }
  const MatchPair& pair = matching_.matches();
  for (std::size_t c = 0; c < sides_.size(); ++c) {
    const Correspondences& matches = c == 0 ? pair.from_first : pair.from_second;
    for (int y = 0; y < sides_[c].step.height(); ++y)
      for (const int x : changed[c][static_cast<std::size_t>(y)]) {
        forget(sides_[c], x, y, reach_px);
        if (std::isfinite(matches.u(x, y)))
          forget(sides_[1 - c], static_cast<int>(std::lround(matches.u(x, y))),
                 static_cast<int>(std::lround(matches.v(x, y))), reach_px);
      }
  }
}

void PointStream::forget(Side& side, int x, int y, int reach) {
  PointMap& points = side.points;
  for (int j = std::max(0, y - reach); j <= std::min(y + reach, points.height() - 1); ++j)
    for (int i = std::max(0, x - reach); i <= std::min(x + reach, points.width() - 1); ++i) {
      side.step(i, j) = none;
      points.x(i, j) = points.y(i, j) = points.z(i, j) = points.sigma(i, j) = not_a_number;
      if (steps_.fits_normals) points.nx(i, j) = points.ny(i, j) = points.nz(i, j) = not_a_number;
      points.status(i, j) = PixelStatus::not_computed;
    }
}

}  // namespace pagesweep
