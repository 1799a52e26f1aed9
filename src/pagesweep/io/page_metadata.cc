// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/page_metadata.h"

#include <fmt/format.h>

#include <cmath>
#include <span>

#include "pagesweep/io/xmp.h"

namespace pagesweep {
namespace {

constexpr double mm_per_inch = 25.4;

/// As XMP writes TIFF's rationals: "3000000/10000".
std::string dots_per_inch(double pixels_per_mm) {
  return pixels_per_mm > 0 ? fmt::format("{}/10000", std::lround(pixels_per_mm * mm_per_inch * 10000)) : "";
}

std::string text_of(const Picture& picture, const char* kind) {
  const auto found = picture.metadata.find(kind);
  if (found == picture.metadata.end()) return "";
  return {reinterpret_cast<const char*>(found->second.data()), found->second.size()};
}

}  // namespace

CaptureTags capture_tags_of(const Picture& picture) {
  const auto exif = picture.metadata.find("exif");
  return exif == picture.metadata.end() ? CaptureTags{} : read_exif(exif->second);
}

void complete_metadata(Picture& picture, const PageMetadata& metadata) {
  const CaptureTags tags = capture_tags_of(picture);
  const std::string resolution = dots_per_inch(picture.pixels_per_mm);
  const std::string xmp = make_xmp({{"dc:title", metadata.title, XmpKind::alternative},
                                    {"dc:source", metadata.source},
                                    {"dc:creator", tags.artist, XmpKind::list},
                                    {"dc:rights", tags.copyright, XmpKind::alternative},
                                    {"xmp:CreatorTool", metadata.program},
                                    {"xmp:CreateDate", iso_date(tags.date_time)},
                                    {"tiff:Make", tags.make},
                                    {"tiff:Model", tags.model},
                                    {"tiff:ImageWidth", std::to_string(picture.width())},
                                    {"tiff:ImageLength", std::to_string(picture.height())},
                                    {"tiff:Orientation", "1"},
                                    {"tiff:XResolution", resolution},
                                    {"tiff:YResolution", resolution},
                                    {"tiff:ResolutionUnit", resolution.empty() ? "" : "2"}},
                                   text_of(picture, "xmp"));
  const auto bytes = std::as_bytes(std::span(xmp));
  picture.metadata["xmp"] = {bytes.begin(), bytes.end()};
}

}  // namespace pagesweep
