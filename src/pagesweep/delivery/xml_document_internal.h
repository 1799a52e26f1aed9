// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <initializer_list>
#include <pugixml.hpp>
#include <sstream>
#include <string>
#include <utility>

namespace pagesweep {

using XmlAttributes = std::initializer_list<std::pair<const char*, std::string>>;

/// A text without the control characters for which XML 1.0 has no place, not even as numbers.
inline std::string xml_text(std::string text) {
  std::erase_if(text,
                [](char c) { return static_cast<unsigned char>(c) < 0x20 && c != '\t' && c != '\n' && c != '\r'; });
  return text;
}

/// Appends an element; attributes without a value are left out.
inline pugi::xml_node add_element(pugi::xml_node parent, const char* name, const XmlAttributes& attributes = {}) {
  pugi::xml_node element = parent.append_child(name);
  for (const auto& [attribute, value] : attributes)
    if (!value.empty()) element.append_attribute(attribute) = xml_text(value).c_str();
  return element;
}

/// Appends an element that holds a text, unless the text is empty.
inline void add_text(pugi::xml_node parent, const char* name, const std::string& text) {
  if (!text.empty()) parent.append_child(name).text() = xml_text(text).c_str();
}

inline pugi::xml_document new_document() {
  pugi::xml_document document;
  pugi::xml_node declaration = document.append_child(pugi::node_declaration);
  declaration.append_attribute("version") = "1.0";
  declaration.append_attribute("encoding") = "UTF-8";
  return document;
}

inline std::string to_text(const pugi::xml_document& document) {
  std::ostringstream text;
  document.save(text, "  ", pugi::format_indent, pugi::encoding_utf8);
  return text.str();
}

}  // namespace pagesweep
