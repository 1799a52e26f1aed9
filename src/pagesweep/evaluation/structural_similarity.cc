// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/structural_similarity.h"

#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

constexpr int window = 11;
constexpr double window_sigma = 1.5;
constexpr std::array<double, 5> scale_weights = {0.0448, 0.2856, 0.3001, 0.2363, 0.1333};
constexpr int smallest_side = window << (scale_weights.size() - 1);
constexpr double c1 = (0.01 * 255) * (0.01 * 255), c2 = (0.03 * 255) * (0.03 * 255);

std::array<float, window> gaussian() {
  std::array<double, window> weights{};
  double sum = 0;
  for (int i = 0; i < window; ++i)
    sum += weights[std::size_t(i)] = std::exp(-0.5 * std::pow((i - 5) / window_sigma, 2));
  std::array<float, window> result{};
  for (std::size_t i = 0; i < window; ++i) result[i] = static_cast<float>(weights[i] / sum);
  return result;
}

/// Mean luminance term and mean contrast times structure term of one scale.
struct Similarity {
  double luminance = 0, structure = 0;
};

/// Weighted sums of a, b, aa, bb and ab over the window's columns, of one row of windows.
struct RowSums {
  std::vector<float> a, b, aa, bb, ab;
  explicit RowSums(std::size_t width) : a(width), b(width), aa(width), bb(width), ab(width) {}
};

void add_column_sums(ImageView<const float> a, ImageView<const float> b, int y, float weight, RowSums& sums) {
  for (int x = 0; x < a.width(); ++x) {
    const float p = a(x, y), q = b(x, y);
    const auto i = static_cast<std::size_t>(x);
    sums.a[i] += weight * p;
    sums.b[i] += weight * q;
    sums.aa[i] += weight * p * p;
    sums.bb[i] += weight * q * q;
    sums.ab[i] += weight * p * q;
  }
}

Similarity similarity_of_row(ImageView<const float> a, ImageView<const float> b, int top,
                             const std::array<float, window>& weights) {
  RowSums sums(static_cast<std::size_t>(a.width()));
  for (int k = 0; k < window; ++k) add_column_sums(a, b, top + k, weights[std::size_t(k)], sums);
  Similarity total;
  for (std::size_t x = 0; x + window <= sums.a.size(); ++x) {
    double mean_a = 0, mean_b = 0, aa = 0, bb = 0, ab = 0;
    for (std::size_t k = 0; k < window; ++k) {
      mean_a += double(weights[k] * sums.a[x + k]);
      mean_b += double(weights[k] * sums.b[x + k]);
      aa += double(weights[k] * sums.aa[x + k]);
      bb += double(weights[k] * sums.bb[x + k]);
      ab += double(weights[k] * sums.ab[x + k]);
    }
    total.luminance += (2 * mean_a * mean_b + c1) / (mean_a * mean_a + mean_b * mean_b + c1);
    total.structure += (2 * (ab - mean_a * mean_b) + c2) / (aa - mean_a * mean_a + bb - mean_b * mean_b + c2);
  }
  return total;
}

Similarity similarity(ImageView<const float> a, ImageView<const float> b) {
  const int rows = a.height() - window + 1, columns = a.width() - window + 1;
  const auto weights = gaussian();
  std::vector<Similarity> of_rows(static_cast<std::size_t>(rows));
  parallel_rows(rows, [&](int y) { of_rows[std::size_t(y)] = similarity_of_row(a, b, y, weights); });
  Similarity mean;
  for (const Similarity& row : of_rows) {
    mean.luminance += row.luminance / (double(rows) * columns);
    mean.structure += row.structure / (double(rows) * columns);
  }
  return mean;
}

Image<float> half_as_fine(ImageView<const float> image) {
  Image<float> half(image.width() / 2, image.height() / 2);
  parallel_rows(half.height(), [&](int y) {
    for (int x = 0; x < half.width(); ++x)
      half(x, y) = 0.25F * (image(2 * x, 2 * y) + image(2 * x + 1, 2 * y) + image(2 * x, 2 * y + 1) +
                            image(2 * x + 1, 2 * y + 1));
  });
  return half;
}

}  // namespace

double ms_ssim(ImageView<const float> a, ImageView<const float> b) {
  if (a.width() != b.width() || a.height() != b.height()) throw std::invalid_argument("ms_ssim: the sizes differ");
  if (a.width() < smallest_side || a.height() < smallest_side) return std::numeric_limits<double>::quiet_NaN();
  double product = 1;
  std::array<Image<float>, 2> finer;
  for (std::size_t scale = 0; scale < scale_weights.size(); ++scale) {
    const Similarity mean = similarity(a, b);
    product *= std::pow(std::max(mean.structure, 0.0), scale_weights[scale]);
    if (scale + 1 == scale_weights.size()) return product * std::pow(mean.luminance, scale_weights[scale]);
    finer = {half_as_fine(a), half_as_fine(b)};
    a = std::as_const(finer[0]).view();
    b = std::as_const(finer[1]).view();
  }
  return product;
}

}  // namespace pagesweep
