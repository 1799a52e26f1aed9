// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/match_sequences.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include "pagesweep/base/error.h"
#include "pagesweep/matching/sequence_fit.h"
#include "pagesweep/matching/sequence_store.h"
#include "pagesweep/matching/two_way.h"

namespace pagesweep {
namespace {

constexpr std::size_t pixels_at_once = 4 * PlaceBatch::most;

/// An epipolar curve as an ideal lens would show it: straight, with places about a pixel apart.
struct SampledCurve {
  CurveLine line{};
  double far = 0, near = 0;      ///< [1/mm] at both ends
  double z_far = 1, z_near = 1;  ///< of the points there, up to a common scale

  SampledCurve() = default;
  SampledCurve(const EpipolarCurve& curve, const LensNumbers& lens) : far(curve.range().far), near(curve.range().near) {
    const Eigen::Vector3d start = curve.direction() + far * curve.origin();
    const Eigen::Vector3d end = curve.direction() + near * curve.origin();
    z_far = start.z();
    z_near = end.z();
    const Eigen::Vector2d first = start.hnormalized(), way = end.hnormalized() - first;
    const int steps =
        std::max(1, static_cast<int>(std::ceil(Eigen::Vector2d(lens.fx * way.x(), lens.fy * way.y()).norm())));
    const Eigen::Vector2f step = (way / steps).cast<float>();
    line = {static_cast<float>(first.x()), static_cast<float>(first.y()), step.x(), step.y(), steps + 1};
  }

  /// [1/mm] What is even in the picture is not in depth: a mixture of homogeneous points weighs them by their z.
  double inverse_depth(double place) const {
    const double share = place / (line.count - 1);
    const double weight_near = share * z_far, weight_far = (1 - share) * z_near;
    return (weight_far * far + weight_near * near) / (weight_far + weight_near);
  }
};

/// A pixel that looks for its match.
struct Seeker {
  int x = 0, y = 0;
  SampledCurve curve;
  double energy = 0;                         ///< of its sequence, in the store's own units
  std::vector<std::int32_t> pixels, scores;  ///< of the curve's places, see ScoredCurve
  std::vector<CurveMinimum> minima;
  std::span<CurveMinimum> unseen;     ///< minima that are neither fitted nor improved
  std::span<CurveMinimum> promising;  ///< improved, and in order
  std::size_t next = 0;               ///< of the promising ones
  SequenceFit best;
  bool has_best = false;
  int place_of_best = 0;
  double sigma_px = 0;  ///< of the best
  std::optional<Match> verdict;

  /// \return the first score, behind a highest one
  std::int32_t* make_room(int count) {
    const auto room = static_cast<std::size_t>(count) + 2 * score_padding;
    if (pixels.size() < room) {
      pixels.resize(room);
      scores.resize(room);
      minima.resize(room);
    }
    scores[score_padding - 1] = std::numeric_limits<std::int32_t>::max();
    return scores.data() + score_padding;
  }
  /// Whether there is a place that may lead. \param slack  of the energy, that its distance may be too large
  bool has_more(double slack) const {
    if (next == promising.size()) return false;
    return !has_best || promising[next].distance_squared <= best.distance_squared + slack * energy;
  }
  std::span<const std::int32_t> scores_between(int first, int last) const {
    return std::span(scores).subspan(static_cast<std::size_t>(score_padding + first),
                                     static_cast<std::size_t>(last - first + 1));
  }
};

/// Finds the least squared difference along epipolar curves, for some pixels at once: first among the pixels nearest to
/// the curve, then between pixels, around every pixel that might come to lead.
class SequenceFinder final : public MatchFinder {
 public:
  SequenceFinder(const SequenceStore& from, const SequenceStore& to, const MatchOptions& options)
      : from_(from),
        to_arrays_(to.arrays()),
        options_(options),
        affine_(options.normalisation == Normalisation::affine),
        fitter_(from, to, options) {
    curves_.reserve(pixels_at_once);
  }

  Match find(int x, int y, const EpipolarCurve& curve, double) override {
    curves_.clear();
    lens_ = curve.view().lens();
    seek(x, y, curve);
    decide();
    return *seekers_[0].verdict;
  }

  /// Matches the pixels (x, y), (x + 1, y), ..., at most pixels_at_once of them.
  void find_run(int x, int y, const EpipolarGeometry& geometry, std::span<Match> matches);

 private:
  /// By how much of the energy the pixels nearest to a curve, up to half a pixel from it, may score worse than the
  /// curve itself; and by how much worse one of its places, up to half a pixel beside the best one.
  static constexpr double across = 0.15, along = 0.15;

  void seek(int x, int y, const EpipolarCurve& curve);
  ScoredCurve scored(const Seeker& seeker) const {
    return {&to_arrays_,
            seeker.pixels.data(),
            seeker.scores.data() + score_padding,
            seeker.curve.line.count,
            from_.square(seeker.x, seeker.y),
            affine_};
  }
  void improve_others(Seeker& seeker) const;
  void decide();
  void hear(const SequenceFit& fit, Seeker& seeker) const;
  Match judge(const Seeker& seeker) const;
  bool is_rival(const SequenceFit& other, int place_of_other, const Seeker& seeker) const;

  const SequenceStore& from_;
  SequenceArrays to_arrays_;
  const MatchOptions& options_;
  bool affine_;
  SequenceFitter fitter_;
  LensNumbers lens_{};                 ///< of the other camera
  std::vector<EpipolarCurve> curves_;  ///< of the seekers
  std::array<Seeker, pixels_at_once> seekers_;
  std::array<SequenceFit, pixels_at_once> fits_;
  std::vector<Seeker*> asked_for_;  ///< by whom the fits were
};

/// Compares with the pixels nearest to the curve, and notes the most promising places.
void SequenceFinder::seek(int x, int y, const EpipolarCurve& curve) {
  Seeker& seeker = seekers_[curves_.size()];
  curves_.push_back(curve);
  seeker.x = x;
  seeker.y = y;
  seeker.curve = SampledCurve(curve, lens_);
  seeker.energy = from_.energy(x, y);
  seeker.next = 0;
  seeker.has_best = false;
  seeker.verdict.reset();
  const int count = seeker.curve.line.count;
  std::int32_t* scores = seeker.make_room(count);
  const double least = score_curve(to_arrays_, lens_, seeker.curve.line, from_.sequence(x, y), from_.square(x, y),
                                   seeker.pixels.data(), scores);
  constexpr double largest = std::numeric_limits<std::int32_t>::max();
  const double limit = std::min(least, options_.max_dissimilarity * seeker.energy) + (across + along) * seeker.energy;
  const int minima =
      find_minima(scored(seeker), static_cast<std::int32_t>(std::min(limit, largest)), seeker.minima.data());
  const auto found = std::span(seeker.minima).first(static_cast<std::size_t>(minima));
  constexpr std::size_t at_first = 2;
  seeker.promising = found.first(std::min(found.size(), at_first));
  seeker.unseen = found.subspan(seeker.promising.size());
  if (!seeker.unseen.empty())
    std::ranges::partial_sort(found, seeker.unseen.begin(), {}, &CurveMinimum::distance_squared);
  improve_minima(scored(seeker), seeker.promising);
  std::ranges::sort(seeker.promising, {}, &CurveMinimum::distance_squared);
}

/// When the first places left the verdict open: which of the others may lead.
void SequenceFinder::improve_others(Seeker& seeker) const {
  constexpr std::size_t most = 6;
  auto others = std::exchange(seeker.unseen, {});
  if (seeker.has_best) {
    const double limit = seeker.best.distance_squared + (across + along) * seeker.energy;
    const auto beyond = std::ranges::partition(others, [&](const auto& m) { return m.distance_squared <= limit; });
    others = others.first(others.size() - beyond.size());
  }
  improve_minima(scored(seeker), others);
  std::ranges::sort(others, {}, &CurveMinimum::distance_squared);
  seeker.promising = others.first(std::min(others.size(), most));
  seeker.next = 0;
}

/// In rounds: fits each seeker's most promising place, until a verdict is found or no other place can change it.
void SequenceFinder::decide() {
  const auto seekers = std::span(seekers_).first(curves_.size());
  for (asked_for_.clear();; asked_for_.clear()) {
    for (Seeker& seeker : seekers) {
      if (seeker.verdict) continue;
      if (!seeker.unseen.empty() && !seeker.has_more(across)) improve_others(seeker);
      if (seeker.has_more(across)) {
        const auto index = static_cast<std::size_t>(&seeker - seekers_.data());
        const double depth = seeker.curve.inverse_depth(seeker.promising[seeker.next++].place);
        fits_[asked_for_.size()].begin(seeker.x, seeker.y, curves_[index], depth);
        asked_for_.push_back(&seeker);
      } else {
        seeker.verdict = judge(seeker);
      }
    }
    if (asked_for_.empty()) return;
    fitter_.fit(std::span(fits_).first(asked_for_.size()));
    for (std::size_t k = 0; k < asked_for_.size(); ++k)
      if (fits_[k].found) hear(fits_[k], *asked_for_[k]);
  }
}

/// What a fit says about its seeker: it may be the best so far, or make it ambiguous.
void SequenceFinder::hear(const SequenceFit& fit, Seeker& seeker) const {
  const int place = static_cast<int>(seeker.promising[seeker.next - 1].place);
  const bool has_rival = seeker.has_best && is_rival(fit, place, seeker);
  if (!seeker.has_best || fit.distance_squared < seeker.best.distance_squared) {
    seeker.best = fit;
    seeker.has_best = true;
    seeker.place_of_best = place;
    seeker.sigma_px = fitter_.sigma_px(fit);
  }
  const bool matches = seeker.best.distance_squared <= options_.max_dissimilarity * seeker.energy;
  if (matches && (has_rival || !(seeker.sigma_px <= options_.max_sigma_px)))
    seeker.verdict = Match::none(PixelStatus::ambiguous);
}

/// When all places that may lead have been heard.
Match SequenceFinder::judge(const Seeker& seeker) const {
  if (seeker.has_best && seeker.best.distance_squared <= options_.max_dissimilarity * seeker.energy)
    return {PixelStatus::ok, seeker.best.pixel, seeker.sigma_px, seeker.best.inverse_depth, not_a_number};
  const auto places = std::span(seeker.pixels).first(static_cast<std::size_t>(seeker.curve.line.count));
  const bool has_view = std::ranges::any_of(places, [&](std::int32_t p) { return p != to_arrays_.nowhere(); });
  return Match::none(has_view ? PixelStatus::no_match : PixelStatus::outside_view);
}

/// Whether two places fit equally well, within the margin, with worse ones in between: a wide minimum is no rivalry, it
/// is a large sigma.
bool SequenceFinder::is_rival(const SequenceFit& other, int place, const Seeker& seeker) const {
  constexpr double same_px = 1.5;
  const double margin = options_.min_distinction * seeker.energy;
  const auto [less, more] = std::minmax(other.distance_squared, seeker.best.distance_squared);
  if (more > less + margin || (other.pixel - seeker.best.pixel).norm() < same_px) return false;
  const auto [begin, end] = std::minmax(place, seeker.place_of_best);
  const std::int32_t barrier = std::ranges::max(seeker.scores_between(begin, end));
  return barrier > more + margin;
}

void SequenceFinder::find_run(int x, int y, const EpipolarGeometry& geometry, std::span<Match> matches) {
  curves_.clear();
  lens_ = geometry.view().lens();
  std::array<std::size_t, pixels_at_once> seeker;
  for (std::size_t k = 0; k < matches.size(); ++k) {
    const int column = x + static_cast<int>(k);
    matches[k] = Match::none(from_.status(column, y));
    if (matches[k].status != PixelStatus::ok) continue;
    const EpipolarCurve curve = geometry.curve(column, y);
    if (curve.range().empty()) {
      matches[k] = Match::none(PixelStatus::outside_view);
      continue;
    }
    seeker[k] = curves_.size();
    seek(column, y, curve);
  }
  decide();
  for (std::size_t k = 0; k < matches.size(); ++k)
    if (matches[k].status == PixelStatus::ok) matches[k] = *seekers_[seeker[k]].verdict;
}

class SequenceMatcher final : public PixelMatcher {
 public:
  SequenceMatcher(const SequenceStore& from, const SequenceStore& to, const MatchOptions& options)
      : from_(from), to_(to), options_(options) {}

  PixelStatus status_of(int x, int y) const override { return from_.status(x, y); }
  std::unique_ptr<MatchFinder> make_finder() const override {
    return std::make_unique<SequenceFinder>(from_, to_, options_);
  }
  /// Along the rows: neighbours look at nearly the same pixels of the other camera.
  void match_rows(const EpipolarGeometry& geometry, int top, int bottom, Correspondences& matches) const override {
    SequenceFinder finder(from_, to_, options_);
    std::array<Match, pixels_at_once> run;
    for (int y = top; y < bottom; ++y)
      for (int x = 0; x < matches.width(); x += static_cast<int>(pixels_at_once)) {
        const std::size_t count = std::min<std::size_t>(pixels_at_once, static_cast<std::size_t>(matches.width() - x));
        finder.find_run(x, y, geometry, std::span(run).first(count));
        for (std::size_t k = 0; k < count; ++k) put(run[k], x + static_cast<int>(k), y, matches);
      }
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
