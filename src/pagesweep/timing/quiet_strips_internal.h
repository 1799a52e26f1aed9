// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "pagesweep/base/image.h"
#include "pagesweep/timing/coarse_search_internal.h"
#include "pagesweep/timing/raw_row_internal.h"

namespace pagesweep {

/// Tells where CoarseSearch need not look, because nothing there has been bright enough lately: a response is at most
/// four blocks of the range of gray values. Most of a picture is like that once the stripe has passed.
class QuietStrips {
 public:
  static constexpr int strip_px = 128;  ///< side by side

  QuietStrips(int width, int height, int block);

  /// Frames begin ... end - 1 have come.
  /// \param is_looked_at  whether note() will be called for all rows
  void begin_step(int begin, int end, bool is_looked_at);
  /// Looks at row y of them. On any thread.
  void note(int y, const RawRow& rows, int first_frame);
  /// The highest gray value of row y in the step's frames. \pre note() was called for the row
  int highest(int y) const;
  /// Whether the step leaves the strip as it is.
  bool is_quiet(int strip, int y, const CoarseSearch::Step& step) const;
  /// Remembers how a strip stands after it was looked at. On any thread.
  void keep(int strip, int y, const CoarseSearch& search);
  /// The latest place of the highest response of one of its pixels.
  int latest(int strip, int y) const { return latest_(strip, y); }
  int count() const { return lowest_rise_.width(); }  ///< of strips in a row

 private:
  struct Step {
    int begin, end;                  ///< [frames]
    Image<std::uint16_t> low, high;  ///< of gray values; empty: not known
  };
  template <class T>
  void note_rows(Step& step, int y, std::span<const T* const> rows);

  int width_, block_;
  std::vector<Step> steps_;   ///< those whose frames may still be asked for
  Image<float> lowest_rise_;  ///< of a strip's pixels; since it was looked at it can only have risen
  Image<std::int32_t> latest_;
};

}  // namespace pagesweep
