// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <span>

#include "pagesweep/base/parallel.h"
#include "pagesweep/timing/profile_bins_internal.h"

namespace pagesweep {
namespace {

using Point = ProfileBins::Point;

double median_of(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Point robust_mean(std::span<const Point> points, std::vector<double>& values) {
  values.clear();
  for (const Point& point : points) values.push_back(point.value);
  const double middle = median_of(values);
  for (double& value : values) value = std::abs(value - middle);
  const double limit = 3 * 1.4826 * median_of(values) + 1e-6;
  Point mean{0, 0, 0};
  for (const Point& point : points) {
    if (std::abs(point.value - middle) > limit) continue;
    mean.time += point.weight * point.time;
    mean.value += point.weight * point.value;
    mean.weight += point.weight;
  }
  mean.time /= mean.weight;
  mean.value /= mean.weight;
  return mean;
}

}  // namespace

ProfileBins::ProfileBins(double begin, double end, double bin_length)
    : begin_(begin), bin_length_(bin_length), count_(static_cast<std::size_t>(std::ceil((end - begin) / bin_length))) {}

std::size_t ProfileBins::bin_of(const Point& point) const {
  const double bin = (point.time - begin_) / bin_length_;
  return bin >= 0 && bin < static_cast<double>(count_) ? static_cast<std::size_t>(bin) : count_;
}

void ProfileBins::fill(std::size_t pixels,
                       const std::function<void(std::size_t pixel, std::vector<Point>&)>& samples_of) {
  constexpr std::size_t pixels_a_piece = 64;
  std::vector<std::vector<Point>> pieces((pixels + pixels_a_piece - 1) / pixels_a_piece);
  parallel_rows(static_cast<int>(pieces.size()), [&](int k) {
    const auto piece = static_cast<std::size_t>(k);
    const std::size_t first = piece * pixels_a_piece, last = std::min(pixels, first + pixels_a_piece);
    for (std::size_t pixel = first; pixel < last; ++pixel) samples_of(pixel, pieces[piece]);
  });
  std::vector<std::size_t> sizes(count_ + 1, 0);
  for (const auto& piece : pieces)
    for (const Point& point : piece) ++sizes[bin_of(point)];
  first_.assign(1, 0);
  for (std::size_t bin = 0; bin < count_; ++bin) first_.push_back(first_.back() + sizes[bin]);
  points_.resize(first_.back());
  std::vector<std::size_t> next = first_;
  for (const auto& piece : pieces)
    for (const Point& point : piece)
      if (const std::size_t bin = bin_of(point); bin < count_) points_[next[bin]++] = point;
}

std::vector<Point> ProfileBins::robust_means() const {
  std::vector<std::span<const Point>> filled;
  for (std::size_t bin = 0; bin < count_; ++bin)
    if (first_[bin + 1] > first_[bin])
      filled.push_back(std::span(points_).subspan(first_[bin], first_[bin + 1] - first_[bin]));
  std::vector<Point> means(filled.size());
  parallel_ranges(static_cast<int>(filled.size()), 16, [&](int first, int last) {
    std::vector<double> values;
    for (auto k = static_cast<std::size_t>(first); k < static_cast<std::size_t>(last); ++k)
      means[k] = robust_mean(filled[k], values);
  });
  return means;
}

}  // namespace pagesweep
