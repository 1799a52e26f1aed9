// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/dewarping/paper_view.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

constexpr double cell_px = 4;
/// Paper does not hide what is nearer behind it than this: less than the surfaces' own errors and the buffer's facets.
constexpr double tolerance_mm = 0.5;

/// Distance from the sensor to a point along its viewing ray; NaN if there is none.
double depth_of(const Scanner& scanner, const Eigen::Vector3d& point, const Eigen::Vector2d& pixel) {
  const auto ray = scanner.ray(pixel);
  return ray ? (point - ray->origin).norm() : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

std::optional<Eigen::Vector2d> difference_vector(const Scanner& scanner, const Eigen::Vector3d& model_mm,
                                                 const Eigen::Vector3d& measured_mm) {
  const auto model_px = scanner.project(model_mm);
  const auto measured_px = scanner.project(measured_mm);
  if (!model_px || !measured_px) return std::nullopt;
  return *model_px - *measured_px;
}

PaperView::PaperView(const PageSurface& surface, const Scanner& scanner, PaperShape shape)
    : surface_(&surface), scanner_(&scanner), shape_(shape) {}

const Image<Eigen::Vector3f>& PaperView::nodes() const {
  return shape_ == PaperShape::measured ? surface_->measured : surface_->model;
}

Eigen::Vector3d PaperView::point(const Eigen::Vector2d& paper_mm) const {
  return interpolate(*surface_, nodes(), paper_mm.x(), paper_mm.y());
}

std::optional<Eigen::Vector2d> PaperView::position(const Eigen::Vector2d& paper_mm) const {
  return scanner_->project(point(paper_mm));
}

bool PaperView::is_on_page(const Eigen::Vector2d& paper_mm) const {
  if (surface_->gutter_at_left && paper_mm.x() < surface_->s_of(0)) return false;
  return !(surface_->gutter_at_right && paper_mm.x() > surface_->s_of(surface_->columns() - 1));
}

struct Occlusion::Corner {
  double x, y;  ///< [cells]
  double depth_mm;
};

Occlusion::Occlusion(std::span<const PaperView> pages) {
  if (pages.empty()) return;
  const auto cells = [](int pixels) { return static_cast<int>(std::ceil(pixels / cell_px)) + 1; };
  const int width = cells(pages.front().scanner().width());
  const int height = cells(pages.front().scanner().height());
  nearest_ = Image<float>(width, height, std::numeric_limits<float>::infinity());
  farthest_ = Image<float>(width, height, -std::numeric_limits<float>::infinity());
  for (const PaperView& page : pages) add(page);
}

void Occlusion::add(const PaperView& page) {
  const Image<Eigen::Vector3f>& nodes = page.nodes();
  std::vector<std::optional<Corner>> corners(nodes.size());
  parallel_rows(nodes.height(), [&](int j) {
    for (int i = 0; i < nodes.width(); ++i) {
      const Eigen::Vector3d point = nodes(i, j).cast<double>();
      const auto pixel = page.scanner().project(point);
      const double depth = pixel ? depth_of(page.scanner(), point, *pixel) : std::numeric_limits<double>::quiet_NaN();
      if (std::isfinite(depth) && pixel->allFinite())
        corners[static_cast<std::size_t>(j * nodes.width() + i)] =
            Corner{pixel->x() / cell_px, pixel->y() / cell_px, depth};
    }
  });
  const auto corner = [&](int i, int j) { return corners[static_cast<std::size_t>(j * nodes.width() + i)]; };
  for (int j = 0; j + 1 < nodes.height(); ++j)
    for (int i = 0; i + 1 < nodes.width(); ++i) {
      const auto a = corner(i, j), b = corner(i + 1, j), c = corner(i, j + 1), d = corner(i + 1, j + 1);
      if (a && b && c) add_triangle(*a, *b, *c);
      if (b && c && d) add_triangle(*b, *c, *d);
    }
}

void Occlusion::add_triangle(const Corner& a, const Corner& b, const Corner& c) {
  const auto first = [](double low, int count) {
    return static_cast<int>(std::clamp(std::ceil(low), 0.0, double(count)));
  };
  const auto last = [](double high, int count) {
    return static_cast<int>(std::clamp(std::floor(high), -1.0, count - 1.0));
  };
  const double area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
  if (area == 0) return;
  const auto [x_low, x_high] = std::minmax({a.x, b.x, c.x});
  const auto [y_low, y_high] = std::minmax({a.y, b.y, c.y});
  for (int y = first(y_low, nearest_.height()); y <= last(y_high, nearest_.height()); ++y)
    for (int x = first(x_low, nearest_.width()); x <= last(x_high, nearest_.width()); ++x) {
      const double wb = ((x - a.x) * (c.y - a.y) - (c.x - a.x) * (y - a.y)) / area;
      const double wc = ((b.x - a.x) * (y - a.y) - (x - a.x) * (b.y - a.y)) / area;
      if (wb < 0 || wc < 0 || wb + wc > 1) continue;
      const auto depth =
          static_cast<float>(a.depth_mm + wb * (b.depth_mm - a.depth_mm) + wc * (c.depth_mm - a.depth_mm));
      nearest_(x, y) = std::min(nearest_(x, y), depth);
      farthest_(x, y) = std::max(farthest_(x, y), depth);
    }
}

bool Occlusion::hides(const Scanner& scanner, const Eigen::Vector3d& point_mm, const Eigen::Vector2d& pixel) const {
  const auto x = static_cast<int>(std::floor(pixel.x() / cell_px));
  const auto y = static_cast<int>(std::floor(pixel.y() / cell_px));
  if (!nearest_.contains(x, y) || !nearest_.contains(x + 1, y + 1)) return false;
  // The point is hidden only if all four cells around it show paper in front of it: at a silhouette, where they
  // disagree, it counts as seen, and a slope between the cells cannot hide itself.
  float front = -std::numeric_limits<float>::infinity(), back = front;
  for (const int dy : {0, 1})
    for (const int dx : {0, 1}) {
      front = std::max(front, nearest_(x + dx, y + dy));
      back = std::max(back, farthest_(x + dx, y + dy));
    }
  if (!(back > front + tolerance_mm)) return false;
  return depth_of(scanner, point_mm, pixel) > front + tolerance_mm;
}

}  // namespace pagesweep
