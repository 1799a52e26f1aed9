// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/sheet_operator.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace pagesweep {
namespace {

constexpr int columns = 37, rows = 11;  // no whole number of vectors

class SheetOperators : public testing::Test {
 protected:
  SheetOperators() {
    for (int j = 0; j < rows; ++j)
      for (int i = 0; i < columns; ++i) {
        const bool pp = i > 0 && i + 1 < columns, qq = j > 0 && j + 1 < rows;
        if (pp) sheet.pp_pp(i, j) = draw(1, 2);
        if (qq) sheet.qq_qq(i, j) = draw(1, 2);
        if (!pp || !qq) continue;
        sheet.pp_pq(i, j) = draw(-1, 1);
        sheet.qq_pq(i, j) = draw(-1, 1);
        sheet.pq_pq(i, j) = draw(2, 4);
      }
  }
  float draw(float low, float high) { return std::uniform_real_distribution(low, high)(random); }
  NodeField heights() {
    NodeField field(columns, rows);
    for (int j = 0; j < rows; ++j)
      for (int i = 0; i < columns; ++i) field(i, j) = draw(-1, 1);
    return field;
  }
  NodeField times(const NodeField& x) {
    NodeField result(columns, rows);
    for (int j = 0; j < rows; j += 4) apply_rows(sheet, x, x, j, std::min(j + 4, rows), result);
    return result;
  }
  static double dot(const NodeField& a, const NodeField& b) {
    double sum = 0;
    for (int j = 0; j < rows; ++j) sum += dot_row(a, b, j);
    return sum;
  }
  /// The quadratic forms of all nodes, as their definition has it.
  double bending(const NodeField& x) const {
    double sum = 0;
    for (int j = 0; j < rows; ++j)
      for (int i = 0; i < columns; ++i) {
        const auto at = [&](int di, int dj) { return static_cast<double>(x(i + di, j + dj)); };
        const double pp = at(-1, 0) - 2 * at(0, 0) + at(1, 0), qq = at(0, -1) - 2 * at(0, 0) + at(0, 1);
        const double pq = (at(1, 1) - at(-1, 1) - at(1, -1) + at(-1, -1)) / 4;
        sum += sheet.pp_pp(i, j) * pp * pp + sheet.qq_qq(i, j) * qq * qq + sheet.pq_pq(i, j) * pq * pq +
               2 * (sheet.pp_pq(i, j) * pp + sheet.qq_pq(i, j) * qq) * pq;
      }
    return sum;
  }

  SheetOperator sheet{columns, rows};
  std::mt19937 random{1};
};

TEST_F(SheetOperators, GivesTheBendingEnergy) {
  const NodeField x = heights();
  EXPECT_NEAR(dot(x, times(x)), bending(x), 1e-5 * bending(x));
}

TEST_F(SheetOperators, IsSymmetric) {
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) {
      sheet.self(i, j) = draw(1, 2);
      if (i + 1 < columns) sheet.right(i, j) = draw(0, 1);
      if (j + 1 < rows) sheet.upper(i, j) = draw(0, 1);
      if (i + 1 < columns && j + 1 < rows) sheet.upper_right(i, j) = draw(0, 1);
      if (i > 0 && j + 1 < rows) sheet.upper_left(i, j) = draw(0, 1);
    }
  const NodeField x = heights(), y = heights();
  const double forth = dot(x, times(y)), back = dot(y, times(x));
  EXPECT_NEAR(forth, back, 1e-5 * std::sqrt(dot(x, times(x)) * dot(y, times(y))));
}

TEST_F(SheetOperators, AddsProductsOfNeighbours) {
  sheet = SheetOperator(columns, rows);
  sheet.upper_left(20, 5) = 2;
  sheet.right(36, 5) = 3;  // has nobody there
  NodeField x(columns, rows);
  x(20, 5) = 7;
  x(19, 6) = 11;
  const NodeField result = times(x);
  EXPECT_EQ(result(20, 5), 22);
  EXPECT_EQ(result(19, 6), 14);
  EXPECT_EQ(dot(result, result), 22 * 22 + 14 * 14);
}

}  // namespace
}  // namespace pagesweep
