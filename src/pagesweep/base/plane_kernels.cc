// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "pagesweep/base/plane_kernels_internal.h"

// Not worth their time to compile beside SSE4, AVX2 and AVX-512.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pagesweep/base/plane_kernels.cc"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace pagesweep::HWY_NAMESPACE {
namespace {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, PlaneBatch::most>;
using Integers = hn::RebindToSigned<Floats>;
using Vector = hn::Vec<Floats>;
using Levels = hn::Vec<Integers>;
using Mask = hn::Mask<Floats>;

HWY_INLINE Vector set(float value) { return hn::Set(Floats(), value); }
HWY_INLINE Vector no_number() { return set(std::numeric_limits<float>::quiet_NaN()); }

/// The pixels at some of a batch's columns, in any row.
class Columns {
 public:
  Columns(const PlaneBatch& batch, std::size_t first, int width, int radius)
      : column_(hn::LoadU(Integers(), &batch.column[first])), first_(batch.column[first]), width_(width) {
    const std::size_t lanes = hn::Lanes(Floats());
    const int last = batch.column[first + lanes - 1];
    in_line_ = first + lanes <= batch.count && last - first_ == static_cast<int>(lanes) - 1;
    inside_ = first_ >= radius && last + radius < width;
  }

  /// The values `i` columns to the right; NaN beyond the borders.
  HWY_INLINE Vector read(const float* row, int i) const {
    if (inside_) return in_line_ ? hn::LoadU(Floats(), row + first_ + i) : hn::GatherIndex(Floats(), row + i, column_);
    const Integers d;
    const Levels place = hn::Add(column_, hn::Set(d, i));
    const Levels inside = hn::Min(hn::Max(place, hn::Zero(d)), hn::Set(d, width_ - 1));
    const Mask is_seen = hn::RebindMask(Floats(), hn::Eq(place, inside));
    return hn::IfThenElse(is_seen, hn::GatherIndex(Floats(), row, inside), no_number());
  }

 private:
  Levels column_;
  int first_, width_;
  bool in_line_, inside_;
};

/// Sums over the values that take part, for the normal equations of a plane.
class Sums {
 public:
  Sums() : n(hn::Zero(Floats())), i_(n), j_(n), ii_(n), ij_(n), jj_(n), d_(n), id_(n), jd_(n) {}

  HWY_INLINE void add(Mask use, Vector i, Vector value) {
    const Vector used_i = hn::IfThenElseZero(use, i), used = hn::IfThenElseZero(use, value);
    row_.n = hn::Add(row_.n, hn::IfThenElseZero(use, set(1)));
    row_.i = hn::Add(row_.i, used_i);
    row_.ii = hn::MulAdd(used_i, i, row_.ii);
    row_.d = hn::Add(row_.d, used);
    row_.id = hn::MulAdd(used, i, row_.id);
  }
  HWY_INLINE void end_row(Vector j) {
    n = hn::Add(n, row_.n);
    i_ = hn::Add(i_, row_.i);
    j_ = hn::MulAdd(j, row_.n, j_);
    ii_ = hn::Add(ii_, row_.ii);
    ij_ = hn::MulAdd(j, row_.i, ij_);
    jj_ = hn::MulAdd(hn::Mul(j, j), row_.n, jj_);
    d_ = hn::Add(d_, row_.d);
    id_ = hn::Add(id_, row_.id);
    jd_ = hn::MulAdd(j, row_.d, jd_);
    row_ = Row();
  }

  struct Plane {
    Vector across, down, middle;
    HWY_INLINE Vector start_of_row(Vector j) const { return hn::MulAdd(down, j, middle); }
  };

  /// About the centroid, the two slopes are a 2 x 2 system.
  Plane solve() const {
    const auto about = [&](Vector ab, Vector a, Vector b) { return hn::Sub(ab, hn::Div(hn::Mul(a, b), n)); };
    const Vector cii = about(ii_, i_, i_), cij = about(ij_, i_, j_), cjj = about(jj_, j_, j_);
    const Vector cid = about(id_, i_, d_), cjd = about(jd_, j_, d_);
    const Vector determinant = hn::MulSub(cii, cjj, hn::Mul(cij, cij));
    const Mask is_plane = hn::And(hn::Ge(n, set(6)), hn::Gt(determinant, hn::Mul(set(1e-3f), hn::Mul(n, n))));
    const Vector across = hn::Div(hn::MulSub(cid, cjj, hn::Mul(cjd, cij)), determinant);
    const Vector down = hn::Div(hn::MulSub(cjd, cii, hn::Mul(cid, cij)), determinant);
    const Vector middle = hn::Div(hn::NegMulAdd(across, i_, hn::NegMulAdd(down, j_, d_)), n);
    const auto known = [&](Vector v) { return hn::IfThenElse(is_plane, v, no_number()); };
    return {known(across), known(down), known(middle)};
  }

  Vector n;

 private:
  /// What all values of a row have in common is multiplied once.
  struct Row {
    Row() : n(hn::Zero(Floats())), i(n), ii(n), d(n), id(n) {}
    Vector n, i, ii, d, id;
  };
  Row row_;
  Vector i_, j_, ii_, ij_, jj_, d_, id_, jd_;
};

/// The planes around as many pixels as a vector has lanes.
class Fit {
 public:
  Fit(const PlaneWindow& window, std::size_t first)
      : radius_(window.radius),
        places_(static_cast<std::size_t>((2 * window.radius + 1) * (2 * window.radius + 1))),
        values_(window.values + first),
        misses_(window.misses + first) {}

  /// Copies the window's values and fits to all of them.
  Sums fit_all(const ImageView<const float>& image, const Columns& columns, int row) {
    const float* own = image.row(row).data();
    const Vector here = columns.read(own, 0);
    Sums sums;
    float* out = values_;
    for (int j = -radius_; j <= radius_; ++j) {
      const bool is_seen = row + j >= 0 && row + j < image.height();
      const float* in = is_seen ? image.row(row + j).data() : own;
      for (int i = -radius_; i <= radius_; ++i, out += PlaneBatch::most) {
        const Vector value = is_seen ? hn::Sub(columns.read(in, i), here) : no_number();
        const Mask use = hn::Le(hn::Abs(value), set(std::numeric_limits<float>::max()));  // false for NaN
        hn::StoreU(hn::IfThenElse(use, value, no_number()), Floats(), out);
        sums.add(use, set(static_cast<float>(i)), value);
      }
      sums.end_row(set(static_cast<float>(j)));
    }
    return sums;
  }

  /// Keeps how far the values are from the plane.
  /// \return the largest of these distances; 0 if there are none
  Vector find_misses(const Sums::Plane& plane) {
    Vector largest = hn::Zero(Floats());
    std::size_t k = 0;
    for (int j = -radius_; j <= radius_; ++j) {
      const Vector start = plane.start_of_row(set(static_cast<float>(j)));
      for (int i = -radius_; i <= radius_; ++i, k += PlaneBatch::most) {
        const Vector there = hn::MulAdd(plane.across, set(static_cast<float>(i)), start);
        const Vector miss = hn::Abs(hn::Sub(hn::LoadU(Floats(), values_ + k), there));
        largest = hn::IfThenElse(hn::Gt(miss, largest), miss, largest);
        hn::StoreU(miss, Floats(), misses_ + k);
      }
    }
    return largest;
  }

  /// Median of the distances, from above: not negative floats are ordered as their bits are, which are bisected.
  Vector median(Vector size, Vector largest) const {
    constexpr std::int32_t octave = 1 << 23, precise = 1 << 16;
    const Integers d;
    const Levels number = hn::ConvertTo(d, size);
    const Levels half = hn::Sub(number, hn::ShiftRight<1>(number));
    Levels high = hn::BitCast(d, largest), low = hn::Max(hn::Zero(d), hn::Sub(high, hn::Set(d, 6 * octave)));
    const auto is_below = hn::Gt(half, count_above(low));
    high = hn::IfThenElse(is_below, low, high);
    low = hn::IfThenZeroElse(is_below, low);
    while (true) {
      const Levels between = hn::Sub(high, low);
      const auto goes_on = hn::Gt(between, hn::Set(d, precise));
      if (hn::AllFalse(d, goes_on)) return hn::BitCast(Floats(), high);
      const Levels middle = hn::Add(low, hn::ShiftRight<1>(between));
      const auto below = hn::Gt(half, count_above(middle));
      high = hn::IfThenElse(hn::And(goes_on, below), middle, high);
      low = hn::IfThenElse(hn::AndNot(below, goes_on), middle, low);
    }
  }

  /// Fits to the values that miss the last plane by at most `limit`.
  Sums fit_near(Vector limit) const {
    Sums sums;
    std::size_t k = 0;
    for (int j = -radius_; j <= radius_; ++j) {
      for (int i = -radius_; i <= radius_; ++i, k += PlaneBatch::most)
        sums.add(hn::Le(hn::LoadU(Floats(), misses_ + k), limit), set(static_cast<float>(i)),
                 hn::LoadU(Floats(), values_ + k));
      sums.end_row(set(static_cast<float>(j)));
    }
    return sums;
  }

 private:
  /// How many distances are above the levels, which are bits of floats.
  HWY_INLINE Levels count_above(Levels levels) const {
    const Integers d;
    const Vector limit = hn::BitCast(Floats(), levels);
    Levels above = hn::Zero(d);
    for (std::size_t k = 0; k < places_; ++k) {
      const Mask is_above = hn::Gt(hn::LoadU(Floats(), misses_ + k * PlaneBatch::most), limit);  // false for NaN
      above = hn::Sub(above, hn::VecFromMask(d, hn::RebindMask(d, is_above)));
    }
    return above;
  }

  int radius_;
  std::size_t places_;
  float *values_, *misses_;
};

void FitPlanes(const ImageView<const float>& values, const PlaneWindow& window, PlaneBatch& batch) {
  const Floats d;
  for (std::size_t first = 0; first < batch.count; first += hn::Lanes(d)) {
    Fit fit(window, first);
    const Sums all = fit.fit_all(values, Columns(batch, first, values.width(), window.radius), batch.row);
    Sums::Plane plane = all.solve();
    const Vector largest = fit.find_misses(plane), median = fit.median(all.n, largest);
    const Vector limit = hn::Mul(set(3), median);
    const Mask has_outliers = hn::Gt(largest, limit);
    if (!hn::AllFalse(d, has_outliers)) {
      const Sums::Plane without = fit.fit_near(limit).solve();
      plane = {hn::IfThenElse(has_outliers, without.across, plane.across),
               hn::IfThenElse(has_outliers, without.down, plane.down),
               hn::IfThenElse(has_outliers, without.middle, plane.middle)};
    }
    hn::StoreU(plane.across, d, &batch.across[first]);
    hn::StoreU(plane.down, d, &batch.down[first]);
    hn::StoreU(plane.middle, d, &batch.middle[first]);
    hn::StoreU(all.n, d, &batch.size[first]);
    hn::StoreU(median, d, &batch.median[first]);
  }
}

void FindExcess(const ImageView<const float>& sigmas, int radius, const float* window_values, const PlaneBatch& batch,
                PlaneBatch::Each<float>& excess) {
  const Floats d;
  for (std::size_t first = 0; first < batch.count; first += hn::Lanes(d)) {
    const Columns columns(batch, first, sigmas.width(), radius);
    const Vector across = hn::LoadU(d, &batch.across[first]), down = hn::LoadU(d, &batch.down[first]);
    const Vector middle = hn::LoadU(d, &batch.middle[first]);
    const Vector half_pixel = hn::Mul(set(0.5f), hn::Sqrt(hn::MulAdd(across, across, hn::Mul(down, down))));
    Vector most = hn::Sub(across, across);  // 0, or NaN without a plane
    const int side = 2 * radius + 1, top = std::max(0, batch.row - radius);
    for (int y = top; y <= std::min(batch.row + radius, sigmas.height() - 1); ++y) {
      const int j = y - batch.row;
      const Vector start = hn::MulAdd(down, set(static_cast<float>(j)), middle);
      const float* value = window_values + first + static_cast<std::size_t>((j + radius) * side) * PlaneBatch::most;
      for (int i = -radius; i <= radius; ++i, value += PlaneBatch::most) {
        const Vector there = hn::MulAdd(across, set(static_cast<float>(i)), start);
        const Vector miss = hn::Abs(hn::Sub(hn::LoadU(d, value), there));
        const Vector six_sigmas = hn::Mul(set(6), columns.read(sigmas.row(y).data(), i));
        const Vector beyond = hn::Sub(miss, hn::Add(half_pixel, six_sigmas));
        most = hn::IfThenElse(hn::Gt(beyond, most), beyond, most);  // passes over NaN
      }
    }
    hn::StoreU(most, d, &excess[first]);
  }
}

}  // namespace
}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(FitPlanes);
HWY_EXPORT(FindExcess);

void fit_planes(const ImageView<const float>& values, const PlaneWindow& window, PlaneBatch& batch) {
  HWY_DYNAMIC_DISPATCH(FitPlanes)(values, window, batch);
}

void find_excess(const ImageView<const float>& sigmas, int radius, const float* window_values, const PlaneBatch& batch,
                 PlaneBatch::Each<float>& excess) {
  HWY_DYNAMIC_DISPATCH(FindExcess)(sigmas, radius, window_values, batch, excess);
}

}  // namespace pagesweep
#endif  // HWY_ONCE
