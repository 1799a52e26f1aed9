// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/ocr/recognise_text.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <sstream>
#include <vector>

#include "pagesweep/base/error.h"
#include "pagesweep/data/gray_picture.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/ocr/hocr.h"
#include "pagesweep/ocr/run_program_internal.h"

namespace pagesweep {
namespace {

constexpr const char* program = "tesseract";
constexpr double mm_per_inch = 25.4;
constexpr double usual_dpi = 300;

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, separator);) parts.push_back(part);
  return parts;
}

/// What is left of messages that may be many: the last line that says something.
std::string last_line(const std::string& messages) {
  std::string last = "it does not say why";
  for (const std::string& line : split(messages, '\n'))
    if (!line.empty()) last = line;
  return last;
}

/// The first line after the heading is the first language.
std::vector<std::string> installed_languages(const std::string& list) {
  std::vector<std::string> lines = split(list, '\n');
  if (!lines.empty()) lines.erase(lines.begin());
  return lines;
}

/// 8 bit of gray: more tells Tesseract nothing.
Image<std::uint8_t> to_gray(const Picture& page) {
  const Image<float> exact = gray_picture(page);
  Image<std::uint8_t> gray(exact.width(), exact.height());
  std::ranges::transform(exact.pixels(), gray.data(), [](float g) { return static_cast<std::uint8_t>(g + 0.5F); });
  return gray;
}

}  // namespace

bool TextRecogniser::is_installed() { return run_program({program, "--version"}).has_value(); }

TextRecogniser::TextRecogniser(std::string language) : language_(std::move(language)) {
  const auto version = run_program({program, "--version"});
  const auto languages = run_program({program, "--list-langs"});
  if (!version || !languages)
    throw Error(ErrorKind::cannot_read,
                "text cannot be recognised: there is no program 'tesseract'; install the package tesseract-ocr");
  version_ = (version->output + version->messages).substr(0, (version->output + version->messages).find('\n'));
  const std::vector<std::string> known = installed_languages(languages->output);
  for (const std::string& wanted : split(language_, '+'))
    if (std::ranges::find(known, wanted) == known.end())
      throw Error(ErrorKind::bad_input,
                  fmt::format("Tesseract has no data for the language '{0}', only for {1}: install tesseract-ocr-{0}",
                              wanted, fmt::join(known, ", ")));
}

TextPage TextRecogniser::operator()(const Picture& page) const {
  const TemporaryFolder folder;
  const auto image = folder / "page.png";
  write_gray_png(image, to_gray(page).view());
  const double dpi = page.pixels_per_mm > 0 ? page.pixels_per_mm * mm_per_inch : usual_dpi;
  const auto answer =
      run_program({program, image.string(), "stdout", "-l", language_, "--dpi",
                   fmt::format("{:.0f}", std::clamp(dpi, 70.0, 2400.0)), "-c", "tessedit_create_hocr=1"});
  if (!answer || answer->exit_code != 0)
    throw Error(ErrorKind::no_result, "Tesseract could not read a page: " + last_line(answer ? answer->messages : ""));
  TextPage text = parse_hocr(answer->output, "Tesseract's answer");
  text.pixels_per_mm = page.pixels_per_mm;
  return text;
}

}  // namespace pagesweep
