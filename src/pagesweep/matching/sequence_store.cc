// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/sequence_store.h"

#include <algorithm>
#include <cmath>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

/// What is asked of one sequence before it is stored.
struct Statistics {
  float mean = 0, energy = 0, lowest = 0, highest = 0;
};

Statistics statistics_of(const std::vector<float>& gray) {
  Statistics s;
  const auto [lowest, highest] = std::minmax_element(gray.begin(), gray.end());
  s.lowest = *lowest;
  s.highest = *highest;
  for (const float g : gray) s.mean += g;
  s.mean /= static_cast<float>(gray.size());
  for (const float g : gray) s.energy += (g - s.mean) * (g - s.mean);
  return s;
}

}  // namespace

SequenceStore::SequenceStore(const Frames& frames, const std::vector<int>& instants, const MatchOptions& options)
    : samples_(static_cast<int>(instants.size())),
      length_((samples_ + lanes - 1) / lanes * lanes),
      data_(static_cast<std::size_t>(frames.width()) * static_cast<std::size_t>(frames.height()) *
            static_cast<std::size_t>(length_)),
      energy_(frames.width(), frames.height()),
      rounding_variance_(frames.width(), frames.height()),
      status_(frames.width(), frames.height(), PixelStatus::ok) {
  const auto range = static_cast<float>(frames.sequence().saturation - frames.sequence().black_level);
  const float darkest = static_cast<float>(options.min_modulation) * range;
  const bool affine = options.normalisation == Normalisation::affine;
  parallel_ranges(height(), 16, [&](int begin, int end) {
    Image<float> rows;
    std::vector<float> gray(instants.size());
    for (int y = begin; y < end; ++y) {
      frames.read_row(y, rows);
      for (int x = 0; x < width(); ++x) {
        for (std::size_t i = 0; i < gray.size(); ++i) gray[i] = std::min(rows(x, instants[i]), range);
        const Statistics s = statistics_of(gray);
        if (!(s.highest - s.lowest >= darkest))
          status_(x, y) = s.lowest >= range ? PixelStatus::saturated : PixelStatus::too_dark;
        const float scale = affine ? full_scale / std::sqrt(std::max(s.energy, 1e-6f)) : full_scale / range;
        const float offset = affine ? s.mean : 0;
        auto* out = const_cast<std::int16_t*>(sequence(x, y));
        for (std::size_t i = 0; i < gray.size(); ++i)
          out[i] = static_cast<std::int16_t>(std::lrint((gray[i] - offset) * scale));
        energy_(x, y) = s.energy * scale * scale;
        rounding_variance_(x, y) = scale * scale / 12;
      }
    }
  });
}

}  // namespace pagesweep
