// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "pagesweep/base/enum_names.h"
#include "pagesweep/data/page.h"
#include "pagesweep/dewarping/lamp_light.h"
#include "pagesweep/dewarping/light_gain.h"
#include "pagesweep/dewarping/page_frame.h"
#include "pagesweep/dewarping/paper_view.h"

namespace pagesweep {

/// What becomes of the shading on a page.
enum class Shading {
  even,  ///< divided out: what slope, distance and the facing page do to the light
  keep,  ///< left as the scan shows it
};
constexpr auto names_of(Shading) { return std::array<std::string_view, 2>{"even", "keep"}; }

/// How paper lies in the light, page by page.
class PageLight {
 public:
  /// \param views  all pages of the scan; kept, with `scan`, as references
  PageLight(std::span<const PaperView> views, const Picture& scan, const ScanLight& light);

  LightGain gain(std::size_t page, const PageFrame& frame) const;

 private:
  struct Spot;
  Spot spot_at(std::size_t page, const Eigen::Vector2d& paper_mm) const;
  std::vector<PaperSample> sample_paper() const;
  std::optional<std::size_t> facing(std::size_t page) const;

  std::span<const PaperView> views_;
  const Picture& scan_;
  ScanLight light_;
};

}  // namespace pagesweep
