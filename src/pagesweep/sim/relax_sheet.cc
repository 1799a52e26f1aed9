// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/relax_sheet.h"

#include <Eigen/SparseCholesky>
#include <array>

namespace pagesweep::sim {
namespace {

using SparseMatrix = Eigen::SparseMatrix<double>;

struct Spring {
  int from, to;
  double length;
};

/// A node's point and how it moves with (u, v).
struct Node {
  Eigen::Vector3d point;
  Eigen::Matrix<double, 3, 2> by_shift;
};

class Relaxation {
 public:
  using Held = std::function<bool(int, int)>;
  Relaxation(const std::vector<double>& s, const std::vector<double>& t, const Image<double>& heights, const Lift& lift,
             const Held& held)
      : s_(s), t_(t), heights_(heights), lift_(lift), shift_(heights.width(), heights.height()) {
    for (int j = 0; j < rows(); ++j)
      for (int i = 0; i < columns(); ++i) {
        stiffness_.push_back(held(i, j) ? 1 : 1e-9);
        connect(i, j, i + 1, j);
        connect(i, j, i, j + 1);
        connect(i, j, i + 1, j + 1);
        connect(i, j, i - 1, j + 1);
      }
  }

  Image<Eigen::Vector2d> solve() {
    Eigen::SimplicialLDLT<SparseMatrix> solver;
    for (int iteration = 0; iteration < 12; ++iteration) {
      Eigen::VectorXd gradient;
      const SparseMatrix normal_matrix = linearise(gradient);
      if (iteration == 0) solver.analyzePattern(normal_matrix);
      solver.factorize(normal_matrix);
      const Eigen::VectorXd step = solver.solve(-gradient);
      for (int n = 0; n < node_count(); ++n) shift_.pixels()[std::size_t(n)] += step.segment<2>(2 * n);
      if (step.lpNorm<Eigen::Infinity>() < 1e-7) break;
    }
    return shift_;
  }

 private:
  int columns() const { return heights_.width(); }
  int rows() const { return heights_.height(); }
  int node_count() const { return columns() * rows(); }

  void connect(int i, int j, int i2, int j2) {
    if (i2 < 0 || i2 >= columns() || j2 >= rows()) return;
    const auto base = [&](int a, int b) { return lift_(s_[std::size_t(a)], t_[std::size_t(b)], 0); };
    springs_.push_back({j * columns() + i, j2 * columns() + i2, (base(i2, j2) - base(i, j)).norm()});
  }

  Node node_at(int n) const {
    const int i = n % columns(), j = n / columns();
    const Eigen::Vector2d shift = shift_(i, j);
    const double s = s_[std::size_t(i)] + shift.x(), t = t_[std::size_t(j)] + shift.y(), height = heights_(i, j);
    const double h = 1e-3;
    Node node;
    node.point = lift_(s, t, height);
    node.by_shift.col(0) = (lift_(s + h, t, height) - lift_(s - h, t, height)) / (2 * h);
    node.by_shift.col(1) = (lift_(s, t + h, height) - lift_(s, t - h, height)) / (2 * h);
    return node;
  }

  /// The normal matrix and the gradient of half the sum of squares at the present shifts.
  SparseMatrix linearise(Eigen::VectorXd& gradient) const {
    std::vector<Node> nodes;
    for (int n = 0; n < node_count(); ++n) nodes.push_back(node_at(n));
    gradient.setZero(2 * node_count());
    std::vector<Eigen::Triplet<double>> entries;
    for (int k = 0; k < 2 * node_count(); ++k) {
      const double stiffness = stiffness_[std::size_t(k / 2)];
      entries.emplace_back(k, k, stiffness);
      gradient[k] = stiffness * shift_.pixels()[std::size_t(k / 2)][k % 2];
    }
    for (const Spring& spring : springs_) {
      const Node &a = nodes[std::size_t(spring.from)], &b = nodes[std::size_t(spring.to)];
      const Eigen::Vector3d side = b.point - a.point;
      const double strain = side.norm() / spring.length - 1;
      const Eigen::RowVector3d by_side = side.transpose() / (side.norm() * spring.length);
      const Eigen::RowVector2d by_a = -by_side * a.by_shift, by_b = by_side * b.by_shift;
      const std::array<double, 4> slopes{by_a.x(), by_a.y(), by_b.x(), by_b.y()};
      const std::array<int, 4> unknowns{2 * spring.from, 2 * spring.from + 1, 2 * spring.to, 2 * spring.to + 1};
      for (std::size_t p = 0; p < 4; ++p) {
        gradient[unknowns[p]] += strain * slopes[p];
        for (std::size_t q = 0; q < 4; ++q) entries.emplace_back(unknowns[p], unknowns[q], slopes[p] * slopes[q]);
      }
    }
    SparseMatrix normal_matrix(2 * node_count(), 2 * node_count());
    normal_matrix.setFromTriplets(entries.begin(), entries.end());
    return normal_matrix;
  }

  const std::vector<double>&s_, &t_;
  const Image<double>& heights_;
  const Lift& lift_;
  Image<Eigen::Vector2d> shift_;
  std::vector<Spring> springs_;
  std::vector<double> stiffness_;  ///< of what ties each node to its place
};

}  // namespace

Image<Eigen::Vector2d> relax_sheet(const std::vector<double>& s_lines, const std::vector<double>& t_lines,
                                   const Image<double>& heights, const Lift& lift,
                                   const std::function<bool(int i, int j)>& held) {
  return Relaxation(s_lines, t_lines, heights, lift, held).solve();
}

}  // namespace pagesweep::sim
