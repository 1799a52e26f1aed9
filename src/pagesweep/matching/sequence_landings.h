// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "pagesweep/matching/sequence_store.h"

namespace pagesweep {

/// Where the matches of one camera's pixels landed in the other's picture, which is where the way back may begin.
///
/// Each pixel keeps the first and the last of the places that it was matched from. Those do not depend on the order in
/// which they come: all threads may enter theirs.
class SequenceLandings {
 public:
  /// \param from   the camera whose pixels are matched first
  /// \param there  the other one, in whose picture they land. Both must outlive this
  SequenceLandings(const SequenceStore& from, const SequenceStore& there);

  /// A pixel of the first camera was matched with a place [px] of the other.
  void land(std::int32_t index, double x, double y) { widen(landing(x, y), place_of(index), place_of(index)); }
  /// A place [px] that may be the match of some pixel, or not: what is seen there and beside is left open.
  void contest(double x, double y) { widen(landing(x, y), -far_apart, far_apart); }
  /// The place on its line from which a pixel of the other camera was matched, as in SequenceArrays; none if nothing
  /// landed there or beside, or if what did came from different places.
  std::optional<float> origin(std::int32_t index) const;

 private:
  static constexpr std::uint32_t half = 0xffff;
  static constexpr double far_apart = 1e6;

  struct Landing {
    std::size_t cell;     ///< 0, which nobody reads: outside the picture
    double beyond_place;  ///< of the pixel's middle
  };
  Landing landing(double x, double y) const;
  double place_of(std::int32_t index) const { return index % from_.stride; }
  std::uint32_t step_at(double place) const;
  void widen(const Landing& landing, double first, double last);

  const SequenceArrays& from_;
  const SequenceArrays& there_;
  int steps_;  ///< a place, a power of two
  /// [line + 1][place + 1] Places are counted in steps, from 1 on: in the lower half the last one, in the upper half by
  /// how much the first one is before the end of the scale. 0 is nothing yet.
  std::unique_ptr<std::uint32_t[]> cells_;
};

}  // namespace pagesweep
