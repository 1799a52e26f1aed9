// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "pagesweep/data/figure.h"
#include "pagesweep/data/picture.h"
#include "pagesweep/report/colour_ramp.h"
#include "pagesweep/report/pictures.h"
#include "pagesweep/report/report.h"

namespace pagesweep {

/// Text as HTML shows it: nothing in it can become markup, inside an element or a quoted attribute. Bytes that are no
/// UTF-8 and control characters become U+FFFD.
std::string escape_html(std::string_view text);

std::string encode_base64(std::string_view bytes);

/// "12.3", "0.081", "12 345"; "–" for a missing value. Three significant digits without
/// zeros at their end, whole numbers in full.
std::string format_number(double value);

/// Encodes pictures for embedding, through files in `folder` that are gone afterwards.
class PictureEncoder {
 public:
  explicit PictureEncoder(std::filesystem::path folder) : folder_(std::move(folder)) {}

  /// A data: URL of at most about 4/3 `most_bytes`: JPEG for what is continuous, coarser until it fits.
  std::string photo(Picture picture, std::size_t most_bytes = 400'000) const;
  /// Likewise without loss, for few flat colours.
  std::string drawing(const Picture& picture) const;

 private:
  std::string encode(const Picture& picture, const char* extension, int quality) const;
  std::filesystem::path folder_;
};

/// <figure> with an image, an optional colour bar and a caption. `title`, `caption` and `unit` are plain text.
struct PictureFigure {
  std::string url;
  std::string title;
  std::string caption;
  int width = 0;  ///< [px] of the picture: its proportions
  int height = 0;
  bool has_bar = false;
  Ramp ramp = Ramp::sequential;
  Range range;
  std::string unit;
};
std::string format_figure(const PictureFigure& figure);

/// A picture, no side of it longer than `longest_px`; title and caption are to be filled in.
PictureFigure photo_figure(const Picture& picture, int longest_px, const PictureEncoder& encoder);
/// Likewise a map in colours with its bar.
PictureFigure map_figure(const Image<float>& values, Ramp ramp, Range range, std::string_view unit,
                         const PictureEncoder& encoder);

/// The page from its first byte to its heading. \param kicker  what kind of page it is, above the title
std::string format_page_head(std::string_view kicker, std::string_view title);
/// A heading, a sentence and what belongs to them; empty if `body` is.
std::string format_section(std::string_view title, std::string_view lead, const std::string& body);
/// Figures side by side: \param columns  "two", "four", "wide" or "surface", see report_style()
std::string format_row(std::string_view columns, const std::string& figures);
/// One number in large letters, of those that stand in a <div class="tiles">.
std::string format_tile(const std::string& value, std::string_view unit, std::string_view what);

/// A bar in a ramp's colours with the values at its ends and in its middle.
std::string format_colour_bar(Ramp ramp, Range range, std::string_view unit);

/// A table a group, in columns; empty if there are no figures.
std::string format_figures(std::span<const Figure> figures);

/// The stripe's profile as an inline SVG; empty if there are fewer than two samples.
std::string format_profile(std::span<const ProfileSample> profile);

/// The style sheet: light and dark, screen and print.
std::string_view report_style();

/// The parts of the page (report_page.cc).
std::string format_report(const ReportInputs& inputs, const Verdict& verdict, const PictureEncoder& encoder);
std::string format_evaluation(std::span<const Figure> figures, std::span<const FigureMap> maps,
                              const PictureEncoder& encoder);

/// Between these comments stands the comparison with the truth. Escaped text cannot contain them.
inline constexpr std::string_view evaluation_begin = "<!-- evaluation begins -->";
inline constexpr std::string_view evaluation_end = "<!-- evaluation ends -->";

}  // namespace pagesweep
