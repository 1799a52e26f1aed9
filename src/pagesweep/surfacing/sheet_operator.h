// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/base/image.h"

namespace pagesweep {

/// A number at each node of a grid. Rows have room for what lies beside them, filled likewise, so that they can be read
/// in whole vectors.
class NodeField {
 public:
  NodeField() = default;
  NodeField(int columns, int rows, float fill = 0);

  int columns() const { return columns_; }
  int rows() const { return values_.height() - 2 * rim; }
  float& operator()(int i, int j) { return values_(i + rim, j + rim); }
  float operator()(int i, int j) const { return values_(i + rim, j + rim); }
  float* row(int j) { return &(*this)(0, j); }  ///< -1 <= j <= rows(); from i = -1 to a vector beyond the last column
  const float* row(int j) const { return &values_(rim, j + rim); }

 private:
  static constexpr int rim = 1;
  int columns_ = 0;
  Image<float> values_;
};

/// The symmetric matrix A of a sheet's energy x' A x / 2 over the heights of a grid's nodes, as the sum of
///
/// * bending: at each node a quadratic form of the second differences (d_pp, d_qq, d_pq) there,
///       d_pp = x(i - 1, j) - 2 x(i, j) + x(i + 1, j),  d_qq likewise along j,
///       d_pq = (x(i + 1, j + 1) - x(i - 1, j + 1) - x(i + 1, j - 1) + x(i - 1, j - 1)) / 4;
/// * products of neighbours: what measurements between four nodes each add.
///
/// Coefficients are 0 where a difference reaches beyond the sheet.
struct SheetOperator {
  SheetOperator(int columns, int rows);

  NodeField pp_pp, pp_pq, qq_qq, qq_pq, pq_pq;            ///< of the bending form
  NodeField self, right, upper, upper_right, upper_left;  ///< products with itself and with that neighbour
};

/// result = bending(bent) + products(lifted), in rows [begin, end). With bent = lifted = x it is A x.
void apply_rows(const SheetOperator& sheet, const NodeField& bent, const NodeField& lifted, int begin, int end,
                NodeField& result);

/// Sum of a(i, j) b(i, j) in row j.
double dot_row(const NodeField& a, const NodeField& b, int j);

/// One step of conjugate gradients in row j: place += length direction, residual += length bent, and
/// scaled = -residual / diagonal.
/// \return the row's sum of -residual * scaled
double step_row(float length, const NodeField& direction, const NodeField& bent, const NodeField& diagonal, int j,
                NodeField& place, NodeField& residual, NodeField& scaled);

/// direction = scaled + keep direction, in row j.
void turn_row(float keep, const NodeField& scaled, int j, NodeField& direction);

}  // namespace pagesweep
