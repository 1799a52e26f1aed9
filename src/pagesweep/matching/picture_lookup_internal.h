// SPDX-License-Identifier: Apache-2.0
// Pictures of floats asked between their pixels, a vector of places at once. To be included by vector code only, once
// for each instruction set.
#if defined(PAGESWEEP_MATCHING_PICTURE_LOOKUP_INTERNAL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef PAGESWEEP_MATCHING_PICTURE_LOOKUP_INTERNAL_H
#undef PAGESWEEP_MATCHING_PICTURE_LOOKUP_INTERNAL_H
#else
#define PAGESWEEP_MATCHING_PICTURE_LOOKUP_INTERNAL_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>

HWY_BEFORE_NAMESPACE();
namespace pagesweep::HWY_NAMESPACE {
namespace {
namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t most_places = 16;  ///< the longest vector
using Floats = hn::CappedTag<float, most_places>;
using Integers = hn::RebindToSigned<Floats>;
using Vector = hn::Vec<Floats>;
using Mask = hn::Mask<Floats>;

HWY_INLINE Vector set(float value) { return hn::Set(Floats(), value); }
HWY_INLINE Vector no_number() { return set(std::numeric_limits<float>::quiet_NaN()); }

/// A place in the other picture, and the cell of pixels around it.
struct Place {
  Vector u, v;  ///< [px]
  hn::Vec<Integers> cell;
  Vector right, down;  ///< [px] from the cell's first pixel
  Mask inside;         ///< of the picture
};

HWY_INLINE Place place_at(Vector u, Vector v, int width, int height) {
  const auto columns = static_cast<float>(width), rows = static_cast<float>(height);
  const auto inside = [](Vector p, float end) { return hn::And(hn::Ge(p, set(-0.5f)), hn::Le(p, set(end - 0.5f))); };
  Place place;
  place.u = u;
  place.v = v;
  place.inside = hn::And(inside(u, columns), inside(v, rows));
  // A place in the outer half pixel takes the outermost cell, and no less than its border.
  const Vector column = hn::Min(hn::Max(hn::IfThenElseZero(place.inside, u), set(0)), set(columns - 1));
  const Vector row = hn::Min(hn::Max(hn::IfThenElseZero(place.inside, v), set(0)), set(rows - 1));
  const Vector left = hn::Min(hn::Floor(column), set(columns - 2)), top = hn::Min(hn::Floor(row), set(rows - 2));
  place.right = hn::Sub(column, left);
  place.down = hn::Sub(row, top);
  const Integers d;
  place.cell = hn::Add(hn::Mul(hn::ConvertTo(d, top), hn::Set(d, width)), hn::ConvertTo(d, left));
  return place;
}

/// What the four pixels of each cell have.
struct Corners {
  Vector a, b, c, d;
};

/// By a load for each pixel of each cell.
class Scattered {
 public:
  HWY_INLINE Scattered(int width, const Place& place) : width_(width), cell_(place.cell) {}
  HWY_INLINE Vector pixel(const float* values) const { return hn::GatherIndex(Floats(), values, cell_); }
  HWY_INLINE Corners corners(const float* values) const {
    return {pixel(values), pixel(values + 1), pixel(values + width_), pixel(values + width_ + 1)};
  }

 private:
  int width_;
  hn::Vec<Integers> cell_;
};

/// Cells that lie side by side in a few rows, as those of neighbours do: stretches of these rows are loaded, and pixels
/// picked from them. What lies elsewhere is gathered.
class SideBySide {
 public:
  HWY_INLINE SideBySide(int width, int height, const Place& place) : width_(width), scattered_(width, place) {
    const Integers d;
    const auto lanes = static_cast<int>(hn::Lanes(d)), last = width * (height - 1) - 2 * lanes;
    HWY_ALIGN std::int32_t cells[most_places];
    hn::Store(place.cell, d, cells);
    hn::Mask<Integers> rest = hn::RebindMask(d, place.inside);
    while (count_ < most && last >= 0 && !hn::AllFalse(d, rest)) {
      Stretch& stretch = stretches_[count_++];
      // A little before the first one, for others that are not in order.
      stretch.begin = std::clamp(cells[hn::FindKnownFirstTrue(d, rest)] - lanes / 4, 0, last);
      stretch.offset = hn::Sub(place.cell, hn::Set(d, stretch.begin));
      const auto here = hn::And(
          rest, hn::And(hn::Gt(stretch.offset, hn::Set(d, -1)), hn::Lt(stretch.offset, hn::Set(d, 2 * lanes - 1))));
      stretch.here = hn::RebindMask(Floats(), here);
      rest = hn::AndNot(here, rest);
    }
    complete_ = hn::AllFalse(d, rest);
    rest_ = hn::RebindMask(Floats(), rest);
  }

  HWY_INLINE Vector pixel(const float* values) const {
    Vector all = set(0);
    for (int k = 0; k < count_; ++k)
      all = hn::IfThenElse(stretches_[k].here, pick(values + stretches_[k].begin, stretches_[k].offset), all);
    return complete_ ? all : hn::IfThenElse(rest_, scattered_.pixel(values), all);
  }

  HWY_INLINE Corners corners(const float* values) const {
    Corners all{set(0), set(0), set(0), set(0)};
    for (int k = 0; k < count_; ++k) {
      const auto& [begin, offset, here] = stretches_[k];
      const auto right = hn::Add(offset, hn::Set(Integers(), 1));
      const float *top = values + begin, *bottom = top + width_;
      all = select(here, {pick(top, offset), pick(top, right), pick(bottom, offset), pick(bottom, right)}, all);
    }
    return complete_ ? all : select(rest_, scattered_.corners(values), all);
  }

 private:
  static constexpr int most = 4;

  struct Stretch {
    int begin;                 ///< pixel
    hn::Vec<Integers> offset;  ///< of cells [pixels]
    Mask here;                 ///< which of them
  };

  /// One of the two vectors' numbers from `values` on for each lane; any where the offset is beyond.
  static HWY_INLINE Vector pick(const float* values, hn::Vec<Integers> offset) {
    const Floats d;
    const Integers integers;
    const auto lanes = static_cast<std::int32_t>(hn::Lanes(d));
    const auto index = hn::IndicesFromVec(d, hn::And(offset, hn::Set(integers, lanes - 1)));
    const Vector low = hn::TableLookupLanes(hn::LoadU(d, values), index);
    const Vector high = hn::TableLookupLanes(hn::LoadU(d, values + lanes), index);
    return hn::IfThenElse(hn::RebindMask(d, hn::Gt(offset, hn::Set(integers, lanes - 1))), high, low);
  }
  static HWY_INLINE Corners select(Mask first, const Corners& a, const Corners& b) {
    return {hn::IfThenElse(first, a.a, b.a), hn::IfThenElse(first, a.b, b.b), hn::IfThenElse(first, a.c, b.c),
            hn::IfThenElse(first, a.d, b.d)};
  }

  int width_, count_ = 0;
  bool complete_;
  Scattered scattered_;
  Stretch stretches_[most];
  Mask rest_;
};

/// Bilinear interpolation.
HWY_INLINE Vector between(const Corners& corners, const Place& place) {
  const auto& [a, b, c, d] = corners;
  const Vector upper = hn::MulAdd(place.right, hn::Sub(b, a), a), lower = hn::MulAdd(place.right, hn::Sub(d, c), c);
  return hn::MulAdd(place.down, hn::Sub(lower, upper), upper);
}

}  // namespace
}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
