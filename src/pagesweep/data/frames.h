// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "pagesweep/base/image.h"
#include "pagesweep/base/progress.h"

namespace pagesweep {

/// A single-channel picture as a matrix camera delivers it: linear light, 8 or 16 bit.
using GrayImage = std::variant<Image<std::uint8_t>, Image<std::uint16_t>>;

int width_of(const GrayImage& image);
int height_of(const GrayImage& image);

/// What is known about a camera's frames before the first one is there.
struct Sequence {
  std::string camera;
  int width = 0;
  int height = 0;
  int count = 0;            ///< frame instants, dropped frames included
  int bit_depth = 8;        ///< of the gray values: 1 to 16
  double black_level = 0;   ///< gray value without light
  double saturation = 255;  ///< first gray value that is clipped
  /// Exposure of each frame relative to the longest one: above 0, at most 1. Empty: all alike.
  std::vector<double> exposures = {};

  bool is_8_bit() const { return bit_depth <= 8; }  ///< else its frames have 16 bit samples
  double exposure(int i) const { return exposures.empty() ? 1 : exposures[static_cast<std::size_t>(i)]; }
};

/// The exposure of each of `count` frames relative to the longest one.
/// \param pattern  exposures in any unit, repeated from frame 0 on
/// \return  empty if all are alike
std::vector<double> relative_exposures(std::span<const double> pattern, int count);

/// The frames of one camera. frame(i) was exposed at time i + late(i) [frames]; a dropped frame is absent.
class Frames {
 public:
  Frames() = default;
  /// \throws std::invalid_argument  if there are exposures, but not one a frame
  explicit Frames(Sequence sequence);

  const Sequence& sequence() const { return sequence_; }
  int width() const { return sequence_.width; }
  int height() const { return sequence_.height; }
  int count() const { return sequence_.count; }
  bool has(int i) const { return images_[static_cast<std::size_t>(i)].has_value(); }
  int dropped() const;
  /// \throws std::invalid_argument  if i is out of range, or size or depth are not the sequence's
  void set(int i, GrayImage image, float late = 0);
  /// Gives a frame's memory back: it counts as dropped from now on.
  void forget(int i) { images_[static_cast<std::size_t>(i)].reset(); }
  const GrayImage& frame(int i) const { return *images_[static_cast<std::size_t>(i)]; }
  /// [frames] by which frame i was exposed later than at time i; of frames that were forgotten, too.
  float late(int i) const { return late_.empty() ? 0 : late_[static_cast<std::size_t>(i)]; }
  /// Whether all frames that have come so far were exposed exactly when they should.
  bool is_even() const { return late_.empty(); }
  /// No frame from `count` on will come: live cameras are not known to stop before they do.
  void end_at(int count);

  /// The gray value sequences of a row of pixels, black level removed and divided by the frame's relative exposure:
  /// samples(x, i) is what pixel (x, y) would show at frame i with the longest exposure and no limit, NaN where the
  /// frame was dropped. A sample that is clipped is +infinity: it says "at least saturation" and nothing more, and no
  /// station can mistake it for a measurement (eq. 10).
  /// \param samples  becomes count() rows of width() pixels
  /// \return whether a sample is clipped
  bool read_row(int y, Image<float>& samples) const;
  /// The same for the pixels (left, y), (left + 1, y), ..., as many as `samples` has columns, and the first frames, as
  /// many as it has rows.
  /// \pre samples fit into the row and the frames
  bool read_row(int y, int left, Image<float>& samples) const;

 private:
  Sequence sequence_;
  std::vector<std::optional<GrayImage>> images_;
  std::vector<float> late_;  ///< one a frame; empty: all are 0
};

/// The brightest sample of each pixel over all frames as read_row() has them, clipped ones at saturation: the picture
/// in which a sweep shows the whole page lit (paper Fig. 4).
Image<float> brightest(const Frames& frames);

/// In how many frames each pixel is clipped (255: that many or more).
Image<std::uint8_t> count_clipped(const Frames& frames);

/// Simultaneous frames of all cameras; a camera whose frame was dropped has none.
struct FrameSet {
  int index = 0;  ///< [frames] time of exposure
  std::vector<std::optional<GrayImage>> images;
  std::vector<float> late = {};  ///< [frames] by which each camera's exposure was later than that; empty: not at all

  float late_of(std::size_t camera) const { return late.empty() ? 0 : late[camera]; }
};

/// Yields the simultaneous frames of all cameras, one instant after the other. A folder, a recording, the
/// simulator and live cameras are all this; the pipeline cannot tell them apart.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  /// How many instants there are may be known only after the last one: until then, live cameras tell the most that
  /// there can be.
  virtual const std::vector<Sequence>& sequences() const = 0;
  /// The next instant, or nothing after the last one.
  /// \throws Error  if a frame cannot be read
  virtual std::optional<FrameSet> next() = 0;
};

/// Reads a source to its end: one Frames a camera, in the order of source.sequences().
std::vector<Frames> read_all(FrameSource& source, Progress& progress = no_progress());

}  // namespace pagesweep
