// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/time_matching.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <vector>

#include "pagesweep/matching/time_finder_internal.h"

namespace pagesweep {
namespace {

/// Median amplitude of a camera's pixels; 1 if there are none.
double usual_amplitude(const TimeMap& map) {
  constexpr std::size_t stride = 61;
  std::vector<float> amplitudes;
  for (std::size_t i = 0; i < map.status.size(); i += stride)
    if (map.status.data()[i] == PixelStatus::ok && map.amplitude.data()[i] > 0)
      amplitudes.push_back(map.amplitude.data()[i]);
  if (amplitudes.empty()) return 1;
  const auto middle = amplitudes.begin() + static_cast<std::ptrdiff_t>(amplitudes.size() / 2);
  std::nth_element(amplitudes.begin(), middle, amplitudes.end());
  return *middle;
}

/// Matches the pixels of some rows from the top down, sixteen of a row at a time: the surface is expected to go on as
/// in the row above, or else as on the left. What does not is looked at by itself.
class RowFollower {
 public:
  RowFollower(const TimeMap& from, const SearchedMap& to, const PixelMatcher& matcher, const EpipolarGeometry& geometry,
              Correspondences& matches)
      : from_(from),
        matcher_(matcher),
        geometry_(geometry),
        matches_(matches),
        max_sigma_px_(static_cast<float>(to.max_sigma_px)),
        finder_(from, to),
        batch_(make_batch(to, geometry)),
        depth_above_(static_cast<std::size_t>(from.width()), not_a_number),
        slope_above_(depth_above_) {}

  void match_row(int y) {
    depth_left_ = not_a_number;
    for (int x = 0; x < from_.width(); x += most_curves) {
      const Pixels pixels{x, y, static_cast<std::size_t>(std::min(most_curves, from_.width() - x))};
      if (!begin(pixels)) continue;
      load(pixels);
      follow(pixels);
      for (std::size_t i = 0; i < pixels.count; ++i)
        if (pending_[i]) look_closely(pixels, i);
      remember();
    }
  }

 private:
  /// Neighbours in a row.
  struct Pixels {
    int x, y;
    std::size_t count;
    int column(std::size_t i) const { return x + static_cast<int>(i); }
  };

  /// Which of the pixels can be matched. \return whether any can
  bool begin(const Pixels& pixels) {
    bool any = false;
    pending_.fill(false);
    depth_.fill(not_a_number);
    for (std::size_t i = 0; i < pixels.count; ++i) {
      const int x = pixels.column(i);
      if (!matcher_.is_wanted(x, pixels.y)) continue;
      const PixelStatus status = from_.status(x, pixels.y);
      pending_[i] = status == PixelStatus::ok;
      any = any || pending_[i];
      if (!pending_[i]) put(Match::none(status), x, pixels.y, matches_);
    }
    return any;
  }

  void load(const Pixels& pixels) {
    const float *time = &from_.time(pixels.x, pixels.y), *sigma = &from_.sigma(pixels.x, pixels.y);
    const float* amplitude = &from_.amplitude(pixels.x, pixels.y);
    const Eigen::Vector2d* rays = &geometry_.ray(pixels.x, pixels.y);
    for (std::size_t i = 0; i < pixels.count; ++i) {
      batch_.ray_x[i] = static_cast<float>(rays[i].x());
      batch_.ray_y[i] = static_cast<float>(rays[i].y());
      batch_.time[i] = time[i];
      batch_.sigma[i] = sigma[i];
      batch_.amplitude[i] = amplitude[i];
    }
  }

  /// Finds what is clear at first sight.
  void follow(const Pixels& pixels) {
    const float *above = depth_above(pixels), *slope = slope_above(pixels);
    for (std::size_t i = 0; i < pixels.count; ++i) {
      const float expected = std::isnan(above[i]) ? depth_left_ : above[i];
      batch_.expected[i] = pending_[i] ? expected : not_a_number;
      batch_.expected_slope[i] = slope[i];
    }
    take(pixels);
  }

  /// Once a depth is known again, the others may go on from there.
  void follow_from(float depth, const Pixels& pixels) {
    for (std::size_t i = 0; i < pixels.count; ++i) {
      batch_.expected[i] = pending_[i] ? depth : not_a_number;
      batch_.expected_slope[i] = not_a_number;
    }
    take(pixels);
  }

  void take(const Pixels& pixels) {
    std::fill(batch_.expected.begin() + static_cast<std::ptrdiff_t>(pixels.count), batch_.expected.end(), not_a_number);
    follow_curves(batch_);
    float *u = &matches_.u(pixels.x, pixels.y), *v = &matches_.v(pixels.x, pixels.y);
    float *sigma = &matches_.sigma(pixels.x, pixels.y), *slope = &matches_.slope(pixels.x, pixels.y);
    PixelStatus* status = &matches_.status(pixels.x, pixels.y);
    float *above = depth_above(pixels), *above_slope = slope_above(pixels);
    for (std::size_t i = 0; i < pixels.count; ++i) {
      if (std::isnan(batch_.inverse_depth[i])) continue;
      pending_[i] = false;
      const bool good = batch_.sigma_px[i] <= max_sigma_px_;
      status[i] = good ? PixelStatus::ok : PixelStatus::ambiguous;
      u[i] = good ? batch_.u[i] : not_a_number;
      if (!good) continue;
      v[i] = batch_.v[i];
      sigma[i] = batch_.sigma_px[i];
      slope[i] = above_slope[i] = batch_.slope[i];
      depth_[i] = above[i] = batch_.inverse_depth[i];
    }
  }

  void look_closely(const Pixels& pixels, std::size_t i) {
    const int x = pixels.column(i);
    float &above = depth_above(pixels)[i], expected = depth_left_;
    for (std::size_t k = 0; k < i; ++k) expected = std::isnan(depth_[k]) ? expected : depth_[k];
    const Match match =
        find_match(geometry_, finder_, x, pixels.y, static_cast<double>(std::isnan(expected) ? above : expected));
    put(match, x, pixels.y, matches_);
    pending_[i] = false;
    if (match.status != PixelStatus::ok) return;
    depth_[i] = above = static_cast<float>(match.inverse_depth);
    slope_above(pixels)[i] = static_cast<float>(match.slope);
    if (i + 1 < pixels.count && pending_[i + 1]) follow_from(depth_[i], pixels);
  }

  void remember() {
    for (const float depth : depth_) depth_left_ = std::isnan(depth) ? depth_left_ : depth;
  }

  float* depth_above(const Pixels& pixels) { return &depth_above_[static_cast<std::size_t>(pixels.x)]; }
  float* slope_above(const Pixels& pixels) { return &slope_above_[static_cast<std::size_t>(pixels.x)]; }

  const TimeMap& from_;
  const PixelMatcher& matcher_;
  const EpipolarGeometry& geometry_;
  Correspondences& matches_;
  const float max_sigma_px_;
  TimeFinder finder_;
  CurveBatch batch_;
  std::array<bool, most_curves> pending_{};  ///< pixels that have not been matched yet
  CurveBatch::Each<float> depth_{};          ///< [1/mm] of these pixels, NaN where not found
  float depth_left_ = not_a_number;          ///< [1/mm] of the last match to the left
  std::vector<float> depth_above_;           ///< [1/mm] of the last match above
  std::vector<float> slope_above_;           ///< [frames/px] of that
};

class TimeMatcher final : public PixelMatcher {
 public:
  TimeMatcher(const TimeMap& from, const SearchedMap& to, const PixelSet* only)
      : PixelMatcher(only), from_(from), to_(to) {}

  PixelStatus status_of(int x, int y) const override { return from_.status(x, y); }
  std::unique_ptr<MatchFinder> make_finder() const override { return std::make_unique<TimeFinder>(from_, to_); }
  void match_rows(const EpipolarGeometry& geometry, int top, int bottom, Correspondences& matches) const override {
    RowFollower follower(from_, to_, *this, geometry, matches);
    for (int y = top; y < bottom; ++y)
      if (wants_any_of(y)) follower.match_row(y);
  }

 private:
  const TimeMap& from_;
  SearchedMap to_;
};

void require_size(const TimeMap& map, const RayTable& camera) {
  if (map.width() != camera.width() || map.height() != camera.height())
    throw std::invalid_argument("match_times: a time map is not of its camera's size");
}

}  // namespace

TimeMatching::TimeMatching(const RayTable& first, const RayTable& second, const MatchOptions& options)
    : first_(first),
      second_(second),
      max_sigma_px_(options.max_sigma_px),
      two_way_(first, second, options),
      first_field_(first.width(), first.height()),
      second_field_(second.width(), second.height()) {}

void TimeMatching::match(const TimeMap& first, const TimeMap& second, const PixelSets& only, Progress& progress) {
  require_size(first, first_);
  require_size(second, second_);
  first_field_.update(first, only.first);
  second_field_.update(second, only.second);
  const double brightness = usual_amplitude(second) / usual_amplitude(first);
  const TimeMatcher from_first(first, {&second_field_, brightness, max_sigma_px_}, only.first),
      from_second(second, {&first_field_, 1 / brightness, max_sigma_px_}, only.second);
  two_way_.match(from_first, from_second, progress);
}

}  // namespace pagesweep
