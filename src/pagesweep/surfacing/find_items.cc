// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/find_items.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace pagesweep {
namespace {

constexpr double apart_mm = 3;
constexpr double least_area_mm2 = 400;

/// A sheet and its extent in the field, rows counted from the lower end of q.
struct Item {
  Image<std::uint8_t> cells;
  int count = 0;
  double left = 1e9, right = -1e9, low = 1e9, high = -1e9;  ///< [cells]

  double height() const { return high - low + 1; }
};

/// The piece that a cell belongs to, gaps of up to `reach` cells included; its cells are marked as seen.
Item take_piece(const Image<std::uint8_t>& paper, int i0, int j0, int reach, Image<char>& seen) {
  Item item;
  item.cells = Image<std::uint8_t>(paper.width(), paper.height(), 0);
  std::vector<std::pair<int, int>> open{{i0, j0}};
  seen(i0, j0) = true;
  while (!open.empty()) {
    const auto [i, j] = open.back();
    open.pop_back();
    item.cells(i, j) = 1;
    ++item.count;
    item.left = std::min<double>(item.left, i);
    item.right = std::max<double>(item.right, i);
    item.low = std::min<double>(item.low, j);
    item.high = std::max<double>(item.high, j);
    for (int b = -reach; b <= reach; ++b)
      for (int a = -reach; a <= reach; ++a)
        if (paper.contains(i + a, j + b) && paper(i + a, j + b) && !seen(i + a, j + b)) {
          seen(i + a, j + b) = true;
          open.emplace_back(i + a, j + b);
        }
  }
  return item;
}

bool on_one_line(const Item& a, const Item& b) {
  const double overlap = std::min(a.high, b.high) - std::max(a.low, b.low) + 1;
  return overlap > 0.5 * std::min(a.height(), b.height());
}

/// From the top down, line by line: the highest sheet that is left begins a line, with all that lie beside it.
std::vector<Item> in_reading_order(std::vector<Item> items) {
  std::vector<Item> ordered;
  while (!items.empty()) {
    const Item first = *std::ranges::max_element(items, {}, &Item::high);
    const auto rest =
        std::stable_partition(items.begin(), items.end(), [&](const Item& item) { return on_one_line(item, first); });
    std::ranges::sort(items.begin(), rest, {}, &Item::left);
    ordered.insert(ordered.end(), std::make_move_iterator(items.begin()), std::make_move_iterator(rest));
    items.erase(items.begin(), rest);
  }
  return ordered;
}

}  // namespace

std::vector<Image<std::uint8_t>> find_items(const HeightField& field, const Image<std::uint8_t>& paper) {
  const int reach = std::max(1, static_cast<int>(apart_mm / field.cell_mm));
  Image<char> seen(paper.width(), paper.height(), false);
  std::vector<Item> items;
  for (int j = 0; j < paper.height(); ++j)
    for (int i = 0; i < paper.width(); ++i) {
      if (!paper(i, j) || seen(i, j)) continue;
      Item item = take_piece(paper, i, j, reach, seen);
      if (item.count * field.cell_mm * field.cell_mm >= least_area_mm2) items.push_back(std::move(item));
    }
  std::vector<Image<std::uint8_t>> sheets;
  for (Item& item : in_reading_order(std::move(items))) sheets.push_back(std::move(item.cells));
  return sheets;
}

}  // namespace pagesweep
