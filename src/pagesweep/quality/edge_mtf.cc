// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/quality/edge_mtf.h"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

constexpr int oversampling = 4;
constexpr double reach_px = 3;           // of the line spread function to either side
constexpr double least_contrast = 0.35;  // between paper and ink, of the paper
constexpr double straightness_px = 0.2;
constexpr double evenness = 0.12;  // of paper and of ink, of their contrast
constexpr std::size_t most_edges = 6000;
constexpr std::size_t least_edges = 25;

/// Sub-pixel place in row y near x at which light passes half-way between the two sides; NaN if it does not.
double crossing(const Image<float>& light, int x, int y, float half, bool falling) {
  for (int k = -1; k <= 1; ++k) {
    const int at = x + k;
    if (at < 0 || at + 1 >= light.width()) continue;
    const float a = light(at, y), b = light(at + 1, y);
    if (falling ? (a > half && b <= half) : (a <= half && b > half)) return at + double((half - a) / (b - a));
  }
  return std::nan("");
}

/// Light beside an edge: mean and largest deviation of the pixels from `from` to `to` away from it.
struct SideOfEdge {
  double mean = 0, scatter = 0;
};
SideOfEdge side_of(const Image<float>& light, int x, int y, int from, int to) {
  SideOfEdge side;
  const int count = std::abs(to - from) + 1, step = to > from ? 1 : -1;
  for (int k = 0; k < count; ++k) side.mean += double(light(x + from + k * step, y)) / count;
  for (int k = 0; k < count; ++k)
    side.scatter = std::max(side.scatter, std::abs(double(light(x + from + k * step, y)) - side.mean));
  return side;
}

/// Whether an edge passes between x and x + 1 in row y, and at which light.
struct EdgeHere {
  float half = 0;
  bool falling = false;  // paper at the left
};
std::optional<EdgeHere> edge_at(const Image<float>& light, int x, int y) {
  constexpr int margin = 7;
  if (x < margin || x + margin >= light.width()) return std::nullopt;
  const bool falling = light(x, y) > light(x + 1, y);
  const SideOfEdge left = side_of(light, x, y, falling ? -5 : -3, -2);
  const SideOfEdge right = side_of(light, x, y, 3, falling ? 4 : 6);
  const double contrast = std::abs(left.mean - right.mean);
  if (!(contrast > least_contrast * std::max(left.mean, right.mean)) || (left.mean > right.mean) != falling)
    return std::nullopt;
  if (std::max(left.scatter, right.scatter) > evenness * contrast) return std::nullopt;
  const auto half = static_cast<float>(0.5 * (left.mean + right.mean));
  const float a = light(x, y), b = light(x + 1, y);
  const bool passes = falling ? (a > half && b <= half) : (a <= half && b > half);
  return passes ? std::optional(EdgeHere{half, falling}) : std::nullopt;
}

std::optional<PrintedEdge> fit_edge(const std::vector<double>& places, int y0, bool falling) {
  const auto n = static_cast<double>(places.size());
  double mean = 0, slope = 0, spread = 0, squares = 0;
  for (const double x : places) mean += x / n;
  for (std::size_t k = 0; k < places.size(); ++k) {
    const double y = double(k) - 0.5 * (n - 1);
    slope += y * (places[k] - mean);
    spread += y * y;
  }
  slope /= spread;
  for (std::size_t k = 0; k < places.size(); ++k)
    squares += std::pow(places[k] - mean - slope * (double(k) - 0.5 * (n - 1)), 2);
  if (std::sqrt(squares / n) > straightness_px || std::abs(slope) > 0.25) return std::nullopt;
  return PrintedEdge{mean - slope * 0.5 * (n - 1), slope, y0, static_cast<int>(places.size()), falling};
}

/// Sums of an edge spread function: light over the distance from the edge, dark side first, 0 to 1.
class EdgeSpread {
 public:
  void add(double distance_px, double value) {
    const int bin = static_cast<int>(std::lround((distance_px + reach_px) * oversampling));
    if (bin < 0 || bin >= bins) return;
    sums_[static_cast<std::size_t>(bin)] += value;
    ++counts_[static_cast<std::size_t>(bin)];
  }
  Mtf transfer() const {
    std::vector<double> spread;
    for (std::size_t k = 0; k < bins; ++k) {
      if (counts_[k] < 20) return {};  // a phase that no edge has
      spread.push_back(sums_[k] / counts_[k]);
    }
    return transfer_of(spread, oversampling);
  }

 private:
  static constexpr int bins = static_cast<int>(2 * reach_px * oversampling) + 1;
  std::array<double, bins> sums_{};
  std::array<int, bins> counts_{};
};

/// One row of an edge, normalised: ink is 0 and paper 1.
struct EdgeRow {
  double place;      ///< of the edge [px]
  double ink, rise;  ///< light = ink + rise value
  double cosine;     ///< between the row and the edge's normal
};

std::optional<EdgeRow> row_of(const Image<float>& light, const PrintedEdge& edge, int y) {
  const double place = edge.x0 + edge.slope * (y - edge.y0);
  const int x = static_cast<int>(std::floor(place));
  if (x < 7 || x + 7 >= light.width()) return std::nullopt;
  const double left = side_of(light, x, y, edge.ink_at_right ? -5 : -3, -2).mean;
  const double right = side_of(light, x, y, 3, edge.ink_at_right ? 4 : 6).mean;
  const double ink = edge.ink_at_right ? right : left, paper = edge.ink_at_right ? left : right;
  if (!(paper > ink)) return std::nullopt;
  return EdgeRow{place, ink, paper - ink, 1 / std::hypot(1, edge.slope)};
}

void add_page_row(const Image<float>& light, const PrintedEdge& edge, const EdgeRow& row, int y, EdgeSpread& spread) {
  const double towards_paper = edge.ink_at_right ? -1 : 1;
  for (int x = static_cast<int>(row.place) - 4; x <= static_cast<int>(row.place) + 5; ++x)
    spread.add(towards_paper * (x - row.place) * row.cosine, (double(light(x, y)) - row.ink) / row.rise);
}

/// The scan's own pixels around the same place, by their distance from the edge on the page.
void add_scan_row(const PictureLight& scan, const ScanMap& map, bool upright, const PrintedEdge& edge,
                  const EdgeRow& row, int y, EdgeSpread& spread) {
  const auto look_up = [&](int along, int across) {
    const int px = upright ? along : across, py = upright ? across : along;
    return map.u.contains(px, py) ? Eigen::Vector2d(map.u(px, py), map.v(px, py))
                                  : Eigen::Vector2d::Constant(std::nan(""));
  };
  const int x = static_cast<int>(std::floor(row.place));
  const Eigen::Vector2d here = look_up(x, y);
  Eigen::Matrix2d scan_by_page;
  scan_by_page << 0.25 * (look_up(x + 2, y) - look_up(x - 2, y)), 0.25 * (look_up(x, y + 2) - look_up(x, y - 2));
  if (!here.allFinite() || !scan_by_page.allFinite() || std::abs(scan_by_page.determinant()) < 0.05) return;
  const Eigen::Matrix2d page_by_scan = scan_by_page.inverse();
  const double towards_paper = edge.ink_at_right ? -1 : 1;
  const int u0 = static_cast<int>(std::lround(here.x())), v0 = static_cast<int>(std::lround(here.y()));
  // The line of scan pixels that runs most across the edge.
  const bool along_u = std::abs(page_by_scan(0, 0)) >= std::abs(page_by_scan(0, 1));
  // What the light of a spot was multiplied with on the page, its paper and ink tell: here they are looked up anew.
  std::vector<std::pair<double, double>> pixels;
  for (int k = -7; k <= 7; ++k) {
    const int u = u0 + (along_u ? k : 0), v = v0 + (along_u ? 0 : k);
    if (u < 0 || v < 0 || u >= scan.width() || v >= scan.height()) return;
    const Eigen::Vector2d page = page_by_scan * (Eigen::Vector2d(u, v) - here);
    const double distance = x + page.x() - row.place - edge.slope * page.y();
    pixels.emplace_back(towards_paper * distance * row.cosine, scan.at(u, v));
  }
  double ink = 0, paper = 0, inks = 0, papers = 0;
  for (const auto& [distance, value] : pixels) {
    if (distance < -1.7 && distance > -3.2) ink += value, ++inks;
    if (distance > 1.7 && distance < 5) paper += value, ++papers;
  }
  if (inks == 0 || papers == 0 || !(paper / papers > ink / inks)) return;
  ink /= inks;
  const double rise = paper / papers - ink;
  for (const auto& [distance, value] : pixels) spread.add(distance, (value - ink) / rise);
}

Image<float> transposed(const Image<float>& image) {
  Image<float> turned(image.height(), image.width());
  for (int y = 0; y < image.height(); ++y)
    for (int x = 0; x < image.width(); ++x) turned(y, x) = image(x, y);
  return turned;
}

EdgeSharpness sharpness_along(const Image<float>& light, const ScanMap& map, bool upright, const PictureLight& scan) {
  std::vector<PrintedEdge> edges = find_printed_edges(light);
  EdgeSharpness sharpness;
  if (edges.size() < least_edges) return sharpness;
  // Enough is enough: every so-many-th.
  const std::size_t step = 1 + edges.size() / most_edges;
  EdgeSpread page_spread, scan_spread;
  for (std::size_t k = 0; k < edges.size(); k += step) {
    ++sharpness.edges;
    for (int y = edges[k].y0; y < edges[k].y0 + edges[k].rows; ++y) {
      const auto row = row_of(light, edges[k], y);
      if (!row) continue;
      add_page_row(light, edges[k], *row, y, page_spread);
      add_scan_row(scan, map, upright, edges[k], *row, y, scan_spread);
    }
  }
  sharpness.page = page_spread.transfer();
  sharpness.scan = scan_spread.transfer();
  return sharpness;
}

}  // namespace

double Mtf::at(double frequency) const {
  if (values.empty()) return std::nan("");
  const double place = std::clamp(frequency / step, 0.0, double(values.size() - 1));
  const auto k = std::min(static_cast<std::size_t>(place), values.size() - 2);
  return values[k] + (place - double(k)) * (values[k + 1] - values[k]);
}

double Mtf::frequency_at(double level) const {
  if (values.empty()) return 0;
  for (std::size_t k = 1; k < values.size(); ++k)
    if (values[k] < level) {
      const double share = (values[k - 1] - level) / (values[k - 1] - values[k]);
      return (double(k - 1) + share) * step;
    }
  return double(values.size() - 1) * step;
}

Mtf transfer_of(const std::vector<double>& edge_spread, int samples_per_px) {
  const std::size_t count = edge_spread.size() - 1;
  std::vector<double> line(count);
  for (std::size_t k = 0; k < count; ++k) {
    // A Hann window keeps noise from the ends out; its middle is flat where the line spread function lives.
    const double place = (double(k) + 0.5) / double(count) - 0.5;
    const double edge = std::clamp((std::abs(place) - 0.25) / 0.25, 0.0, 1.0);
    line[k] = (edge_spread[k + 1] - edge_spread[k]) * 0.5 * (1 + std::cos(std::numbers::pi * edge));
  }
  Mtf mtf;
  for (double frequency = 0; frequency <= 1; frequency += mtf.step) {
    double real = 0, imaginary = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const double angle = 2 * std::numbers::pi * frequency * double(k) / samples_per_px;
      real += line[k] * std::cos(angle);
      imaginary += line[k] * std::sin(angle);
    }
    // What bins and differences of neighbouring ones have averaged: a sinc each.
    const double x = std::numbers::pi * frequency / samples_per_px;
    const double averaged = x > 0 ? std::pow(std::sin(x) / x, 2) : 1;
    mtf.values.push_back(std::hypot(real, imaginary) / averaged);
  }
  const double whole = mtf.values.front();
  if (!(whole > 0.2)) return {};
  for (double& value : mtf.values) value /= whole;
  return mtf;
}

std::vector<PrintedEdge> find_printed_edges(const Image<float>& light, int least_rows) {
  constexpr int longest = 48;
  constexpr int columns = 64;  // of a stripe of the picture: one task
  const int stripes = (light.width() + columns - 1) / columns;
  std::vector<std::vector<PrintedEdge>> found(static_cast<std::size_t>(stripes));
  parallel_rows(stripes, [&](int stripe) {
    Image<char> taken(columns, light.height(), false);
    const int from = stripe * columns, to = std::min(from + columns, light.width());
    std::vector<double> places;
    for (int y = 0; y < light.height(); ++y)
      for (int x = from; x < to; ++x) {
        if (x + 1 >= light.width() || taken(x - from, y) || std::abs(light(x, y) - light(x + 1, y)) < 0.02f) continue;
        const auto start = edge_at(light, x, y);
        if (!start) continue;
        places.clear();
        int at = x;
        for (int row = y; row < std::min(y + longest, light.height()); ++row) {
          const double place = crossing(light, at, row, start->half, start->falling);
          if (std::isnan(place)) break;
          at = static_cast<int>(std::floor(place));
          if (at < from || at >= to || taken(at - from, row) || !edge_at(light, at, row)) break;
          taken(at - from, row) = true;
          places.push_back(place);
        }
        if (static_cast<int>(places.size()) < least_rows) continue;
        if (const auto edge = fit_edge(places, y, start->falling))
          found[static_cast<std::size_t>(stripe)].push_back(*edge);
      }
  });
  std::vector<PrintedEdge> edges;
  for (const auto& some : found) edges.insert(edges.end(), some.begin(), some.end());
  return edges;
}

std::array<EdgeSharpness, 2> measure_sharpness(const Page& page, const Image<float>& page_light,
                                               const PictureLight& scan) {
  return {sharpness_along(page_light, page.scan_map, true, scan),
          sharpness_along(transposed(page_light), page.scan_map, false, scan)};
}

}  // namespace pagesweep
