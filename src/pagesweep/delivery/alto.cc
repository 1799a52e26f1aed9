// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/delivery/alto.h"

#include <fmt/format.h>

#include <cmath>

#include "pagesweep/delivery/xml_document_internal.h"

namespace pagesweep {
namespace {

std::string number(double value) { return fmt::format("{}", std::round(value * 100) / 100); }

pugi::xml_node add_box(pugi::xml_node parent, const char* name, const std::string& id, const TextBox& box) {
  return add_element(parent, name,
                     {{"ID", id},
                      {"HPOS", number(box.left)},
                      {"VPOS", number(box.top)},
                      {"WIDTH", number(box.width())},
                      {"HEIGHT", number(box.height())}});
}

/// The languages that Tesseract names by other letters than ISO 639, in which xsd:language allows them.
std::string iso_language(const std::string& language) {
  const std::string letters = language.substr(0, language.find('_'));  // chi_sim, aze_cyrl
  return letters.size() == 3 ? letters : "";
}

/// Writes elements whose ids count within their kind.
class AltoWriter {
 public:
  void add(pugi::xml_node space, const TextBlock& block) {
    for (const TextParagraph& paragraph : block.paragraphs) {
      pugi::xml_node element = add_box(space, "TextBlock", fmt::format("block_{}", ++blocks_), paragraph.box);
      if (const std::string language = iso_language(paragraph.language); !language.empty())
        element.append_attribute("LANG") = language.c_str();
      for (const TextLine& line : paragraph.lines)
        if (!line.words.empty()) add(element, line);  // the schema knows no line without a string
    }
  }

 private:
  void add(pugi::xml_node block, const TextLine& line) {
    pugi::xml_node element = add_box(block, "TextLine", fmt::format("line_{}", ++lines_), line.box);
    element.append_attribute("BASELINE") =
        fmt::format("{},{} {},{}", number(line.box.left), number(line.baseline_at(line.box.left)),
                    number(line.box.right), number(line.baseline_at(line.box.right)))
            .c_str();
    const TextWord* before = nullptr;
    for (const TextWord& word : line.words) {
      if (before)
        add_element(element, "SP",
                    {{"HPOS", number(before->box.right)},
                     {"VPOS", number(line.box.top)},
                     {"WIDTH", number(std::max(0.0, word.box.left - before->box.right))}});
      before = &word;
      pugi::xml_node string = add_box(element, "String", fmt::format("word_{}", ++words_), word.box);
      string.append_attribute("CONTENT") = xml_text(word.text).c_str();
      string.append_attribute("WC") = fmt::format("{:.2f}", word.confidence).c_str();
    }
  }

  int blocks_ = 0, lines_ = 0, words_ = 0;
};

void describe_processing(pugi::xml_node alto, const AltoHeader& header) {
  const pugi::xml_node description = add_element(alto, "Description");
  add_text(description, "MeasurementUnit", "pixel");
  add_text(add_element(description, "sourceImageInformation"), "fileName", header.image);
  const auto add_processing = [&](const char* id, const char* category, const std::string& program) {
    if (program.empty()) return;
    const pugi::xml_node processing = add_element(description, "Processing", {{"ID", id}});
    add_text(processing, "processingCategory", category);
    add_text(processing, "processingDateTime", header.date);
    const pugi::xml_node software = add_element(processing, "processingSoftware");
    add_text(software, "softwareName", program.substr(0, program.find(' ')));
    if (program.find(' ') != std::string::npos)
      add_text(software, "softwareVersion", program.substr(program.find(' ') + 1));
  };
  add_processing("flattening", "preOperation", header.program);
  add_processing("recognition", "contentGeneration", header.ocr);
}

}  // namespace

std::string format_alto(const TextPage& page, const AltoHeader& header) {
  pugi::xml_document document = new_document();
  const pugi::xml_node alto =
      add_element(document, "alto",
                  {{"xmlns", "http://www.loc.gov/standards/alto/ns-v4#"},
                   {"xmlns:xsi", "http://www.w3.org/2001/XMLSchema-instance"},
                   {"xsi:schemaLocation",
                    "http://www.loc.gov/standards/alto/ns-v4# http://www.loc.gov/standards/alto/v4/alto-4-2.xsd"},
                   {"SCHEMAVERSION", "4.2"}});
  describe_processing(alto, header);
  const std::string width = std::to_string(page.width_px), height = std::to_string(page.height_px);
  const pugi::xml_node element =
      add_element(add_element(alto, "Layout"), "Page",
                  {{"ID", "page_1"}, {"PHYSICAL_IMG_NR", "1"}, {"WIDTH", width}, {"HEIGHT", height}});
  const pugi::xml_node space = add_box(element, "PrintSpace", "space_1",
                                       {0, 0, static_cast<double>(page.width_px), static_cast<double>(page.height_px)});
  AltoWriter writer;
  for (const TextBlock& block : page.blocks) writer.add(space, block);
  return to_text(document);
}

}  // namespace pagesweep
