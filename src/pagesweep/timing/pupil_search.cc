// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/pupil_search_internal.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <span>
#include <variant>

#include "pagesweep/base/parallel.h"
#include "pagesweep/data/time_map.h"
#include "pagesweep/timing/outline_columns_internal.h"

namespace pagesweep {
namespace {

constexpr int rows_looked_at = 64, columns_looked_at = 256;  // of each camera: enough pixels for any subset
constexpr int fewest_samples = 8;

std::uint64_t mix(std::uint64_t z) {  // splitmix64's finaliser
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
  return z ^ (z >> 31);
}

SensorNoise first_guess(const Sequence& sequence) {
  // A gray value stands for all light that rounds to it.
  return {.ceiling = sequence.saturation - sequence.black_level - 0.5};
}

/// First gray value that is clipped.
int clipped_from(const Sequence& sequence) {
  return static_cast<int>(std::clamp(std::ceil(sequence.saturation), 0.0, 65536.0));
}

/// What a gray value sequence shows at a glance.
struct Outline {
  double background = 0;  ///< [gray values]
  double noise = 0;       ///< [gray values]
  double high = 0;        ///< [gray values]
  int peak = 0;           ///< [frames]
  bool clipped = false;
};

/// Where the sequence crosses a level, walking from `from` in steps of `direction`; NaN if it never does.
template <class SampleAt>
double crossing(const SampleAt& sample_at, int count, int from, int direction, float level) {
  float before = not_a_number;
  for (int i = from; i >= 0 && i < count; i += direction) {
    const float here = sample_at(i);
    if (std::isnan(here)) continue;
    if (here <= level) {
      const double share = std::isfinite(before) ? (level - here) / (before - here) : 0.5;
      return i - direction * share;
    }
    before = here;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

/// Fills in what an outline shows without a profile. \return whether a complete bell clearly above the noise is there
/// \param sample_at  of frame 0 ... count - 1; NaN: dropped, +infinity: clipped
template <class SampleAt>
bool examine(const Outline& outline, const SampleAt& sample_at, int count, Pupil& pupil) {
  pupil.clipped = outline.clipped;
  pupil.background = outline.background;
  pupil.amplitude = outline.high - outline.background;
  if (pupil.amplitude < 10 * std::max(outline.noise, 0.5)) return false;
  const auto half = static_cast<float>(pupil.background + 0.5 * pupil.amplitude);
  const double rise = crossing(sample_at, count, outline.peak, -1, half);
  const double fall = crossing(sample_at, count, outline.peak, 1, half);
  pupil.middle = 0.5 * (rise + fall);
  pupil.fwhm = fall - rise;
  return std::isfinite(pupil.middle) && pupil.fwhm >= 1;
}

/// The outline of samples of several exposures: of clipped ones, only those of the shortest exposure. A longer one was
/// clipped at a level above which that one still sees.
bool outline_among_exposures(std::span<float> gray, const FrameNoise& noise, Outline& outline) {
  std::vector<double> present, changes;
  outline.peak = -1;
  for (int i = 0; i < static_cast<int>(gray.size()); ++i) {
    float& sample = gray[static_cast<std::size_t>(i)];
    if (std::isinf(sample) && noise.at(i).ceiling < noise.highest_ceiling()) sample = not_a_number;
    if (std::isnan(sample)) continue;
    const double seen = std::min(static_cast<double>(sample), noise.highest_ceiling());
    if (!present.empty()) changes.push_back(std::abs(seen - present.back()));
    present.push_back(seen);
    if (outline.peak < 0 || sample > gray[static_cast<std::size_t>(outline.peak)]) outline.peak = i;
  }
  if (present.size() < fewest_samples) return false;
  const float highest = gray[static_cast<std::size_t>(outline.peak)];
  outline.clipped = std::isinf(highest);
  outline.high = std::min(static_cast<double>(highest), noise.highest_ceiling());
  const auto nth = [](std::vector<double>& values, std::size_t n) {
    const auto place = values.begin() + static_cast<std::ptrdiff_t>(n);
    std::nth_element(values.begin(), place, values.end());
    return *place;
  };
  outline.background = nth(present, background_rank(present.size()));
  outline.noise = nth(changes, changes.size() / 2);
  return true;
}

}  // namespace

PupilSearch::PupilSearch(const Sequence& sequence, std::size_t camera)
    : sequence_(sequence),
      noise_(first_guess(sequence), sequence.exposures),
      camera_(camera),
      row_step_(std::max(1, sequence.height / rows_looked_at)),
      column_step_(std::max(1, sequence.width / columns_looked_at)),
      rows_((sequence.height + row_step_ - 1) / row_step_),
      columns_((sequence.width + column_step_ - 1) / column_step_),
      is_of_one_exposure_(noise_.mean_weight() == 1) {}

Pupil PupilSearch::pupil_at(int column, int row) const {
  Pupil pupil;
  pupil.camera = camera_;
  pupil.x = column * column_step_;
  pupil.y = row * row_step_;
  pupil.rank = mix((static_cast<std::uint64_t>(pupil.y) << 32) + static_cast<std::uint64_t>(pupil.x) +
                   0x9E3779B97F4A7C15ULL * (camera_ + 1));
  return pupil;
}

std::vector<Pupil> PupilSearch::find(const Frames& frames, int end) {
  if (is_of_one_exposure_) keep(frames, end);
  std::vector<std::vector<Pupil>> found(static_cast<std::size_t>(rows_));
  parallel_rows(rows_, [&](int row) {
    auto& here = found[static_cast<std::size_t>(row)];
    is_of_one_exposure_ ? find_in_row(row, end, here) : find_among_exposures(frames, row, end, here);
  });
  std::vector<Pupil> pupils;
  for (auto& row : found) std::ranges::move(row, std::back_inserter(pupils));
  return pupils;
}

void PupilSearch::keep(const Frames& frames, int end) {
  const int first = static_cast<int>(kept_.size()), limit = clipped_from(sequence_);
  if (first >= end) return;
  kept_.resize(static_cast<std::size_t>(end));
  parallel_rows(end - first, [&](int k) {
    const int i = first + k;
    if (!frames.has(i)) return;
    auto& seen = kept_[static_cast<std::size_t>(i)] = Image<std::uint16_t>(outlined_width(columns_), rows_);
    std::visit(
        [&](const auto& image) {
          for (int row = 0; row < rows_; ++row)
            for (int column = 0; column < columns_; ++column)
              seen(column, row) =
                  static_cast<std::uint16_t>(std::min<int>(image(column * column_step_, row * row_step_), limit));
        },
        frames.frame(i));
  });
}

float PupilSearch::kept_sample(int i, int column, int row) const {
  const Image<std::uint16_t>& seen = kept_[static_cast<std::size_t>(i)];
  if (seen.empty()) return not_a_number;
  const int gray = seen(column, row);
  if (gray >= clipped_from(sequence_)) return std::numeric_limits<float>::infinity();
  return static_cast<float>(gray) - static_cast<float>(sequence_.black_level);
}

void PupilSearch::find_in_row(int row, int end, std::vector<Pupil>& found) const {
  std::vector<const std::uint16_t*> rows;
  std::vector<int> numbers;  // of the frames that are there
  for (int i = 0; i < end; ++i)
    if (const auto& seen = kept_[static_cast<std::size_t>(i)]; !seen.empty()) {
      rows.push_back(seen.row(row).data());
      numbers.push_back(i);
    }
  if (rows.size() < fewest_samples) return;
  const ColumnOutlines outlines = outline_columns(rows, columns_);
  for (int column = 0; column < columns_; ++column) {
    const auto k = static_cast<std::size_t>(column);
    Outline outline{outlines.background[k] - sequence_.black_level, static_cast<double>(outlines.change[k]),
                    outlines.high[k] - sequence_.black_level, numbers[outlines.peak[k]]};
    outline.clipped = outlines.high[k] >= clipped_from(sequence_);
    outline.high = std::min(outline.high, noise_.highest_ceiling());
    Pupil pupil = pupil_at(column, row);
    if (examine(outline, [&](int i) { return kept_sample(i, column, row); }, end, pupil)) found.push_back(pupil);
  }
}

void PupilSearch::find_among_exposures(const Frames& frames, int row, int end, std::vector<Pupil>& found) const {
  Image<float> samples(sequence_.width, end);
  frames.read_row(row * row_step_, 0, samples);
  std::vector<float> gray(static_cast<std::size_t>(end));
  for (int column = 0; column < columns_; ++column) {
    for (int i = 0; i < end; ++i) gray[static_cast<std::size_t>(i)] = samples(column * column_step_, i);
    Outline outline;
    if (!outline_among_exposures(gray, noise_, outline)) continue;
    Pupil pupil = pupil_at(column, row);
    if (examine(outline, [&](int i) { return gray[static_cast<std::size_t>(i)]; }, end, pupil)) found.push_back(pupil);
  }
}

PupilSamples PupilSearch::samples(const Frames& frames, const Pupil& pupil, double reach, int end) const {
  PupilSamples samples;
  samples.first_frame = std::clamp(static_cast<int>(std::floor(pupil.middle - reach)), 0, end);
  const int last = std::clamp(static_cast<int>(std::ceil(pupil.middle + reach)) + 1, samples.first_frame, end);
  Image<float> one(1, end);
  if (!is_of_one_exposure_) frames.read_row(pupil.y, pupil.x, one);
  for (int i = samples.first_frame; i < last; ++i) {
    samples.gray.push_back(is_of_one_exposure_ ? kept_sample(i, pupil.x / column_step_, pupil.y / row_step_)
                                               : one(0, i));
    if (!frames.is_even()) samples.late.push_back(frames.late(i));
  }
  return samples;
}

}  // namespace pagesweep
