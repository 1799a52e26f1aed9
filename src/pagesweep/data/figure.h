// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <string>

#include "pagesweep/base/image.h"

namespace pagesweep {

/// One quantity that a run or an evaluation found, or the reason why it is missing. Tables, JSON and the report are
/// all made from lists of these.
struct Figure {
  std::string group;  ///< what it is a property of: "points", "times", "page_1", ...; a key for scripts
  std::string name;   ///< within the group: "rms", "completeness", ...; a key for scripts, without blanks
  std::string what;   ///< the same in words for people
  double value = std::numeric_limits<double>::quiet_NaN();  ///< NaN: missing, and `reason` says why
  std::string unit;                                         ///< "mm", "frames", "%", ...; "" for a count or a ratio
  std::string reason;                                       ///< why the value is missing; "" where it is not
};

/// A quantity over a camera's picture or over a page, to be shown in colours.
struct FigureMap {
  std::string group;    ///< as Figure::group
  std::string what;     ///< in words for people
  std::string caption;  ///< what a reader should learn from it
  std::string unit;
  Image<float> values;     ///< NaN where there is none
  bool is_signed = false;  ///< deviations to both sides of 0, rather than sizes from 0 on
};

}  // namespace pagesweep
