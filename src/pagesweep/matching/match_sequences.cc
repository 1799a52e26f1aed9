// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/match_sequences.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include "pagesweep/base/error.h"
#include "pagesweep/matching/sequence_fit.h"
#include "pagesweep/matching/sequence_store.h"
#include "pagesweep/matching/two_way.h"

namespace pagesweep {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();

/// Sum of squared differences (eq. 1), given up where it exceeds `limit`.
float squared_difference(const std::int16_t* a, const std::int16_t* b, int length, float limit) {
  constexpr int block = 64;  // so many squares of SequenceStore's samples fit into 32 bits
  float sum = 0;
  for (int begin = 0; begin < length; begin += block) {
    const int end = std::min(length, begin + block);
    std::int32_t part = 0;
    for (int i = begin; i < end; ++i) {
      const auto d = static_cast<std::int16_t>(a[i] - b[i]);
      part += static_cast<std::int32_t>(d) * d;
    }
    sum += static_cast<float>(part);
    if (sum > limit) return infinity;
  }
  return sum;
}

/// A place that may be the match.
struct Candidate {
  int sample;  ///< of the curve
  SequenceFit fit;
};

/// Finds the least squared difference along epipolar curves: first among the pixels nearest to the curve, then between
/// pixels, around every pixel that might come to lead.
class SequenceFinder final : public MatchFinder {
 public:
  SequenceFinder(const SequenceStore& from, const SequenceStore& to, const MatchOptions& options)
      : from_(from), to_(to), options_(options), fitter_(from, to, options) {}

  Match find(int x, int y, const EpipolarCurve& curve, double) override {
    sample(curve, samples_);
    scan(x, y);
    fit_minima(x, y, curve);
    const double energy = from_.energy(x, y);
    const auto best = std::min_element(candidates_.begin(), candidates_.end(), [](const auto& a, const auto& b) {
      return a.fit.distance_squared < b.fit.distance_squared;
    });
    if (best == candidates_.end() || best->fit.distance_squared > options_.max_dissimilarity * energy)
      return Match::none(has_view() ? PixelStatus::no_match : PixelStatus::outside_view);
    const bool rivalled = std::any_of(candidates_.begin(), candidates_.end(), [&](const Candidate& other) {
      return is_rival(other, *best, options_.min_distinction * energy);
    });
    if (rivalled || !(best->fit.sigma_px <= options_.max_sigma_px)) return Match::none(PixelStatus::ambiguous);
    return {PixelStatus::ok, best->fit.pixel, best->fit.sigma_px, best->fit.inverse_depth, not_a_number};
  }

 private:
  /// By how much of the energy the nearest pixel, up to half a pixel away, may score worse than the place itself.
  static constexpr double coarseness = 0.3;

  bool has_view() const {
    return std::any_of(samples_.u.begin(), samples_.u.end(), [](float u) { return !std::isnan(u); });
  }
  void scan(int x, int y);
  void fit_minima(int x, int y, const EpipolarCurve& curve);
  bool is_rival(const Candidate& other, const Candidate& best, double margin) const;

  const SequenceStore& from_;
  const SequenceStore& to_;
  const MatchOptions& options_;
  SequenceFitter fitter_;
  CurveSamples samples_;
  std::vector<float> scores_;  ///< of the samples; infinity where one is no candidate, or clearly worse than another
  std::vector<std::pair<float, std::size_t>> minima_;  ///< score and sample
  std::vector<Candidate> candidates_;
};

/// Compares with the pixels nearest to the samples.
void SequenceFinder::scan(int x, int y) {
  const std::int16_t* own = from_.sequence(x, y);
  const auto slack = static_cast<float>(coarseness * from_.energy(x, y));
  float limit = static_cast<float>(options_.max_dissimilarity) * from_.energy(x, y) + slack;
  scores_.assign(samples_.u.size(), infinity);
  for (std::size_t i = 0; i < scores_.size(); ++i) {
    if (std::isnan(samples_.u[i])) continue;
    const int u = std::clamp(static_cast<int>(samples_.u[i] + 0.5f), 0, to_.width() - 1);
    const int v = std::clamp(static_cast<int>(samples_.v[i] + 0.5f), 0, to_.height() - 1);
    if (to_.status(u, v) != PixelStatus::ok) continue;
    scores_[i] = squared_difference(own, to_.sequence(u, v), to_.length(), limit);
    limit = std::min(limit, scores_[i] + slack);
  }
}

/// Fits around the minima of the scores that may come to be the best, the most promising ones first.
void SequenceFinder::fit_minima(int x, int y, const EpipolarCurve& curve) {
  constexpr std::size_t most = 8;
  minima_.clear();
  candidates_.clear();
  const auto score = [&](std::size_t i) { return i < scores_.size() ? scores_[i] : infinity; };
  for (std::size_t i = 0; i < scores_.size(); ++i)
    if (scores_[i] < score(i - 1) && scores_[i] <= score(i + 1)) minima_.push_back({scores_[i], i});
  std::sort(minima_.begin(), minima_.end());
  if (minima_.size() > most) minima_.resize(most);
  const double slack = coarseness * from_.energy(x, y);
  double least = minima_.empty() ? 0 : minima_[0].first;
  for (const auto& [value, i] : minima_) {
    if (value > least + slack) break;
    const auto fit = fitter_.fit(x, y, curve, samples_.inverse_depth[i]);
    if (!fit) continue;
    candidates_.push_back({static_cast<int>(i), *fit});
    least = std::min(least, fit->distance_squared);
  }
}

/// Whether another place fits as well as the best one, within the margin, with worse ones in between: a wide minimum is
/// no rivalry, it is a large sigma.
bool SequenceFinder::is_rival(const Candidate& other, const Candidate& best, double margin) const {
  constexpr double same_px = 1.5;
  if (other.fit.distance_squared > best.fit.distance_squared + margin) return false;
  if ((other.fit.pixel - best.fit.pixel).norm() < same_px) return false;
  const auto [begin, end] = std::minmax(other.sample, best.sample);
  const float barrier = *std::max_element(scores_.begin() + begin, scores_.begin() + end);
  return barrier > other.fit.distance_squared + margin;
}

class SequenceMatcher final : public Matcher {
 public:
  SequenceMatcher(const SequenceStore& from, const SequenceStore& to, const MatchOptions& options)
      : from_(from), to_(to), options_(options) {}

  PixelStatus status_of(int x, int y) const override { return from_.status(x, y); }
  std::unique_ptr<MatchFinder> make_finder() const override {
    return std::make_unique<SequenceFinder>(from_, to_, options_);
  }

 private:
  const SequenceStore& from_;
  const SequenceStore& to_;
  const MatchOptions& options_;
};

void require_size(const Frames& frames, const RayTable& camera) {
  if (frames.width() != camera.width() || frames.height() != camera.height())
    throw std::invalid_argument("match_sequences: the frames are not of their camera's size");
}

}  // namespace

MatchPair match_sequences(const Frames& first, const Frames& second, const RayTable& first_camera,
                          const RayTable& second_camera, const MatchOptions& options, Progress& progress) {
  require_size(first, first_camera);
  require_size(second, second_camera);
  std::vector<int> instants;  // at which both cameras have a frame
  for (int i = 0; i < std::min(first.count(), second.count()); ++i)
    if (first.has(i) && second.has(i)) instants.push_back(i);
  if (instants.size() < 3)
    throw no_result("fewer than 3 frames were taken by both cameras, so that their sequences cannot be compared");
  const SequenceStore first_store(first, instants, options), second_store(second, instants, options);
  const SequenceMatcher from_first(first_store, second_store, options), from_second(second_store, first_store, options);
  return match_both_ways(first_camera, second_camera, from_first, from_second, options, progress);
}

}  // namespace pagesweep
