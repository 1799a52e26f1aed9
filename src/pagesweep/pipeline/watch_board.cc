// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/pipeline/watch_board.h"

#include <algorithm>
#include <cmath>

#include "pagesweep/timing/time_stream.h"

namespace pagesweep {
namespace {

/// The amplitudes as a picture: white paper, the brightest hundredth but for glints, becomes 230.
Image<std::uint8_t> texture_of(const TimeMap& times) {
  constexpr float white = 230;
  Image<std::uint8_t> texture(times.width(), times.height());
  std::vector<float> amplitudes;
  for (std::size_t i = 0; i < times.status.size(); ++i)
    if (times.status.data()[i] == PixelStatus::ok) amplitudes.push_back(times.amplitude.data()[i]);
  if (amplitudes.empty()) return texture;
  const auto bright = amplitudes.begin() + static_cast<std::ptrdiff_t>(amplitudes.size() * 99 / 100);
  std::nth_element(amplitudes.begin(), bright, amplitudes.end());
  for (std::size_t i = 0; i < texture.size(); ++i) {
    const float amplitude = times.amplitude.data()[i];
    if (amplitude > 0) texture.data()[i] = static_cast<std::uint8_t>(std::min(254.0F, white * amplitude / *bright));
  }
  return texture;
}

}  // namespace

BoardSweep watch_board(FrameSource& frames, Progress& progress) {
  TimeStream times(frames.sequences());
  progress.begin("following the stripe over the board");
  while (auto set = frames.next()) {
    const double part = (set->index + 1.0) / frames.sequences()[0].count;
    times.add(*std::move(set));
    progress.advance(part);
  }
  BoardSweep sweep{{}, times.finish(progress)};
  for (const TimeMap& map : sweep.timing.maps) sweep.textures.push_back(texture_of(map));
  return sweep;
}

}  // namespace pagesweep
