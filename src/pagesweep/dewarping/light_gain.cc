// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/dewarping/light_gain.h"

#include <algorithm>
#include <variant>
#include <vector>

#include "pagesweep/base/parallel.h"
#include "pagesweep/dewarping/gain_kernels.h"

namespace pagesweep {
namespace {

constexpr int rows_at_once = 32;

/// What multiplies 16 bit samples' light, as ByteTones does that of 8 bit.
struct WordTones {
  ToneTables tones;
  void multiply_light(std::span<const float> gains, std::span<std::uint16_t> samples) const {
    std::vector<std::uint16_t> whole_steps(gains.size());
    std::ranges::copy(samples, whole_steps.begin());
    pagesweep::multiply_light(tones, gains, whole_steps);
    std::copy_n(whole_steps.begin(), samples.size(), samples.begin());
  }
};

/// The rows of one thread, and what it needs room for.
template <class T, class Tones>
class RowGainer {
 public:
  RowGainer(const LightGain& gain, const Tones& tones, const Image<float>& shown, int channels, double pixels_per_mm,
            Image<T>& samples)
      : gain_(gain),
        tones_(tones),
        shown_(shown),
        samples_(samples),
        nodes_per_px_(static_cast<float>(1 / (pixels_per_mm * gain.pitch_mm))),
        nodes_(static_cast<std::size_t>(channels)) {
    const std::size_t pixels =
        (static_cast<std::size_t>(shown.width()) + gain_row_step - 1) / gain_row_step * gain_row_step;
    shown_row_.resize(pixels, 0.0f);
    gains_.resize(pixels * nodes_.size());
  }

  void apply(int y) {
    cut_grid((static_cast<float>(y) + 0.5f) * nodes_per_px_);
    std::ranges::copy(shown_.row(y), shown_row_.begin());
    spread_gains(nodes_, nodes_per_px_, shown_row_, gains_);
    tones_.multiply_light(gains_, samples_.row(y));
  }

 private:
  /// The grid at v rows of nodes from its first.
  void cut_grid(float v) {
    for (std::size_t c = 0; c < nodes_.size(); ++c) {
      const Image<float>& values = gain_.values[c];
      const int j = std::clamp(static_cast<int>(v), 0, values.height() - 2);
      const float b = v - static_cast<float>(j);
      nodes_[c].resize(static_cast<std::size_t>(values.width()));
      for (int i = 0; i < values.width(); ++i)
        nodes_[c][static_cast<std::size_t>(i)] = values(i, j) + b * (values(i, j + 1) - values(i, j));
    }
  }

  const LightGain& gain_;
  const Tones& tones_;
  const Image<float>& shown_;
  Image<T>& samples_;
  float nodes_per_px_;
  std::vector<std::vector<float>> nodes_;  ///< of each channel
  std::vector<float> shown_row_, gains_;
};

template <class T, class Tones>
void apply_to_rows(const LightGain& gain, const Tones& tones, Page& page, Image<T>& samples) {
  const Picture& picture = page.picture;
  parallel_ranges(picture.height(), rows_at_once, [&](int begin, int end) {
    RowGainer<T, Tones> gainer(gain, tones, page.scan_map.u, picture.channels, picture.pixels_per_mm, samples);
    for (int y = begin; y < end; ++y) gainer.apply(y);
  });
}

}  // namespace

void apply_gain(const LightGain& gain, Page& page) {
  Picture& picture = page.picture;
  ToneTables tones(TransferCurve::of(picture), picture.bit_depth());
  if (auto* words = std::get_if<Image<std::uint16_t>>(&picture.samples)) {
    apply_to_rows(gain, WordTones{std::move(tones)}, page, *words);
    return;
  }
  float least = 1, most = 1;
  for (std::size_t c = 0; c < static_cast<std::size_t>(picture.channels); ++c) {
    least = std::min(least, std::ranges::min(gain.values[c].pixels()));
    most = std::max(most, std::ranges::max(gain.values[c].pixels()));
  }
  apply_to_rows(gain, ByteTones(tones, least, most), page, std::get<Image<std::uint8_t>>(picture.samples));
}

}  // namespace pagesweep
