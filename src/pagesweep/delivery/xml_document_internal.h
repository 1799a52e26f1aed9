// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <initializer_list>
#include <pugixml.hpp>
#include <sstream>
#include <string>
#include <utility>

namespace pagesweep {

using XmlAttributes = std::initializer_list<std::pair<const char*, std::string>>;

/// Appends an element; attributes without a value are left out.
inline pugi::xml_node add_element(pugi::xml_node parent, const char* name, const XmlAttributes& attributes = {}) {
  pugi::xml_node element = parent.append_child(name);
  for (const auto& [attribute, value] : attributes)
    if (!value.empty()) element.append_attribute(attribute) = value.c_str();
  return element;
}

/// Appends an element that holds a text, unless the text is empty.
inline void add_text(pugi::xml_node parent, const char* name, const std::string& text) {
  if (!text.empty()) parent.append_child(name).text() = text.c_str();
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
