// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/print.h"

#include <pango/pangocairo.h>

#include <cmath>
#include <memory>
#include <numbers>

namespace pagesweep::sim {
namespace {

constexpr double mm_per_point = 25.4 / 72;

struct Release {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
  void operator()(cairo_t* context) const { cairo_destroy(context); }
  void operator()(cairo_font_options_t* options) const { cairo_font_options_destroy(options); }
  void operator()(PangoFontDescription* font) const { pango_font_description_free(font); }
  void operator()(PangoLayout* layout) const { g_object_unref(layout); }
  void operator()(PangoLayoutIter* lines) const { pango_layout_iter_free(lines); }
};
template <class T>
using Owned = std::unique_ptr<T, Release>;

/// A sheet of coverage: 0 paper, 1 full ink. Lengths in millimetres from the sheet's top left corner.
class Press {
 public:
  Press(const PrintDesign& design, double pixels_per_mm)
      : design_(design),
        surface_(cairo_image_surface_create(CAIRO_FORMAT_A8,
                                            static_cast<int>(std::lround(design.width_mm * pixels_per_mm)),
                                            static_cast<int>(std::lround(design.height_mm * pixels_per_mm)))),
        cairo_(cairo_create(surface_.get())) {
    cairo_scale(cairo_.get(), pixels_per_mm, pixels_per_mm);
  }

  void print_texts() {
    for (const std::string& text : design_.texts)
      for (std::size_t begin = 0; begin < text.size();) {
        std::size_t end = text.find("\n\n", begin);
        if (end == std::string::npos) end = text.size();
        print_paragraph(trimmed(text.substr(begin, end - begin)));
        begin = end + 2;
      }
  }

  void print_footer() {
    if (design_.footer.empty()) return;
    const auto layout = make_layout(design_.footer, design_.font_size_pt, false);
    PangoLayoutLine* line = pango_layout_get_line_readonly(layout.get(), 0);
    PangoRectangle extents;
    pango_layout_line_get_extents(line, nullptr, &extents);
    const double middle = 0.5 * (design_.margin_left_mm + design_.width_mm - design_.margin_right_mm);
    show_line(line, middle - 0.5 * extents.width / PANGO_SCALE, design_.height_mm - 0.55 * design_.margin_bottom_mm);
    append(design_.footer);
  }

  void print_ruled(const Figure& figure) {
    cairo_t* c = cairo_.get();
    const double w = figure.width_mm, h = figure.height_mm;
    cairo_save(c);
    cairo_translate(c, figure.x_mm, figure.y_mm);
    for (int i = 0; i <= 20; ++i) {
      cairo_set_line_width(c, i % 20 == 0 ? 0.5 : i % 5 == 0 ? 0.25 : 0.12);
      cairo_move_to(c, w * i / 20, 0), cairo_line_to(c, w * i / 20, h);
      if (i <= 10) cairo_move_to(c, 0, h * i / 10), cairo_line_to(c, w, h * i / 10);
      cairo_stroke(c);
    }
    cairo_set_line_width(c, 0.7);
    cairo_rectangle(c, 0, 0, w, h);
    cairo_stroke(c);
    for (int i = 0; i <= 200; ++i) {
      const double x = i / 200.0, bell = std::exp(-0.5 * std::pow((x - 0.45) / 0.12, 2));
      cairo_line_to(c, w * x, h * (0.9 - 0.75 * bell));
    }
    cairo_stroke(c);
    cairo_restore(c);
  }

  PrintedSheet take(double pixels_per_mm) {
    cairo_surface_flush(surface_.get());
    PrintedSheet sheet;
    sheet.albedo = Image<float>(cairo_image_surface_get_width(surface_.get()),
                                cairo_image_surface_get_height(surface_.get()), float(design_.paper_albedo));
    for (const Figure& figure : design_.figures)
      if (figure.kind != FigureKind::ruled) expose_photo(figure, pixels_per_mm, sheet.albedo);
    const unsigned char* coverage = cairo_image_surface_get_data(surface_.get());
    const int stride = cairo_image_surface_get_stride(surface_.get());
    for (int y = 0; y < sheet.albedo.height(); ++y)
      for (int x = 0; x < sheet.albedo.width(); ++x) {
        float& albedo = sheet.albedo(x, y);
        const float ink = static_cast<float>(coverage[y * stride + x]) / 255;
        albedo += ink * (static_cast<float>(design_.ink_albedo) - albedo);
      }
    sheet.text = std::move(text_);
    sheet.text_was_cut = was_cut_;
    return sheet;
  }

 private:
  double left() const { return design_.margin_left_mm + column_ * (column_width() + column_gap); }
  double column_width() const {
    const double width = design_.width_mm - design_.margin_left_mm - design_.margin_right_mm;
    return (width - (design_.columns - 1) * column_gap) / design_.columns;
  }
  static std::string trimmed(std::string text) {
    while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
    return text.substr(std::min(text.find_first_not_of("\n "), text.size()));
  }

  /// Units of the layout are millimetres; fonts are hinted nowhere, so that lines break alike at every resolution.
  Owned<PangoLayout> make_layout(const std::string& text, double size_pt, bool bold) const {
    Owned<PangoLayout> layout(pango_cairo_create_layout(cairo_.get()));
    const Owned<cairo_font_options_t> options(cairo_font_options_create());
    cairo_font_options_set_hint_style(options.get(), CAIRO_HINT_STYLE_NONE);
    cairo_font_options_set_hint_metrics(options.get(), CAIRO_HINT_METRICS_OFF);
    cairo_font_options_set_antialias(options.get(), CAIRO_ANTIALIAS_GRAY);
    PangoContext* context = pango_layout_get_context(layout.get());
    pango_cairo_context_set_font_options(context, options.get());
    pango_cairo_context_set_resolution(context, 72);
    pango_context_set_round_glyph_positions(context, false);
    pango_layout_context_changed(layout.get());
    const Owned<PangoFontDescription> font(pango_font_description_new());
    pango_font_description_set_family(font.get(), "Liberation Serif");
    pango_font_description_set_absolute_size(font.get(), size_pt * mm_per_point * PANGO_SCALE);
    if (bold) pango_font_description_set_weight(font.get(), PANGO_WEIGHT_BOLD);
    pango_layout_set_font_description(layout.get(), font.get());
    pango_layout_set_width(layout.get(), static_cast<int>(column_width() * PANGO_SCALE));
    pango_layout_set_text(layout.get(), text.c_str(), static_cast<int>(text.size()));
    return layout;
  }

  void show_line(PangoLayoutLine* line, double x_mm, double baseline_mm) {
    cairo_move_to(cairo_.get(), x_mm, baseline_mm);
    pango_cairo_show_layout_line(cairo_.get(), line);
  }

  void print_paragraph(std::string text) {
    const bool heading = text.starts_with("# ");
    if (heading) text = text.substr(2);
    const double size = (heading ? 1.5 : 1) * design_.font_size_pt;
    const double step = 1.15 * size * mm_per_point * (heading ? 1 : design_.line_spacing);
    const auto layout = make_layout(text, size, heading);
    pango_layout_set_justify(layout.get(), !heading);
    if (heading && below_ > design_.margin_top_mm) below_ += 0.8 * step;
    const Owned<PangoLayoutIter> lines(pango_layout_get_iter(layout.get()));
    std::size_t printed = 0;
    do {
      if (!find_room(step)) break;
      PangoLayoutLine* line = pango_layout_iter_get_line_readonly(lines.get());
      show_line(line, left(), below_ - 0.25 * step);
      printed = static_cast<std::size_t>(line->start_index + line->length);
    } while (pango_layout_iter_next_line(lines.get()));
    if (printed < text.size()) was_cut_ = true;
    if (printed > 0) append(trimmed(text.substr(0, printed)));
    below_ += (heading ? 0.6 : 0.35) * step;
  }

  /// Moves `below_`, the lower end of what is printed, one line down: past figures, into the next column.
  bool find_room(double step) {
    while (column_ < design_.columns) {
      below_ += step;
      for (const Figure& figure : design_.figures) {
        const bool beside = figure.x_mm > left() + column_width() || figure.x_mm + figure.width_mm < left();
        const double top = figure.y_mm - 2, bottom = figure.y_mm + figure.height_mm + 2;
        if (!beside && below_ > top && below_ - step < bottom) below_ = bottom + step;
      }
      if (below_ <= design_.height_mm - design_.margin_bottom_mm) return true;
      if (++column_ < design_.columns) below_ = design_.margin_top_mm;
    }
    return false;
  }

  void append(const std::string& text) { text_ += (text_.empty() ? "" : "\n\n") + text; }

  static void expose_photo(const Figure& figure, double pixels_per_mm, Image<float>& albedo) {
    const bool black = figure.kind == FigureKind::black;
    for (int j = 0; j < albedo.height(); ++j)
      for (int i = 0; i < albedo.width(); ++i) {
        const double x = ((i + 0.5) / pixels_per_mm - figure.x_mm) / figure.width_mm;
        const double y = ((j + 0.5) / pixels_per_mm - figure.y_mm) / figure.height_mm;
        if (x < 0 || y < 0 || x > 1 || y > 1) continue;
        const double tone = landscape(x, y);
        albedo(i, j) = static_cast<float>(black ? 0.03 + 0.05 * tone : 0.08 + 0.6 * tone);
      }
  }

  /// Brightness, 0 to 1, of three ranges of hills under a sky with a sun.
  static double landscape(double x, double y) {
    const double sky = 0.55 + 0.35 * (1 - y);
    const double from_sun = std::hypot((x - 0.72) * 1.4, y - 0.24);
    double tone = from_sun < 0.09 ? 1 : sky + 0.1 * std::exp(-8 * from_sun);
    for (int range = 0; range < 3; ++range) {
      const double ridge = 0.42 + 0.17 * range +
                           0.06 * std::sin(2 * std::numbers::pi * (1.3 + range) * x + 1.7 * range) +
                           0.015 * std::sin(31 * x * (1 + 0.3 * range));
      if (y > ridge) tone = 0.5 - 0.17 * range + 0.12 * std::sin(40 * (y - ridge)) * (y - ridge);
    }
    return std::min(1.0, std::max(0.0, tone));
  }

  static constexpr double column_gap = 10;  // [mm]

  const PrintDesign& design_;
  Owned<cairo_surface_t> surface_;
  Owned<cairo_t> cairo_;
  int column_ = 0;
  double below_ = design_.margin_top_mm;
  std::string text_;
  bool was_cut_ = false;
};

}  // namespace

PrintedSheet print_sheet(const PrintDesign& design, double pixels_per_mm) {
  Press press(design, pixels_per_mm);
  for (const Figure& figure : design.figures)
    if (figure.kind == FigureKind::ruled) press.print_ruled(figure);
  press.print_texts();
  press.print_footer();
  return press.take(pixels_per_mm);
}

}  // namespace pagesweep::sim
