// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/delivery/xml_structure_testing.h"

#include "pagesweep/delivery/alto.h"
#include "pagesweep/delivery/deliver.h"
#include "pagesweep/delivery/mets.h"
#include "pagesweep/io/files_testing.h"

namespace pagesweep {
namespace {

using test::StructureCheck;
using testing::HasSubstr;

pugi::xml_document parsed(const std::string& text) {
  pugi::xml_document document;
  EXPECT_TRUE(document.load_string(text.c_str()));
  return document;
}

std::string alto_errors(const TextPage& page) {
  return StructureCheck(test::alto_rules())
      .errors_of(parsed(format_alto(page, {"p.tif", "pagesweep 1.0", "tesseract 5.3.0", "2026-11-22T18:00:00Z"})));
}

const std::vector<DeliveredPage> pages{
    {"p 1",
     "i",
     {{"tiff", "tiff/p 1.tif", 10, std::string(64, 'a')}, {"alto", "alto/p1.xml", 9, std::string(64, 'b')}}},
    {"p2", "2", {{"tiff", "tiff/p2.tif", 12, std::string(64, 'c')}, {"alto", "alto/p2.xml", 8, std::string(64, 'd')}}}};

std::string mets_of(const std::string& language) {
  return format_mets({"urn:x", "a & b \x02", "pagesweep 1.0", "2026-11-22T18:00:00Z", language}, pages,
                     {{"pdf", "job.pdf", 99, std::string(64, 'e')}});
}

TEST(XmlStructure, AltoOfTextIsAsItsSchemaPrescribes) {
  const TextBox box{10, 20, 90, 40};
  const TextLine line{box, 0.01, -5, 22, {{"a", {10, 20, 30, 40}, 0.5}, {"<b>", {50, 20, 90, 40}, 1}}};
  TextPage page{.width_px = 500, .height_px = 300, .pixels_per_mm = 10, .blocks = {}};
  EXPECT_EQ(alto_errors(page), "");  // a blank page
  page.blocks = {{box, {{box, "eng", {line, line}}, {box, "chi_sim", {line}}, {box, "script/Latin", {line}}}}};
  EXPECT_EQ(alto_errors(page), "");
}

TEST(XmlStructure, AltoOfAPoorReadingIsAsItsSchemaPrescribes) {
  const TextBox box{10, 20, 90, 40};
  const TextLine no_words{box, 0, 0, 22, {}};
  const TextLine odd{box, 0, 0, 22, {{"", {10, 20, 30, 40}, 0}, {"\x01\x0c", {25, 20, 20, 40}, 0.3}}};
  TextPage page{.width_px = 500, .height_px = 300, .pixels_per_mm = 10, .blocks = {}};
  page.blocks = {{box, {{box, "", {no_words}}, {box, "deu", {no_words, odd}}}}};
  EXPECT_EQ(alto_errors(page), "");
  const std::string text = format_alto(page, {"p.tif", "pagesweep", "", "2026-11-22T18:00:00Z"});
  for (const char c : text) EXPECT_TRUE(static_cast<unsigned char>(c) >= 0x20 || c == '\n') << int(c);
  EXPECT_EQ(text.find("&#"), std::string::npos);  // no place in XML 1.0 for control characters, not even as numbers
}

TEST(XmlStructure, MetsOfAJobIsAsItsSchemaPrescribes) {
  for (const char* language : {"", "deu", "deu+lat"})
    EXPECT_EQ(StructureCheck(test::mets_rules()).errors_of(parsed(mets_of(language))), "") << language;
}

TEST(XmlStructure, WhatIsWrongIsFound) {
  const auto errors_after = [](const auto& spoil) {
    pugi::xml_document document = parsed(mets_of("deu"));
    spoil(document.child("mets"));
    return StructureCheck(test::mets_rules()).errors_of(document);
  };
  EXPECT_THAT(errors_after([](pugi::xml_node mets) { mets.remove_child("structMap"); }), HasSubstr("children are"));
  EXPECT_THAT(errors_after([](pugi::xml_node mets) { mets.append_move(mets.child("fileSec")); }),
              HasSubstr("children are"));
  EXPECT_THAT(errors_after([](pugi::xml_node mets) { mets.child("dmdSec").remove_attribute("ID"); }),
              HasSubstr("lacks ID"));
  EXPECT_THAT(errors_after([](pugi::xml_node mets) { mets.child("fileSec").remove_child("fileGrp"); }),
              HasSubstr("which is not there"));
  EXPECT_THAT(errors_after([](pugi::xml_node mets) { mets.append_attribute("Label") = "x"; }),
              HasSubstr("has no attribute Label"));
  EXPECT_THAT(errors_after([](pugi::xml_node mets) { mets.child("metsHdr").attribute("CREATEDATE") = "today"; }),
              HasSubstr("is today"));
}

}  // namespace
}  // namespace pagesweep
