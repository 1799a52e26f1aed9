// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "pagesweep/timing/plain_bells_internal.h"
#include "pagesweep/timing/stripe_windows_internal.h"

namespace pagesweep {

/// The samples of one pixel's recorded window, made ready for PlainBells.
struct BellSamples {
  enum class Kind {
    core,            ///< if samples are missing, then at the bell's foot
    partial,         ///< others are missing
    uneven,          ///< frames were exposed a little late
    clipped,         ///< some are clipped
    clipped_uneven,  ///< both
    too_uneven       ///< no plain case
  };
  static Content content_of(Kind kind);
  int centre = 0;  ///< [frames] of the bell, nearly
  float log_width = 0;
  const BellTable* table = nullptr;
  const float* light = nullptr;  ///< black level removed, from the window's first on; +infinity: clipped
  int start = 0;                 ///< [frames] after the centre where the bell's middle may be
  Kind kind = Kind::core;
  bool is_whole = false;  ///< every frame is there that may be looked at
};

/// Reads them, up to `most_bells` at a time. One a thread.
class BellReader {
 public:
  /// The arguments must outlive this.
  BellReader(const StripeWindows& windows, const PlainBells& bells, double fwhm);

  /// \param slot  0 ... most_bells - 1: what was read there before is gone
  /// \pre the stripe passed the pixel
  void read(int x, int y, float log_width, int slot, BellSamples& samples);
  /// Puts them with the others of their kind.
  void add_to(PlainBells& bells, const BellSamples& samples) const;

 private:
  template <class T>
  void read(const T* gray, int centre, float log_width, int slot, BellSamples& samples);
  BellSamples::Kind kind_of(const BellSamples& samples, bool is_clipped) const;
  /// Whether any sample that counts is clipped.
  bool is_clipped(const BellSamples& samples) const;
  int plateau(const BellSamples& samples) const;

  const StripeWindows& windows_;
  const PlainBells& bells_;
  int near_;  ///< [frames] from a bell's expected middle, where a plateau may be met
  int core_;  ///< [frames] to both sides of a bell's expected middle
  std::vector<float> light_;
};

}  // namespace pagesweep
