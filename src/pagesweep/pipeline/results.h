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
enum class PageFormat { png, tiff };
constexpr auto names_of(PageFormat) { return std::array<std::string_view, 2>{"png", "tiff"}; }

struct PageFileOptions {
  PageFormat format = PageFormat::png;
  PictureFileOptions picture;
  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("format", format, "", "file format of the flat pages");
    picture.describe(visit);
  }
};

/// Writes what the cameras measured (docs/formats.md, "Results"): points.ply, and for each camera NAME its maps
/// NAME_points.tiff, NAME_point_sigma.tiff, NAME_intensity.tiff, NAME_status.png, NAME_clipped.png (in how
/// many frames a pixel is clipped) and NAME_times.tiff.
/// \throws Error  if a file cannot be written
void write_measurement(const std::filesystem::path& folder, const Measurement& measurement);

/// Reads the points back, to make surfaces and pages anew; time maps and frames are not restored.
/// \throws Error  if a file is missing or does not fit the rig
Measurement read_measurement(const std::filesystem::path& folder, const Rig& rig);

/// Writes for each page N page_N.png (or .tiff), page_N_scanmap.tiff and page_N_surface.tiff, and removes the files of
/// pages that an earlier run left and this one does not have.
/// \throws Error  if a file cannot be written
void write_pages(const std::filesystem::path& folder, std::span<const Page> pages,
                 std::span<const PageSurface> surfaces, const PageFileOptions& options = {});

}  // namespace pagesweep
