// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/edge_correction.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <span>
#include <stdexcept>
#include <utility>

#include "pagesweep/base/local_plane.h"
#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

/// Offsets beyond are the work of something else than an edge of print.
constexpr float largest_offset_px = 2;
/// [standard deviations] A leaning that no gain below 1 px^2 makes as large as that tells and corrects nothing.
constexpr float least_leaning = 0.2f;

/// Derivative of the samples at -2..2 at the middle one, exact for cubics; over fewer neighbours at borders.
float derivative(float before2, float before, float after, float after2) {
  const float narrow = 0.5f * (after - before);
  const float wide = 0.25f * (after2 - before2);
  return std::isfinite(wide) ? (4 * narrow - wide) / 3 : narrow;
}

/// The offsets of a row of pixels [px].
struct RowOffsets {
  std::span<const float> dx, dy;
};

/// Derivatives of the logarithm of the amplitude, row by row. It holds scratch memory: one a thread.
class AmplitudeOffsets {
 public:
  explicit AmplitudeOffsets(const TimeMap& times)
      : times_(times), dx_(static_cast<std::size_t>(times.width())), dy_(dx_.size()) {}

  RowOffsets row(int y) {
    for (int x = 0; x < times_.width(); ++x) {
      const auto k = static_cast<std::size_t>(x);
      const float here = amplitude(x, y);
      dx_[k] = derivative(amplitude(x - 2, y), amplitude(x - 1, y), amplitude(x + 1, y), amplitude(x + 2, y)) / here;
      dy_[k] = derivative(amplitude(x, y - 2), amplitude(x, y - 1), amplitude(x, y + 1), amplitude(x, y + 2)) / here;
    }
    return {dx_, dy_};
  }

 private:
  float amplitude(int x, int y) const {
    return times_.amplitude.contains(x, y) && times_.status(x, y) == PixelStatus::ok ? times_.amplitude(x, y)
                                                                                     : not_a_number;
  }

  const TimeMap& times_;
  std::vector<float> dx_, dy_;
};

class Surroundings {
 public:
  Surroundings(const TimeMap& times, const RowOffsets& offsets) : times_(times), offsets_(offsets) {}

  /// Whether there may be something to compare.
  bool are_worth_it(int x, int y) const {
    const auto [dx, dy] = offset(x);
    if (times_.status(x, y) != PixelStatus::ok || !(std::abs(dx) + std::abs(dy) < largest_offset_px)) return false;
    const float least = least_leaning * times_.sigma(x, y);
    return !((dx * dx + dy * dy) * frames_a_pixel_squared(x, y).most < least * least);
  }

  /// What is compared of the pixels of a row that are worth it.
  void look(PlaneBatch& planes, PlaneFitter& fitter, EdgeComparisons& comparisons) const {
    fitter.fit(times_.time, planes);
    const auto are_one_surface = fitter.are_one_surface(times_.sigma, planes);
    for (std::size_t k = 0; k < planes.count; ++k) {
      if (!planes.found(k)) continue;
      const int x = planes.column[k], y = planes.row;
      const auto [dx, dy] = offset(x);
      comparisons.push_back({x, y, -planes.middle[k], dx * planes.across[k] + dy * planes.down[k],
                             std::sqrt(dx * dx + dy * dy), std::sqrt(frames_a_pixel_squared(x, y).least),
                             are_one_surface[k]});
    }
  }

 private:
  std::pair<float, float> offset(int x) const {
    return {offsets_.dx[static_cast<std::size_t>(x)], offsets_.dy[static_cast<std::size_t>(x)]};
  }
  struct Range {
    float least, most;
  };
  /// What the stripe takes from pixel to pixel, squared: from the more equal of the neighbours on either side, as
  /// between the others there may be a step, and from the less equal ones.
  Range frames_a_pixel_squared(int x, int y) const {
    const auto difference = [&](int dx, int dy) {
      const bool inside = times_.time.contains(x + dx, y + dy);
      return inside ? std::abs(times_.time(x + dx, y + dy) - times_.time(x, y)) : not_a_number;
    };
    const Range across = range_of(difference(1, 0), difference(-1, 0));
    const Range down = range_of(difference(0, 1), difference(0, -1));
    return {across.least * across.least + down.least * down.least, across.most * across.most + down.most * down.most};
  }
  /// One that is NaN says nothing; two say 0.
  static Range range_of(float a, float b) {
    const bool has_a = !std::isnan(a), has_b = !std::isnan(b);
    if (has_a && has_b) return {std::min(a, b), std::max(a, b)};
    const float only = has_a ? a : has_b ? b : 0;
    return {only, only};
  }

  const TimeMap& times_;
  RowOffsets offsets_;
};

/// \param row_of  gives the offsets of row y, which last until the next
template <class RowOf>
void compare_row(const TimeMap& times, int y, const PixelSet* only, const RowOf& row_of, PlaneFitter& fitter,
                 EdgeComparisons& comparisons) {
  if (!any_takes_part(only, y)) return;
  const Surroundings surroundings(times, row_of(y));
  const auto are_worth_it = [&](int x) { return takes_part(only, x, y) && surroundings.are_worth_it(x, y); };
  in_batches(times.width(), y, are_worth_it,
             [&](PlaneBatch& planes) { surroundings.look(planes, fitter, comparisons); });
}

/// \param compare  appends what is compared of the rows begin ... end - 1
EdgeComparisons gather_rows(int height, const std::function<void(int begin, int end, EdgeComparisons&)>& compare) {
  constexpr int rows_at_once = 8;
  std::vector<EdgeComparisons> parts(static_cast<std::size_t>((height + rows_at_once - 1) / rows_at_once));
  parallel_ranges(height, rows_at_once, [&](int begin, int end) {
    compare(begin, end, parts[static_cast<std::size_t>(begin / rows_at_once)]);
  });
  std::vector<std::size_t> begins{0};
  for (const EdgeComparisons& part : parts) begins.push_back(begins.back() + part.size());
  EdgeComparisons all(begins.back());
  parallel_ranges(static_cast<int>(parts.size()), 8, [&](int begin, int end) {
    for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k)
      std::ranges::copy(parts[k], all.begin() + static_cast<std::ptrdiff_t>(begins[k]));
  });
  return all;
}

constexpr int plane_radius_px = 3;
constexpr int edges_at_once = 4096;

}  // namespace

/// Sums over edges, for a straight line through the origin.
struct EdgeFit::Sums {
  double ll = 0, lm = 0, mm = 0;  ///< leaning and misfit
  double fourth = 0, excess = 0;  ///< leaning^4, leaning^2 (rest^2 - 1)
  long long count = 0;

  void operator+=(const Sums& more) {
    ll += more.ll;
    lm += more.lm;
    mm += more.mm;
    fourth += more.fourth;
    excess += more.excess;
    count += more.count;
  }
};

SpotOffsets offsets_from_amplitude(const TimeMap& times) {
  SpotOffsets offsets(times.width(), times.height());
  parallel_rows(times.height(), [&](int y) {
    AmplitudeOffsets amplitudes(times);
    const auto [dx, dy] = amplitudes.row(y);
    std::ranges::copy(dx, offsets.dx.row(y).begin());
    std::ranges::copy(dy, offsets.dy.row(y).begin());
  });
  return offsets;
}

EdgeComparisons compare_with_surroundings(const TimeMap& times, const SpotOffsets& offsets, const PixelSet* only) {
  if (times.width() != offsets.width() || times.height() != offsets.height())
    throw std::invalid_argument("edge correction: time map and offsets differ in size");
  const auto row_of = [&](int y) { return RowOffsets{offsets.dx.row(y), offsets.dy.row(y)}; };
  return gather_rows(times.height(), [&](int begin, int end, EdgeComparisons& comparisons) {
    PlaneFitter fitter(plane_radius_px);
    for (int y = begin; y < end; ++y) compare_row(times, y, only, row_of, fitter, comparisons);
  });
}

EdgeComparisons compare_by_amplitude(const TimeMap& times, const PixelSet* only) {
  return gather_rows(times.height(), [&](int begin, int end, EdgeComparisons& comparisons) {
    PlaneFitter fitter(plane_radius_px);
    AmplitudeOffsets amplitudes(times);
    const auto row_of = [&](int y) { return amplitudes.row(y); };
    for (int y = begin; y < end; ++y) compare_row(times, y, only, row_of, fitter, comparisons);
  });
}

void EdgeFit::add(const TimeMap& times, const EdgeComparisons& comparisons) {
  for (const EdgeComparison& seen : comparisons) {
    if (!seen.one_surface) continue;
    const float sigma = times.sigma(seen.x, seen.y), leaning = seen.leaning / sigma;
    if (std::abs(leaning) >= least_leaning) edges_.push_back({leaning, seen.misfit / sigma});
  }
}

/// Sums over some edges whose rest, with that gain, is within `limit` sigmas.
EdgeFit::Sums EdgeFit::sum(std::span<const Edge> edges, double gain, double limit) {
  Sums sums;
  for (const auto& [leaning_sigmas, misfit_sigmas] : edges) {
    const double leaning = leaning_sigmas, misfit = misfit_sigmas, rest = misfit - gain * leaning;
    if (!(std::abs(rest) < limit)) continue;
    const double square = leaning * leaning;
    sums.ll += square;
    sums.lm += leaning * misfit;
    sums.mm += misfit * misfit;
    sums.fourth += square * square;
    sums.excess += square * (rest * rest - 1);
    ++sums.count;
  }
  return sums;
}

EdgeFit::Sums EdgeFit::gather(double gain, double limit) const {
  const auto count = static_cast<int>(edges_.size());
  std::vector<Sums> parts((edges_.size() + edges_at_once - 1) / edges_at_once);
  parallel_ranges(count, edges_at_once, [&](int begin, int end) {
    const auto some = std::span(edges_).subspan(static_cast<std::size_t>(begin), static_cast<std::size_t>(end - begin));
    parts[static_cast<std::size_t>(begin / edges_at_once)] = sum(some, gain, limit);
  });
  Sums sums;
  for (const Sums& part : parts) sums += part;
  return sums;
}

EdgeCorrection EdgeFit::fit() {
  fitted_ = edges_.size();
  constexpr double widest = 20, usual = 6;
  EdgeCorrection correction;
  // Outliers are what the last gain leaves far away; the limit narrows as the gain gets better.
  double gain = 0;
  Sums sums;
  for (const double limit : {widest, usual, usual}) {
    sums = gather(gain, limit);
    if (sums.count < 100 || !(sums.ll > 0)) return correction;
    gain = sums.lm / sums.ll;
  }
  const double gain_sigma = 1 / std::sqrt(sums.ll);
  correction.edges = sums.count;
  if (gain < 5 * gain_sigma) return correction;
  sums = gather(gain, usual);
  correction.gain = gain;
  const double rest = sums.mm - 2 * gain * sums.lm + gain * gain * sums.ll;
  correction.before = std::sqrt(sums.mm / static_cast<double>(sums.count));
  correction.after = std::sqrt(rest / static_cast<double>(sums.count));
  correction.scatter = std::sqrt(std::max(0.0, sums.excess / sums.fourth)) / gain;
  return correction;
}

EdgeCorrection fit_edges(const TimeMap& times, const EdgeComparisons& comparisons) {
  EdgeFit edges;
  edges.add(times, comparisons);
  return edges.fit();
}

void correct_edges(TimeMap& times, const EdgeComparisons& comparisons, const EdgeCorrection& correction) {
  if (!(correction.gain > 0)) return;
  const auto correct = [&](const EdgeComparison& seen) {
    const double shift = correction.gain * seen.leaning;
    // On two surfaces the spot's middle is somewhere in the pixel: evenly distributed over it, at most.
    const double off_px = std::min(correction.gain * seen.offset_px, 1 / std::sqrt(12.0));
    const double doubt = seen.one_surface ? correction.scatter * shift : off_px * seen.pixel;
    float& sigma = times.sigma(seen.x, seen.y);
    sigma = static_cast<float>(std::hypot(sigma, doubt));
    if (seen.one_surface) times.time(seen.x, seen.y) -= static_cast<float>(shift);
  };
  parallel_ranges(static_cast<int>(comparisons.size()), edges_at_once, [&](int begin, int end) {
    std::for_each(comparisons.begin() + begin, comparisons.begin() + end, correct);
  });
}

}  // namespace pagesweep
