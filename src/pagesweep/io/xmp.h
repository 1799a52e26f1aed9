// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace pagesweep {

/// Which kind of value an XMP property has (ISO 16684-1).
enum class XmpKind {
  text,         ///< a simple value
  alternative,  ///< a text for any language: rdf:Alt with x-default
  list,         ///< an ordered list, here of one: rdf:Seq
  bag,          ///< an unordered one: rdf:Bag
};

struct XmpProperty {
  std::string name;  ///< with a prefix: dc, xmp, xmpMM, xmpRights, tiff, exif, pdf or pdfaid
  std::string value;
  XmpKind kind = XmpKind::text;
};

/// An XMP packet with these properties, those with an empty value left out, and with all that `earlier` says otherwise.
/// \param earlier  a packet; one that is empty or no XMP counts as none
/// \throws std::invalid_argument  if a prefix is not known
std::string make_xmp(const std::vector<XmpProperty>& properties, std::string_view earlier = {});

}  // namespace pagesweep
