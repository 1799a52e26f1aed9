// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "pagesweep/base/image.h"
#include "pagesweep/data/frames.h"
#include "pagesweep/timing/sensor_noise.h"

namespace pagesweep {

/// A pixel whose gray values may teach the profile, and what they show without one.
struct Pupil {
  std::size_t camera = 0;
  int x = 0, y = 0;        ///< [px]
  bool clipped = false;    ///< at least one sample of the shortest exposure is
  double background = 0;   ///< [gray values]
  double amplitude = 0;    ///< [gray values]
  double middle = 0;       ///< [frames] between the crossings of half height
  double fwhm = 0;         ///< [frames]
  std::uint64_t rank = 0;  ///< random, fixed by the pixel's place
};

/// The samples that a pupil teaches with.
struct PupilSamples {
  int first_frame = 0;
  std::vector<float> gray;  ///< NaN: dropped, +infinity: clipped
  std::vector<float> late;  ///< [frames] by which each sample was exposed later; empty: not at all

  double time_of(std::size_t k) const {
    return first_frame + static_cast<double>(k) + (late.empty() ? 0 : static_cast<double>(late[k]));
  }
};

/// Looks for pupils on a sparse grid over one camera's picture, again and again while its frames arrive. Of frames of
/// one exposure it keeps what the grid sees, so that each is looked at once.
class PupilSearch {
 public:
  PupilSearch(const Sequence& sequence, std::size_t camera);

  /// With a first guess of everything but the ceilings.
  const FrameNoise& noise() const { return noise_; }
  /// All pixels of the grid that show a bell clearly above the noise in the frames before `end`.
  std::vector<Pupil> find(const Frames& frames, int end);
  /// A pupil's samples up to `reach` [frames] before and after its middle, of frames before `end`.
  /// \pre find() looked at these frames
  PupilSamples samples(const Frames& frames, const Pupil& pupil, double reach, int end) const;

 private:
  void keep(const Frames& frames, int end);
  void find_in_row(int row, int end, std::vector<Pupil>& found) const;
  void find_among_exposures(const Frames& frames, int row, int end, std::vector<Pupil>& found) const;
  Pupil pupil_at(int column, int row) const;
  float kept_sample(int i, int column, int row) const;

  Sequence sequence_;
  FrameNoise noise_;
  std::size_t camera_;
  int row_step_, column_step_;  ///< [px]
  int rows_, columns_;
  bool is_of_one_exposure_;
  std::vector<Image<std::uint16_t>> kept_;  ///< of each frame what the grid sees; empty: dropped
};

}  // namespace pagesweep
