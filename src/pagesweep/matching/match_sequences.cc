// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/match_sequences.h"

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
#include "pagesweep/matching/sequence_landings.h"
#include "pagesweep/matching/sequence_search_internal.h"
#include "pagesweep/matching/sequence_store.h"
#include "pagesweep/matching/two_way.h"

namespace pagesweep {
namespace {

constexpr std::size_t pixels_at_once = 4 * PlaceBatch::most;

/// A pixel that looks for its match.
struct Seeker {
  static constexpr int none = -1;
  static constexpr float done = std::numeric_limits<float>::infinity();  ///< instead of a distance

  std::int32_t index = 0;             ///< see SequenceStore
  std::array<double, 3> direction{};  ///< see CurveFrame
  CurveLine line{};
  float far = 0, near = 0;      ///< [1/mm] at the line's ends
  float z_far = 1, z_near = 1;  ///< of the points there, up to a common scale
  double energy = 0;            ///< of its sequence, in the store's own units
  OwnSequence own{};
  ScoredCurve curve;
  CurveMinima minima;
  bool are_improved = false;  ///< the minima
  int asked = none;           ///< which of them was fitted last
  SequenceFit best;
  bool has_best = false;
  int place_of_best = 0;
  Eigen::Vector2d rival_px{0, 0};  ///< if that makes it ambiguous
  bool has_rival = false;
  bool returns = false;  ///< its fit is where a match of the other camera began
  std::optional<Match> verdict;

  std::span<const std::int32_t> scores_between(int first, int last) const {
    return {curve.first_score() + first, static_cast<std::size_t>(last - first + 1)};
  }
  /// [1/mm] What is even in the picture is not in depth: a mixture of homogeneous points weighs them by their z.
  double inverse_depth_at(double share) const {
    const double weight_near = share * z_far, weight_far = (1 - share) * z_near;
    return (weight_near * near + weight_far * far) / (weight_near + weight_far);
  }
};

/// Finds the least squared difference along epipolar curves, for some pixels at once: first among the pixels nearest to
/// the curve, then between pixels, around every pixel that might come to lead.
class SequenceFinder final : public MatchFinder {
 public:
  SequenceFinder(const SequenceStore& from, const SequenceStore& to, const MatchOptions& options)
      : from_(from),
        to_(to.arrays()),
        options_(options),
        affine_(options.normalisation == Normalisation::affine),
        fitter_(from, to, options) {}

  Match find(int x, int y, const EpipolarCurve& curve, double) override {
    look_into(curve.view(), curve.origin(), curve.range());
    seekers_[0].index = from_.index(x, y);
    set_direction(seekers_[0], curve.direction());
    find_all(1);
    return *seekers_[0].verdict;
  }

  /// Which picture the curves are in, and their range of depths.
  void look_into(const View& view, const Eigen::Vector3d& origin, const InverseDepthRange& range) {
    frame_ = {view.lens(),
              {origin.x(), origin.y(), origin.z()},
              {view.lowest().x(), view.lowest().y()},
              {view.highest().x(), view.highest().y()},
              range.far,
              range.near};
  }
  /// What find_block() may begin with, and what it leaves behind; null: nothing.
  void use(const SequenceLandings* known, SequenceLandings* new_ones) {
    known_ = known;
    new_ones_ = new_ones;
  }
  /// Matches the pixels of a rectangle, at most pixels_at_once of them.
  void find_block(int left, int top, int right, int bottom, const EpipolarGeometry& geometry, Correspondences& matches);

 private:
  /// By how much of the energy the pixels nearest to a curve, up to half a pixel from it, may score worse than the
  /// curve itself; and by how much worse one of its places, up to half a pixel beside the best one.
  static constexpr double across = 0.15, along = 0.15;

  static void set_direction(Seeker& seeker, const Eigen::Vector3d& direction) {
    seeker.direction = {direction.x(), direction.y(), direction.z()};
  }
  void find_all(std::size_t count);
  void lay(std::span<Seeker> seekers);
  void begin(Seeker& seeker);
  bool begin_to_return(Seeker& seeker);
  void end_return(const SequenceFit& fit, Seeker& seeker);
  bool is_home(const SequenceFit& fit, const Seeker& seeker) const;
  void seek(Seeker& seeker);
  std::optional<float> next_place(Seeker& seeker) const;
  std::optional<float> only_promising_place(Seeker& seeker) const;
  void decide(std::span<Seeker> seekers);
  void ask(Seeker& seeker);
  void ask_at(double inverse_depth, Seeker& seeker);
  void hear(const SequenceFit& fit, Seeker& seeker) const;
  void judge(Seeker& seeker) const;
  void judge_sigmas(std::span<Seeker> seekers);
  bool matches(const Seeker& seeker) const {
    return seeker.has_best && seeker.best.distance_squared <= options_.max_dissimilarity * seeker.energy;
  }
  bool is_rival(const SequenceFit& other, int place_of_other, const Seeker& seeker) const;
  void leave_landing(const Seeker& seeker) const;

  const SequenceStore& from_;
  const SequenceArrays& to_;
  const MatchOptions& options_;
  bool affine_;
  const SequenceLandings* known_ = nullptr;
  SequenceLandings* new_ones_ = nullptr;
  SequenceFitter fitter_;
  CurveFrame frame_{};
  LineBatch lines_;
  std::array<Seeker, pixels_at_once> seekers_;
  std::array<SequenceFit, pixels_at_once> fits_;  ///< of each seeker
  std::vector<SequenceFit*> asked_, heard_;
};

void SequenceFinder::find_all(std::size_t count) {
  const auto seekers = std::span(seekers_).first(count);
  lay(seekers);
  asked_.clear();
  for (Seeker& seeker : seekers) begin(seeker);
  decide(seekers);
  judge_sigmas(seekers);
}

/// Lays the epipolar curves.
void SequenceFinder::lay(std::span<Seeker> seekers) {
  for (std::size_t first = 0; first < seekers.size(); first += LineBatch::most) {
    const auto some = seekers.subspan(first, std::min<std::size_t>(LineBatch::most, seekers.size() - first));
    for (std::size_t k = 0; k < some.size(); ++k)
      for (std::size_t i = 0; i < 3; ++i) lines_.direction[i][k] = some[k].direction[i];
    lay_lines(frame_, to_.along_rows, lines_);
    for (std::size_t k = 0; k < some.size(); ++k) {
      some[k].line = lines_.line(k);
      some[k].far = lines_.far[k];
      some[k].near = lines_.near[k];
      some[k].z_far = lines_.z_far[k];
      some[k].z_near = lines_.z_near[k];
    }
  }
}

/// Asks for a seeker's first fit, if it needs any.
void SequenceFinder::begin(Seeker& seeker) {
  seeker.has_best = seeker.has_rival = seeker.returns = false;
  seeker.verdict.reset();
  if (!(seeker.line.count > 0)) {
    seeker.verdict = Match::none(PixelStatus::outside_view);
    return;
  }
  seeker.energy = from_.energy(seeker.index);
  seeker.own = from_.sequence(seeker.index);
  if (begin_to_return(seeker)) return;
  seek(seeker);
  ask(seeker);
}

/// Where one pixel of the other camera found its match at a seeker, and no other one did, that place is fitted first.
bool SequenceFinder::begin_to_return(Seeker& seeker) {
  if (!known_ || !(seeker.line.straight > 0)) return false;
  const auto origin = known_->origin(seeker.index);
  if (!origin) return false;
  const float share = (*origin - seeker.line.from) / (seeker.line.to - seeker.line.from);
  if (!(share >= 0 && share <= 1)) return false;
  seeker.returns = true;
  ask_at(seeker.inverse_depth_at(share), seeker);
  return true;
}

/// A fit where the match should be is the match, or else the whole curve has to be searched.
void SequenceFinder::end_return(const SequenceFit& fit, Seeker& seeker) {
  seeker.returns = false;
  if (is_home(fit, seeker)) {
    seeker.best = fit;
    seeker.has_best = true;
    judge(seeker);
  } else {
    seek(seeker);
  }
}

bool SequenceFinder::is_home(const SequenceFit& fit, const Seeker& seeker) const {
  constexpr int most_attempts = 3;  // so that it is no more than two pixels away
  return fit.found && fit.attempts <= most_attempts && fit.least_sigma_px <= options_.max_sigma_px &&
         fit.distance_squared <= options_.max_dissimilarity * seeker.energy;
}

/// Compares with the pixels nearest to the curve, and notes the most promising places.
void SequenceFinder::seek(Seeker& seeker) {
  score_curve(to_, frame_.lens, seeker.line, seeker.own, seeker.curve);
  constexpr double largest = std::numeric_limits<std::int32_t>::max() - 1;
  const double least = seeker.curve.least, slack = (across + along) * seeker.energy;
  const double limit = std::min(least, options_.max_dissimilarity * seeker.energy) + slack;
  find_minima(seeker.curve, static_cast<std::int32_t>(std::min(limit, largest)), seeker.minima);
  seeker.are_improved = false;
  seeker.asked = Seeker::none;
}

/// The lowest pixel on the curve, if no other comes near to it.
std::optional<float> SequenceFinder::only_promising_place(Seeker& seeker) const {
  const auto scores = std::span(seeker.minima.score).first(static_cast<std::size_t>(seeker.minima.count));
  const auto lowest = std::ranges::min_element(scores);
  const double close = *lowest + along * seeker.energy;
  const auto rivals = std::ranges::count_if(scores, [&](std::int32_t score) { return score <= close; });
  if (rivals != 1 && rivals < 5) return std::nullopt;
  seeker.asked = static_cast<int>(lowest - scores.begin());
  const auto at = static_cast<std::size_t>(seeker.asked);
  // It will be on the side of the better neighbour.
  return 0.75f * static_cast<float>(seeker.minima.place[at]) + 0.25f * static_cast<float>(seeker.minima.beside[at]);
}

/// The most promising place that was not fitted yet; none if no other may lead.
std::optional<float> SequenceFinder::next_place(Seeker& seeker) const {
  CurveMinima& minima = seeker.minima;
  if (minima.count == 0) return std::nullopt;
  if (!seeker.are_improved) {
    const bool is_first = !seeker.has_best && seeker.asked == Seeker::none;
    if (is_first)
      if (const auto place = only_promising_place(seeker)) return place;
    if (minima.count == 1) return std::nullopt;
    improve_minima(to_, seeker.curve, seeker.own.square, affine_, minima);
    seeker.are_improved = true;
    if (!is_first) minima.distance_squared[static_cast<std::size_t>(seeker.asked)] = Seeker::done;
  }
  const auto distances = std::span(minima.distance_squared).first(static_cast<std::size_t>(minima.count));
  const auto least = std::ranges::min_element(distances);
  if (*least == Seeker::done) return std::nullopt;
  if (seeker.has_best && *least > seeker.best.distance_squared + across * seeker.energy) return std::nullopt;
  *least = Seeker::done;
  seeker.asked = static_cast<int>(least - distances.begin());
  return minima.improved_place[static_cast<std::size_t>(seeker.asked)];
}

/// In rounds: fits each seeker's most promising place, until a verdict is found or no other place can change it.
void SequenceFinder::decide(std::span<Seeker> seekers) {
  while (!asked_.empty()) {
    const std::size_t moving = fitter_.fit(frame_, asked_);
    heard_.assign(asked_.begin() + static_cast<std::ptrdiff_t>(moving), asked_.end());
    asked_.resize(moving);
    for (const SequenceFit* fit : heard_) {
      Seeker& seeker = seekers[static_cast<std::size_t>(fit - fits_.data())];
      if (seeker.returns)
        end_return(*fit, seeker);
      else if (fit->found)
        hear(*fit, seeker);
      ask(seeker);
    }
  }
}

/// Asks for a fit at the seeker's most promising place, if it needs one for its verdict.
void SequenceFinder::ask(Seeker& seeker) {
  if (seeker.verdict) return;
  if (const auto place = next_place(seeker))
    ask_at(seeker.inverse_depth_at(seeker.curve.share_at(*place)), seeker);
  else
    judge(seeker);
}

void SequenceFinder::ask_at(double inverse_depth, Seeker& seeker) {
  SequenceFit& fit = fits_[static_cast<std::size_t>(&seeker - seekers_.data())];
  fit.index = seeker.index;
  fit.own = seeker.own;
  fit.direction = &seeker.direction;
  fit.inverse_depth = inverse_depth;
  fit.attempts = 0;
  asked_.push_back(&fit);
}

/// What a fit says about its seeker: it may be the best so far, or make it ambiguous.
void SequenceFinder::hear(const SequenceFit& fit, Seeker& seeker) const {
  const int place = seeker.minima.place[static_cast<std::size_t>(seeker.asked)];
  const bool has_rival = seeker.has_best && is_rival(fit, place, seeker);
  if (has_rival) {
    seeker.rival_px = fit.distance_squared < seeker.best.distance_squared ? seeker.best.pixel : fit.pixel;
    seeker.has_rival = true;
  }
  if (!seeker.has_best || fit.distance_squared < seeker.best.distance_squared) {
    seeker.best = fit;
    seeker.has_best = true;
    seeker.place_of_best = place;
  }
  if (matches(seeker) && (has_rival || !(seeker.best.least_sigma_px <= options_.max_sigma_px)))
    seeker.verdict = Match::none(PixelStatus::ambiguous);
}

/// When all places that may lead have been heard. A match has no sigma yet.
void SequenceFinder::judge(Seeker& seeker) const {
  if (matches(seeker)) {
    seeker.verdict = {PixelStatus::ok, seeker.best.pixel, 0, seeker.best.inverse_depth, not_a_number};
  } else {
    seeker.verdict = Match::none(seeker.curve.sees_anything() ? PixelStatus::no_match : PixelStatus::outside_view);
  }
}

/// Gives matches their sigma, which may be too large.
void SequenceFinder::judge_sigmas(std::span<Seeker> seekers) {
  std::array<const SequenceFit*, MixtureBatch::most> fits;
  std::array<Seeker*, MixtureBatch::most> whose;
  std::array<double, MixtureBatch::most> sigmas_px;
  std::size_t count = 0;
  const auto flush = [&] {
    fitter_.find_sigmas(std::span(fits).first(count), sigmas_px);
    for (std::size_t k = 0; k < count; ++k) {
      whose[k]->verdict->sigma_px = sigmas_px[k];
      if (!(sigmas_px[k] <= options_.max_sigma_px)) whose[k]->verdict = Match::none(PixelStatus::ambiguous);
    }
    count = 0;
  };
  for (Seeker& seeker : seekers) {
    if (seeker.verdict->status != PixelStatus::ok) continue;
    fits[count] = &seeker.best;
    whose[count++] = &seeker;
    if (count == MixtureBatch::most) flush();
  }
  if (count > 0) flush();
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

void SequenceFinder::find_block(int left, int top, int right, int bottom, const EpipolarGeometry& geometry,
                                Correspondences& matches) {
  std::array<std::pair<int, int>, pixels_at_once> pixels;
  std::size_t count = 0;
  for (int y = top; y < bottom; ++y)
    for (int x = left; x < right; ++x) {
      const std::int32_t index = from_.index(x, y);
      matches.status(x, y) = from_.status(index);
      if (from_.status(index) != PixelStatus::ok) continue;
      seekers_[count].index = index;
      set_direction(seekers_[count], geometry.direction(x, y));
      pixels[count++] = {x, y};
    }
  find_all(count);
  for (std::size_t k = 0; k < count; ++k) {
    put(*seekers_[k].verdict, pixels[k].first, pixels[k].second, matches);
    if (new_ones_) leave_landing(seekers_[k]);
  }
}

/// A match, for the way back; or places that might have been one.
void SequenceFinder::leave_landing(const Seeker& seeker) const {
  if (!seeker.has_best) return;
  if (seeker.verdict->status == PixelStatus::ok)
    new_ones_->land(seeker.index, seeker.best.pixel.x(), seeker.best.pixel.y());
  else
    new_ones_->contest(seeker.best.pixel.x(), seeker.best.pixel.y());
  if (seeker.has_rival) new_ones_->contest(seeker.rival_px.x(), seeker.rival_px.y());
}

class SequenceMatcher final : public PixelMatcher {
 public:
  /// \param known, new_ones  see SequenceFinder::use()
  SequenceMatcher(const SequenceStore& from, const SequenceStore& to, const MatchOptions& options,
                  const SequenceLandings* known, SequenceLandings* new_ones)
      : from_(from), to_(to), options_(options), known_(known), new_ones_(new_ones) {}

  PixelStatus status_of(int x, int y) const override { return from_.status(from_.index(x, y)); }
  std::unique_ptr<MatchFinder> make_finder() const override {
    return std::make_unique<SequenceFinder>(from_, to_, options_);
  }
  /// Along the lines of what is stored: neighbours look at nearly the same pixels of the other camera.
  void match_rows(const EpipolarGeometry& geometry, int top, int bottom, Correspondences& matches) const override {
    SequenceFinder finder(from_, to_, options_);
    finder.look_into(geometry.view(), geometry.origin(), geometry.range());
    finder.use(known_, new_ones_);
    constexpr int all = static_cast<int>(pixels_at_once);
    const int rows = from_.arrays().along_rows ? 1 : std::min(all, bottom - top), columns = all / rows;
    for (int y = top; y < bottom; y += rows)
      for (int x = 0; x < matches.width(); x += columns)
        finder.find_block(x, y, std::min(x + columns, matches.width()), std::min(y + rows, bottom), geometry, matches);
  }

 private:
  const SequenceStore& from_;
  const SequenceStore& to_;
  const MatchOptions& options_;
  const SequenceLandings* known_;
  SequenceLandings* new_ones_;
};

/// Whether one camera's epipolar curves run along the rows of another's picture rather than its columns, in its middle.
bool runs_along_rows(const Camera& from, const Camera& to) {
  const Eigen::Vector3d epipole = to.cam_from_rig * from.center();
  return std::abs(epipole.x()) >= std::abs(epipole.y());
}

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
  const Camera &camera1 = first_camera.camera(), &camera2 = second_camera.camera();
  const SequenceStore first_store(first, instants, runs_along_rows(camera2, camera1), options);
  const SequenceStore second_store(second, instants, runs_along_rows(camera1, camera2), options);
  SequenceLandings landings(first_store, second_store);
  const SequenceMatcher from_first(first_store, second_store, options, nullptr, &landings);
  const SequenceMatcher from_second(second_store, first_store, options, &landings, nullptr);
  return match_both_ways(first_camera, second_camera, from_first, from_second, options, progress);
}

}  // namespace pagesweep
