// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/lay_flat.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "pagesweep/base/parallel.h"
#include "pagesweep/surfacing/straighten.h"

namespace pagesweep {
namespace {

constexpr double margin_mm = 8;
constexpr double model_node_spacing_mm = 5, creased_node_spacing_mm = 2.5;
constexpr double explained_sigmas = 4;  // strain beyond so many standard deviations is not noise
constexpr double coarsest_spacing_mm = 2, finest_spacing_mm = 0.7;
constexpr double interpolation_error_mm = 0.01;
constexpr double guessed_weight = 1e-3;  // of lengths where nothing was measured
constexpr double least_straightening_rad = 0.1;

struct Range {
  double low = 1e300, high = -1e300;
  void include(double x) {
    low = std::min(low, x);
    high = std::max(high, x);
  }
};

Range alpha_range(const RuledSurface& model, std::span<const Support> places, GutterSide gutter) {
  Range range;
  for (const Support& place : places) range.include(model.frame.ruling_from_plan(place.plan).x());
  if (gutter != GutterSide::none) range.include(0);
  return range;
}

/// By how much a single page is askew when its places on the paper are turned as they are seen from above. Little is
/// left to the page's edges and its text, which know better.
double straightening(const std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>>& paper_and_plan,
                     const Eigen::Rotation2Dd& turn) {
  std::vector<Eigen::Vector2d> seen;
  for (const auto& [paper, plan] : paper_and_plan) seen.push_back(turn * paper);
  const double angle = askew_rad(std::move(seen));
  return std::abs(angle) > least_straightening_rad ? angle : 0;
}

}  // namespace

CutLength::CutLength(const RuledSurface& surface, double from, double to) : from_(from) {
  const int steps = std::max(2, static_cast<int>(std::ceil((to - from) / 0.25)));
  step_ = (to - from) / steps;
  const double b = 0.5 * (surface.b_low + surface.b_high);
  const auto speed = [&](double alpha) { return std::hypot(1 + surface.frame.fan * b, surface.at(alpha, b).slope); };
  lengths_.push_back(0);
  speeds_.push_back(speed(from));
  for (int k = 1; k <= steps; ++k) {
    const double a = from + k * step_;
    speeds_.push_back(speed(a));
    const double simpson = speeds_.rbegin()[1] + 4 * speed(a - 0.5 * step_) + speeds_.back();
    lengths_.push_back(lengths_.back() + step_ / 6 * simpson);
  }
  const double origin = length_at(0);
  for (double& length : lengths_) length -= origin;
}

CutLength::Place CutLength::place(std::size_t k, double x) const {
  const double rise = lengths_[k + 1] - lengths_[k];
  const double v0 = step_ * speeds_[k], v1 = step_ * speeds_[k + 1];
  const double c2 = 3 * rise - 2 * v0 - v1, c3 = v0 + v1 - 2 * rise;  // cubic Hermite interpolation
  return {lengths_[k] + x * (v0 + x * (c2 + x * c3)), v0 + x * (2 * c2 + 3 * x * c3)};
}

double CutLength::length_at(double alpha) const {
  const auto last = static_cast<double>(lengths_.size()) - 1;
  const double position = (alpha - from_) / step_;
  if (position < 0) return lengths_.front() + position * step_ * speeds_.front();
  if (position > last) return lengths_.back() + (position - last) * step_ * speeds_.back();
  const double k = std::min(std::floor(position), last - 1);
  return place(static_cast<std::size_t>(k), position - k).length_mm;
}

double CutLength::alpha_at(double length_mm) const {
  const auto last = static_cast<double>(lengths_.size()) - 1;
  if (length_mm < lengths_.front()) return from_ + (length_mm - lengths_.front()) / speeds_.front();
  if (length_mm > lengths_.back()) return from_ + last * step_ + (length_mm - lengths_.back()) / speeds_.back();
  const auto above = std::upper_bound(lengths_.begin() + 1, lengths_.end() - 1, length_mm);
  const auto k = static_cast<std::size_t>(above - lengths_.begin() - 1);
  double x = (length_mm - lengths_[k]) / (lengths_[k + 1] - lengths_[k]);
  for (int newton = 0; newton < 3; ++newton) {
    const Place here = place(k, x);
    x += (length_mm - here.length_mm) / here.slope;
  }
  return from_ + (static_cast<double>(k) + x) * step_;
}

FlatPage::FlatPage(const RuledSurface& model, const Differences& differences, std::span<const Support> places,
                   GutterSide gutter, bool straighten)
    : model_(model),
      differences_(&differences),
      gutter_(gutter),
      straighten_(straighten),
      cut_(model, alpha_range(model, places, gutter).low, alpha_range(model, places, gutter).high) {
  const Range alpha = alpha_range(model, places, gutter);
  length0_ = cut_.length_at(alpha.low) - (gutter == GutterSide::left ? 0 : margin_mm);
  length1_ = cut_.length_at(alpha.high) + (gutter == GutterSide::right ? 0 : margin_mm);
  b0_ = model.b_low - margin_mm;
  b1_ = model.b_high + margin_mm;
  set_nodes(model_node_spacing_mm);
  for (const Support& place : places) places_.push_back(place.plan);

  // To begin with: arc length along the cut, length along the ruling, t downwards.
  Image<Eigen::Vector2d> start(columns_, rows_, Eigen::Vector2d::Zero());
  const Eigen::Rotation2Dd turn(model.frame.angle_rad());
  for (int j = 0; j < rows_; ++j)
    for (int i = 0; i < columns_; ++i) {
      const Eigen::Vector2d up = turn * Eigen::Vector2d(length0_ + i * length_step_, b0_ + j * b_step_);
      start(i, j) = {up.x(), -up.y()};
    }
  lay_flat(start);
  spacing_mm_ = fine_enough_spacing();
}

void FlatPage::set_nodes(double spacing_mm) {
  columns_ = std::max(3, static_cast<int>(std::ceil((length1_ - length0_) / spacing_mm)) + 1);
  length_step_ = (length1_ - length0_) / (columns_ - 1);
  rows_ = std::max(3, static_cast<int>(std::ceil((b1_ - b0_) / spacing_mm)) + 1);
  b_step_ = (b1_ - b0_) / (rows_ - 1);
}

void FlatPage::follow_measurement(const Differences& differences) {
  differences_ = &differences;
  follows_ = true;
  const Image<Eigen::Vector2d> by_model = flat_;
  set_nodes(creased_node_spacing_mm);
  Image<Eigen::Vector2d> start(columns_, rows_);
  for (int j = 0; j < rows_; ++j)
    for (int i = 0; i < columns_; ++i)
      start(i, j) = interpolate_nodes(by_model, i * (by_model.width() - 1.0) / (columns_ - 1),
                                      j * (by_model.height() - 1.0) / (rows_ - 1));
  lay_flat(start);
  spacing_mm_ = fine_enough_spacing();
}

Eigen::Vector3d FlatPage::above(double alpha, double b) const {
  return measured_above(model_, *differences_, model_.point(alpha, b), model_.normal(alpha, b));
}

Eigen::Vector3d FlatPage::surface_point(double alpha, double b) const {
  return follows_ ? above(alpha, b) : model_.point(alpha, b);
}

/// Alpha of columns that divide each of the grid's into `finer`.
std::vector<double> FlatPage::alphas_of(int columns, int finer) const {
  std::vector<double> alphas;
  for (int i = 0; i < columns; ++i) alphas.push_back(alpha_of(double(i) / finer));
  return alphas;
}

void FlatPage::lay_flat(const Image<Eigen::Vector2d>& start) {
  // Lengths of edges and diagonals are sums of chords between the points of a lattice four times as fine.
  constexpr int finer = 4;
  Image<Eigen::Vector3d> lattice(finer * (columns_ - 1) + 1, finer * (rows_ - 1) + 1);
  const std::vector<double> alphas = alphas_of(lattice.width(), finer);
  parallel_rows(lattice.height(), [&](int j) {
    const double b = b_of(double(j) / finer);
    for (int i = 0; i < lattice.width(); ++i) lattice(i, j) = surface_point(alphas[static_cast<std::size_t>(i)], b);
  });
  Sheet sheet{columns_, rows_, [&](double i, double j) {
                return lattice(static_cast<int>(std::lround(finer * i)), static_cast<int>(std::lround(finer * j)));
              }};
  if (follows_)
    sheet.weight = [&](int i, int j) { return is_measured(lattice(finer * i, finer * j)) ? 1 : guessed_weight; };
  flat_ = flatten(sheet, start, &distortion_);
  turn_upright();
  measure_strain();
}

double Strain::share_beyond(double least) const {
  double measured = 0, beyond = 0;
  for (std::size_t k = 0; k < relative.size(); ++k) {
    if (std::isnan(relative.data()[k])) continue;
    ++measured;
    beyond += std::abs(relative.data()[k]) > std::max(least, explained_sigmas * double(sigma.data()[k]));
  }
  return measured > 0 ? beyond / measured : 0;
}

/// Compares the edges of the grid on the measured sheet with the same edges laid flat. A height's noise lengthens an
/// edge by its share of the slope against the model, and on the level by its square.
void FlatPage::measure_strain() {
  Image<Eigen::Vector3d> measured(2 * columns_ - 1, 2 * rows_ - 1);  // nodes and what lies halfway
  Image<float> height_sigma(columns_, rows_, not_a_number);
  const std::vector<double> alphas = alphas_of(measured.width(), 2);
  const auto model_node = [&](int i, int j) { return model_.point(alphas[2 * static_cast<std::size_t>(i)], b_of(j)); };
  parallel_rows(measured.height(), [&](int j) {
    for (int i = 0; i < measured.width(); ++i) {
      measured(i, j) = above(alphas[static_cast<std::size_t>(i)], b_of(0.5 * j));
      PixelStatus status = PixelStatus::not_computed;
      if (i % 2 == 0 && j % 2 == 0) look_up_status(measured(i, j), 1, height_sigma(i / 2, j / 2), status);
    }
  });
  strain_.relative = strain_.sigma = Image<float>(columns_, rows_, not_a_number);
  Image<Eigen::Vector3d> sums(columns_, rows_, Eigen::Vector3d::Zero());  // strain, variance, edges
  const auto add = [&](int i, int j, int i2, int j2) {
    if (i2 >= columns_ || j2 >= rows_) return;
    const double sigma = std::hypot(double(height_sigma(i, j)), double(height_sigma(i2, j2)));
    if (!std::isfinite(sigma)) return;
    const Eigen::Vector3d &a = measured(2 * i, 2 * j), &m = measured(i + i2, j + j2), &b = measured(2 * i2, 2 * j2);
    const double flat = (flat_(i2, j2) - flat_(i, j)).norm();
    const double length = (4 * ((m - a).norm() + (b - m).norm()) - (b - a).norm()) / 3;
    const double chord = (model_node(i2, j2) - model_node(i, j)).norm();
    const double rise = std::sqrt(std::max(0.0, std::pow((b - a).norm() / chord, 2) - 1)), noise = sigma / flat;
    const Eigen::Vector3d edge(length / flat - 1, std::pow(rise * noise, 2) + std::pow(noise, 4), 1);
    sums(i, j) += edge;
    sums(i2, j2) += edge;
  };
  for (int j = 0; j < rows_; ++j)
    for (int i = 0; i < columns_; ++i) {
      add(i, j, i + 1, j);
      add(i, j, i, j + 1);
    }
  for (std::size_t k = 0; k < sums.size(); ++k) {
    const Eigen::Vector3d& sum = sums.data()[k];
    if (!(sum.z() > 0)) continue;
    strain_.relative.data()[k] = static_cast<float>(sum.x() / sum.z());
    strain_.sigma.data()[k] = static_cast<float>(std::sqrt(sum.y()) / sum.z());
  }
}

/// Paper coordinates of the model's spot at a place (p, q).
Eigen::Vector2d FlatPage::paper_at(const Eigen::Vector2d& plan) const {
  const Eigen::Vector2d ruling = model_.frame.ruling_from_plan(plan);
  return interpolate_nodes(flat_, (cut_.length_at(ruling.x()) - length0_) / length_step_, (ruling.y() - b0_) / b_step_);
}

/// Turns the paper so that the gutter runs along t; a single page so that it lies as it is seen from above, or upright
/// if it is far from that. Then shifts (0, 0) to the upper left corner of what is measured.
void FlatPage::turn_upright() {
  double sine = 0, cosine = 0;
  const auto add = [&](const Eigen::Vector2d& is, const Eigen::Vector2d& should) {
    cosine += is.dot(should);
    sine += is.x() * should.y() - is.y() * should.x();
  };
  if (gutter_ != GutterSide::none) {
    const int column = gutter_ == GutterSide::left ? 0 : columns_ - 1;
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (int j = 0; j < rows_; ++j) mean += flat_(column, j) / rows_;
    for (int j = 0; j < rows_; ++j) add(flat_(column, j) - mean, {0, 0.5 * (rows_ - 1) - j});
  } else {
    // The measured places alone: the margin may be bent to any side.
    std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> pairs;
    Eigen::Vector2d mean_flat = Eigen::Vector2d::Zero(), mean_plan = mean_flat;
    for (const Eigen::Vector2d& plan : places_) {
      pairs.emplace_back(paper_at(plan), Eigen::Vector2d(plan.x(), -plan.y()));
      mean_flat += pairs.back().first / static_cast<double>(places_.size());
      mean_plan += pairs.back().second / static_cast<double>(places_.size());
    }
    for (const auto& [flat, plan] : pairs) add(flat - mean_flat, plan - mean_plan);
    if (straighten_) turned_rad_ = straightening(pairs, Eigen::Rotation2Dd(std::atan2(sine, cosine)));
  }
  const Eigen::Rotation2Dd turn(std::atan2(sine, cosine) - turned_rad_);
  for (Eigen::Vector2d& place : flat_.pixels()) place = turn * place;
  find_outline();
}

/// Where the measured places lie on the paper, with a margin but none at the gutter.
void FlatPage::find_outline() {
  Range s, t;
  for (const Eigen::Vector2d& plan : places_) {
    const Eigen::Vector2d ruling = model_.frame.ruling_from_plan(plan);
    const Eigen::Vector2d paper =
        interpolate_nodes(flat_, (cut_.length_at(ruling.x()) - length0_) / length_step_, (ruling.y() - b0_) / b_step_);
    s.include(paper.x());
    t.include(paper.y());
  }
  const auto gutter_s = [&](int column) {
    double mean = 0;
    for (int j = 0; j < rows_; ++j) mean += flat_(column, j).x() / rows_;
    return mean;
  };
  if (gutter_ == GutterSide::left) s.low = gutter_s(0);
  if (gutter_ == GutterSide::right) s.high = gutter_s(columns_ - 1);
  const Eigen::Vector2d corner(s.low, t.low);
  for (Eigen::Vector2d& place : flat_.pixels()) place -= corner;
  low_ = {gutter_ == GutterSide::left ? 0 : -margin_mm, -margin_mm};
  high_ = {s.high - s.low + (gutter_ == GutterSide::right ? 0 : margin_mm), t.high - t.low + margin_mm};
}

/// Grid position of a paper spot, by Newton's method.
Eigen::Vector2d FlatPage::node_at(const Eigen::Vector2d& paper, Eigen::Vector2d guess) const {
  constexpr double near = 1e-4;  // [nodes] a step of so much leaves about its square
  for (int step = 0; step < 8; ++step) {
    const InterpolatedNode here = differentiate_nodes(flat_, guess.x(), guess.y());
    const Eigen::Vector2d move = here.jacobian.inverse() * (paper - here.value);
    guess += move;
    if (move.cwiseAbs().maxCoeff() < near) break;
  }
  return guess;
}

PageSurface FlatPage::empty_page(double spacing_mm) const {
  PageSurface page;
  page.spacing_mm = spacing_mm;
  const int columns = static_cast<int>(std::ceil((high_.x() - low_.x()) / spacing_mm)) + 1;
  const int rows = static_cast<int>(std::ceil((high_.y() - low_.y()) / spacing_mm)) + 1;
  page.t0_mm = low_.y();
  // The grid ends exactly at the gutter; what the last cell is too wide goes to the other side.
  page.s0_mm = gutter_ == GutterSide::right ? high_.x() - (columns - 1) * spacing_mm : low_.x();
  page.gutter_at_left = gutter_ == GutterSide::left;
  page.gutter_at_right = gutter_ == GutterSide::right;
  page.model = Image<Eigen::Vector3f>(columns, rows, Eigen::Vector3f::Zero());
  return page;
}

PageSurface FlatPage::sample(const PlanFrame& frame) const {
  PageSurface page = empty_page(spacing_mm_);
  page.turned_rad = turned_rad_;
  page.measured = page.model;
  page.sigma = Image<float>(page.columns(), page.rows(), not_a_number);
  page.status = Image<PixelStatus>(page.columns(), page.rows(), PixelStatus::not_computed);
  page.strain = page.strain_sigma = page.cover_mm = page.sigma;
  for_each_node(page, [&](int i, int j, const Eigen::Vector2d& node) {
    const double alpha = alpha_of(node.x()), b = b_of(node.y());
    const Eigen::Vector3d point = model_.point(alpha, b), normal = model_.normal(alpha, b);
    const Eigen::Vector3d measured = measured_above(model_, *differences_, point, normal);
    look_up_status(measured, normal.z(), page.sigma(i, j), page.status(i, j));
    page.cover_mm(i, j) = cover_above(measured);
    const int column = std::clamp(static_cast<int>(std::lround(node.x())), 0, columns_ - 1);
    const int row = std::clamp(static_cast<int>(std::lround(node.y())), 0, rows_ - 1);
    page.strain(i, j) = strain_.relative(column, row);
    page.strain_sigma(i, j) = strain_.sigma(column, row);
    page.measured(i, j) = frame.rig_from_plan(measured).cast<float>();
    page.model(i, j) = frame.rig_from_plan(follows_ ? measured : point).cast<float>();
  });
  return page;
}

template <class Use>
void FlatPage::for_each_node(const PageSurface& page, const Use& use) const {
  parallel_rows(page.rows(), [&](int j) {
    Eigen::Vector2d node(0.5 * (columns_ - 1), 0.5 * (rows_ - 1)), step = Eigen::Vector2d::Zero();
    for (int i = 0; i < page.columns(); ++i) {
      const Eigen::Vector2d next = node_at({page.s_of(i), page.t_of(j)}, node + step);
      if (i > 0) step = next - node;
      node = next;
      use(i, j, node);
    }
  });
}

bool FlatPage::is_measured(const Eigen::Vector3d& point) const {
  float sigma = not_a_number;
  PixelStatus status = PixelStatus::not_computed;
  look_up_status(point, 1, sigma, status);
  return status == PixelStatus::ok;
}

void FlatPage::look_up_status(const Eigen::Vector3d& measured, double normal_z, float& sigma,
                              PixelStatus& status) const {
  const int i = static_cast<int>(std::lround(differences_->field->i_of(measured.x())));
  const int j = static_cast<int>(std::lround(differences_->field->j_of(measured.y())));
  if (!differences_->status.contains(i, j)) return;
  status = differences_->status(i, j);
  sigma = differences_->sigma(i, j) * static_cast<float>(normal_z);
}

float FlatPage::cover_above(const Eigen::Vector3d& measured) const {
  const int i = static_cast<int>(std::lround(differences_->field->i_of(measured.x())));
  const int j = static_cast<int>(std::lround(differences_->field->j_of(measured.y())));
  return differences_->cover_mm.contains(i, j) ? differences_->cover_mm(i, j) : not_a_number;
}

/// Largest error of the interpolated model in the middle of cells, a sample of their rows, the gutter's among them.
double FlatPage::interpolation_error(double spacing_mm) const {
  const PageSurface page = empty_page(spacing_mm);
  double largest = 0;
  for (int j = 1; j + 2 < page.rows(); j += std::max(1, page.rows() / 8)) {
    PageSurface strip;  // the four rows of nodes that have a say in the middle of a cell
    strip.spacing_mm = spacing_mm;
    strip.s0_mm = page.s0_mm;
    strip.t0_mm = page.t_of(j - 1);
    strip.model = Image<Eigen::Vector3f>(page.columns(), 4, Eigen::Vector3f::Zero());
    for_each_node(strip, [&](int i, int k, const Eigen::Vector2d& node) {
      strip.model(i, k) = surface_point(alpha_of(node.x()), b_of(node.y())).cast<float>();
    });
    Eigen::Vector2d node(0.5 * (columns_ - 1), 0.5 * (rows_ - 1));
    for (int i = 0; i + 1 < page.columns(); ++i) {
      const double s = strip.s_of(i + 0.5), t = strip.t_of(1.5);
      node = node_at({s, t}, node);
      const Eigen::Vector3d should = surface_point(alpha_of(node.x()), b_of(node.y()));
      largest = std::max(largest, (interpolate(strip, strip.model, s, t) - should).norm());
    }
  }
  return largest;
}

double FlatPage::fine_enough_spacing() const {
  double spacing = coarsest_spacing_mm;
  while (0.75 * spacing > finest_spacing_mm && interpolation_error(spacing) > interpolation_error_mm) spacing *= 0.75;
  return spacing;
}

}  // namespace pagesweep
