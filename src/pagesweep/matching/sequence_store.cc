// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/sequence_store.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <variant>

#include "pagesweep/base/image.h"
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

/// An odd number of cache lines, so that the rows of a line are not all kept at the same place.
int stride_for(int places) {
  constexpr int cache_line = 16;
  const int lines = (places + score_padding + cache_line - 1) / cache_line;
  return (lines | 1) * cache_line;
}

}  // namespace

SequenceStore::SequenceStore(const Frames& frames, const std::vector<int>& instants, bool along_rows,
                             const MatchOptions& options)
    : samples_(static_cast<int>(instants.size())) {
  const int lines = along_rows ? frames.height() : frames.width();
  const int places = along_rows ? frames.width() : frames.height();
  const int pairs = (samples_ + 1) / 2, stride = stride_for(places);
  const std::size_t pixels = static_cast<std::size_t>(lines) * static_cast<std::size_t>(stride);
  pairs_ = std::make_unique_for_overwrite<PairBlock[]>(pixels / score_padding * static_cast<std::size_t>(pairs));
  own_ = std::make_unique_for_overwrite<std::int32_t[]>(pixels);
  next_ = std::make_unique_for_overwrite<std::int32_t[]>(pixels);
  energy_ = std::make_unique_for_overwrite<float[]>(pixels);
  rounding_variance_ = std::make_unique_for_overwrite<float[]>(pixels);
  status_ = std::make_unique_for_overwrite<PixelStatus[]>(pixels);
  if (options.normalisation == Normalisation::none) squares_.resize(pixels);
  arrays_ = {pairs_[0].pairs, own_.get(), squares_.empty() ? nullptr : squares_.data(),
             next_.get(),     pairs,      stride,
             lines,           places,     along_rows};
  parallel_ranges(frames.height(), 16, [&](int begin, int end) { store_rows(frames, instants, options, begin, end); });
  parallel_ranges(lines, 16, [&](int begin, int end) {
    for (int line = begin; line < end; ++line) {
      const std::size_t first = at(arrays_.index(line, 0));
      multiply_neighbours(arrays_, line, &own_[first], &next_[first]);
    }
  });
}

template <class Sample>
void SequenceStore::store(int left, int y, const SampleRows<Sample>& gray, const MatchOptions& options) {
  alignas(64) std::array<float, pixels_at_once> energy, lowest, highest, scale;
  const bool affine = options.normalisation == Normalisation::affine;
  const auto darkest = static_cast<float>(options.min_modulation) * gray.range;
  const int line = arrays_.along_rows ? y : left, place = arrays_.along_rows ? left : y;
  const std::ptrdiff_t stride = arrays_.stride, pixel_step = arrays_.along_rows ? 1 : arrays_.pairs * stride;
  pack_sequences(gray, affine, {pairs_at(line, place), stride, pixel_step},
                 {energy.data(), lowest.data(), highest.data(), scale.data()});
  for (std::size_t k = 0; k < static_cast<std::size_t>(gray.pixels); ++k) {
    const std::int32_t pixel = index(left + static_cast<int>(k), y);
    energy_[at(pixel)] = energy[k] * scale[k] * scale[k];
    rounding_variance_[at(pixel)] = scale[k] * scale[k] / 12;
    const bool known = highest[k] - lowest[k] >= darkest;
    status_[at(pixel)] = known                     ? PixelStatus::ok
                         : lowest[k] >= gray.range ? PixelStatus::saturated
                                                   : PixelStatus::too_dark;
    if (!known) store_zeros(pixel);
    if (!affine) squares_[at(pixel)] = known ? multiply(arrays_, pixel, pixel) : nothing;
  }
}

void SequenceStore::store_rows(const Frames& frames, const std::vector<int>& instants, const MatchOptions& options,
                               int begin, int end) {
  const Sequence& sequence = frames.sequence();
  const auto black_level = static_cast<float>(sequence.black_level);
  const auto range = static_cast<float>(sequence.saturation - sequence.black_level);
  const int width = frames.width(), pixels = std::min(pixels_at_once, width);
  const bool are_bytes = sequence.is_8_bit() && sequence.exposures.empty() && width >= pixels_at_once;
  SampleReader reader(frames, instants);
  std::vector<const std::uint8_t*> bytes(instants.size());
  for (int y = begin; y < end; ++y)
    for (int left = 0; left < width; left += pixels_at_once) {
      // The last pixels of a row are stored together with some that already are.
      const int first = std::max(0, std::min(left, width - pixels_at_once));
      if (are_bytes) {
        std::ranges::transform(instants, bytes.begin(),
                               [&](int i) { return &std::get<Image<std::uint8_t>>(frames.frame(i))(first, y); });
        store<std::uint8_t>(first, y, {bytes, pixels, range, black_level}, options);
      } else {
        store<float>(first, y, {reader.read(y, first), pixels, range}, options);
      }
    }
}

void SequenceStore::store_zeros(std::int32_t index) {
  std::int32_t* pair = pairs_at(index / arrays_.stride, index % arrays_.stride);
  for (int j = 0; j < arrays_.pairs; ++j, pair += arrays_.stride) *pair = 0;
}

}  // namespace pagesweep
