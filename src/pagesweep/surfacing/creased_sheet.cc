// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/creased_sheet.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "pagesweep/base/parallel.h"
#include "pagesweep/surfacing/sheet_operator.h"

namespace pagesweep {
namespace {

constexpr int most_steps = 60;       // of conjugate gradients a round
constexpr int rows_at_once = 16;     // for a thread
constexpr double settled = 1e-3;     // of the gradient's length against the round's first
constexpr double robust_sigmas = 3;  // Cauchy's weights

/// Second derivatives, and what multiplies them. Zero where a neighbour is missing.
struct Bending {
  float pp = 0, pq = 0, qq = 0;
};

/// The mean height of a cell's points as a sum over the four nodes around their mean place.
struct Reading {
  int i = 0, j = 0;  // of the lower left node
  std::array<double, 4> share{};
  double z = 0;
  double weight = 0;
  double robust = 1;
};

/// The part of a grid in which there is a sheet.
struct Extent {
  int i0, j0, i1, j1;  ///< first, and one beyond the last
  bool empty() const { return i1 <= i0; }
  template <class T>
  Image<T> cut(const Image<T>& whole) const {
    Image<T> part(i1 - i0, j1 - j0);
    for (int j = j0; j < j1; ++j)
      for (int i = i0; i < i1; ++i) part(i - i0, j - j0) = whole(i, j);
    return part;
  }
};

Extent extent_of(const Image<std::uint8_t>& within) {
  Extent extent{within.width(), within.height(), 0, 0};
  for (int j = 0; j < within.height(); ++j)
    for (int i = 0; i < within.width(); ++i)
      if (within(i, j))
        extent = {std::min(extent.i0, i), std::min(extent.j0, j), std::max(extent.i1, i + 1),
                  std::max(extent.j1, j + 1)};
  // A sheet of paper has a second row and column.
  if (!extent.empty() && (extent.i1 - extent.i0 < 2 || extent.j1 - extent.j0 < 2)) return {0, 0, 0, 0};
  return extent;
}

class CreasedSheet {
 public:
  CreasedSheet(const Image<CellMean>& cells, const Image<double>& base, double cell_mm, double noise_factor,
               const Image<std::uint8_t>& within, const Image<double>& start, const CreaseOptions& options)
      : base_(base),
        h_(cell_mm),
        within_(within),
        options_(options),
        z_(start),
        weights_(start.width(), start.height()) {
    note_neighbours();
    readings_.resize(static_cast<std::size_t>(rows()));
    parallel_rows(rows(), [&](int j) {
      for (int i = 0; i < columns(); ++i)
        if (within_(i, j) && cells(i, j).weight > 0) add_reading(cells(i, j), i, j, noise_factor);
    });
    std::vector<double> weights;
    for (const auto& row : readings_)
      for (const Reading& reading : row) weights.push_back(reading.weight);
    if (weights.empty()) return;
    const auto middle = weights.begin() + static_cast<std::ptrdiff_t>(weights.size() / 2);
    std::ranges::nth_element(weights, middle);
    // A fold of length L between two places r on either side of it costs its angle times 2 tau L, and takes away
    // sqrt(rho r^3 L / 6) standard deviations of noise a radian. With this tau three of them are not worth a fold where
    // r and L are the smoothing width.
    const double density = *middle / (h_ * h_);
    stiffness_ = 0.3 * options.smoothing_mm * std::sqrt(density);
  }

  Image<double> fit() {
    if (!(stiffness_ > 0)) return z_;
    for (int round = 0; round < options_.rounds; ++round) {
      weigh_bending();
      weigh_readings(round + 2 >= options_.rounds);
      improve();
    }
    return z_;
  }

 private:
  using Field = Image<double>;
  int columns() const { return z_.width(); }
  int rows() const { return z_.height(); }
  bool is_in(int i, int j) const { return within_.contains(i, j) && within_(i, j); }

  /// Which second derivatives a node has: those whose neighbours are all within.
  enum Has : std::uint8_t { has_pp = 1, has_qq = 2, has_pq = 4 };
  void note_neighbours() {
    has_ = Image<std::uint8_t>(columns(), rows(), 0);
    parallel_rows(rows(), [&](int j) {
      for (int i = 0; i < columns(); ++i) {
        if (!within_(i, j)) continue;
        const bool pp = is_in(i - 1, j) && is_in(i + 1, j), qq = is_in(i, j - 1) && is_in(i, j + 1);
        const bool pq = is_in(i - 1, j - 1) && is_in(i + 1, j - 1) && is_in(i - 1, j + 1) && is_in(i + 1, j + 1);
        has_(i, j) = static_cast<std::uint8_t>(has_pp * pp + has_qq * qq + has_pq * pq);
      }
    });
  }

  void add_reading(const CellMean& cell, int i, int j, double noise_factor) {
    constexpr double model_noise_mm = 0.01;
    const double x = i + cell.p / h_, y = j + cell.q / h_;
    Reading r;
    r.i = static_cast<int>(std::floor(x)), r.j = static_cast<int>(std::floor(y));
    if (is_in(r.i, r.j) && is_in(r.i + 1, r.j) && is_in(r.i, r.j + 1) && is_in(r.i + 1, r.j + 1)) {
      const double a = x - r.i, b = y - r.j;
      r.share = {(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b};
    } else {
      r.i = std::min(i, columns() - 2), r.j = std::min(j, rows() - 2);
      r.share[static_cast<std::size_t>((i - r.i) + 2 * (j - r.j))] = 1;
    }
    r.z = cell.z;
    r.weight = 1 / (noise_factor * noise_factor / cell.weight + model_noise_mm * model_noise_mm);
    readings_[static_cast<std::size_t>(j)].push_back(r);
  }

  template <class T>
  static double value(const Image<T>& field, const Reading& r) {
    return r.share[0] * field(r.i, r.j) + r.share[1] * field(r.i + 1, r.j) + r.share[2] * field(r.i, r.j + 1) +
           r.share[3] * field(r.i + 1, r.j + 1);
  }

  Bending bending(const Field& z, int i, int j) const {
    Bending b;
    const std::uint8_t has = has_(i, j);
    const double h2 = h_ * h_;
    if (has & has_pp) b.pp = static_cast<float>((z(i - 1, j) - 2 * z(i, j) + z(i + 1, j)) / h2);
    if (has & has_qq) b.qq = static_cast<float>((z(i, j - 1) - 2 * z(i, j) + z(i, j + 1)) / h2);
    if (has & has_pq)
      b.pq = static_cast<float>((z(i + 1, j + 1) - z(i - 1, j + 1) - z(i + 1, j - 1) + z(i - 1, j - 1)) / (4 * h2));
    return b;
  }

  /// W = (H^2 + curvature^2)^(-1/2), so that tr(W H^2) is about the nuclear norm of H.
  void weigh_bending() {
    Field whole = z_;
    for (std::size_t k = 0; k < whole.size(); ++k) whole.data()[k] += base_.data()[k];
    const double least = std::pow(options_.sharp_curvature_per_mm, 2);
    parallel_rows(rows(), [&](int j) {
      for (int i = 0; i < columns(); ++i) {
        const Bending b = bending(whole, i, j);
        Eigen::Matrix2d square;
        square(0, 0) = double(b.pp) * b.pp + double(b.pq) * b.pq + least;
        square(1, 1) = double(b.qq) * b.qq + double(b.pq) * b.pq + least;
        square(0, 1) = square(1, 0) = double(b.pq) * (double(b.pp) + b.qq);
        // The root of a 2 x 2 matrix M is (M + sqrt(det M)) / sqrt(tr M + 2 sqrt(det M)).
        const double root = std::sqrt(std::max(square.determinant(), 0.0));
        const Eigen::Matrix2d half =
            (square + root * Eigen::Matrix2d::Identity()) / std::sqrt(square.trace() + 2 * root);
        const Eigen::Matrix2d inverse = half.inverse();
        weights_(i, j) = {static_cast<float>(inverse(0, 0)), static_cast<float>(inverse(0, 1)),
                          static_cast<float>(inverse(1, 1))};
      }
    });
  }

  void weigh_readings(bool robust) {
    parallel_rows(rows(), [&](int j) {
      for (Reading& r : readings_[static_cast<std::size_t>(j)]) {
        const double residual = value(z_, r) - r.z;
        r.robust = robust ? 1 / (1 + residual * residual * r.weight / (robust_sigmas * robust_sigmas)) : 1;
      }
    });
  }

  /// The derivative of half the energy by the heights, as a matrix and its constant part. Twice the bending energy is
  /// the sum over nodes of stiffness h^2 tr(W H^2).
  void assemble(SheetOperator& sheet, NodeField& pull) const {
    const double unit = stiffness_ / (h_ * h_);
    parallel_rows(rows(), [&](int j) {
      for (int i = 0; i < columns(); ++i) {
        const Bending& w = weights_(i, j);
        const std::uint8_t has = has_(i, j);
        const auto if_has = [&](int derivatives, float weight) {
          return (has & derivatives) == derivatives ? static_cast<float>(unit * double(weight)) : 0.0f;
        };
        sheet.pp_pp(i, j) = if_has(has_pp, w.pp);
        sheet.qq_qq(i, j) = if_has(has_qq, w.qq);
        sheet.pp_pq(i, j) = if_has(has_pp | has_pq, w.pq);
        sheet.qq_pq(i, j) = if_has(has_qq | has_pq, w.pq);
        sheet.pq_pq(i, j) = if_has(has_pq, w.pp + w.qq);  // both pq and qp
      }
    });
    for (const auto& row : readings_)
      for (const Reading& r : row) add_products(r, sheet, pull);
  }

  static void add_products(const Reading& r, SheetOperator& sheet, NodeField& pull) {
    const auto weight = static_cast<float>(r.weight * r.robust), push = weight * static_cast<float>(r.z);
    std::array<float, 4> share{};
    for (std::size_t k = 0; k < 4; ++k) {
      const int i = r.i + static_cast<int>(k % 2), j = r.j + static_cast<int>(k / 2);
      share[k] = static_cast<float>(r.share[k]);
      sheet.self(i, j) += weight * share[k] * share[k];
      pull(i, j) += push * share[k];
    }
    sheet.right(r.i, r.j) += weight * share[0] * share[1];
    sheet.right(r.i, r.j + 1) += weight * share[2] * share[3];
    sheet.upper(r.i, r.j) += weight * share[0] * share[2];
    sheet.upper(r.i + 1, r.j) += weight * share[1] * share[3];
    sheet.upper_right(r.i, r.j) += weight * share[0] * share[3];
    sheet.upper_left(r.i + 1, r.j) += weight * share[1] * share[2];
  }

  /// The matrix's diagonal, roughly: as if a node had its neighbours' weights.
  NodeField diagonal(const SheetOperator& sheet) const {
    constexpr double bending = 4 + 0.25;
    NodeField diagonal(columns(), rows(), 1);
    const double unit = bending * stiffness_ / (h_ * h_);
    parallel_rows(rows(), [&](int j) {
      for (int i = 0; i < columns(); ++i)
        if (within_(i, j))
          diagonal(i, j) =
              sheet.self(i, j) + static_cast<float>(unit * (double(weights_(i, j).pp) + double(weights_(i, j).qq)));
    });
    return diagonal;
  }

  /// Adds up what each row gives, whatever the order in which rows are done.
  template <class Row>
  double sum_rows(const Row& of_row) const {
    std::vector<double> sums(static_cast<std::size_t>(rows()), 0);
    parallel_ranges(rows(), rows_at_once, [&](int begin, int end) {
      for (int j = begin; j < end; ++j) sums[static_cast<std::size_t>(j)] = of_row(j);
    });
    return std::accumulate(sums.begin(), sums.end(), 0.0);
  }

  void apply(const SheetOperator& sheet, const NodeField& bent, const NodeField& lifted, NodeField& result) const {
    parallel_ranges(rows(), rows_at_once,
                    [&](int begin, int end) { apply_rows(sheet, bent, lifted, begin, end, result); });
  }

  /// Conjugate gradients from the present heights.
  void improve() {
    SheetOperator sheet(columns(), rows());
    NodeField pull(columns(), rows());
    assemble(sheet, pull);
    const NodeField scale = diagonal(sheet);
    NodeField whole(columns(), rows()), place = whole, residual = whole, scaled = whole, bent = whole,
                                        direction = whole;
    for (int j = 0; j < rows(); ++j)
      for (int i = 0; i < columns(); ++i) {
        place(i, j) = static_cast<float>(z_(i, j));
        whole(i, j) = static_cast<float>(z_(i, j) + base_(i, j));
      }
    apply(sheet, whole, place, residual);
    for (int j = 0; j < rows(); ++j)
      for (int i = 0; i < columns(); ++i) residual(i, j) -= pull(i, j);
    const auto step = [&](double length) {
      return sum_rows([&](int j) {
        return step_row(static_cast<float>(length), direction, bent, scale, j, place, residual, scaled);
      });
    };
    double slope = step(0);
    direction = scaled;
    const double first = slope;
    for (int steps = 0; steps < most_steps && slope > settled * settled * first; ++steps) {
      apply(sheet, direction, direction, bent);
      const double length = slope / sum_rows([&](int j) { return dot_row(direction, bent, j); });
      const double next = step(length);
      parallel_ranges(rows(), rows_at_once, [&](int begin, int end) {
        for (int j = begin; j < end; ++j) turn_row(static_cast<float>(next / slope), scaled, j, direction);
      });
      slope = next;
    }
    for (int j = 0; j < rows(); ++j)
      for (int i = 0; i < columns(); ++i)
        if (within_(i, j)) z_(i, j) = static_cast<double>(place(i, j));
  }

  const Field& base_;
  double h_;
  const Image<std::uint8_t>& within_;
  CreaseOptions options_;
  Field z_;
  Image<std::uint8_t> has_;  ///< of each node
  Image<Bending> weights_;   ///< W, symmetric
  std::vector<std::vector<Reading>> readings_;
  double stiffness_ = 0;
};

}  // namespace

Image<double> fit_creased_sheet(const Image<CellMean>& cells, const Image<double>& base, double cell_mm,
                                double noise_factor, const Image<std::uint8_t>& within, const Image<double>& start,
                                const CreaseOptions& options) {
  const Extent extent = extent_of(within);
  if (extent.empty()) return start;
  const Image<std::uint8_t> inside = extent.cut(within);
  const Image<double> ground = extent.cut(base);
  CreasedSheet sheet(extent.cut(cells), ground, cell_mm, noise_factor, inside, extent.cut(start), options);
  const Image<double> fitted = sheet.fit();
  Image<double> heights = start;
  for (int j = 0; j < fitted.height(); ++j)
    for (int i = 0; i < fitted.width(); ++i) heights(extent.i0 + i, extent.j0 + j) = fitted(i, j);
  return heights;
}

}  // namespace pagesweep
