// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/xmp.h"

#include <algorithm>
#include <array>
#include <pugixml.hpp>
#include <sstream>
#include <stdexcept>

namespace pagesweep {
namespace {

struct Namespace {
  std::string_view prefix;
  const char* uri;
};
constexpr std::array<Namespace, 8> namespaces = {{{"dc", "http://purl.org/dc/elements/1.1/"},
                                                  {"xmp", "http://ns.adobe.com/xap/1.0/"},
                                                  {"xmpMM", "http://ns.adobe.com/xap/1.0/mm/"},
                                                  {"xmpRights", "http://ns.adobe.com/xap/1.0/rights/"},
                                                  {"tiff", "http://ns.adobe.com/tiff/1.0/"},
                                                  {"exif", "http://ns.adobe.com/exif/1.0/"},
                                                  {"pdf", "http://ns.adobe.com/pdf/1.3/"},
                                                  {"pdfaid", "http://www.aiim.org/pdfa/ns/id/"}}};
constexpr const char* rdf_uri = "http://www.w3.org/1999/02/22-rdf-syntax-ns#";

const Namespace& namespace_of(std::string_view property) {
  const std::string_view prefix = property.substr(0, property.find(':'));
  const auto* found = std::ranges::find(namespaces, prefix, &Namespace::prefix);
  if (found == namespaces.end()) throw std::invalid_argument("make_xmp: unknown prefix: " + std::string(prefix));
  return *found;
}

/// Appends a new element that holds the properties.
void describe(pugi::xml_node rdf, const std::vector<XmpProperty>& properties) {
  pugi::xml_node description = rdf.append_child("rdf:Description");
  description.append_attribute("rdf:about") = "";
  for (const XmpProperty& property : properties) {
    if (property.value.empty()) continue;
    const Namespace& space = namespace_of(property.name);
    const std::string declaration = "xmlns:" + std::string(space.prefix);
    if (!description.attribute(declaration.c_str())) description.append_attribute(declaration.c_str()) = space.uri;
    pugi::xml_node element = description.append_child(property.name.c_str());
    if (property.kind != XmpKind::text) {
      constexpr std::array<const char*, 4> containers = {"", "rdf:Alt", "rdf:Seq", "rdf:Bag"};
      element = element.append_child(containers[static_cast<std::size_t>(property.kind)]).append_child("rdf:li");
      if (property.kind == XmpKind::alternative) element.append_attribute("xml:lang") = "x-default";
    }
    element.text() = property.value.c_str();
  }
}

/// Takes away what the new properties say, in either of the forms that RDF has: as elements and as attributes.
void remove_properties(pugi::xml_node rdf, const std::vector<XmpProperty>& properties) {
  for (pugi::xml_node description : rdf.children("rdf:Description"))
    for (const XmpProperty& property : properties) {
      if (property.value.empty()) continue;
      while (description.remove_child(property.name.c_str()));
      description.remove_attribute(property.name.c_str());
    }
}

/// The earlier packet's RDF, or one that is empty.
pugi::xml_node find_rdf(pugi::xml_document& document, std::string_view earlier) {
  if (document.load_buffer(earlier.data(), earlier.size())) {
    const pugi::xml_node meta = document.child("x:xmpmeta");
    if (const pugi::xml_node rdf = meta.child("rdf:RDF")) return rdf;
  }
  document.reset();
  pugi::xml_node meta = document.append_child("x:xmpmeta");
  meta.append_attribute("xmlns:x") = "adobe:ns:meta/";
  pugi::xml_node rdf = meta.append_child("rdf:RDF");
  rdf.append_attribute("xmlns:rdf") = rdf_uri;
  return rdf;
}

}  // namespace

std::string make_xmp(const std::vector<XmpProperty>& properties, std::string_view earlier) {
  pugi::xml_document document;
  const pugi::xml_node rdf = find_rdf(document, earlier);
  remove_properties(rdf, properties);
  describe(rdf, properties);
  std::ostringstream text;
  text << "<?xpacket begin=\"\xEF\xBB\xBF\" id=\"W5M0MpCehiHzreSzNTczkc9d\"?>\n";
  document.child("x:xmpmeta").print(text, " ", pugi::format_indent, pugi::encoding_utf8);
  text << "<?xpacket end=\"w\"?>";
  return text.str();
}

}  // namespace pagesweep
