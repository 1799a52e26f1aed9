// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "pagesweep/base/enum_names.h"

namespace pagesweep {

struct ReportInputs;

/// What a report advises.
enum class VerdictLevel {
  good,        ///< nothing to do
  look,        ///< usable, but something deserves a look
  scan_again,  ///< not usable as it is
};
constexpr auto names_of(VerdictLevel) { return std::array<std::string_view, 3>{"good", "look", "scan_again"}; }

struct VerdictOptions {
  double good_share = 0.95;
  double usable_share = 0.7;
  double good_sigma_mm = 0.2;
  double usable_sigma_mm = 0.6;
  double most_dropped = 0.02;
  double most_spoilt = 0.05;

  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("good-share", good_share, "", "a page of which less was measured deserves a look");
    visit("usable-share", usable_share, "", "a page of which less was measured should be scanned again");
    visit("good-sigma", good_sigma_mm, "mm", "points that are less certain deserve a look");
    visit("usable-sigma", usable_sigma_mm, "mm", "points that are less certain should be measured again");
    visit("most-dropped", most_dropped, "", "share of a camera's frames that may be missing");
    visit("most-spoilt", most_spoilt, "",
          "share of a camera's lit pixels that may be lost to one reason: overexposure, truncation, gloss");
  }
};

/// A scan in plain words.
struct Verdict {
  VerdictLevel level = VerdictLevel::good;
  std::string headline;              ///< one sentence: what was measured and how well
  std::string advice;                ///< one sentence: what to do
  std::vector<std::string> remarks;  ///< what is not as it should be, worst first, each with its remedy
};

/// The rules are those of VerdictOptions: the level is the worst that any page, camera or warning-free figure deserves.
Verdict judge(const ReportInputs& inputs);

}  // namespace pagesweep
