// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/data/frames.h"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "pagesweep/base/parallel.h"
#include "pagesweep/data/gray_samples_internal.h"

namespace pagesweep {

int width_of(const GrayImage& image) {
  return std::visit([](const auto& pixels) { return pixels.width(); }, image);
}

int height_of(const GrayImage& image) {
  return std::visit([](const auto& pixels) { return pixels.height(); }, image);
}

std::vector<double> relative_exposures(std::span<const double> pattern, int count) {
  if (pattern.empty()) return {};
  const auto [shortest, longest] = std::ranges::minmax(pattern);
  if (shortest == longest) return {};
  std::vector<double> exposures;
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i)
    exposures.push_back(pattern[i % pattern.size()] / longest);
  return exposures;
}

Frames::Frames(Sequence sequence) : sequence_(std::move(sequence)), images_(static_cast<std::size_t>(sequence_.count)) {
  if (!sequence_.exposures.empty() && sequence_.exposures.size() != images_.size())
    throw std::invalid_argument("Frames: there must be one exposure a frame, or none");
}

int Frames::dropped() const {
  return static_cast<int>(std::count_if(images_.begin(), images_.end(), [](const auto& image) { return !image; }));
}

void Frames::set(int i, GrayImage image, float late) {
  if (i < 0 || i >= count()) throw std::invalid_argument("Frames::set: no such frame");
  if (width_of(image) != width() || height_of(image) != height())
    throw std::invalid_argument("Frames::set: the frame's size is not the sequence's");
  if (std::holds_alternative<Image<std::uint8_t>>(image) != sequence_.is_8_bit())
    throw std::invalid_argument("Frames::set: the frame's depth is not the sequence's");
  images_[static_cast<std::size_t>(i)] = std::move(image);
  if (late != 0 && late_.empty()) late_.assign(images_.size(), 0);
  if (!late_.empty()) late_[static_cast<std::size_t>(i)] = late;
}

void Frames::end_at(int count) {
  if (count < 0 || count > this->count()) throw std::invalid_argument("Frames::end_at: there are not that many");
  const auto size = static_cast<std::size_t>(count);
  sequence_.count = count;
  images_.resize(size);
  if (!late_.empty()) late_.resize(size);
  if (!sequence_.exposures.empty()) sequence_.exposures.resize(size);
}

bool Frames::read_row(int y, Image<float>& samples) const {
  if (samples.width() != width() || samples.height() != count()) samples = Image<float>(width(), count());
  return read_row(y, 0, samples);
}

bool Frames::read_row(int y, int left, Image<float>& samples) const {
  bool clipped = false;
  for (int i = 0; i < samples.height(); ++i) {
    const auto out = samples.row(i);
    if (!has(i)) {
      std::fill(out.begin(), out.end(), std::numeric_limits<float>::quiet_NaN());
      continue;
    }
    const GrayScale scale{static_cast<float>(sequence_.black_level), static_cast<float>(sequence_.saturation),
                          static_cast<float>(1 / sequence_.exposure(i))};
    std::visit([&](const auto& image) { clipped |= to_samples(&image(left, y), scale, out); }, frame(i));
  }
  return clipped;
}

Image<float> brightest(const Frames& frames) {
  Image<float> picture(frames.width(), frames.height());
  const auto& sequence = frames.sequence();
  parallel_rows(frames.height(), [&](int y) {
    Image<float> samples;
    frames.read_row(y, samples);
    const auto out = picture.row(y);
    for (int i = 0; i < frames.count(); ++i) {
      const auto clipped = static_cast<float>((sequence.saturation - sequence.black_level) / sequence.exposure(i));
      for (int x = 0; x < frames.width(); ++x)  // a dropped frame's NaN is never the greater one
        if (const float gray = std::min(samples(x, i), clipped); gray > out[static_cast<std::size_t>(x)])
          out[static_cast<std::size_t>(x)] = gray;
    }
  });
  return picture;
}

Image<std::uint8_t> count_clipped(const Frames& frames) {
  Image<std::uint8_t> counts(frames.width(), frames.height());
  const double saturation = frames.sequence().saturation;
  parallel_rows(frames.height(), [&](int y) {
    const auto out = counts.row(y);
    for (int i = 0; i < frames.count(); ++i) {
      if (!frames.has(i)) continue;
      std::visit(
          [&](const auto& image) {
            const auto in = image.row(y);
            for (std::size_t x = 0; x < in.size(); ++x)
              out[x] = static_cast<std::uint8_t>(out[x] + (in[x] >= saturation && out[x] < 255));
          },
          frames.frame(i));
    }
  });
  return counts;
}

std::vector<Frames> read_all(FrameSource& source, Progress& progress) {
  std::vector<Frames> cameras;
  for (const Sequence& sequence : source.sequences()) cameras.emplace_back(sequence);
  progress.begin("reading frames");
  while (auto set = source.next()) {
    for (std::size_t c = 0; c < cameras.size(); ++c)
      if (set->images[c]) cameras[c].set(set->index, std::move(*set->images[c]), set->late_of(c));
    if (!cameras.empty()) progress.advance((set->index + 1.0) / cameras[0].count());
  }
  for (std::size_t c = 0; c < cameras.size(); ++c) cameras[c].end_at(source.sequences()[c].count);
  return cameras;
}

}  // namespace pagesweep
