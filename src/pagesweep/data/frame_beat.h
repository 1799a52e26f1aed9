// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace pagesweep {

/// Times of exposure, as cameras stamp them, on the beat that the frames should have kept.
///
/// The beat's instants are `interval_ns` apart; one of them is instant 0. A frame belongs to the nearest instant that
/// is later than the last frame's, and is that much early or late: a trigger that was lost leaves an instant out, one
/// that came unevenly makes its frame late. All that follows counts time by instants.
class FrameBeat {
 public:
  struct Place {
    int index = 0;    ///< instant
    double late = 0;  ///< [instants] that the exposure was later
  };

  /// \throws std::invalid_argument  if the interval is not above 0
  explicit FrameBeat(double interval_ns);

  /// Where the next frame belongs. The first one is at instant 0, and on time.
  /// \param timestamp_ns  later than those before
  /// \return nothing if it is not later, or too late to be of the same sweep
  std::optional<Place> place(std::int64_t timestamp_ns);
  /// [instants] from instant 0 to a moment.
  double time_of(std::int64_t timestamp_ns) const;

  double interval_ns() const { return interval_ns_; }

 private:
  double interval_ns_;
  std::optional<std::int64_t> first_, last_;
  int last_index_ = -1;
};

/// The usual time between neighbouring frames: the median, which a few lost ones do not move.
/// \return 0 if there are fewer than two
double usual_interval_ns(std::span<const std::int64_t> timestamps_ns);

}  // namespace pagesweep
