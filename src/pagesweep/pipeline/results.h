// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <span>
#include <string_view>

#include "pagesweep/io/image_file.h"
#include "pagesweep/pipeline/scan_page.h"

namespace pagesweep {

/// Format of the flat pages' files.
enum class PageFormat { png, tiff, jpeg, jp2 };
constexpr auto names_of(PageFormat) { return std::array<std::string_view, 4>{"png", "tiff", "jpeg", "jp2"}; }
constexpr std::string_view extension_of(PageFormat format) {
  return format == PageFormat::jpeg ? "jpg" : name_of(format);
}

struct PageFileOptions {
  PageFormat format = PageFormat::png;
  std::string page_name = "page_{page}";
  int first_page = 1;
  PictureFileOptions picture;
  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("format", format, "", "file format of the flat pages");
    visit("page-name", page_name, "",
          "names of their files: text with {page} or {page:04}, {index}, {side} (left, right, single), {capture}");
    visit("first-page", first_page, "", "number of the first page in names");
    picture.describe(visit);
  }
};

/// What pages were made from and by what, for their names and metadata.
struct PageOrigin {
  std::string capture;  ///< its name
  std::string program;  ///< "pagesweep 0.1.0"
};

/// To be called before the work, so that a wrong pattern fails early.
/// \throws std::invalid_argument  if the pattern for names is wrong, or gives the two pages of a spread the same name
void check(const PageFileOptions& options);

/// Writes what the cameras measured (docs/formats.md, "Results"): points.ply, and for each camera NAME its maps
/// NAME_points.tiff, NAME_point_sigma.tiff, NAME_intensity.tiff, NAME_status.png, NAME_clipped.png (in how
/// many frames a pixel is clipped) and NAME_times.tiff.
/// \throws Error  if a file cannot be written
void write_measurement(const std::filesystem::path& folder, const Measurement& measurement);

/// Reads the points back, to make surfaces and pages anew; time maps and frames are not restored.
/// \throws Error  if a file is missing or does not fit the rig
Measurement read_measurement(const std::filesystem::path& folder, const Rig& rig);

/// Writes for each page N its picture (page_N.png, if nothing else is asked for), page_N_scanmap.tiff and
/// page_N_surface.tiff, then pages.json, and removes the files of pages that an earlier run left and this one does not
/// have. Pictures say what they are: resolution, an ICC profile (the scan's, or sRGB), and XMP.
/// \throws Error                  if a file cannot be written
/// \throws std::invalid_argument  if the pattern for names is wrong or gives two pages the same name
void write_pages(const std::filesystem::path& folder, std::span<const Page> pages,
                 std::span<const PageSurface> surfaces, const PageFileOptions& options = {},
                 const PageOrigin& origin = {});

}  // namespace pagesweep
