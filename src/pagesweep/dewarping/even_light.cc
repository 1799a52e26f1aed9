// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/dewarping/even_light.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>

#include "pagesweep/base/parallel.h"
#include "pagesweep/data/transfer_curve.h"
#include "pagesweep/dewarping/gutter_glow.h"

namespace pagesweep {
namespace {

constexpr double slope_reach_mm = 1.5;                // normals are taken over twice that
constexpr double least_gain = 0.5, most_gain = 4;     // beyond, print would be noise
constexpr double crease_mm = 1;                       // beside the gutter, where light is taken to be what it is there
constexpr double rim_mm = 3;                          // likewise at the free edges
constexpr int glow_step = 4;                          // rows of gains
constexpr double sample_pitch_mm = 8;                 // of blank paper, where the lamp is looked for
constexpr double paper_from = 0.75, paper_to = 0.95;  // quantiles of the light in a cell: paper between the lines
constexpr double least_paper_light = 0.05;

/// Where the scan's pixel sees the plane on which the scanner's white was measured.
Eigen::Vector3d on_reference(const Scanner& scanner, const Eigen::Vector2d& pixel, const Eigen::Vector3d& point,
                             double height_mm) {
  const auto ray = scanner.ray(pixel);
  if (!ray || !(std::abs(ray->direction.z()) > 1e-6)) return {point.x(), point.y(), height_mm};
  return ray->origin + (height_mm - ray->origin.z()) / ray->direction.z() * ray->direction;
}

/// Paper between the lines.
struct BrightPaper {
  double light = 0;
  Eigen::Vector2d paper_mm = Eigen::Vector2d::Zero();
};

/// What is bright, but not the brightest, in a cell around a spot, and where that is: light falls off within a cell,
/// too.
BrightPaper bright_paper(const PaperView& view, const Picture& scan, const TransferCurve& curve,
                         const Eigen::Vector2d& paper_mm) {
  constexpr int steps = 10;
  std::vector<BrightPaper> spots;
  for (int k = 0; k < steps * steps; ++k) {
    const Eigen::Vector2d offset((k % steps + 0.5) / steps - 0.5, (k / steps + 0.5) / steps - 0.5);
    const Eigen::Vector2d spot = paper_mm + sample_pitch_mm * offset;
    const auto pixel = view.position(spot);
    if (!pixel || !view.scanner().sees(*pixel)) return {};
    const int x = std::clamp(static_cast<int>(std::lround(pixel->x())), 0, scan.width() - 1);
    const int y = std::clamp(static_cast<int>(std::lround(pixel->y())), 0, scan.height() - 1);
    double sum = 0;
    for (int c = 0; c < scan.channels; ++c) sum += double(curve.light_of(scan, x, y, c));
    spots.push_back({sum / scan.channels, spot});
  }
  std::ranges::stable_sort(spots, {}, &BrightPaper::light);
  const auto rank = [&](double share) { return static_cast<std::size_t>(share * double(spots.size())); };
  const std::span<const BrightPaper> bright = std::span(spots).subspan(rank(paper_from), rank(paper_to - paper_from));
  BrightPaper mean;
  for (const BrightPaper& spot : bright) {
    mean.light += spot.light / double(bright.size());
    mean.paper_mm += spot.paper_mm / double(bright.size());
  }
  return mean;
}

/// A place along a side of the page, moved away from its free ends: the last measured slopes there are noisy.
double inside(double place_mm, double length_mm, bool gutter_first, bool gutter_last) {
  const double rim = std::min(rim_mm, 0.25 * length_mm);
  return std::clamp(place_mm, gutter_first ? 0 : rim, length_mm - (gutter_last ? 0 : rim));
}

}  // namespace

struct PageLight::Spot {
  bool seen = false;
  Eigen::Vector3d point, normal, at_reference;
  Eigen::Vector2d pixel;
};

PageLight::PageLight(std::span<const PaperView> views, const Picture& scan, const ScanLight& light)
    : views_(views), scan_(scan), light_(light) {
  if (!light_.lamp || !light_.ambient) light_ = find_light(light_, sample_paper());
}

PageLight::Spot PageLight::spot_at(std::size_t page, const Eigen::Vector2d& paper_mm) const {
  const PaperView& view = views_[page];
  Spot spot;
  spot.point = view.point(paper_mm);
  // At the gutter the slope is that of this side.
  const auto keep = [&](double s) {
    const PageSurface& surface = view.surface();
    return std::clamp(s, surface.s_of(0), surface.s_of(surface.columns() - 1));
  };
  const Eigen::Vector2d left(keep(paper_mm.x() - slope_reach_mm), paper_mm.y());
  const Eigen::Vector2d right(keep(paper_mm.x() + slope_reach_mm), paper_mm.y());
  const Eigen::Vector2d down(0, slope_reach_mm);
  spot.normal = (view.point(paper_mm + down) - view.point(paper_mm - down)).cross(view.point(right) - view.point(left));
  if (spot.normal.z() < 0) spot.normal = -spot.normal;
  spot.normal.normalize();
  const auto pixel = view.scanner().project(spot.point);
  if (!pixel || !spot.normal.allFinite()) return spot;
  spot.seen = true;
  spot.pixel = *pixel;
  spot.at_reference = on_reference(view.scanner(), *pixel, spot.point, light_.white ? light_.white->height_mm : 0);
  return spot;
}

/// The page on the other side of the gutter.
std::optional<std::size_t> PageLight::facing(std::size_t page) const {
  const PageSurface& surface = views_[page].surface();
  if (surface.gutter_at_right && page + 1 < views_.size() && views_[page + 1].surface().gutter_at_left) return page + 1;
  if (surface.gutter_at_left && page > 0 && views_[page - 1].surface().gutter_at_right) return page - 1;
  return std::nullopt;
}

std::vector<PaperSample> PageLight::sample_paper() const {
  const TransferCurve curve = TransferCurve::of(scan_);
  std::vector<PaperSample> samples;
  for (std::size_t page = 0; page < views_.size(); ++page) {
    const PageSurface& surface = views_[page].surface();
    std::optional<GutterGlow> glow;
    if (const auto other = facing(page)) glow.emplace(views_[page], views_[*other], scan_, light_);
    const int columns = static_cast<int>((surface.columns() - 1) * surface.spacing_mm / sample_pitch_mm);
    const int rows = static_cast<int>((surface.rows() - 1) * surface.spacing_mm / sample_pitch_mm);
    std::vector<std::optional<PaperSample>> found(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
    parallel_rows(rows, [&](int j) {
      for (int i = 0; i < columns; ++i) {
        const Eigen::Vector2d paper(surface.s0_mm + (i + 0.5) * sample_pitch_mm,
                                    surface.t0_mm + (j + 0.5) * sample_pitch_mm);
        const auto a = static_cast<int>(std::lround((paper.x() - surface.s0_mm) / surface.spacing_mm));
        const auto b = static_cast<int>(std::lround((paper.y() - surface.t0_mm) / surface.spacing_mm));
        if (surface.status(a, b) != PixelStatus::ok) continue;
        const BrightPaper bright = bright_paper(views_[page], scan_, curve, paper);
        if (!(bright.light > least_paper_light)) continue;
        const Spot spot = spot_at(page, bright.paper_mm);
        if (!spot.seen) continue;
        PaperSample sample{spot.point, spot.normal, spot.at_reference, 0, bright.light, static_cast<int>(page)};
        if (glow) {
          const ChannelLight by_channel = glow->at(bright.paper_mm, spot.point, spot.normal);
          sample.glow = (by_channel[0] + by_channel[1] + by_channel[2]) / 3;
        }
        found[static_cast<std::size_t>(j * columns + i)] = sample;
      }
    });
    for (const auto& sample : found)
      if (sample) samples.push_back(*sample);
  }
  return samples;
}

LightGain PageLight::gain(std::size_t page, const PageFrame& frame) const {
  LightGain gain;
  const int columns = std::max(2, static_cast<int>(std::ceil(frame.width_mm / gain.pitch_mm)) + 1);
  const int rows = std::max(2, static_cast<int>(std::ceil(frame.height_mm / gain.pitch_mm)) + 1);
  for (Image<float>& values : gain.values) values = Image<float>(columns, rows, 1.0f);
  const PageSurface& surface = views_[page].surface();
  const auto paper_at = [&](int i, int j) {
    Eigen::Vector2d paper = frame.paper_from_page(
        {inside(i * gain.pitch_mm, frame.width_mm, surface.gutter_at_left, surface.gutter_at_right),
         inside(j * gain.pitch_mm, frame.height_mm, false, false)});
    if (surface.gutter_at_left) paper.x() = std::max(paper.x(), surface.s_of(0) + crease_mm);
    if (surface.gutter_at_right) paper.x() = std::min(paper.x(), surface.s_of(surface.columns() - 1) - crease_mm);
    return paper;
  };
  std::optional<GutterGlow> glow;
  if (const auto other = facing(page)) glow.emplace(views_[page], views_[*other], scan_, light_);
  const LampLight lamp(light_);
  ChannelLight typical_white{1, 1, 1};
  if (light_.white) typical_white = light_.white->at(0.5, 0.5);
  // Along the gutter the facing page's light hardly changes: every so-many-th row will do.
  const int glow_rows = glow ? (rows + glow_step - 1) / glow_step + 1 : 0;
  Image<ChannelLight> glows(columns, glow_rows, ChannelLight{});
  parallel_rows(glow_rows, [&](int j) {
    for (int i = 0; i < columns; ++i) {
      const Eigen::Vector2d paper = paper_at(i, j * glow_step);
      if (const Spot spot = spot_at(page, paper); spot.seen) glows(i, j) = glow->at(paper, spot.point, spot.normal);
    }
  });
  const auto glow_at = [&](int i, int j, std::size_t c) {
    if (!glow) return 0.0;
    const int row = j / glow_step;
    const double share = double(j % glow_step) / glow_step;
    return (1 - light_.ambient.value_or(0)) * ((1 - share) * glows(i, row)[c] + share * glows(i, row + 1)[c]);
  };
  parallel_rows(rows, [&](int j) {
    for (int i = 0; i < columns; ++i) {
      const Spot spot = spot_at(page, paper_at(i, j));
      if (!spot.seen) continue;
      const double direct = lamp.at(spot.point, spot.normal, spot.at_reference);
      ChannelLight white = typical_white;
      if (light_.white)
        white = light_.white->at(spot.pixel.x() / (scan_.width() - 1), spot.pixel.y() / (scan_.height() - 1));
      for (std::size_t c = 0; c < 3; ++c)
        gain.values[c](i, j) = static_cast<float>(
            std::clamp(typical_white[c] / white[c] / (direct + glow_at(i, j, c)), least_gain, most_gain));
    }
  });
  return gain;
}

}  // namespace pagesweep
