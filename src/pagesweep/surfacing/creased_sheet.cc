// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/creased_sheet.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

constexpr int most_steps = 60;       // of conjugate gradients a round
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

  /// Adds the derivative of half the bending energy: sum over nodes of the adjoint second differences of
  /// stiffness h^2 (W H + H W) / 2.
  void add_bending(const Field& z, Field& result) const {
    Image<Bending> moment(columns(), rows());
    const double h2 = h_ * h_;
    parallel_rows(rows(), [&](int j) {
      for (int i = 0; i < columns(); ++i) {
        const Bending b = bending(z, i, j), w = weights_(i, j);
        const auto scale = static_cast<float>(stiffness_ * h2);
        moment(i, j) = {scale * (w.pp * b.pp + w.pq * b.pq),
                        scale * (w.pq * (b.pp + b.qq) + (w.pp + w.qq) * b.pq),  // both pq and qp
                        scale * (w.qq * b.qq + w.pq * b.pq)};
        const std::uint8_t has = has_(i, j);
        if (!(has & has_pp)) moment(i, j).pp = 0;
        if (!(has & has_qq)) moment(i, j).qq = 0;
        if (!(has & has_pq)) moment(i, j).pq = 0;
      }
    });
    parallel_rows(rows(), [&](int j) {
      const int above = std::min(j + 1, rows() - 1), below = std::max(j - 1, 0);  // nodes at the border have no moment
      for (int i = 0; i < columns(); ++i) {
        if (!within_(i, j)) continue;
        const int left = std::max(i - 1, 0), right = std::min(i + 1, columns() - 1);
        double sum = double(moment(left, j).pp) + moment(right, j).pp - 2 * double(moment(i, j).pp);
        sum += double(moment(i, below).qq) + moment(i, above).qq - 2 * double(moment(i, j).qq);
        sum += (double(moment(left, below).pq) + moment(right, above).pq - moment(left, above).pq -
                moment(right, below).pq) /
               4;
        result(i, j) += sum / h2;
      }
    });
  }

  /// Adds B' w (B z - readings), or B' w B z alone.
  void add_readings(const Field& z, bool with_data, Field& result) const {
    for (const auto& row : readings_)
      for (const Reading& r : row) {
        const double push = r.weight * r.robust * (value(z, r) - (with_data ? r.z : 0));
        result(r.i, r.j) += r.share[0] * push;
        result(r.i + 1, r.j) += r.share[1] * push;
        result(r.i, r.j + 1) += r.share[2] * push;
        result(r.i + 1, r.j + 1) += r.share[3] * push;
      }
  }

  Field diagonal() const {
    Field diagonal(columns(), rows(), 1e-12);
    const double h2 = h_ * h_;
    for (int j = 0; j < rows(); ++j)
      for (int i = 0; i < columns(); ++i)
        diagonal(i, j) += stiffness_ / h2 *
                          (4 * (double(weights_(i, j).pp) + weights_(i, j).qq) +
                           0.25 * (double(weights_(i, j).pp) + weights_(i, j).qq));
    for (const auto& row : readings_)
      for (const Reading& r : row)
        for (int k = 0; k < 4; ++k)
          diagonal(r.i + k % 2, r.j + k / 2) +=
              r.weight * r.robust * r.share[static_cast<std::size_t>(k)] * r.share[static_cast<std::size_t>(k)];
    return diagonal;
  }

  static double dot(const Field& a, const Field& b) {
    std::vector<double> sums(static_cast<std::size_t>(a.height()), 0);
    parallel_rows(a.height(), [&](int j) {
      for (int i = 0; i < a.width(); ++i) sums[static_cast<std::size_t>(j)] += a(i, j) * b(i, j);
    });
    return std::accumulate(sums.begin(), sums.end(), 0.0);
  }

  /// Calls use(k) for every node.
  template <class Use>
  void for_each_node(const Use& use) const {
    const auto width = static_cast<std::size_t>(columns());
    parallel_rows(rows(), [&](int j) {
      for (std::size_t k = static_cast<std::size_t>(j) * width; k < (static_cast<std::size_t>(j) + 1) * width; ++k)
        use(k);
    });
  }

  /// Conjugate gradients from the present heights.
  void improve() {
    const Field scale = diagonal();
    Field whole = z_;
    for (std::size_t k = 0; k < whole.size(); ++k) whole.data()[k] += base_.data()[k];
    Field residual(columns(), rows(), 0);
    add_bending(whole, residual);
    add_readings(z_, true, residual);
    Field direction(columns(), rows(), 0), scaled = direction;
    const auto precondition = [&] {
      for_each_node(
          [&](std::size_t k) { scaled.data()[k] = within_.data()[k] ? -residual.data()[k] / scale.data()[k] : 0; });
    };
    precondition();
    direction = scaled;
    double slope = -dot(residual, scaled);
    const double first = slope;
    for (int step = 0; step < most_steps && slope > settled * settled * first; ++step) {
      Field bent(columns(), rows(), 0);
      add_bending(direction, bent);
      add_readings(direction, false, bent);
      const double length = slope / dot(direction, bent);
      for_each_node([&](std::size_t k) {
        z_.data()[k] += length * direction.data()[k];
        residual.data()[k] += length * bent.data()[k];
      });
      precondition();
      const double next = -dot(residual, scaled);
      const double keep = next / slope;
      for_each_node([&](std::size_t k) { direction.data()[k] = scaled.data()[k] + keep * direction.data()[k]; });
      slope = next;
    }
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
  return CreasedSheet(cells, base, cell_mm, noise_factor, within, start, options).fit();
}

}  // namespace pagesweep
