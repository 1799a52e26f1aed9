// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/sheet_operator.h"

#include <utility>
#include <vector>

// clang-format off
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pagesweep/surfacing/sheet_operator.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace pagesweep::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
/// Never more than the 16 values that rows have to spare.
using Tag = hn::CappedTag<float, 16>;
using Vec = hn::Vec<Tag>;

/// What the bending form makes of the second differences in one row.
struct MomentRow {
  explicit MomentRow(int columns) : pp(size(columns), 0), qq(size(columns), 0), pq(size(columns), 0) {}
  static std::size_t size(int columns) { return static_cast<std::size_t>(columns) + 2 + 16; }
  std::vector<float> pp, qq, pq;  ///< from i = -1
};

Vec At(const NodeField& field, int i, int j) { return hn::LoadU(Tag(), field.row(j) + i); }

void FindMoments(const SheetOperator& sheet, const NodeField& x, int j, MomentRow& moments) {
  const Tag d;
  const Vec quarter = hn::Set(d, 0.25f);
  for (int i = 0; i < x.columns(); i += static_cast<int>(hn::Lanes(d))) {
    const Vec twice = hn::Add(At(x, i, j), At(x, i, j));
    const Vec pp = hn::Sub(hn::Add(At(x, i - 1, j), At(x, i + 1, j)), twice);
    const Vec qq = hn::Sub(hn::Add(At(x, i, j - 1), At(x, i, j + 1)), twice);
    const Vec pq = hn::Mul(quarter, hn::Sub(hn::Add(At(x, i + 1, j + 1), At(x, i - 1, j - 1)),
                                            hn::Add(At(x, i - 1, j + 1), At(x, i + 1, j - 1))));
    const Vec pp_pq = At(sheet.pp_pq, i, j), qq_pq = At(sheet.qq_pq, i, j);
    const auto k = static_cast<std::size_t>(i + 1);
    hn::StoreU(hn::MulAdd(At(sheet.pp_pp, i, j), pp, hn::Mul(pp_pq, pq)), d, &moments.pp[k]);
    hn::StoreU(hn::MulAdd(At(sheet.qq_qq, i, j), qq, hn::Mul(qq_pq, pq)), d, &moments.qq[k]);
    hn::StoreU(hn::MulAdd(pp_pq, pp, hn::MulAdd(qq_pq, qq, hn::Mul(At(sheet.pq_pq, i, j), pq))), d, &moments.pq[k]);
  }
}

/// The adjoint of the second differences.
Vec Unbend(const MomentRow& below, const MomentRow& here, const MomentRow& above, int i) {
  const Tag d;
  const auto k = static_cast<std::size_t>(i + 1);
  const auto at = [&](const std::vector<float>& row, std::size_t place) { return hn::LoadU(d, &row[place]); };
  const Vec middle = hn::Add(at(here.pp, k), at(here.qq, k));
  const Vec pp = hn::Add(at(here.pp, k - 1), at(here.pp, k + 1)), qq = hn::Add(at(below.qq, k), at(above.qq, k));
  const Vec pq =
      hn::Sub(hn::Add(at(below.pq, k - 1), at(above.pq, k + 1)), hn::Add(at(above.pq, k - 1), at(below.pq, k + 1)));
  return hn::MulAdd(hn::Set(d, 0.25f), pq, hn::Sub(hn::Add(pp, qq), hn::Add(middle, middle)));
}

Vec Products(const SheetOperator& sheet, const NodeField& x, int i, int j) {
  Vec sum = hn::Mul(At(sheet.self, i, j), At(x, i, j));
  sum = hn::MulAdd(At(sheet.right, i, j), At(x, i + 1, j), sum);
  sum = hn::MulAdd(At(sheet.right, i - 1, j), At(x, i - 1, j), sum);
  sum = hn::MulAdd(At(sheet.upper, i, j), At(x, i, j + 1), sum);
  sum = hn::MulAdd(At(sheet.upper, i, j - 1), At(x, i, j - 1), sum);
  sum = hn::MulAdd(At(sheet.upper_right, i, j), At(x, i + 1, j + 1), sum);
  sum = hn::MulAdd(At(sheet.upper_right, i - 1, j - 1), At(x, i - 1, j - 1), sum);
  sum = hn::MulAdd(At(sheet.upper_left, i, j), At(x, i - 1, j + 1), sum);
  return hn::MulAdd(At(sheet.upper_left, i + 1, j - 1), At(x, i + 1, j - 1), sum);
}

void ApplyRows(const SheetOperator& sheet, const NodeField& bent, const NodeField& lifted, int begin, int end,
               NodeField& result) {
  const Tag d;
  MomentRow below(bent.columns()), here(bent.columns()), above(bent.columns());
  if (begin > 0) FindMoments(sheet, bent, begin - 1, below);
  FindMoments(sheet, bent, begin, here);
  for (int j = begin; j < end; ++j) {
    if (j + 1 < bent.rows())
      FindMoments(sheet, bent, j + 1, above);
    else
      above = MomentRow(bent.columns());
    for (int i = 0; i < bent.columns(); i += static_cast<int>(hn::Lanes(d)))
      hn::StoreU(hn::Add(Unbend(below, here, above, i), Products(sheet, lifted, i, j)), d, result.row(j) + i);
    std::swap(below, here);
    std::swap(here, above);
  }
}

double DotRow(const NodeField& a, const NodeField& b, int j) {
  const Tag d;
  Vec sum = hn::Zero(d);
  for (int i = 0; i < a.columns(); i += static_cast<int>(hn::Lanes(d))) sum = hn::MulAdd(At(a, i, j), At(b, i, j), sum);
  return static_cast<double>(hn::GetLane(hn::SumOfLanes(d, sum)));
}

double StepRow(float length, const NodeField& direction, const NodeField& bent, const NodeField& diagonal, int j,
               NodeField& place, NodeField& residual, NodeField& scaled) {
  const Tag d;
  const Vec step = hn::Set(d, length);
  Vec sum = hn::Zero(d);
  for (int i = 0; i < place.columns(); i += static_cast<int>(hn::Lanes(d))) {
    hn::StoreU(hn::MulAdd(step, At(direction, i, j), At(place, i, j)), d, place.row(j) + i);
    const Vec left = hn::MulAdd(step, At(bent, i, j), At(residual, i, j));
    const Vec downhill = hn::Div(hn::Neg(left), At(diagonal, i, j));
    hn::StoreU(left, d, residual.row(j) + i);
    hn::StoreU(downhill, d, scaled.row(j) + i);
    sum = hn::NegMulAdd(left, downhill, sum);
  }
  return static_cast<double>(hn::GetLane(hn::SumOfLanes(d, sum)));
}

void TurnRow(float keep, const NodeField& scaled, int j, NodeField& direction) {
  const Tag d;
  const Vec share = hn::Set(d, keep);
  for (int i = 0; i < scaled.columns(); i += static_cast<int>(hn::Lanes(d)))
    hn::StoreU(hn::MulAdd(share, At(direction, i, j), At(scaled, i, j)), d, direction.row(j) + i);
}

}  // namespace
}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(ApplyRows);
HWY_EXPORT(DotRow);
HWY_EXPORT(StepRow);
HWY_EXPORT(TurnRow);

NodeField::NodeField(int columns, int rows, float fill)
    : columns_(columns), values_((columns + 15) / 16 * 16 + 2 * rim, rows + 2 * rim, fill) {}

SheetOperator::SheetOperator(int columns, int rows)
    : pp_pp(columns, rows),
      pp_pq(columns, rows),
      qq_qq(columns, rows),
      qq_pq(columns, rows),
      pq_pq(columns, rows),
      self(columns, rows),
      right(columns, rows),
      upper(columns, rows),
      upper_right(columns, rows),
      upper_left(columns, rows) {}

void apply_rows(const SheetOperator& sheet, const NodeField& bent, const NodeField& lifted, int begin, int end,
                NodeField& result) {
  HWY_DYNAMIC_DISPATCH(ApplyRows)(sheet, bent, lifted, begin, end, result);
}

double dot_row(const NodeField& a, const NodeField& b, int j) { return HWY_DYNAMIC_DISPATCH(DotRow)(a, b, j); }

double step_row(float length, const NodeField& direction, const NodeField& bent, const NodeField& diagonal, int j,
                NodeField& place, NodeField& residual, NodeField& scaled) {
  return HWY_DYNAMIC_DISPATCH(StepRow)(length, direction, bent, diagonal, j, place, residual, scaled);
}

void turn_row(float keep, const NodeField& scaled, int j, NodeField& direction) {
  HWY_DYNAMIC_DISPATCH(TurnRow)(keep, scaled, j, direction);
}

}  // namespace pagesweep
#endif
