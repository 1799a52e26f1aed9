// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <map>
#include <pugixml.hpp>
#include <regex>
#include <set>
#include <string>
#include <vector>

/// What XML schemas prescribe, as far as a file can break it, checked for this directory's tests: element by element
/// the order of its children, its attributes and their types, and that references lead somewhere.
namespace pagesweep::test {

/// An attribute's type: a pattern of its value, or "ID", "IDREF", "IDREFS" of XML Schema.
struct AttributeRule {
  std::string name, type;
  bool required = false;
};

struct ElementRule {
  std::string children;  ///< a pattern of their names, each followed by a blank: "(String (SP )?)+"
  std::vector<AttributeRule> attributes;
  std::string text;  ///< a pattern of what stands in it; empty: nothing may
};

/// By name of the element. What is "any" below an element is not looked at.
using StructureRules = std::map<std::string, ElementRule>;

inline const std::string
    any_text = "[\\s\\S]*",
    decimal = "-?[0-9]+(\\.[0-9]+)?", integer = "-?[0-9]+", share = "0(\\.[0-9]+)?|1(\\.0+)?",
    language = "[a-zA-Z]{1,8}(-[a-zA-Z0-9]{1,8})*",
    date_time = "[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9]{2}:[0-9]{2}:[0-9]{2}(\\.[0-9]+)?(Z|[+-][0-9]{2}:[0-9]{2})?";

class StructureCheck {
 public:
  explicit StructureCheck(const StructureRules& rules) : rules_(rules) {}

  /// All that is wrong, one a line; empty if nothing is.
  std::string errors_of(const pugi::xml_document& document) {
    look_at(document.document_element(), "");
    for (const auto& [id, place] : references_)
      if (!ids_.contains(id)) complain(place, "refers to " + id + ", which is not there");
    return errors_;
  }

 private:
  void complain(const std::string& place, const std::string& what) { errors_ += place + ": " + what + "\n"; }

  void look_at(const pugi::xml_node& element, const std::string& above) {
    const std::string place = above + "/" + element.name();
    const auto rule = rules_.find(element.name());
    if (rule == rules_.end()) return complain(place, "there is no such element");
    look_at_attributes(element, rule->second, place);
    if (rule->second.children == "any") return;
    std::string names, text;
    for (const pugi::xml_node& child : element.children()) {
      if (child.type() == pugi::node_element) names += child.name() + std::string(" ");
      if (child.type() == pugi::node_pcdata) text += child.value();
    }
    if (!std::regex_match(names, std::regex(rule->second.children))) complain(place, "children are " + names);
    if (!std::regex_match(text, std::regex(rule->second.text))) complain(place, "holds the text " + text);
    for (const pugi::xml_node& child : element.children())
      if (child.type() == pugi::node_element) look_at(child, place);
  }

  void look_at_attributes(const pugi::xml_node& element, const ElementRule& rule, const std::string& place) {
    for (const AttributeRule& attribute : rule.attributes)
      if (attribute.required && !element.attribute(attribute.name.c_str())) complain(place, "lacks " + attribute.name);
    for (const pugi::xml_attribute& attribute : element.attributes()) {
      const std::string name = attribute.name();
      if (name.starts_with("xmlns") || name.starts_with("xsi:")) continue;
      const auto is_it = [&](const AttributeRule& other) { return other.name == name; };
      const auto allowed = std::find_if(rule.attributes.begin(), rule.attributes.end(), is_it);
      if (allowed == rule.attributes.end())
        complain(place, "has no attribute " + name);
      else
        look_at_value(allowed->type, attribute.value(), place + "@" + name);
    }
  }

  void look_at_value(const std::string& type, const std::string& value, const std::string& place) {
    static const std::regex name_pattern("[A-Za-z_][A-Za-z0-9_.-]*");
    if (type == "ID") {
      if (!std::regex_match(value, name_pattern)) complain(place, "is no name: " + value);
      if (!ids_.insert(value).second) complain(place, "is there twice: " + value);
    } else if (type == "IDREF" || type == "IDREFS") {
      std::istringstream list(value);
      for (std::string id; list >> id;) references_.emplace_back(id, place);
    } else if (!std::regex_match(value, std::regex(type))) {
      complain(place, "is " + value);
    }
  }

  const StructureRules& rules_;
  std::set<std::string> ids_;
  std::vector<std::pair<std::string, std::string>> references_;
  std::string errors_;
};

/// ALTO 4.2 (alto-4-2.xsd of the Library of Congress): the elements that hold text of a page.
inline const StructureRules& alto_rules() {
  static const auto with_box = [](std::vector<AttributeRule> more) {
    for (const char* name : {"HPOS", "VPOS", "WIDTH", "HEIGHT"}) more.push_back({name, decimal});
    return more;
  };
  static const StructureRules rules{
      {"alto", {"(Description )?(Styles )?(Tags )?Layout ", {{"SCHEMAVERSION", any_text}}, ""}},
      {"Description", {"MeasurementUnit (sourceImageInformation )?(OCRProcessing )*(Processing )*", {}, ""}},
      {"MeasurementUnit", {"", {}, "pixel|mm10|inch1200"}},
      {"sourceImageInformation", {"(fileName )?(fileIdentifier )*(documentIdentifier )*", {}, ""}},
      {"fileName", {"", {}, any_text}},
      {"Processing",
       {"(processingCategory )?(processingDateTime )?(processingAgency )?(processingStepDescription )*"
        "(processingStepSettings )?(processingSoftware )?",
        {{"ID", "ID", true}},
        ""}},
      {"processingCategory", {"", {}, "contentGeneration|contentModification|preOperation|postOperation|other"}},
      {"processingDateTime", {"", {}, date_time}},
      {"processingSoftware",
       {"(softwareCreator )?(softwareName )?(softwareVersion )?(applicationDescription )?", {}, ""}},
      {"softwareName", {"", {}, any_text}},
      {"softwareVersion", {"", {}, any_text}},
      {"Layout", {"(Page )+", {{"STYLEREFS", "IDREFS"}}, ""}},
      {"Page",
       {"(TopMargin )?(LeftMargin )?(RightMargin )?(BottomMargin )?(PrintSpace )?",
        {{"ID", "ID", true},
         {"PHYSICAL_IMG_NR", decimal, true},
         {"PRINTED_IMG_NR", any_text},
         {"WIDTH", decimal},
         {"HEIGHT", decimal},
         {"PROCESSINGREFS", "IDREFS"}},
        ""}},
      {"PrintSpace", {"((TextBlock|Illustration|GraphicalElement|ComposedBlock) )*", with_box({{"ID", "ID"}}), ""}},
      {"TextBlock", {"(TextLine )*", with_box({{"ID", "ID", true}, {"LANG", language}}), ""}},
      {"TextLine",
       {"(String (SP )?)+(HYP )?",
        with_box({{"ID", "ID"}, {"BASELINE", "(-?[0-9.]+,-?[0-9.]+ ?)+"}, {"LANG", language}}), ""}},
      {"String", {"", with_box({{"ID", "ID"}, {"CONTENT", any_text, true}, {"WC", share}, {"LANG", language}}), ""}},
      {"SP", {"", with_box({{"ID", "ID"}}), ""}},
  };
  return rules;
}

/// METS 1.12 (mets.xsd of the Library of Congress): what a job of pages needs of it.
inline const StructureRules& mets_rules() {
  static const StructureRules rules{
      {"mets",
       {"(metsHdr )?(dmdSec )*(amdSec )*(fileSec )?(structMap )+(structLink )?(behaviorSec )*",
        {{"ID", "ID"}, {"OBJID", any_text}, {"LABEL", any_text}, {"TYPE", any_text}, {"PROFILE", any_text}},
        ""}},
      {"metsHdr",
       {"(agent )*(altRecordID )*(metsDocumentID )?",
        {{"ID", "ID"}, {"CREATEDATE", date_time}, {"LASTMODDATE", date_time}, {"RECORDSTATUS", any_text}},
        ""}},
      {"agent",
       {"name (note )*",
        {{"ROLE", "CREATOR|EDITOR|ARCHIVIST|PRESERVATION|DISSEMINATOR|CUSTODIAN|IPOWNER|OTHER", true},
         {"TYPE", "INDIVIDUAL|ORGANIZATION|OTHER"},
         {"OTHERTYPE", any_text}},
        ""}},
      {"name", {"", {}, any_text}},
      {"dmdSec", {"(mdRef )?(mdWrap )?", {{"ID", "ID", true}}, ""}},
      {"mdWrap", {"(binData |xmlData )", {{"MIMETYPE", any_text}, {"MDTYPE", "MARC|MODS|DC|PREMIS|OTHER", true}}, ""}},
      {"xmlData", {"any", {}, ""}},
      {"fileSec", {"(fileGrp )+", {{"ID", "ID"}}, ""}},
      {"fileGrp", {"(fileGrp )*(file )*", {{"ID", "ID"}, {"USE", any_text}}, ""}},
      {"file",
       {"(FLocat )*(FContent )?(stream )*(transformFile )*(file )*",
        {{"ID", "ID", true},
         {"MIMETYPE", any_text},
         {"SIZE", integer},
         {"CHECKSUM", "[0-9a-f]{64}"},
         {"CHECKSUMTYPE", "MD5|SHA-1|SHA-256|SHA-384|SHA-512"}},
        ""}},
      {"FLocat", {"", {{"LOCTYPE", "ARK|URN|URL|PURL|HANDLE|DOI|OTHER", true}, {"xlink:href", "[^ ]+"}}, ""}},
      {"structMap", {"div ", {{"ID", "ID"}, {"TYPE", any_text}, {"LABEL", any_text}}, ""}},
      {"div",
       {"(mptr )*(fptr )*(div )*",
        {{"ID", "ID"},
         {"ORDER", integer},
         {"ORDERLABEL", any_text},
         {"LABEL", any_text},
         {"DMDID", "IDREFS"},
         {"TYPE", any_text}},
        ""}},
      {"fptr", {"(par |seq |area )?", {{"ID", "ID"}, {"FILEID", "IDREF"}}, ""}},
  };
  return rules;
}

}  // namespace pagesweep::test
