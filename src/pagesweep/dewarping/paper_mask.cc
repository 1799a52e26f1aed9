// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/dewarping/paper_mask.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "pagesweep/base/parallel.h"
#include "pagesweep/dewarping/flat_preview_internal.h"

namespace pagesweep {
namespace {

constexpr double cell_mm = 3;            // of the paper's colour
constexpr double paper_quantile = 0.8;   // of a cell's samples: paper between letters
constexpr double least_contrast = 0.15;  // between paper and table
constexpr double beside_mm = 8;          // how far beside the page the table is looked at
constexpr double measured_rim_mm = 2.5;  // as far as the measurement may reach beyond a torn edge
constexpr double shade_cell_mm = 0.5;    // in which the shade around an obstruction is followed
constexpr int shade_reach = 12;          // cells
constexpr double least_shade = 0.015;    // of the paper's light

float median_of(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Fills cells that have no value with the mean of neighbours that have one, ring by ring from outside.
void spread_into_holes(Image<float>& cells) {
  std::vector<std::pair<int, int>> holes;
  for (int y = 0; y < cells.height(); ++y)
    for (int x = 0; x < cells.width(); ++x)
      if (std::isnan(cells(x, y))) holes.emplace_back(x, y);
  while (!holes.empty()) {
    std::vector<std::pair<int, int>> left;
    std::vector<float> values;
    for (const auto& [x, y] : holes) {
      float sum = 0;
      int count = 0;
      for (int j = -1; j <= 1; ++j)
        for (int i = -1; i <= 1; ++i)
          if (cells.contains(x + i, y + j) && std::isfinite(cells(x + i, y + j))) sum += cells(x + i, y + j), ++count;
      values.push_back(count > 0 ? sum / static_cast<float>(count) : not_a_number);
    }
    for (std::size_t k = 0; k < holes.size(); ++k) {
      cells(holes[k].first, holes[k].second) = values[k];
      if (std::isnan(values[k])) left.push_back(holes[k]);
    }
    if (left.size() == holes.size()) break;
    holes = std::move(left);
  }
}

/// Forgets cells that are filled with print: those clearly darker than most around them.
Image<float> without_print(const Image<float>& cells) {
  constexpr int reach = 3;
  constexpr float clearly = 0.97f;
  Image<float> paper = cells;
  for (int y = 0; y < cells.height(); ++y)
    for (int x = 0; x < cells.width(); ++x) {
      std::vector<float> around;
      for (int j = std::max(0, y - reach); j <= std::min(cells.height() - 1, y + reach); ++j)
        for (int i = std::max(0, x - reach); i <= std::min(cells.width() - 1, x + reach); ++i)
          if (std::isfinite(cells(i, j))) around.push_back(cells(i, j));
      if (!around.empty() && cells(x, y) < clearly * median_of(around)) paper(x, y) = not_a_number;
    }
  return paper;
}

/// The paper's colour in one channel, cell by cell, from what is not masked.
template <class T>
Image<float> paper_colour(const Image<T>& samples, int channels, int channel, const Image<char>& mask, int cell) {
  const int columns = (mask.width() + cell - 1) / cell, rows = (mask.height() + cell - 1) / cell;
  Image<float> colours(columns, rows, not_a_number);
  parallel_rows(rows, [&](int j) {
    std::vector<float> values;
    for (int i = 0; i < columns; ++i) {
      values.clear();
      int all = 0;
      for (int y = j * cell; y < std::min((j + 1) * cell, mask.height()); y += 2)
        for (int x = i * cell; x < std::min((i + 1) * cell, mask.width()); x += 2, ++all)
          if (!mask(x, y)) values.push_back(static_cast<float>(samples(x * channels + channel, y)));
      if (3 * static_cast<int>(values.size()) < 2 * all || values.empty()) continue;
      const auto at = values.begin() + static_cast<std::ptrdiff_t>(paper_quantile * double(values.size() - 1));
      std::nth_element(values.begin(), at, values.end());
      colours(i, j) = *at;
    }
  });
  Image<float> paper = without_print(colours);
  spread_into_holes(paper);
  return paper;
}

/// Bilinear between the cells' middles.
float colour_at(const Image<float>& cells, int x, int y, int cell) {
  const float u = std::clamp((static_cast<float>(x) + 0.5f) / static_cast<float>(cell) - 0.5f, 0.0f,
                             static_cast<float>(cells.width() - 1));
  const float v = std::clamp((static_cast<float>(y) + 0.5f) / static_cast<float>(cell) - 0.5f, 0.0f,
                             static_cast<float>(cells.height() - 1));
  const int i = std::min(static_cast<int>(u), std::max(0, cells.width() - 2));
  const int j = std::min(static_cast<int>(v), std::max(0, cells.height() - 2));
  const int i2 = std::min(i + 1, cells.width() - 1), j2 = std::min(j + 1, cells.height() - 1);
  const float a = u - static_cast<float>(i), b = v - static_cast<float>(j);
  return (1 - b) * ((1 - a) * cells(i, j) + a * cells(i2, j)) + b * ((1 - a) * cells(i, j2) + a * cells(i2, j2));
}

/// Brightness of the page in cells, text filled, and which of them are masked.
struct ShadeCells {
  int size_px;
  Image<float> brightness;
  Image<char> masked;

  ShadeCells(const Image<char>& mask, const Picture& picture)
      : size_px(std::max(1, static_cast<int>(std::lround(shade_cell_mm * picture.pixels_per_mm)))),
        brightness((mask.width() + size_px - 1) / size_px, (mask.height() + size_px - 1) / size_px, 0.0f),
        masked(brightness.width(), brightness.height(), false) {
    std::visit(
        [&](const auto& samples) {
          parallel_rows(masked.height(), [&](int j) { average(samples, picture.channels, mask, j); });
        },
        picture.samples);
    brightness = close_dark_spots(brightness, 2);
  }

 private:
  template <class T>
  void average(const Image<T>& samples, int channels, const Image<char>& mask, int j) {
    for (int i = 0; i < masked.width(); ++i) {
      double sum = 0;
      int count = 0;
      for (int y = j * size_px; y < std::min((j + 1) * size_px, mask.height()); ++y)
        for (int x = i * size_px; x < std::min((i + 1) * size_px, mask.width()); ++x) {
          for (int c = 0; c < channels; ++c) sum += samples(x * channels + c, y), ++count;
          if (mask(x, y)) masked(i, j) = true;
        }
      brightness(i, j) = static_cast<float>(sum / count);
    }
  }
};

/// Brightness of the unshaded paper around what is masked: the median of blocks of cells that lie beyond the reach of
/// shade, spread into the rest.
Image<float> unshaded_paper(const ShadeCells& cells) {
  constexpr int block = 8;
  const Image<char>& masked = cells.masked;
  Image<char> near(masked.width(), masked.height(), false);
  for (int j = 0; j < masked.height(); ++j)
    for (int i = 0; i < masked.width(); ++i)
      if (masked(i, j))
        for (int b = std::max(0, j - shade_reach); b <= std::min(masked.height() - 1, j + shade_reach); ++b)
          for (int a = std::max(0, i - shade_reach); a <= std::min(masked.width() - 1, i + shade_reach); ++a)
            near(a, b) = true;
  Image<float> levels((masked.width() + block - 1) / block, (masked.height() + block - 1) / block, not_a_number);
  for (int j = 0; j < levels.height(); ++j)
    for (int i = 0; i < levels.width(); ++i) {
      std::vector<float> values;
      for (int b = j * block; b < std::min((j + 1) * block, masked.height()); ++b)
        for (int a = i * block; a < std::min((i + 1) * block, masked.width()); ++a)
          if (!near(a, b)) values.push_back(cells.brightness(a, b));
      if (!values.empty()) levels(i, j) = median_of(values);
    }
  spread_into_holes(levels);
  Image<float> paper(masked.width(), masked.height());
  for (int j = 0; j < paper.height(); ++j)
    for (int i = 0; i < paper.width(); ++i) paper(i, j) = colour_at(levels, i, j, block);
  return paper;
}

/// Adds the shadow that an obstruction casts around it, the light that its edges throw there, and what is left of its
/// rim: from the mask outwards, as long as it differs less and less from the paper beyond. Of print only what is
/// broader than 2 mm could be taken for it, and only as far as it becomes more like paper.
void add_shade(const Picture& picture, Image<char>& mask) {
  constexpr float noise = 0.01f;
  ShadeCells cells(mask, picture);
  const Image<float> paper = unshaded_paper(cells);
  std::vector<std::pair<int, int>> rim;
  for (int j = 0; j < paper.height(); ++j)
    for (int i = 0; i < paper.width(); ++i)
      if (cells.masked(i, j)) rim.emplace_back(i, j);
  Image<char> shaded = cells.masked;
  for (int step = 0; step < shade_reach && !rim.empty(); ++step) {
    std::vector<std::pair<int, int>> next;
    for (const auto& [i, j] : rim)
      for (const auto& [a, b] : {std::pair{i + 1, j}, {i - 1, j}, {i, j + 1}, {i, j - 1}}) {
        if (!paper.contains(a, b) || cells.masked(a, b)) continue;
        shaded(a, b) = true;  // one cell more than is seen to be in the shade: there it ends
        const float off = std::abs(cells.brightness(a, b) - paper(a, b));
        const float before = std::abs(cells.brightness(i, j) - paper(i, j));
        if (!(off > static_cast<float>(least_shade) * paper(a, b))) continue;
        if (step > 0 && off > before + noise * paper(a, b)) continue;
        cells.masked(a, b) = true;
        next.emplace_back(a, b);
      }
    rim = std::move(next);
  }
  for (int y = 0; y < mask.height(); ++y)
    for (int x = 0; x < mask.width(); ++x)
      if (shaded(x / cells.size_px, y / cells.size_px)) mask(x, y) = true;
}

void forget_place(Page& page, int x, int y) {
  page.scan_map.u(x, y) = not_a_number;
  page.scan_map.v(x, y) = not_a_number;
}

/// Brightness of paper and of the table beside the page.
struct Levels {
  double paper = 0, table = 0;
};
Levels find_levels(const FlatPreview& preview, const PageFrame& frame) {
  std::vector<float> paper, table;
  for (int y = 0; y < preview.height(); ++y)
    for (int x = 0; x < preview.width(); ++x) {
      const float brightness = preview.brightness(x, y);
      if (std::isnan(brightness)) continue;
      if (preview.measured(x, y)) {
        paper.push_back(brightness);
      } else if (const Eigen::Vector2d at = frame.page_from_paper({preview.s_of(x), preview.t_of(y)});
                 at.x() < -1 || at.y() < -1 || at.x() > frame.width_mm + 1 || at.y() > frame.height_mm + 1) {
        table.push_back(brightness);
      }
    }
  if (paper.empty() || table.empty()) return {};
  const auto at = paper.begin() + static_cast<std::ptrdiff_t>(0.85 * double(paper.size() - 1));
  std::nth_element(paper.begin(), at, paper.end());
  return {*at, median_of(table)};
}

/// How sure it is that a node of the surface shows paper. At its rim the measurement goes on a little beyond the paper.
enum class Ground : char { unmeasured, rim, paper };

Image<Ground> ground_of(const PageSurface& surface) {
  const int reach = static_cast<int>(std::ceil(measured_rim_mm / surface.spacing_mm));
  Image<Ground> ground(surface.columns(), surface.rows(), Ground::unmeasured);
  parallel_rows(ground.height(), [&](int j) {
    for (int i = 0; i < ground.width(); ++i) {
      if (surface.status(i, j) != PixelStatus::ok) continue;
      ground(i, j) = Ground::paper;
      for (int b = j - reach; b <= j + reach; ++b)
        for (int a = i - reach; a <= i + reach; ++a)
          if (surface.status.contains(a, b) && surface.status(a, b) != PixelStatus::ok) ground(i, j) = Ground::rim;
    }
  });
  return ground;
}

/// Pixels that are dark and off the measured paper; at its rim only those that are nearly as dark as the table.
Image<char> find_dark(const PageSurface& surface, const FlatPreview& preview, const PageFrame& frame, const Page& page,
                      const Levels& levels) {
  const Image<float> cells = close_dark_spots(preview.brightness, 1);
  const Image<Ground> grounds = ground_of(surface);
  const Picture& picture = page.picture;
  Image<char> dark(picture.width(), picture.height(), false);
  parallel_rows(dark.height(), [&](int y) {
    for (int x = 0; x < dark.width(); ++x) {
      const Eigen::Vector2d paper = frame.paper_at_pixel(x, y, picture.pixels_per_mm);
      const auto i = static_cast<int>(std::lround((paper.x() - preview.s0_mm) / preview.pitch_mm));
      const auto j = static_cast<int>(std::lround((paper.y() - preview.t0_mm) / preview.pitch_mm));
      if (!preview.brightness.contains(i, j)) continue;
      const auto a = static_cast<int>(std::lround((paper.x() - surface.s0_mm) / surface.spacing_mm));
      const auto b = static_cast<int>(std::lround((paper.y() - surface.t0_mm) / surface.spacing_mm));
      const Ground ground = grounds.contains(a, b) ? grounds(a, b) : Ground::unmeasured;
      if (ground == Ground::paper) continue;
      const double share = ground == Ground::rim ? 0.25 : 0.5;
      dark(x, y) = double(cells(i, j)) < levels.table + share * (levels.paper - levels.table) ||
                   std::isnan(preview.brightness(i, j));
    }
  });
  return dark;
}

/// Of the dark pixels those that are connected with the border of the page.
Image<char> connected_with_border(const Image<char>& dark) {
  Image<char> outside(dark.width(), dark.height(), false);
  std::vector<std::pair<int, int>> open;
  const auto visit = [&](int x, int y) {
    if (!dark.contains(x, y) || !dark(x, y) || outside(x, y)) return;
    outside(x, y) = true;
    open.emplace_back(x, y);
  };
  for (int x = 0; x < dark.width(); ++x) visit(x, 0), visit(x, dark.height() - 1);
  for (int y = 0; y < dark.height(); ++y) visit(0, y), visit(dark.width() - 1, y);
  while (!open.empty()) {
    const auto [x, y] = open.back();
    open.pop_back();
    visit(x - 1, y), visit(x + 1, y), visit(x, y - 1), visit(x, y + 1);
  }
  return outside;
}

/// Adds the blurred edge of what is masked: pixels beside it, up to half a millimetre away, that are darker than the
/// threshold themselves.
void add_fringe(const Picture& picture, double threshold, Image<char>& mask) {
  const int steps = std::max(1, static_cast<int>(std::lround(0.5 * picture.pixels_per_mm)));
  for (int step = 0; step < steps; ++step) {
    const Image<char> before = mask;
    parallel_rows(mask.height(), [&](int y) {
      for (int x = 0; x < mask.width(); ++x) {
        if (before(x, y) || !(brightness_at(picture, {x, y}) < threshold)) continue;
        for (const auto& [a, b] : {std::pair{x + 1, y}, {x - 1, y}, {x, y + 1}, {x, y - 1}})
          if (before.contains(a, b) && before(a, b)) mask(x, y) = true;
      }
    });
  }
}

}  // namespace

Image<char> find_obstructions(const PageSurface& surface, const PageFrame& frame, const Picture& picture,
                              double rim_mm) {
  const double pixels_per_mm = picture.pixels_per_mm;
  if (!std::ranges::count(surface.status.pixels(), PixelStatus::covered)) return {};
  const double reach = rim_mm / surface.spacing_mm;
  const int nodes = static_cast<int>(std::ceil(reach));
  Image<char> mask(frame.width_px(pixels_per_mm), frame.height_px(pixels_per_mm), false);
  parallel_rows(mask.height(), [&](int y) {
    for (int x = 0; x < mask.width(); ++x) {
      const Eigen::Vector2d paper = frame.paper_at_pixel(x, y, pixels_per_mm);
      const double u = (paper.x() - surface.s0_mm) / surface.spacing_mm;
      const double v = (paper.y() - surface.t0_mm) / surface.spacing_mm;
      const int i = static_cast<int>(std::lround(u)), j = static_cast<int>(std::lround(v));
      for (int b = j - nodes; b <= j + nodes && !mask(x, y); ++b)
        for (int a = i - nodes; a <= i + nodes; ++a)
          if (surface.status.contains(a, b) && surface.status(a, b) == PixelStatus::covered &&
              std::hypot(a - u, b - v) <= reach) {
            mask(x, y) = true;
            break;
          }
    }
  });
  if (std::ranges::count(mask.pixels(), char{true})) add_shade(picture, mask);
  return mask;
}

Image<char> find_surroundings(const PaperView& view, const Picture& scan, const PageFrame& frame, const Page& page) {
  const FlatPreview preview = make_flat_preview(view, scan, beside_mm);
  const Levels levels = find_levels(preview, frame);
  if (!(levels.table < (1 - least_contrast) * levels.paper)) return {};
  Image<char> outside = connected_with_border(find_dark(view.surface(), preview, frame, page, levels));
  add_fringe(page.picture, 0.5 * (levels.paper + levels.table), outside);
  return outside;
}

void cover_with(const Image<char>& mask, double brightness, Page& page) {
  Picture& picture = page.picture;
  std::visit(
      [&]<class T>(Image<T>& samples) {
        const auto value = static_cast<T>(std::clamp(brightness, 0.0, 1.0) * std::numeric_limits<T>::max() + 0.5);
        for (int y = 0; y < mask.height(); ++y)
          for (int x = 0; x < mask.width(); ++x) {
            if (!mask(x, y)) continue;
            for (int c = 0; c < picture.channels; ++c) samples(x * picture.channels + c, y) = value;
            forget_place(page, x, y);
          }
      },
      picture.samples);
}

void cover_with_paper(const Image<char>& mask, Page& page) {
  Picture& picture = page.picture;
  const int cell = std::max(4, static_cast<int>(std::lround(cell_mm * picture.pixels_per_mm)));
  std::visit(
      [&]<class T>(Image<T>& samples) {
        for (int c = 0; c < picture.channels; ++c) {
          const Image<float> colours = paper_colour(samples, picture.channels, c, mask, cell);
          for (int y = 0; y < mask.height(); ++y)
            for (int x = 0; x < mask.width(); ++x) {
              const float colour = mask(x, y) ? colour_at(colours, x, y, cell) : not_a_number;
              if (std::isfinite(colour)) samples(x * picture.channels + c, y) = static_cast<T>(colour + 0.5f);
            }
        }
      },
      picture.samples);
  for (int y = 0; y < mask.height(); ++y)
    for (int x = 0; x < mask.width(); ++x)
      if (mask(x, y)) forget_place(page, x, y);
}

}  // namespace pagesweep
