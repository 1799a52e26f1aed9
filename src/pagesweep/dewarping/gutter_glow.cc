// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/dewarping/gutter_glow.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "pagesweep/base/parallel.h"
#include "pagesweep/data/transfer_curve.h"

namespace pagesweep {
namespace {

constexpr double reach_mm = 150;        // beyond, a strip's share is below a thousandth
constexpr double share_step_mm = 0.5;   // of the table
constexpr double nearest_mm = 0.5;      // nearer, the direction of a node is noise
constexpr double own_reach_mm = 3;      // nearer, the slope of the paper is noise
constexpr double least_crossing = 0.9;  // cosine between the spine and the sheet's normal

int gutter_column(const PageSurface& surface) { return surface.gutter_at_left ? 0 : surface.columns() - 1; }

/// Light of each node of a page as the scan shows it, averaged over its surroundings: `reach` nodes up and down, one to
/// either side.
Image<std::array<float, 3>> light_of_nodes(const PaperView& view, const Picture& scan, int reach) {
  const TransferCurve curve = TransferCurve::of(scan);
  const Image<Eigen::Vector3f>& nodes = view.nodes();
  Image<std::array<float, 3>> seen(nodes.width(), nodes.height(), {0, 0, 0});
  Image<float> weight(nodes.width(), nodes.height(), 0.0f);
  parallel_rows(nodes.height(), [&](int j) {
    for (int i = 0; i < nodes.width(); ++i) {
      const auto pixel = view.scanner().project(nodes(i, j).cast<double>());
      if (!pixel || !view.scanner().sees(*pixel)) continue;
      const int x = std::clamp(static_cast<int>(std::lround(pixel->x())), 0, scan.width() - 1);
      const int y = std::clamp(static_cast<int>(std::lround(pixel->y())), 0, scan.height() - 1);
      weight(i, j) = 1;
      for (int c = 0; c < 3; ++c)
        seen(i, j)[static_cast<std::size_t>(c)] = curve.light_of(scan, x, y, std::min(c, scan.channels - 1));
    }
  });
  Image<std::array<float, 3>> mean(nodes.width(), nodes.height(), {0, 0, 0});
  parallel_rows(nodes.height(), [&](int j) {
    for (int i = 0; i < nodes.width(); ++i) {
      float sum = 0;
      for (int b = std::max(0, j - reach); b <= std::min(nodes.height() - 1, j + reach); ++b)
        for (int a = std::max(0, i - 1); a <= std::min(nodes.width() - 1, i + 1); ++a) {
          sum += weight(a, b);
          for (std::size_t c = 0; c < 3; ++c) mean(i, j)[c] += weight(a, b) * seen(a, b)[c];
        }
      for (float& value : mean(i, j)) value /= std::max(1.0f, sum);
    }
  });
  return mean;
}

}  // namespace

double lit_share(double distance_mm, double sigma_mm) {
  // With y = d tan(a) along the strip: (2 / pi) times the integral of cos^2(a) exp(-(d tan(a) / sigma)^2 / 2).
  constexpr int steps = 24;
  const double ratio = distance_mm / sigma_mm;
  double sum = 0;
  for (int k = 0; k < steps; ++k) {
    const double angle = std::numbers::pi / 2 * (k + 0.5) / steps;
    sum += std::pow(std::cos(angle), 2) * std::exp(-0.5 * std::pow(ratio * std::tan(angle), 2));
  }
  return 2 * sum / steps;
}

GutterGlow::GutterGlow(const PaperView& page, const PaperView& facing, const Picture& scan, const ScanLight& light)
    : page_(page), facing_(facing), lamp_(light) {
  for (double distance = 0; distance <= reach_mm + 2 * share_step_mm; distance += share_step_mm)
    lit_shares_.push_back(lit_share(distance, light.stripe_fwhm_mm / 2.3548));
  const int reach = static_cast<int>(std::lround(0.5 * light.stripe_fwhm_mm / facing.surface().spacing_mm));
  sent_ = light_of_nodes(facing, scan, reach);
}

double GutterGlow::share_at(double distance_mm) const {
  const double place = distance_mm / share_step_mm;
  const auto k = std::min(static_cast<std::size_t>(place), lit_shares_.size() - 2);
  return lit_shares_[k] + (place - static_cast<double>(k)) * (lit_shares_[k + 1] - lit_shares_[k]);
}

/// The row of nodes whose end at the gutter the sheet of light passes together with the point.
int GutterGlow::row_beside(const PaperView& view, const Eigen::Vector3d& point,
                           const Eigen::Vector3d& sheet_normal) const {
  const Image<Eigen::Vector3f>& nodes = view.nodes();
  const int column = gutter_column(view.surface());
  const auto along = [&](int j) { return sheet_normal.dot(nodes(column, j).cast<double>()); };
  const int last = nodes.height() - 1;
  const double share = (sheet_normal.dot(point) - along(0)) / (along(last) - along(0));
  return static_cast<int>(std::lround(std::clamp(share, 0.0, 1.0) * last));
}

ChannelLight GutterGlow::at(const Eigen::Vector2d& paper_mm, const Eigen::Vector3d& point_mm,
                            const Eigen::Vector3d& normal) const {
  ChannelLight glow{};
  const LightFrame frame = lamp_.frame_at(point_mm);
  const Image<Eigen::Vector3f>& own = page_.nodes();
  const int own_gutter = gutter_column(page_.surface());
  const Eigen::Vector3d spine = (own(own_gutter, own.height() - 1) - own(own_gutter, 0)).cast<double>().normalized();
  if (std::abs(spine.dot(frame.normal)) < least_crossing) return glow;

  // In the plane across the spine: the normal, and the direction towards the gutter.
  const Eigen::Vector3d upright = (normal - normal.dot(spine) * spine).normalized();
  Eigen::Vector3d inwards = spine.cross(upright);
  const double side = page_.surface().gutter_at_left ? -1 : 1;  // s grows towards the gutter, or away from it
  const Eigen::Vector3d along_s = page_.point(paper_mm + Eigen::Vector2d(1, 0)) - point_mm;
  if (inwards.dot(along_s) * side < 0) inwards = -inwards;
  struct Direction {
    double distance_mm;
    double sine;  // of the angle from the normal towards the gutter: all that is asked of it; +-1 where that is obtuse
  };
  const auto direction_to = [&](const Eigen::Vector3f& node) -> Direction {
    const Eigen::Vector3d arm = node.cast<double>() - point_mm;
    const double across = arm.dot(inwards), above = arm.dot(upright);
    const double distance = std::sqrt(across * across + above * above);
    return {distance, above > 0 ? across / distance : std::copysign(1.0, across)};
  };

  double horizon = 1;
  const int own_row = row_beside(page_, point_mm, frame.normal);
  const int step = page_.surface().gutter_at_left ? -1 : 1;
  const double column = (paper_mm.x() - page_.surface().s0_mm) / page_.surface().spacing_mm;
  for (int i = static_cast<int>(std::lround(column)); i >= 0 && i < own.width(); i += step)
    if (const auto [distance, sine] = direction_to(own(i, own_row)); distance > own_reach_mm && sine > 0)
      horizon = std::min(horizon, sine);

  const Image<Eigen::Vector3f>& nodes = facing_.nodes();
  const int row = row_beside(facing_, point_mm, frame.normal);
  for (int i = gutter_column(facing_.surface()); i >= 0 && i < nodes.width(); i += step) {
    const auto [distance, sine] = direction_to(nodes(i, row));
    if (distance > reach_mm || sine == -1) break;
    if (distance < nearest_mm || !(sine < horizon)) continue;
    if (i != gutter_column(facing_.surface())) {
      const double share = 0.5 * (horizon - sine) * share_at(distance);
      for (std::size_t c = 0; c < 3; ++c) glow[c] += share * static_cast<double>(sent_(i, row)[c]);
    }
    horizon = sine;
  }
  return glow;
}

}  // namespace pagesweep
