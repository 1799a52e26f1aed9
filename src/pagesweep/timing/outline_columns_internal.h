// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace pagesweep {

/// The stripe passes quickly: the lower half of a sequence's samples is background, whatever the drift. That of this
/// rank, from 0, is taken for it.
constexpr std::size_t background_rank(std::size_t samples) { return samples / 4; }

/// What columns of samples show at a glance, an entry a column.
struct ColumnOutlines {
  std::vector<std::uint16_t> background;  ///< the sample of background_rank()
  std::vector<std::uint16_t> change;      ///< median change from one sample to the next
  std::vector<std::uint16_t> high;        ///< highest sample
  std::vector<std::uint16_t> peak;        ///< its row, the first of several
};

/// The length that rows of so many columns must have.
constexpr int outlined_width(int columns) { return (columns + 31) / 32 * 32; }

/// \param rows  2 to 65535 of outlined_width(columns) samples
ColumnOutlines outline_columns(std::span<const std::uint16_t* const> rows, int columns);

}  // namespace pagesweep
