// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/live/sweep_watch.h"

#include <algorithm>
#include <cstdint>
#include <limits>

namespace pagesweep {
namespace {

constexpr int pixel_step = 8;
constexpr int frames_to_believe = 3;     ///< a flicker is no stripe
constexpr double least_lit = 0.002;      ///< share of the picture
constexpr double least_rise = 1.0 / 24;  ///< share of the gray values

}  // namespace

SweepWatch::SweepWatch(const std::vector<Sequence>& sequences) {
  for (const Sequence& sequence : sequences) {
    Camera camera;
    camera.threshold = least_rise * (sequence.saturation - sequence.black_level);
    camera.darkest = Image<std::uint16_t>((sequence.width + pixel_step - 1) / pixel_step,
                                          (sequence.height + pixel_step - 1) / pixel_step,
                                          std::numeric_limits<std::uint16_t>::max());
    cameras_.push_back(std::move(camera));
  }
}

bool SweepWatch::look(Camera& camera, const GrayImage& image) const {
  double lit = 0, x_sum = 0, y_sum = 0;
  std::visit(
      [&](const auto& pixels) {
        for (int y = 0; y < camera.darkest.height(); ++y) {
          const auto row = pixels.row(y * pixel_step);
          for (int x = 0; x < camera.darkest.width(); ++x) {
            const std::uint16_t gray = row[static_cast<std::size_t>(x * pixel_step)];
            std::uint16_t& darkest = camera.darkest(x, y);
            darkest = std::min(darkest, gray);
            if (gray - darkest < camera.threshold) continue;
            lit += 1, x_sum += x, y_sum += y;
          }
        }
      },
      image);
  const double size = static_cast<double>(camera.darkest.size());
  camera.position.reset();
  if (lit < least_lit * size) return false;
  camera.position = Position{x_sum / lit / camera.darkest.width(), y_sum / lit / camera.darkest.height()};
  return true;
}

SweepWatch::State SweepWatch::look(const FrameSet& set) {
  bool is_lit = false, is_seen = false;
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    if (!set.images[c]) continue;
    is_seen = true;
    is_lit |= look(cameras_[c], *set.images[c]);
  }
  if (!is_seen) return state_;
  lit_ = is_lit ? lit_ + 1 : 0;
  dark_ = is_lit ? 0 : dark_ + 1;
  if (state_ == State::waiting && lit_ >= frames_to_believe) state_ = State::sweeping;
  if (state_ == State::sweeping && dark_ >= frames_around_sweep) state_ = State::over;
  return state_;
}

}  // namespace pagesweep
