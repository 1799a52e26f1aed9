// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/match_sequences.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "pagesweep/base/error.h"
#include "pagesweep/matching/nearest_place.h"
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

/// The other camera's sequences where the curve crosses the pixel grid around a place: `vertices` neighbouring columns
/// where it runs along the rows, rows where it runs along the columns. Between two crossings the sequence is
/// interpolated linearly, as everywhere across the curve: the paper's bilinear sub-pixel on a curve.
struct Crossings {
  static constexpr int vertices = SequenceProducts::crossings;

  bool along_rows;                                    ///< the curve runs along the picture's rows
  int first;                                          ///< column (or row) of the first crossing
  double at_first, slope;                             ///< the other coordinate there, and its change a crossing
  double depth_at_first, depth_step;                  ///< inverse depth likewise
  std::array<bool, vertices> usable{};                ///< the pixels beside the crossing have sequences
  std::array<std::vector<float>, vertices> sequence;  ///< interpolated
  std::array<double, vertices> weight_squares{};      ///< of the interpolation: what it leaves of noise
  std::array<double, vertices> rounding_variance{};
};

/// Finds the least squared difference along epipolar curves.
class SequenceMatcher final : public Matcher {
 public:
  SequenceMatcher(const SequenceStore& from, const SequenceStore& to, const MatchOptions& options)
      : from_(from), to_(to), options_(options), affine_(options.normalisation == Normalisation::affine) {}

  PixelStatus status_of(int x, int y) const override { return from_.status(x, y); }

  Match find(int x, int y, const EpipolarCurve& curve, double, CurveSamples& samples) const override {
    sample(curve, samples);
    thread_local std::vector<float> scores;
    const int best = scan(x, y, samples, scores);
    if (best < 0) return Match::none(has_view(samples) ? PixelStatus::no_match : PixelStatus::outside_view);
    if (!is_distinct(scores, best, margin(x, y))) return Match::none(PixelStatus::ambiguous);
    return refine(x, y, curve, samples.inverse_depth[static_cast<std::size_t>(best)]);
  }

 private:
  float margin(int x, int y) const { return static_cast<float>(options_.min_distinction) * from_.energy(x, y); }
  static bool has_view(const CurveSamples& samples);
  int scan(int x, int y, const CurveSamples& samples, std::vector<float>& scores) const;
  bool is_distinct(const std::vector<float>& scores, int best, float margin) const;
  Match refine(int x, int y, const EpipolarCurve& curve, double inverse_depth) const;
  double sigma(int x, int y, const Crossings& crossings, const CurvePlace& place) const;
  bool find_crossings(const EpipolarCurve& curve, double inverse_depth, Crossings& crossings) const;
  void interpolate(Crossings& crossings, std::size_t vertex) const;
  SequenceProducts products(const std::int16_t* sequence, const Crossings& crossings) const;

  const SequenceStore& from_;
  const SequenceStore& to_;
  const MatchOptions& options_;
  bool affine_;
};

bool SequenceMatcher::has_view(const CurveSamples& samples) {
  return std::any_of(samples.u.begin(), samples.u.end(), [](float u) { return !std::isnan(u); });
}

/// Scores of the pixels nearest to the samples; infinity where one is no candidate, or clearly worse than another.
/// \return the best one's index, -1 if there is none
int SequenceMatcher::scan(int x, int y, const CurveSamples& samples, std::vector<float>& scores) const {
  const std::int16_t* own = from_.sequence(x, y);
  const float slack = margin(x, y);
  float least = static_cast<float>(2 * options_.max_dissimilarity) * from_.energy(x, y);
  int best = -1;
  scores.assign(static_cast<std::size_t>(samples.size()), infinity);
  for (std::size_t i = 0; i < scores.size(); ++i) {
    if (std::isnan(samples.u[i])) continue;
    const int u = std::clamp(static_cast<int>(samples.u[i] + 0.5f), 0, to_.width() - 1);
    const int v = std::clamp(static_cast<int>(samples.v[i] + 0.5f), 0, to_.height() - 1);
    if (to_.status(u, v) != PixelStatus::ok) continue;
    scores[i] = squared_difference(own, to_.sequence(u, v), to_.length(), least + slack);
    if (scores[i] < least) {
      least = scores[i];
      best = static_cast<int>(i);
    }
  }
  return best;
}

/// Whether all places that are as good as the best one, within the margin, hang together with it.
bool SequenceMatcher::is_distinct(const std::vector<float>& scores, int best, float margin) const {
  constexpr int gap_px = 4;  // a pixel or two between may be worse: texture, noise, candidates half a pixel off
  const float limit = scores[static_cast<std::size_t>(best)] + margin;
  int begin = best, end = best;
  for (int i = best - 1; i >= std::max(0, begin - gap_px); --i)
    if (scores[static_cast<std::size_t>(i)] <= limit) begin = i;
  const int last = static_cast<int>(scores.size()) - 1;
  for (int i = best + 1; i <= std::min(last, end + gap_px); ++i)
    if (scores[static_cast<std::size_t>(i)] <= limit) end = i;
  for (int i = 0; i <= last; ++i)
    if ((i < begin || i > end) && scores[static_cast<std::size_t>(i)] <= limit) return false;
  return true;
}

/// The curve's tangent at a place, and where it crosses the grid around.
bool SequenceMatcher::find_crossings(const EpipolarCurve& curve, double inverse_depth, Crossings& crossings) const {
  const double step = 0.5 / curve.speed(inverse_depth);
  const auto here = curve.at(inverse_depth);
  auto there = curve.at(inverse_depth + step);
  if (!here) return false;
  const double direction = there ? 1 : -1;
  if (!there) there = curve.at(inverse_depth - step);
  if (!there) return false;
  const Eigen::Vector2d change = direction * (*there - *here);
  crossings.along_rows = std::abs(change.x()) >= std::abs(change.y());
  const int main = crossings.along_rows ? 0 : 1;
  if (change[main] == 0) return false;
  crossings.slope = change[1 - main] / change[main];
  crossings.depth_step = step / change[main];
  crossings.first = static_cast<int>(std::floor((*here)[main])) - (Crossings::vertices / 2 - 1);
  const double back = crossings.first - (*here)[main];
  crossings.at_first = (*here)[1 - main] + back * crossings.slope;
  crossings.depth_at_first = inverse_depth + back * crossings.depth_step;
  for (std::size_t i = 0; i < Crossings::vertices; ++i) interpolate(crossings, i);
  return true;
}

void SequenceMatcher::interpolate(Crossings& c, std::size_t vertex) const {
  const int main = c.first + static_cast<int>(vertex);
  const int width = c.along_rows ? to_.width() : to_.height(), height = c.along_rows ? to_.height() : to_.width();
  const double across = std::clamp(c.at_first + static_cast<double>(vertex) * c.slope, 0.0, height - 1.0);
  const int low = std::min(static_cast<int>(across), std::max(0, height - 2)), high = std::min(low + 1, height - 1);
  const auto share = static_cast<float>(across - low);
  c.usable[vertex] = false;
  if (main < 0 || main >= width) return;
  const auto place = [&](int other) { return c.along_rows ? std::pair(main, other) : std::pair(other, main); };
  const auto [x0, y0] = place(low);
  const auto [x1, y1] = place(high);
  if (to_.status(x0, y0) != PixelStatus::ok || to_.status(x1, y1) != PixelStatus::ok) return;
  c.usable[vertex] = true;
  const std::int16_t* a = to_.sequence(x0, y0);
  const std::int16_t* b = to_.sequence(x1, y1);
  std::vector<float>& out = c.sequence[vertex];
  out.resize(static_cast<std::size_t>(to_.length()));
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = a[i] + share * static_cast<float>(b[i] - a[i]);
  c.weight_squares[vertex] = (1 - share) * (1 - share) + share * share;
  c.rounding_variance[vertex] = std::max(to_.rounding_variance(x0, y0), to_.rounding_variance(x1, y1));
}

float dot(const std::vector<float>& a, const std::vector<float>& b) {
  std::array<float, SequenceStore::lanes> sums{};
  for (std::size_t i = 0; i < a.size(); i += sums.size())
    for (std::size_t k = 0; k < sums.size(); ++k) sums[k] += a[i + k] * b[i + k];
  float sum = 0;
  for (const float s : sums) sum += s;
  return sum;
}

/// Takes out of `slope` what a change of gain would do just as well.
void remove_gain(const std::int16_t* sequence, std::vector<float>& slope) {
  float product = 0, square = 0;
  for (std::size_t k = 0; k < slope.size(); ++k) {
    product += slope[k] * sequence[k];
    square += static_cast<float>(sequence[k]) * sequence[k];
  }
  const float share = square > 0 ? product / square : 0;
  for (std::size_t k = 0; k < slope.size(); ++k) slope[k] -= share * sequence[k];
}

SequenceProducts SequenceMatcher::products(const std::int16_t* sequence, const Crossings& crossings) const {
  thread_local std::vector<float> own;
  own.assign(sequence, sequence + from_.length());
  SequenceProducts p;
  p.gg = dot(own, own);
  p.usable = crossings.usable;
  p.gs.setZero();
  p.ss.setZero();
  for (int i = 0; i < Crossings::vertices; ++i) {
    const std::vector<float>& a = crossings.sequence[static_cast<std::size_t>(i)];
    if (!p.usable[static_cast<std::size_t>(i)]) continue;
    p.gs[i] = dot(own, a);
    for (int j = i; j < Crossings::vertices; ++j)
      if (p.usable[static_cast<std::size_t>(j)])
        p.ss(i, j) = p.ss(j, i) = dot(a, crossings.sequence[static_cast<std::size_t>(j)]);
  }
  return p;
}

Match SequenceMatcher::refine(int x, int y, const EpipolarCurve& curve, double inverse_depth) const {
  thread_local Crossings crossings;
  if (!find_crossings(curve, inverse_depth, crossings)) return Match::none(PixelStatus::outside_view);
  const CurvePlace nearest =
      nearest_place(products(from_.sequence(x, y), crossings), options_.normalisation, options_.interpolation);
  if (nearest.segment < 0 || nearest.distance_squared > options_.max_dissimilarity * from_.energy(x, y))
    return Match::none(PixelStatus::no_match);
  const double sigma_px = std::hypot(1.0, crossings.slope) * sigma(x, y, crossings, nearest);
  if (!(sigma_px <= options_.max_sigma_px)) return Match::none(PixelStatus::ambiguous);
  const double place = nearest.segment + nearest.share;
  const double depth = crossings.depth_at_first + place * crossings.depth_step;
  const auto pixel = curve.at(depth);
  if (!pixel) return Match::none(PixelStatus::outside_view);
  return {PixelStatus::ok, *pixel, sigma_px, depth};
}

/// Standard deviation of a place [crossings]. Residuals r and slopes d of the frames give it twice: as in any least
/// squares, sqrt(mean r^2 / sum d^2), and without the belief that residuals are alike in all frames,
/// sqrt(sum r^2 d^2) / sum d^2. The second is larger where the sequences differ just where they change, as beside
/// clipped stripes; the larger one counts.
double SequenceMatcher::sigma(int x, int y, const Crossings& crossings, const CurvePlace& place) const {
  thread_local std::vector<float> residual, slope;
  const std::int16_t* own = from_.sequence(x, y);
  residual.assign(own, own + from_.length());
  slope.assign(residual.size(), 0);
  double rounding = from_.rounding_variance(x, y), slope_noise = 0;
  for (std::size_t i = 0; i < Crossings::vertices; ++i) {
    const auto index = static_cast<Eigen::Index>(i);
    const auto value = static_cast<float>(place.gain * place.value[index]);
    const auto change = static_cast<float>(place.gain * place.derivative[index]);
    if (value == 0 && change == 0) continue;
    const std::vector<float>& s = crossings.sequence[i];
    for (std::size_t k = 0; k < residual.size(); ++k) {
      residual[k] -= value * s[k];
      slope[k] += change * s[k];
    }
    rounding += value * value * crossings.weight_squares[i] * crossings.rounding_variance[i];
    slope_noise += change * change * crossings.weight_squares[i];
  }
  if (affine_) remove_gain(own, slope);
  const double unknowns = affine_ ? 3 : 1, freedom = std::max(1.0, from_.samples() - unknowns);
  const double noise = dot(residual, residual) / freedom + rounding;
  for (std::size_t k = 0; k < residual.size(); ++k) residual[k] *= slope[k];
  const double weighted = dot(residual, residual) * from_.samples() / freedom;
  // Noise of the crossings looks like slope; what exceeds it is known to be slope. Half of the noise is the pixel's
  // own.
  const double slope_squared = dot(slope, slope) - 0.5 * noise * slope_noise * from_.samples();
  if (!(slope_squared > 0)) return infinity;
  return std::max(std::sqrt(noise / slope_squared), std::sqrt(weighted) / slope_squared);
}

void require_size(const Frames& frames, const Camera& camera) {
  if (frames.width() != camera.width || frames.height() != camera.height)
    throw std::invalid_argument("match_sequences: the frames are not of their camera's size");
}

}  // namespace

MatchPair match_sequences(const Frames& first, const Frames& second, const Camera& first_camera,
                          const Camera& second_camera, const MatchOptions& options, Progress& progress) {
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
