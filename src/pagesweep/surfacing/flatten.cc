// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/flatten.h"

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

namespace pagesweep {
namespace {

constexpr int most_steps = 12;
constexpr double settled_mm = 1e-5;
constexpr double held_weight = 1e3;

struct Edge {
  int from, to;  // node numbers
  double length_mm;
  double weight;
};

/// Length of the surface curve between two nodes. The chord errs by (h / R)^2 / 24, two half chords by a quarter of
/// that; extrapolated, the error is of fourth order.
double curve_length(const Sheet& sheet, double i0, double j0, double i1, double j1) {
  const auto chords = [&](int pieces) {
    double sum = 0;
    Eigen::Vector3d before = sheet.at(i0, j0);
    for (int k = 1; k <= pieces; ++k) {
      const double share = static_cast<double>(k) / pieces;
      const Eigen::Vector3d next = sheet.at(i0 + share * (i1 - i0), j0 + share * (j1 - j0));
      sum += (next - before).norm();
      before = next;
    }
    return sum;
  };
  return (4 * chords(4) - chords(2)) / 3;
}

std::vector<Edge> edges_of(const Sheet& sheet) {
  constexpr std::array<std::pair<int, int>, 4> directions{{{1, 0}, {0, 1}, {1, 1}, {-1, 1}}};
  std::vector<Edge> edges;
  for (int j = 0; j < sheet.rows; ++j)
    for (int i = 0; i < sheet.columns; ++i)
      for (const auto& [di, dj] : directions) {
        const int i2 = i + di, j2 = j + dj;
        if (i2 < 0 || i2 >= sheet.columns || j2 >= sheet.rows) continue;
        const double weight = sheet.weight ? std::min(sheet.weight(i, j), sheet.weight(i2, j2)) : 1;
        edges.push_back({j * sheet.columns + i, j2 * sheet.columns + i2, curve_length(sheet, i, j, i2, j2), weight});
      }
  return edges;
}

double energy(const std::vector<Edge>& edges, const Eigen::VectorXd& places) {
  double sum = 0;
  for (const Edge& e : edges) {
    const double length = (places.segment<2>(2 * e.to) - places.segment<2>(2 * e.from)).norm();
    sum += e.weight * std::pow(length / e.length_mm - 1, 2);
  }
  return sum;
}

/// The Gauss-Newton step. Three coordinates, which turn and shift the whole, are held: both of the middle node and one
/// of a node at the border.
class Relaxation {
 public:
  Relaxation(const Sheet& sheet, std::vector<Edge> edges, Eigen::VectorXd places)
      : edges_(std::move(edges)), places_(std::move(places)) {
    const int middle = (sheet.rows / 2) * sheet.columns + sheet.columns / 2;
    const int below = middle % sheet.columns;
    const int other = below == middle ? middle + sheet.columns : below;
    // The one that a turn about the middle changes most.
    const Eigen::Vector2d arm = places_.segment<2>(2 * other) - places_.segment<2>(2 * middle);
    held_ = {2 * middle, 2 * middle + 1, 2 * other + (std::abs(arm.x()) > std::abs(arm.y()) ? 1 : 0)};
  }

  void run() {
    double before = energy(edges_, places_);
    for (int step = 0; step < most_steps; ++step) {
      Eigen::VectorXd move = next_move(step > 0);
      Eigen::VectorXd trial = places_ + move;
      double after = energy(edges_, trial);
      for (int halving = 0; halving < 8 && !(after <= before); ++halving) {
        move *= 0.5;
        trial = places_ + move;
        after = energy(edges_, trial);
      }
      if (!(after <= before)) return;
      places_ = trial;
      before = after;
      if (move.lpNorm<Eigen::Infinity>() < settled_mm) return;
    }
  }

  const Eigen::VectorXd& places() const { return places_; }
  Distortion distortion() const {
    Distortion d;
    double weights = 0;
    for (const Edge& e : edges_) {
      const double length = (places_.segment<2>(2 * e.to) - places_.segment<2>(2 * e.from)).norm();
      if (e.weight == 1) d.largest = std::max(d.largest, std::abs(length / e.length_mm - 1));
      weights += e.weight;
    }
    d.rms = std::sqrt(energy(edges_, places_) / weights);
    return d;
  }

 private:
  /// Derivative of an edge's residual sqrt(weight) (length / length_mm - 1) by its end `to`, and the residual.
  std::pair<Eigen::Vector2d, double> derivative(const Edge& e) const {
    const Eigen::Vector2d along = places_.segment<2>(2 * e.to) - places_.segment<2>(2 * e.from);
    const double length = along.norm(), root = std::sqrt(e.weight);
    return {root * along / (length * e.length_mm), root * (length / e.length_mm - 1)};
  }

  /// The Gauss-Newton step from the present places. The matrix hardly changes from one to the next: an earlier one,
  /// factorised, makes conjugate gradients converge in a few steps. It is factorised anew only where it does not.
  Eigen::VectorXd next_move(bool factorised) {
    Eigen::VectorXd pull = Eigen::VectorXd::Zero(places_.size());  // the gradient's opposite
    derivatives_.resize(edges_.size());
    for (std::size_t k = 0; k < edges_.size(); ++k) {
      const auto [g, residual] = derivative(edges_[k]);
      derivatives_[k] = g;
      pull.segment<2>(2 * edges_[k].to) -= residual * g;
      pull.segment<2>(2 * edges_[k].from) += residual * g;
    }
    if (factorised)
      if (auto move = conjugate_gradients(pull)) return *std::move(move);
    factorise();
    return cholesky_.solve(pull);
  }

  std::optional<Eigen::VectorXd> conjugate_gradients(Eigen::VectorXd left) const {
    constexpr int most = 12;
    constexpr double accuracy = 1e-3;
    Eigen::VectorXd move = Eigen::VectorXd::Zero(left.size()), direction = cholesky_.solve(left);
    double slope = left.dot(direction);
    const double first = slope;
    for (int step = 0; step < most && slope > 0; ++step) {
      const Eigen::VectorXd bent = multiply(direction);
      const double length = slope / direction.dot(bent);
      move += length * direction;
      left -= length * bent;
      const Eigen::VectorXd scaled = cholesky_.solve(left);
      const double next = left.dot(scaled);
      if (!(next > accuracy * accuracy * first)) return move;
      direction = scaled + next / slope * direction;
      slope = next;
    }
    return std::nullopt;
  }

  Eigen::VectorXd multiply(const Eigen::VectorXd& v) const {
    Eigen::VectorXd product = Eigen::VectorXd::Zero(v.size());
    for (const int k : held_) product(k) += held_weight * v(k);
    for (std::size_t k = 0; k < edges_.size(); ++k) {
      const Edge& e = edges_[k];
      const Eigen::Vector2d& g = derivatives_[k];
      const Eigen::Vector2d force = g.dot(v.segment<2>(2 * e.to) - v.segment<2>(2 * e.from)) * g;
      product.segment<2>(2 * e.to) += force;
      product.segment<2>(2 * e.from) -= force;
    }
    return product;
  }

  void factorise() {
    std::vector<Eigen::Triplet<double>> entries;
    entries.reserve(16 * edges_.size());
    for (std::size_t k = 0; k < edges_.size(); ++k) {
      const Edge& e = edges_[k];
      const Eigen::Vector2d& g = derivatives_[k];
      for (const int row : {e.from, e.to})
        for (const int column : {e.from, e.to})
          for (int a = 0; a < 2; ++a)
            for (int b = 0; b < 2; ++b)
              if (2 * row + a >= 2 * column + b)
                entries.emplace_back(2 * row + a, 2 * column + b, (row == column ? 1 : -1) * g(a) * g(b));
    }
    for (const int k : held_) entries.emplace_back(k, k, held_weight);
    Eigen::SparseMatrix<double> hessian(places_.size(), places_.size());
    hessian.setFromTriplets(entries.begin(), entries.end());
    if (!analysed_) cholesky_.analyzePattern(hessian);
    analysed_ = true;
    cholesky_.factorize(hessian);
  }

  std::vector<Edge> edges_;
  Eigen::VectorXd places_;
  std::vector<Eigen::Vector2d> derivatives_;  ///< of each edge's residual by its end `to`
  std::array<int, 3> held_{};
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> cholesky_;
  bool analysed_ = false;
};

}  // namespace

Image<Eigen::Vector2d> flatten(const Sheet& sheet, const Image<Eigen::Vector2d>& start, Distortion* distortion) {
  if (sheet.columns < 2 || sheet.rows < 2 || start.width() != sheet.columns || start.height() != sheet.rows)
    throw std::invalid_argument("flatten: a start place is needed for each of at least 2 x 2 nodes");
  Eigen::VectorXd places(2 * static_cast<Eigen::Index>(start.size()));
  for (std::size_t k = 0; k < start.size(); ++k) places.segment<2>(2 * static_cast<Eigen::Index>(k)) = start.data()[k];
  Relaxation relaxation(sheet, edges_of(sheet), std::move(places));
  relaxation.run();
  if (distortion) *distortion = relaxation.distortion();
  Image<Eigen::Vector2d> flat(sheet.columns, sheet.rows);
  for (std::size_t k = 0; k < flat.size(); ++k)
    flat.data()[k] = relaxation.places().segment<2>(2 * static_cast<Eigen::Index>(k));
  return flat;
}

InterpolatedNode differentiate_nodes(const Image<Eigen::Vector2d>& nodes, double i, double j) {
  const NodeWeights columns(i, nodes.width()), rows(j, nodes.height());
  const auto wi = columns.values(), wj = rows.values(), di = columns.slopes(), dj = rows.slopes();
  InterpolatedNode node;
  for (std::size_t b = 0; b < 4; ++b) {
    Eigen::Vector2d row = Eigen::Vector2d::Zero(), row_slope = row;
    for (std::size_t a = 0; a < 4; ++a) {
      const int column = columns.first + static_cast<int>(a), line = rows.first + static_cast<int>(b);
      if (!nodes.contains(column, line)) continue;
      row += wi[a] * nodes(column, line);
      row_slope += di[a] * nodes(column, line);
    }
    node.value += wj[b] * row;
    node.jacobian.col(0) += wj[b] * row_slope;
    node.jacobian.col(1) += dj[b] * row;
  }
  return node;
}

}  // namespace pagesweep
