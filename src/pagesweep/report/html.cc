// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/report/html.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "pagesweep/io/atomic_file.h"
#include "pagesweep/io/image_file.h"

namespace pagesweep {
namespace {

constexpr std::string_view replacement_character = "\xEF\xBF\xBD";

/// Length of the valid UTF-8 sequence at the beginning of `text`; 0 if there is none.
std::size_t utf8_length(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char first = byte(0);
  if (first < 0x80) return 1;
  const std::size_t length = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
  if (first < 0xC2 || first > 0xF4 || text.size() < length) return 0;
  for (std::size_t i = 1; i < length; ++i)
    if ((byte(i) & 0xC0) != 0x80) return 0;
  // Overlong forms, surrogates, beyond U+10FFFF.
  if (first == 0xE0 && byte(1) < 0xA0) return 0;
  if (first == 0xED && byte(1) > 0x9F) return 0;
  if (first == 0xF0 && byte(1) < 0x90) return 0;
  if (first == 0xF4 && byte(1) > 0x8F) return 0;
  return length;
}

}  // namespace

std::string escape_html(std::string_view text) {
  std::string html;
  html.reserve(text.size());
  while (!text.empty()) {
    const std::size_t length = utf8_length(text);
    const char c = text[0];
    const bool is_control = length == 1 && static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t';
    if (length == 0 || is_control || c == 0x7F)
      html += replacement_character;
    else if (c == '&')
      html += "&amp;";
    else if (c == '<')
      html += "&lt;";
    else if (c == '>')
      html += "&gt;";
    else if (c == '"')
      html += "&quot;";
    else if (c == '\'')
      html += "&#39;";
    else
      html += text.substr(0, length);
    text.remove_prefix(std::max<std::size_t>(1, length));
  }
  return html;
}

std::string encode_base64(std::string_view bytes) {
  static constexpr char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t word = 0;
    for (std::size_t k = 0; k < 3; ++k) word = word << 8 | (k < count ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k) text += k <= count ? digits[word >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

std::string format_number(double value) {
  if (!std::isfinite(value)) return "–";
  if (std::abs(value) >= 1000 || value == std::round(value)) {
    std::string digits = fmt::format("{:.0f}", std::abs(value));
    if (digits.size() > 4)
      for (std::size_t i = digits.size(); i > 3; i -= 3) digits.insert(i - 3, "\u2009");
    return (value < 0 ? "−" : "") + digits;
  }
  const int decimals = std::clamp(2 - static_cast<int>(std::floor(std::log10(std::abs(value)))), 0, 6);
  std::string digits = fmt::format("{:.{}f}", std::abs(value), decimals);
  if (decimals > 0) digits.erase(std::max(digits.find_last_not_of('0') + 1, digits.find('.') + 2));
  return (value < 0 ? "−" : "") + digits;
}

std::string PictureEncoder::encode(const Picture& picture, const char* extension, int quality) const {
  const AtomicFile file(folder_ / (std::string(".report") + extension));  // never committed: nothing stays
  PictureFileOptions options;
  options.jpeg_quality = quality;
  write_picture(file.temporary(), picture, options);
  return read_bytes(file.temporary(), std::size_t{1} << 28);
}

std::string PictureEncoder::photo(Picture picture, std::size_t most_bytes) const {
  constexpr std::size_t longest_profile = 20'000;
  if (picture.icc_profile.size() > longest_profile) picture.icc_profile.clear();
  std::string bytes;
  for (int quality = 86;; quality = 70) {
    bytes = encode(picture, ".jpg", quality);
    if (bytes.size() <= most_bytes) break;
    if (quality > 70) continue;
    const int longest = std::max(picture.width(), picture.height());
    if (longest < 64) break;
    picture = shrink(picture, longest * 2 / 3);
  }
  return "data:image/jpeg;base64," + encode_base64(bytes);
}

std::string PictureEncoder::drawing(const Picture& picture) const {
  return "data:image/png;base64," + encode_base64(encode(picture, ".png", 90));
}

std::string format_colour_bar(Ramp ramp, Range range, std::string_view unit) {
  const double middle = 0.5 * (range.low + range.high);
  return fmt::format(
      R"(<div class="bar"><div style="background:{}"></div><span>{}</span><span>{}</span><span>{} {}</span></div>)",
      css_gradient(ramp), format_number(range.low), format_number(std::abs(middle) < 1e-12 ? 0 : middle),
      format_number(range.high), escape_html(unit));
}

std::string format_figure(const PictureFigure& figure) {
  const std::string title = escape_html(figure.title);
  std::string html = fmt::format(R"(<figure><img src="{}" width="{}" height="{}" alt="{}">)", figure.url, figure.width,
                                 figure.height, title);
  if (figure.has_bar) html += format_colour_bar(figure.ramp, figure.range, figure.unit);
  html += fmt::format("<figcaption><b>{}</b> {}</figcaption></figure>\n", title, escape_html(figure.caption));
  return html;
}

PictureFigure photo_figure(const Picture& picture, int longest_px, const PictureEncoder& encoder) {
  const Picture small = shrink(picture, longest_px);
  PictureFigure figure;
  figure.url = encoder.photo(small);
  figure.width = small.width();
  figure.height = small.height();
  return figure;
}

PictureFigure map_figure(const Image<float>& values, Ramp ramp, Range range, std::string_view unit,
                         const PictureEncoder& encoder) {
  PictureFigure figure =
      photo_figure(draw_map(values, ramp, range), std::max(values.width(), values.height()), encoder);
  figure.has_bar = true;
  figure.ramp = ramp;
  figure.range = range;
  figure.unit = unit;
  return figure;
}

std::string format_page_head(std::string_view kicker, std::string_view title) {
  return fmt::format(
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{0} – {1}</title>\n"
      "<style>{2}</style></head>\n<body>\n<header><p class=\"kicker\">{1}</p><h1>{0}</h1></header>\n",
      escape_html(title), escape_html(kicker), report_style());
}

std::string format_section(std::string_view title, std::string_view lead, const std::string& body) {
  if (body.empty()) return "";
  return fmt::format("<section><h2>{}</h2>\n<p class=\"lead\">{}</p>\n{}</section>\n", escape_html(title),
                     escape_html(lead), body);
}

std::string format_row(std::string_view columns, const std::string& figures) {
  return figures.empty() ? "" : fmt::format("<div class=\"row {}\">\n{}</div>\n", columns, figures);
}

std::string format_tile(const std::string& value, std::string_view unit, std::string_view what) {
  return fmt::format("<div><b>{} <small>{}</small></b><span>{}</span></div>", escape_html(value), escape_html(unit),
                     escape_html(what));
}

std::string format_figures(std::span<const Figure> figures) {
  std::string html, group;
  for (const Figure& figure : figures) {
    if (figure.group != group || html.empty()) {
      group = figure.group;
      std::string name = group;
      std::replace(name.begin(), name.end(), '_', ' ');
      html += html.empty() ? "" : "</table>\n";
      html += fmt::format("<table class=\"figures\"><tr><th colspan=\"2\">{}</th></tr>\n", escape_html(name));
    }
    const std::string why =
        figure.reason.empty() ? "" : fmt::format(" <span class=\"why\">{}</span>", escape_html(figure.reason));
    html += fmt::format("<tr><td>{}{}</td><td class=\"n\">{} <span class=\"u\">{}</span></td></tr>\n",
                        escape_html(figure.what), why, format_number(figure.value), escape_html(figure.unit));
  }
  return html.empty() ? "" : "<div class=\"figures-columns\">" + html + "</table>\n</div>\n";
}

std::string format_profile(std::span<const ProfileSample> profile) {
  if (profile.size() < 2) return "";
  const double width = 360, height = 200, left = 10, right = 10, top = 8, base = 176;
  const double begin = profile.front().time_frames, end = profile.back().time_frames;
  if (!(end > begin)) return "";
  const auto x_of = [&](double time) { return left + (time - begin) / (end - begin) * (width - left - right); };
  const auto y_of = [&](double light) { return base - std::clamp(light, -0.1, 1.2) * (base - top - 12); };
  std::string line;
  for (const ProfileSample& sample : profile)
    line += fmt::format("{}{:.1f} {:.1f}", line.empty() ? "M" : "L", x_of(sample.time_frames), y_of(sample.light));
  const double range = end - begin;
  const double step = range > 40 ? 10 : range > 16 ? 4 : range > 8 ? 2 : 1;
  std::string ticks;
  for (double t = std::ceil(begin / step) * step; t <= end; t += step)
    ticks += fmt::format(R"(<path class="grid" d="M{0:.1f} {1}V{2}"/><text x="{0:.1f}" y="192">{3:.0f}</text>)",
                         x_of(t), top, base, t);
  return fmt::format(
      R"(<svg class="plot" viewBox="0 0 {} {}" role="img" aria-label="stripe profile">{}<path class="grid" d="M{} {}H{}"/>)"
      R"(<path class="area" d="{}L{:.1f} {}L{:.1f} {}Z"/><path class="curve" d="{}"/></svg>)",
      width, height, ticks, left, base, width - right, line, x_of(end), base, x_of(begin), base, line);
}

}  // namespace pagesweep
