// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <string>

#include "pagesweep/data/picture.h"
#include "pagesweep/sim/print.h"

namespace pagesweep::test {

struct TypesetPage {
  Picture picture;
  std::string text;
};

/// A small page of printed text at 300 dpi, in gray or in RGB.
inline TypesetPage typeset_page(const std::string& text, int channels = 1) {
  sim::PrintDesign design;
  design.width_mm = 90;
  design.height_mm = 50;
  design.margin_left_mm = design.margin_right_mm = design.margin_top_mm = design.margin_bottom_mm = 8;
  design.texts = {text};
  const double pixels_per_mm = 300 / 25.4;
  sim::PrintedSheet sheet = print_sheet(design, pixels_per_mm);
  TypesetPage page{make_picture(sheet.albedo.width(), sheet.albedo.height(), channels, 8), std::move(sheet.text)};
  page.picture.pixels_per_mm = pixels_per_mm;
  auto& samples = std::get<0>(page.picture.samples);
  for (int y = 0; y < samples.height(); ++y)
    for (int x = 0; x < samples.width(); ++x)
      samples(x, y) = static_cast<std::uint8_t>(255 * std::min(1.0F, 1.15F * sheet.albedo(x / channels, y)));
  return page;
}

}  // namespace pagesweep::test
