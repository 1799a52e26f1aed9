// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "pagesweep/base/enum_names.h"
#include "pagesweep/base/image.h"

namespace pagesweep::sim {

enum class FigureKind {
  ruled,  ///< a frame with a ruled grid and a curve in it
  photo,  ///< a procedural gray picture: a landscape with a sun
  black,  ///< the same, almost black: the darkest thing that is printed
};
constexpr auto names_of(FigureKind) { return std::array<std::string_view, 3>{"ruled", "photo", "black"}; }

/// A figure across the sheet's columns; text keeps clear of it.
struct Figure {
  FigureKind kind = FigureKind::ruled;
  double x_mm = 0, y_mm = 0;  ///< top left corner on the sheet
  double width_mm = 0, height_mm = 0;
};

/// What is printed on a sheet. A text is paragraphs separated by blank lines; one that begins with "# " is a heading.
struct PrintDesign {
  double width_mm = 0, height_mm = 0;
  double paper_albedo = 0.85;
  double ink_albedo = 0.05;
  std::vector<std::string> texts;  ///< one after the other
  double font_size_pt = 12;
  double line_spacing = 1.3;  ///< in units of the font's own
  double margin_left_mm = 20, margin_right_mm = 20, margin_top_mm = 20, margin_bottom_mm = 22;
  int columns = 1;
  std::string footer;  ///< at the middle of the lower margin: the page number
  std::vector<Figure> figures;
};

struct PrintedSheet {
  Image<float> albedo;  ///< pixel (i, j) is centred at s = (i + 0.5) / pixels_per_mm, t = (j + 0.5) / pixels_per_mm
  std::string text;     ///< what found room, in reading order; empty if there is none
  bool text_was_cut = false;
};

/// Typesets a sheet with Pango and Cairo in Liberation Serif, justified, unhinted.
PrintedSheet print_sheet(const PrintDesign& design, double pixels_per_mm);

}  // namespace pagesweep::sim
