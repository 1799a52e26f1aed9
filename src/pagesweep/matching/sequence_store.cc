// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/sequence_store.h"

#include <algorithm>
#include <array>
#include <numeric>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

constexpr int pixels_at_once = 128;  // their samples of some dozen frames stay in the fastest memory

/// The samples of some frames, for some pixels of a row at a time.
class SampleReader {
 public:
  SampleReader(const Frames& frames, const std::vector<int>& instants)
      : frames_(frames),
        samples_(std::min(pixels_at_once, frames.width()), frames.count()),
        filled_up_((samples_.width() + score_padding - 1) / score_padding * score_padding, frames.count()) {
    for (const int i : instants) rows_.push_back(filled_up_.row(i).data());
  }

  /// Those of the pixels (left, y), (left + 1, y) ...; all of them must be in the picture.
  std::span<const float* const> read(int y, int left) {
    if (filled_up_.width() == samples_.width()) {
      frames_.read_row(y, left, filled_up_);
    } else {  // a picture narrower than what is read at once
      frames_.read_row(y, left, samples_);
      for (int i = 0; i < samples_.height(); ++i) std::ranges::copy(samples_.row(i), filled_up_.row(i).begin());
    }
    return rows_;
  }

 private:
  const Frames& frames_;
  Image<float> samples_;
  Image<float> filled_up_;  ///< whole vectors are read
  std::vector<const float*> rows_;
};

}  // namespace

SequenceStore::SequenceStore(const Frames& frames, const std::vector<int>& instants, const MatchOptions& options)
    : samples_(static_cast<int>(instants.size())),
      parts_((instants.size() + sequence_padding - 1) / sequence_padding),
      energy_(frames.width(), frames.height()),
      rounding_variance_(frames.width(), frames.height()),
      status_(frames.width(), frames.height(), PixelStatus::ok) {
  data_ = std::make_unique_for_overwrite<SequencePart[]>((status_.size() + 1) * parts_);
  std::fill_n(sequence_at(status_.size()), length(), std::int16_t{0});
  if (options.normalisation == Normalisation::none) {
    squares_.resize(status_.size() + 1);
    squares_.back() = nothing;
  }
  parallel_ranges(height(), 16, [&](int begin, int end) { store_rows(frames, instants, options, begin, end); });
}

void SequenceStore::store_rows(const Frames& frames, const std::vector<int>& instants, const MatchOptions& options,
                               int begin, int end) {
  const auto range = static_cast<float>(frames.sequence().saturation - frames.sequence().black_level);
  SampleReader reader(frames, instants);
  for (int y = begin; y < end; ++y)
    for (int left = 0; left < width(); left += pixels_at_once) {
      // The last pixels of a row are stored together with some that already are.
      const int first = std::max(0, std::min(left, width() - pixels_at_once));
      const int pixels = std::min(pixels_at_once, width());
      store(first, y, {reader.read(y, first), pixels, range}, options);
    }
}

void SequenceStore::store(int left, int y, const GrayRows& gray, const MatchOptions& options) {
  alignas(64) std::array<float, pixels_at_once> energy, lowest, highest, scale;
  const bool affine = options.normalisation == Normalisation::affine;
  const auto darkest = static_cast<float>(options.min_modulation) * gray.range;
  pack_sequences(gray, affine, length(), sequence_at(index(left, y)),
                 {energy.data(), lowest.data(), highest.data(), scale.data()});
  for (std::size_t k = 0; k < static_cast<std::size_t>(gray.pixels); ++k) {
    const std::size_t pixel = index(left, y) + k;
    std::int16_t* sequence = sequence_at(pixel);
    energy_.data()[pixel] = energy[k] * scale[k] * scale[k];
    rounding_variance_.data()[pixel] = scale[k] * scale[k] / 12;
    const bool known = highest[k] - lowest[k] >= darkest;
    if (!known) {
      status_.data()[pixel] = lowest[k] >= gray.range ? PixelStatus::saturated : PixelStatus::too_dark;
      std::fill_n(sequence, length(), std::int16_t{0});
    }
    if (!affine) squares_[pixel] = known ? std::inner_product(sequence, sequence + length(), sequence, 0) : nothing;
  }
}

}  // namespace pagesweep
