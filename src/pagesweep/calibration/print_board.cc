// SPDX-License-Identifier: Apache-2.0
#include <cairo-pdf.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <vector>

#include "pagesweep/calibration/draw_board.h"

namespace pagesweep {
namespace {

constexpr double margin_mm = 8;       ///< that printers leave white
constexpr double ruler_room_mm = 12;  ///< beside the pattern, for a ruler and its numbers
constexpr double points_per_mm = 72 / 25.4;
constexpr double font_mm = 2.8;

/// What is on the sheet: millimetres from its top left corner, y down.
struct Sheet {
  Paper paper;
  std::vector<BoardDrawing::Rectangle> rectangles;
  std::vector<BoardDrawing::Disc> discs;
  struct Text {
    double x_mm, y_mm;
    bool upwards;
    std::string text;
  };
  std::vector<Text> texts;
};

double ruler_length(double pattern_mm) { return std::max(10.0, 10 * std::floor(pattern_mm / 10)); }

/// How far circles reach beyond their middles.
double overhang(const Board& board) { return board.type == BoardType::circles ? 0.5 * board.marker_mm : 0; }

Paper paper_needed(const BoardDrawing& drawing, double beyond) {
  return {drawing.width_mm + 2 * beyond + ruler_room_mm + 2 * margin_mm,
          drawing.height_mm + 2 * beyond + ruler_room_mm + 2 * margin_mm};
}

Paper choose_paper(const Paper& needed, const std::optional<Paper>& paper) {
  if (!paper) return {std::ceil(needed.width_mm), std::ceil(needed.height_mm)};
  for (const Paper& turned : {*paper, Paper{paper->height_mm, paper->width_mm}})
    if (needed.width_mm <= turned.width_mm && needed.height_mm <= turned.height_mm) return turned;
  throw std::invalid_argument(fmt::format(
      "the board with its rulers and margins needs {:.0f} mm x {:.0f} mm and does not fit paper of {:.0f} mm x "
      "{:.0f} mm: take fewer or smaller squares, or larger paper",
      needed.width_mm, needed.height_mm, paper->width_mm, paper->height_mm));
}

/// Ticks every millimetre, longer ones every five and ten.
void add_rulers(const BoardPrint& print, double left, double bottom, Sheet& sheet) {
  const auto tick_length = [](int mm) { return mm % 10 == 0 ? 4.0 : mm % 5 == 0 ? 2.8 : 1.8; };
  constexpr double thin = 0.12;
  const double base_y = bottom + 2, base_x = left - 2;
  for (int mm = 0; mm <= std::lround(print.ruler_x_mm); ++mm) {
    sheet.rectangles.push_back({left + mm - 0.5 * thin, base_y, thin, tick_length(mm)});
    if (mm % 50 == 0) sheet.texts.push_back({left + mm - 1, base_y + 7.2, false, fmt::format("{}", mm)});
  }
  for (int mm = 0; mm <= std::lround(print.ruler_y_mm); ++mm) {
    sheet.rectangles.push_back({base_x - tick_length(mm), bottom - mm - 0.5 * thin, tick_length(mm), thin});
    if (mm % 50 == 0) sheet.texts.push_back({base_x - 4.6, bottom - mm + 1, true, fmt::format("{}", mm)});
  }
}

std::string label_of(const Board& board, const BoardPrint& print) {
  const std::string kind =
      board.type == BoardType::charuco ? fmt::format("ChArUco {}", board.dictionary) : std::string(name_of(board.type));
  return fmt::format("pagesweep board: {} {}x{}, {} mm. Print at 100 %. Rulers: {:.0f} mm across, {:.0f} mm up.", kind,
                     board.columns, board.rows, board.square_mm, print.ruler_x_mm, print.ruler_y_mm);
}

Sheet lay_out(const Board& board, const BoardDrawing& drawing, const BoardPrint& print) {
  Sheet sheet{print.paper, {}, {}, {}};
  const double beyond = overhang(board);
  const Paper needed = paper_needed(drawing, beyond);
  const double left = 0.5 * (print.paper.width_mm - needed.width_mm) + margin_mm + ruler_room_mm + beyond;
  const double bottom = 0.5 * (print.paper.height_mm + needed.height_mm) - margin_mm - ruler_room_mm - beyond;
  for (const auto& r : drawing.rectangles)
    sheet.rectangles.push_back({left + r.x_mm, bottom - r.y_mm - r.height_mm, r.width_mm, r.height_mm});
  for (const auto& d : drawing.discs) sheet.discs.push_back({left + d.x_mm, bottom - d.y_mm, d.radius_mm});
  add_rulers(print, left - beyond, bottom + beyond, sheet);
  sheet.texts.push_back({left - beyond, bottom + beyond + 12.2, false, label_of(board, print)});
  return sheet;
}

// Each kind of black is one path: neighbours in one path leave no seam between them.

std::string draw_svg(const Sheet& sheet) {
  std::string path, discs, texts;
  for (const auto& r : sheet.rectangles)
    path += fmt::format("M{:.5g} {:.5g}h{:.5g}v{:.5g}h{:.5g}z", r.x_mm, r.y_mm, r.width_mm, r.height_mm, -r.width_mm);
  for (const auto& d : sheet.discs)
    discs += fmt::format("<circle cx=\"{:.6g}\" cy=\"{:.6g}\" r=\"{:.6g}\"/>\n", d.x_mm, d.y_mm, d.radius_mm);
  for (const auto& t : sheet.texts)
    texts += fmt::format("<text transform=\"translate({:.6g} {:.6g}){}\">{}</text>\n", t.x_mm, t.y_mm,
                         t.upwards ? " rotate(-90)" : "", t.text);
  return fmt::format(
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.6g}mm\" "
      "height=\"{1:.6g}mm\" viewBox=\"0 0 {0:.6g} {1:.6g}\">\n<path d=\"{2}\"/>\n{3}<g font-family=\"sans-serif\" "
      "font-size=\"{4}\">\n{5}</g>\n</svg>\n",
      sheet.paper.width_mm, sheet.paper.height_mm, path, discs, font_mm, texts);
}

struct Release {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
  void operator()(cairo_t* context) const { cairo_destroy(context); }
};

cairo_status_t append(void* text, const unsigned char* data, unsigned length) {
  static_cast<std::string*>(text)->append(reinterpret_cast<const char*>(data), length);
  return CAIRO_STATUS_SUCCESS;
}

std::string draw_pdf(const Sheet& sheet) {
  std::string pdf;
  {
    const std::unique_ptr<cairo_surface_t, Release> surface(cairo_pdf_surface_create_for_stream(
        append, &pdf, sheet.paper.width_mm * points_per_mm, sheet.paper.height_mm * points_per_mm));
    const std::unique_ptr<cairo_t, Release> context(cairo_create(surface.get()));
    cairo_t* c = context.get();
    cairo_scale(c, points_per_mm, points_per_mm);
    for (const auto& r : sheet.rectangles) cairo_rectangle(c, r.x_mm, r.y_mm, r.width_mm, r.height_mm);
    cairo_fill(c);
    for (const auto& d : sheet.discs) {
      cairo_new_sub_path(c);
      cairo_arc(c, d.x_mm, d.y_mm, d.radius_mm, 0, 2 * std::numbers::pi);
    }
    cairo_fill(c);
    cairo_select_font_face(c, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(c, font_mm);
    for (const auto& t : sheet.texts) {
      cairo_save(c);
      cairo_translate(c, t.x_mm, t.y_mm);
      if (t.upwards) cairo_rotate(c, -0.5 * std::numbers::pi);
      cairo_move_to(c, 0, 0);
      cairo_show_text(c, t.text.c_str());
      cairo_restore(c);
    }
    cairo_surface_finish(surface.get());
    if (cairo_surface_status(surface.get()) != CAIRO_STATUS_SUCCESS || cairo_status(c) != CAIRO_STATUS_SUCCESS)
      throw std::invalid_argument("the board cannot be drawn");
  }
  return pdf;
}

}  // namespace

std::optional<Paper> paper_named(std::string_view name) {
  static constexpr auto papers = std::to_array<std::pair<std::string_view, Paper>>({{"A0", {841, 1189}},
                                                                                    {"A1", {594, 841}},
                                                                                    {"A2", {420, 594}},
                                                                                    {"A3", {297, 420}},
                                                                                    {"A4", {210, 297}},
                                                                                    {"A5", {148, 210}},
                                                                                    {"A6", {105, 148}},
                                                                                    {"letter", {215.9, 279.4}},
                                                                                    {"legal", {215.9, 355.6}},
                                                                                    {"tabloid", {279.4, 431.8}}});
  for (const auto& [known, paper] : papers)
    if (name == known) return paper;
  Paper paper;
  int used = 0;
  const std::string text(name);
  if (std::sscanf(text.c_str(), "%lfx%lf%n", &paper.width_mm, &paper.height_mm, &used) != 2 ||
      static_cast<std::size_t>(used) != text.size())
    return std::nullopt;
  const auto is_sensible = [](double mm) { return mm >= 20 && mm <= 5000; };
  return is_sensible(paper.width_mm) && is_sensible(paper.height_mm) ? std::optional(paper) : std::nullopt;
}

BoardPrint print_board(const Board& board, const std::optional<Paper>& paper) {
  const BoardDrawing drawing = draw_board(board);
  BoardPrint print;
  print.paper = choose_paper(paper_needed(drawing, overhang(board)), paper);
  print.ruler_x_mm = ruler_length(drawing.width_mm);
  print.ruler_y_mm = ruler_length(drawing.height_mm);
  const Sheet sheet = lay_out(board, drawing, print);
  print.svg = draw_svg(sheet);
  print.pdf = draw_pdf(sheet);
  return print;
}

}  // namespace pagesweep
