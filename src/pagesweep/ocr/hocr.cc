// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/ocr/hocr.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <map>
#include <optional>
#include <pugixml.hpp>
#include <sstream>

#include "pagesweep/base/error.h"

namespace pagesweep {
namespace {

constexpr double mm_per_inch = 25.4;
constexpr double most_px = 1e6;

/// The properties in an element's title: "bbox 0 0 20 10; baseline 0.01 -3; x_wconf 96".
class Properties {
 public:
  Properties(pugi::xml_node element, const std::filesystem::path& file)
      : title_(element.attribute("title").value()), id_(element.attribute("id").value()), file_(file) {}

  /// The numbers after a name, if there are as many as asked for.
  std::optional<std::vector<double>> numbers(std::string_view name, std::size_t count) const {
    std::istringstream properties(title_);
    for (std::string property; std::getline(properties, property, ';');) {
      std::istringstream words(property);
      std::string word;
      if (!(words >> word) || word != name) continue;
      std::vector<double> values;
      for (double value = 0; words >> value;) values.push_back(checked(value));
      if (values.size() >= count) return values;
    }
    return std::nullopt;
  }

  TextBox box() const {
    const auto edges = numbers("bbox", 4);
    if (!edges) throw error("expected a \"bbox\" of four numbers");
    const TextBox box{(*edges)[0], (*edges)[1], (*edges)[2], (*edges)[3]};
    if (!(box.left <= box.right && box.top <= box.bottom)) throw error("the box ends before it begins");
    return box;
  }
  Error error(const std::string& problem) const { return bad_input(file_, id_, problem); }

 private:
  double checked(double value) const {
    if (!(std::abs(value) <= most_px)) throw error(fmt::format("{} is no place on a page", value));
    return value;
  }

  std::string title_, id_;
  const std::filesystem::path& file_;
};

bool is_of_class(pugi::xml_node element, std::initializer_list<std::string_view> names) {
  const std::string_view name = element.attribute("class").value();
  return std::ranges::find(names, name) != names.end();
}

bool is_line(pugi::xml_node element) {
  return is_of_class(element, {"ocr_line", "ocr_header", "ocr_caption", "ocr_textfloat"});
}

/// All text in an element, without blanks around it.
std::string text_of(pugi::xml_node element) {
  std::string text;
  for (const pugi::xml_node child : element.children()) text += text_of(child);
  text += element.value();
  std::erase_if(text, [](char c) { return static_cast<unsigned char>(c) < ' ' && c != '\n' && c != '\t'; });
  const auto begin = text.find_first_not_of(" \t\r\n");
  return begin == std::string::npos ? "" : text.substr(begin, text.find_last_not_of(" \t\r\n") + 1 - begin);
}

TextLine read_line(pugi::xml_node element, const std::filesystem::path& file) {
  const Properties properties(element, file);
  TextLine line;
  line.box = properties.box();
  if (const auto baseline = properties.numbers("baseline", 2)) {
    line.baseline_slope = (*baseline)[0];
    line.baseline_offset_px = (*baseline)[1];
  }
  if (const auto size = properties.numbers("x_size", 1)) line.size_px = size->front();
  for (const pugi::xml_node child : element.children()) {
    if (!is_of_class(child, {"ocrx_word"})) continue;
    const Properties of_word(child, file);
    TextWord word{text_of(child), of_word.box(), 0};
    if (const auto confidence = of_word.numbers("x_wconf", 1)) word.confidence = confidence->front() / 100;
    if (!word.text.empty()) line.words.push_back(std::move(word));
  }
  return line;
}

TextParagraph read_paragraph(pugi::xml_node element, const std::filesystem::path& file) {
  TextParagraph paragraph{Properties(element, file).box(), element.attribute("lang").value(), {}};
  for (const pugi::xml_node child : element.children()) {
    if (!is_line(child)) continue;
    TextLine line = read_line(child, file);
    if (!line.words.empty()) paragraph.lines.push_back(std::move(line));
  }
  return paragraph;
}

TextBlock read_block(pugi::xml_node element, const std::filesystem::path& file) {
  TextBlock block{Properties(element, file).box(), {}};
  for (const pugi::xml_node child : element.children()) {
    if (!is_of_class(child, {"ocr_par"})) continue;
    TextParagraph paragraph = read_paragraph(child, file);
    if (!paragraph.lines.empty()) block.paragraphs.push_back(std::move(paragraph));
  }
  return block;
}

std::string bbox(const TextBox& box) {
  return fmt::format("bbox {:.0f} {:.0f} {:.0f} {:.0f}", std::floor(box.left), std::floor(box.top),
                     std::ceil(box.right), std::ceil(box.bottom));
}

/// Adds elements whose ids count within their kind.
class HocrWriter {
 public:
  pugi::xml_node add(pugi::xml_node parent, const char* tag, const char* kind, const std::string& title) {
    pugi::xml_node element = parent.append_child(tag);
    element.append_attribute("class") = kind;
    element.append_attribute("id") = fmt::format("{}_{}", kind, ++count_[kind]).c_str();
    element.append_attribute("title") = title.c_str();
    return element;
  }
  void add(pugi::xml_node parent, const TextLine& line) {
    std::string title = bbox(line.box) + fmt::format("; baseline {} {}", line.baseline_slope, line.baseline_offset_px);
    if (line.size_px > 0) title += fmt::format("; x_size {}", line.size_px);
    const pugi::xml_node element = add(parent, "span", "ocr_line", title);
    for (const TextWord& word : line.words)
      add(element, "span", "ocrx_word", bbox(word.box) + fmt::format("; x_wconf {:.0f}", 100 * word.confidence))
          .text() = word.text.c_str();
  }

 private:
  std::map<std::string, int> count_;
};

pugi::xml_node add_head(pugi::xml_document& document, const HocrHeader& header) {
  auto declaration = document.append_child(pugi::node_declaration);
  declaration.append_attribute("version") = "1.0";
  declaration.append_attribute("encoding") = "UTF-8";
  document.append_child(pugi::node_doctype)
      .set_value(
          "html PUBLIC \"-//W3C//DTD XHTML 1.0 Transitional//EN\" "
          "\"http://www.w3.org/TR/xhtml1/DTD/xhtml1-transitional.dtd\"");
  pugi::xml_node html = document.append_child("html");
  html.append_attribute("xmlns") = "http://www.w3.org/1999/xhtml";
  pugi::xml_node head = html.append_child("head");
  head.append_child("title").text() = header.title.c_str();
  const auto meta = [&](const char* name, const std::string& content) {
    pugi::xml_node element = head.append_child("meta");
    element.append_attribute("name") = name;
    element.append_attribute("content") = content.c_str();
  };
  meta("ocr-system", header.system);
  meta("ocr-capabilities", "ocr_page ocr_carea ocr_par ocr_line ocrx_word ocrp_wconf");
  return html.append_child("body");
}

}  // namespace

std::string format_hocr(const TextPage& page, const HocrHeader& header) {
  pugi::xml_document document;
  HocrWriter writer;
  std::string title =
      fmt::format("image \"{}\"; bbox 0 0 {} {}; ppageno 0", header.image, page.width_px, page.height_px);
  if (page.pixels_per_mm > 0) {
    const double dpi = std::round(page.pixels_per_mm * mm_per_inch * 1000) / 1000;
    title += fmt::format("; scan_res {} {}", dpi, dpi);
  }
  const pugi::xml_node body = writer.add(add_head(document, header), "div", "ocr_page", title);
  for (const TextBlock& block : page.blocks) {
    const pugi::xml_node area = writer.add(body, "div", "ocr_carea", bbox(block.box));
    for (const TextParagraph& paragraph : block.paragraphs) {
      pugi::xml_node element = writer.add(area, "p", "ocr_par", bbox(paragraph.box));
      if (!paragraph.language.empty()) element.append_attribute("lang") = paragraph.language.c_str();
      for (const TextLine& line : paragraph.lines) writer.add(element, line);
    }
  }
  std::ostringstream text;
  document.save(text, " ", pugi::format_indent, pugi::encoding_utf8);
  return text.str();
}

TextPage parse_hocr(std::string_view text, const std::filesystem::path& file) {
  pugi::xml_document document;
  const auto result =
      document.load_buffer(text.data(), text.size(), pugi::parse_default | pugi::parse_doctype, pugi::encoding_utf8);
  if (!result) throw bad_input(file, fmt::format("byte {}", result.offset), result.description());
  const pugi::xml_node element = document.find_node([](pugi::xml_node n) { return is_of_class(n, {"ocr_page"}); });
  if (!element) throw bad_input(file, "", "expected hOCR, found no \"ocr_page\"");
  const Properties properties(element, file);
  TextPage page;
  page.width_px = static_cast<int>(properties.box().right);
  page.height_px = static_cast<int>(properties.box().bottom);
  if (page.width_px < 1 || page.height_px < 1) throw properties.error("the page is empty");
  if (const auto resolution = properties.numbers("scan_res", 2)) page.pixels_per_mm = resolution->front() / mm_per_inch;
  for (const pugi::xml_node child : element.children()) {
    if (!is_of_class(child, {"ocr_carea"})) continue;
    TextBlock block = read_block(child, file);
    if (!block.paragraphs.empty()) page.blocks.push_back(std::move(block));
  }
  return page;
}

}  // namespace pagesweep
