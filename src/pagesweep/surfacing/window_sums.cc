// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/window_sums.h"

#include <algorithm>
#include <cmath>

// clang-format off
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pagesweep/surfacing/window_sums.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace pagesweep::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
/// A neighbourhood has some hundred cells: with longer vectors the sums over their lanes would weigh too much.
using Tag = hn::CappedTag<float, 8>;
using Vec = hn::Vec<Tag>;

/// (1, u, v, uu, uv, vv) of the cells from k on.
struct Terms {
  Vec u, v, uu, uv, vv;
  Terms(Tag d, const Window& w, std::size_t k)
      : u(hn::LoadU(d, &w.u[k])),
        v(hn::LoadU(d, &w.v[k])),
        uu(hn::LoadU(d, &w.uu[k])),
        uv(hn::LoadU(d, &w.uv[k])),
        vv(hn::LoadU(d, &w.vv[k])) {}
  Vec dot(Tag d, const std::array<float, 6>& c) const {
    const Vec linear = hn::MulAdd(hn::Set(d, c[2]), v, hn::MulAdd(hn::Set(d, c[1]), u, hn::Set(d, c[0])));
    return hn::MulAdd(hn::Set(d, c[5]), vv, hn::MulAdd(hn::Set(d, c[4]), uv, hn::MulAdd(hn::Set(d, c[3]), uu, linear)));
  }
};

double total(Tag d, Vec v) { return hn::GetLane(hn::SumOfLanes(d, v)); }

double Gather(const CellColumns& cells, const WindowPlace& place, Window& w) {
  const Tag d;
  const auto narrow = [](double x) { return static_cast<float>(x); };
  const double r = place.radius_mm;
  const int reach = static_cast<int>(r / place.cell_mm) + 1;
  const Vec cell_mm = hn::Set(d, narrow(place.cell_mm)), per_radius = hn::Set(d, narrow(1 / r)),
            per_area = hn::Set(d, narrow(1 / (r * r)));
  const Vec one = hn::Set(d, 1), lanes = hn::Iota(d, 0);
  const Vec towards_p = hn::Set(d, narrow(place.towards_p)), towards_q = hn::Set(d, narrow(place.towards_q)),
            behind = hn::Set(d, narrow(-0.75 * place.cell_mm));
  Vec nearest = one;
  std::size_t n = 0;
  const int left = std::max(0, place.column - reach), right = std::min(cells.width - 1, place.column + reach);
  const int low = std::max(0, place.row - reach), high = std::min(cells.height - 1, place.row + reach);
  for (int j = low; j <= high; ++j)
    for (int i = left; i <= right; i += static_cast<int>(hn::Lanes(d))) {
      const auto load = [&](const Image<float>& column) { return hn::LoadU(d, &column(i, j)); };
      const Vec weight = load(cells.weight);
      const Vec u = hn::MulAdd(hn::Add(lanes, hn::Set(d, narrow(i - place.column))), cell_mm, load(cells.p));
      const Vec v = hn::MulAdd(hn::Set(d, narrow(j - place.row)), cell_mm, load(cells.q));
      const Vec uu = hn::Mul(u, u), vv = hn::Mul(v, v);
      const Vec distance2 = hn::Mul(hn::Add(uu, vv), per_area);
      const auto kept = hn::And(hn::And(hn::Gt(weight, hn::Zero(d)), hn::Lt(distance2, one)),
                                hn::Ge(hn::MulAdd(u, towards_p, hn::Mul(v, towards_q)), behind));
      if (hn::AllFalse(d, kept)) continue;
      const auto store = [&](Vec value, std::vector<float>& column) {
        hn::StoreU(hn::Compress(value, kept), d, &column[n]);
      };
      nearest = hn::Min(nearest, hn::IfThenElse(kept, distance2, one));
      store(hn::Mul(u, per_radius), w.u);
      store(hn::Mul(v, per_radius), w.v);
      store(hn::Mul(hn::Add(uu, load(cells.pp)), per_area), w.uu);
      store(hn::Mul(hn::MulAdd(u, v, load(cells.pq)), per_area), w.uv);
      store(hn::Mul(hn::Add(vv, load(cells.qq)), per_area), w.vv);
      store(load(cells.z), w.z);
      store(weight, w.weight);
      const Vec kernel = hn::Sub(one, distance2);
      store(hn::Mul(kernel, kernel), w.kernel);
      n += hn::CountTrue(d, kept);
    }
  w.size = n;
  w.z0_mm = n > 0 ? w.z[0] : 0;
  const Vec z0 = hn::Set(d, narrow(w.z0_mm));
  for (std::size_t k = 0; k < n; k += hn::Lanes(d)) hn::StoreU(hn::Sub(hn::LoadU(d, &w.z[k]), z0), d, &w.z[k]);
  return r * std::sqrt(static_cast<double>(hn::GetLane(hn::MinOfLanes(d, nearest))));
}

WindowSums AddUp(const Window& window) {
  const Tag d;
  Vec a[21], b[6];
  std::fill_n(a, 21, hn::Zero(d));
  std::fill_n(b, 6, hn::Zero(d));
  for (std::size_t k = 0; k < window.size; k += hn::Lanes(d)) {
    const Terms t(d, window, k);
    const Vec w = hn::Mul(hn::LoadU(d, &window.weight[k]),
                          hn::Mul(hn::LoadU(d, &window.kernel[k]), hn::LoadU(d, &window.robust[k])));
    const Vec z = hn::LoadU(d, &window.z[k]);
    const Vec wu = hn::Mul(w, t.u), wv = hn::Mul(w, t.v), wuu = hn::Mul(w, t.uu), wuv = hn::Mul(w, t.uv),
              wvv = hn::Mul(w, t.vv);
    const Vec weighted[6] = {w, wu, wv, wuu, wuv, wvv}, terms[5] = {t.u, t.v, t.uu, t.uv, t.vv};
    std::size_t at = 0;
    for (std::size_t r = 0; r < 6; ++r) {
      b[r] = hn::MulAdd(weighted[r], z, b[r]);
      if (r == 0) a[at++] = hn::Add(a[0], w);
      for (std::size_t c = std::max<std::size_t>(r, 1); c < 6; ++c, ++at)
        a[at] = hn::MulAdd(weighted[r], terms[c - 1], a[at]);
    }
  }
  WindowSums sums;
  for (std::size_t k = 0; k < 21; ++k) sums.a[k] = total(d, a[k]);
  for (std::size_t k = 0; k < 6; ++k) sums.b[k] = total(d, b[k]);
  return sums;
}

void FindResiduals(const std::array<float, 6>& coefficients, Window& window) {
  const Tag d;
  for (std::size_t k = 0; k < window.size; k += hn::Lanes(d)) {
    const Vec fit = Terms(d, window, k).dot(d, coefficients);
    const Vec residual = hn::Abs(hn::Sub(hn::LoadU(d, &window.z[k]), fit));
    hn::StoreU(hn::Mul(residual, hn::Sqrt(hn::LoadU(d, &window.weight[k]))), d, &window.residual[k]);
  }
}

double MedianResidual(const Window& window) {
  const Tag d;
  Vec sum = hn::Zero(d);
  for (std::size_t k = 0; k < window.size; k += hn::Lanes(d)) sum = hn::Add(sum, hn::LoadU(d, &window.residual[k]));
  // By halving an interval, which costs less than moving them about. No median exceeds two means.
  float low = 0, high = static_cast<float>(2 * total(d, sum) / static_cast<double>(window.size));
  const auto above = static_cast<float>(window.size - window.size / 2 - 1);  // so many of them are larger
  for (int halving = 0; halving < 8; ++halving) {
    const float middle = 0.5f * (low + high);
    const Vec threshold = hn::Set(d, middle);
    Vec count = hn::Zero(d);
    for (std::size_t k = 0; k < window.size; k += hn::Lanes(d))
      count = hn::Add(count, hn::IfThenElseZero(hn::Gt(hn::LoadU(d, &window.residual[k]), threshold), hn::Set(d, 1)));
    (total(d, count) > above ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

void WeighResiduals(double unit, bool redescending, Window& window) {
  // Tukey's biweight keeps 95 % efficiency under Gaussian noise with this cut-off.
  constexpr double tukey_cutoff = 4.685;
  const Tag d;
  const Vec one = hn::Set(d, 1);
  const Vec scale = hn::Set(d, static_cast<float>(1 / (redescending ? tukey_cutoff * unit : unit)));
  for (std::size_t k = 0; k < window.size; k += hn::Lanes(d)) {
    const Vec x = hn::Mul(scale, hn::LoadU(d, &window.residual[k]));
    const Vec y = hn::Max(hn::NegMulAdd(x, x, one), hn::Zero(d));
    hn::StoreU(redescending ? hn::Mul(y, y) : hn::Div(one, hn::Max(one, x)), d, &window.robust[k]);
  }
}

double SumOfInfluence(const std::array<float, 6>& influence, const Window& window) {
  const Tag d;
  Vec sum = hn::Zero(d);
  for (std::size_t k = 0; k < window.size; k += hn::Lanes(d)) {
    const Vec share = hn::Mul(hn::LoadU(d, &window.kernel[k]), hn::LoadU(d, &window.robust[k]));
    const Vec l = hn::Mul(share, Terms(d, window, k).dot(d, influence));
    sum = hn::MulAdd(hn::Mul(l, l), hn::LoadU(d, &window.weight[k]), sum);
  }
  return total(d, sum);
}

}  // namespace
}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(Gather);
HWY_EXPORT(AddUp);
HWY_EXPORT(FindResiduals);
HWY_EXPORT(MedianResidual);
HWY_EXPORT(WeighResiduals);
HWY_EXPORT(SumOfInfluence);

void Window::reserve(std::size_t cells) {
  for (auto* column : {&u, &v, &uu, &uv, &vv, &z, &weight, &kernel, &robust, &residual})
    if (column->size() < cells + slack) column->resize(cells + slack);
}

void Window::pad() {
  for (auto* column : {&u, &v, &uu, &uv, &vv, &z, &weight, &kernel, &robust, &residual})
    std::fill_n(column->begin() + static_cast<std::ptrdiff_t>(size), slack, 0.0f);
}

CellColumns::CellColumns(const Image<CellMean>& cells)
    : width(cells.width()), height(cells.height()), p(width + static_cast<int>(Window::slack), height, 0) {
  q = z = pp = pq = qq = weight = p;
  for (int j = 0; j < height; ++j)
    for (int i = 0; i < width; ++i) {
      const CellMean& cell = cells(i, j);
      p(i, j) = cell.p;
      q(i, j) = cell.q;
      z(i, j) = cell.z;
      pp(i, j) = cell.pp;
      pq(i, j) = cell.pq;
      qq(i, j) = cell.qq;
      weight(i, j) = cell.weight;
    }
}

double gather(const CellColumns& cells, const WindowPlace& place, Window& window) {
  const auto side = static_cast<std::size_t>(2 * (place.radius_mm / place.cell_mm + 1) + 1);
  window.reserve(side * side);
  const double nearest_mm = HWY_DYNAMIC_DISPATCH(Gather)(cells, place, window);
  window.pad();
  return nearest_mm;
}

WindowSums add_up(const Window& window) { return HWY_DYNAMIC_DISPATCH(AddUp)(window); }
void find_residuals(const std::array<float, 6>& coefficients, Window& window) {
  HWY_DYNAMIC_DISPATCH(FindResiduals)(coefficients, window);
}
double median_residual(const Window& window) { return HWY_DYNAMIC_DISPATCH(MedianResidual)(window); }
void weigh_residuals(double unit, bool redescending, Window& window) {
  HWY_DYNAMIC_DISPATCH(WeighResiduals)(unit, redescending, window);
}
double sum_of_influence(const std::array<float, 6>& influence, const Window& window) {
  return HWY_DYNAMIC_DISPATCH(SumOfInfluence)(influence, window);
}

}  // namespace pagesweep
#endif  // HWY_ONCE
