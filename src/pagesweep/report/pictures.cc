// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/report/pictures.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

using Bytes = Image<std::uint8_t>;

void put(Bytes& bytes, int x, int y, Rgb colour) {
  bytes(3 * x, y) = colour.r;
  bytes(3 * x + 1, y) = colour.g;
  bytes(3 * x + 2, y) = colour.b;
}

/// An RGB picture whose pixel (x, y) is colour_at(x, y).
template <class ColourAt>
Picture draw(int width, int height, const ColourAt& colour_at) {
  Picture picture = make_picture(width, height, 3, 8);
  Bytes& bytes = std::get<Bytes>(picture.samples);
  parallel_rows(height, [&](int y) {
    for (int x = 0; x < width; ++x) put(bytes, x, y, colour_at(x, y));
  });
  return picture;
}

double share_of(double value, Range range) {
  const double width = range.high - range.low;
  return width > 0 ? (value - range.low) / width : 0.5 + 0 * value;
}

Rgb scale(Rgb colour, double factor) {
  const auto scaled = [&](std::uint8_t c) {
    return static_cast<std::uint8_t>(std::clamp(std::lround(c * factor), 0l, 255l));
  };
  return {scaled(colour.r), scaled(colour.g), scaled(colour.b)};
}

std::vector<float> finite_values(const Image<float>& values) {
  std::vector<float> finite;
  for (const float value : values.pixels())
    if (std::isfinite(value)) finite.push_back(value);
  return finite;
}

double quantile(std::vector<float>& values, double share) {
  const auto at = values.begin() + std::lround(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

int shrink_factor(int width, int height, int longest_px) {
  return std::max(1, (std::max(width, height) + longest_px - 1) / std::max(1, longest_px));
}

}  // namespace

Range range_of(const Image<float>& values, double tail) {
  std::vector<float> finite = finite_values(values);
  if (finite.empty()) return {};
  return {quantile(finite, tail), quantile(finite, 1 - tail)};
}

Range symmetric_range_of(const Image<float>& values, double tail) {
  std::vector<float> finite = finite_values(values);
  if (finite.empty()) return {-1, 1};
  for (float& value : finite) value = std::abs(value);
  const double size = std::max(quantile(finite, 1 - tail), 1e-6);
  return {-size, size};
}

double round_step(Range range, int lines) {
  const double wanted = (range.high - range.low) / lines;
  if (!(wanted > 0)) return 1;
  const double power = std::pow(10, std::floor(std::log10(wanted)));
  const double factor = wanted / power;
  return power * (factor < 1.5 ? 1 : factor < 3.5 ? 2 : factor < 7.5 ? 5 : 10);
}

Picture draw_map(const Image<float>& values, Ramp ramp, Range range) {
  return draw(values.width(), values.height(),
              [&](int x, int y) { return colour_of(ramp, share_of(values(x, y), range)); });
}

Picture draw_contours(const Image<float>& values, Ramp ramp, Range range, double step) {
  const auto band = [&](int x, int y) { return std::floor(values(x, y) / step); };
  return draw(values.width(), values.height(), [&](int x, int y) {
    const Rgb colour = colour_of(ramp, share_of(values(x, y), range));
    const auto differs = [&](int i, int j) {
      return values.contains(i, j) && std::isfinite(values(i, j)) && band(i, j) != band(x, y);
    };
    const bool on_line = std::isfinite(values(x, y)) && (differs(x + 1, y) || differs(x, y + 1));
    return on_line ? scale(colour, 0.72) : colour;
  });
}

Picture draw_status(const Image<PixelStatus>& status) {
  return draw(status.width(), status.height(), [&](int x, int y) { return colour_of(status(x, y)); });
}

Image<float> shrink(const Image<float>& values, int longest_px) {
  const int factor = shrink_factor(values.width(), values.height(), longest_px);
  if (factor == 1) return values;
  Image<float> small(values.width() / factor, values.height() / factor);
  parallel_rows(small.height(), [&](int y) {
    for (int x = 0; x < small.width(); ++x) {
      double sum = 0;
      int count = 0;
      for (int j = y * factor; j < (y + 1) * factor; ++j)
        for (int i = x * factor; i < (x + 1) * factor; ++i)
          if (std::isfinite(values(i, j))) {
            sum += values(i, j);
            ++count;
          }
      small(x, y) = count > 0 ? static_cast<float>(sum / count) : not_a_number;
    }
  });
  return small;
}

Image<PixelStatus> shrink(const Image<PixelStatus>& status, int longest_px) {
  const int factor = shrink_factor(status.width(), status.height(), longest_px);
  Image<PixelStatus> small(status.width() / factor, status.height() / factor);
  for (int y = 0; y < small.height(); ++y)
    for (int x = 0; x < small.width(); ++x) small(x, y) = status(x * factor + factor / 2, y * factor + factor / 2);
  return small;
}

Picture shrink(const Picture& picture, int longest_px) {
  const int factor = shrink_factor(picture.width(), picture.height(), longest_px);
  const int channels = picture.channels;
  Picture small = make_picture(picture.width() / factor, picture.height() / factor, channels, 8);
  small.icc_profile = picture.icc_profile;
  Bytes& bytes = std::get<Bytes>(small.samples);
  const double to_8_bit = (picture.bit_depth() == 16 ? 255.0 / 65535 : 1.0) / (factor * factor);
  std::visit(
      [&](const auto& samples) {
        parallel_rows(small.height(), [&](int y) {
          for (int x = 0; x < bytes.width(); ++x) {
            const int pixel = x / channels, channel = x % channels;
            double sum = 0;
            for (int j = y * factor; j < (y + 1) * factor; ++j)
              for (int i = pixel * factor; i < (pixel + 1) * factor; ++i) sum += samples(i * channels + channel, j);
            bytes(x, y) = static_cast<std::uint8_t>(std::lround(sum * to_8_bit));
          }
        });
      },
      picture.samples);
  return small;
}

Picture crop_to_pages(const Picture& scan, std::span<const Page> pages) {
  double left = scan.width(), top = scan.height(), right = -1, bottom = -1;
  for (const Page& page : pages)
    for (std::size_t i = 0; i < page.scan_map.u.size(); ++i) {
      const double u = page.scan_map.u.data()[i], v = page.scan_map.v.data()[i];
      if (!std::isfinite(u) || !std::isfinite(v)) continue;
      left = std::min(left, u);
      right = std::max(right, u);
      top = std::min(top, v);
      bottom = std::max(bottom, v);
    }
  const auto inside = [](double position, int size) { return static_cast<int>(std::clamp(position, 0.0, size - 1.0)); };
  if (!(right > left && bottom > top) || right < 0 || bottom < 0 || left > scan.width() || top > scan.height())
    return {};
  const int x0 = inside(left, scan.width()), x1 = inside(right, scan.width());
  const int y0 = inside(top, scan.height()), y1 = inside(bottom, scan.height());
  Picture crop = make_picture(x1 - x0 + 1, y1 - y0 + 1, scan.channels, scan.bit_depth());
  crop.icc_profile = scan.icc_profile;
  std::visit(
      [&](auto& to) {
        const auto& from = std::get<std::decay_t<decltype(to)>>(scan.samples);
        for (int y = 0; y < to.height(); ++y) {
          const auto source = from.row(y0 + y).subspan(static_cast<std::size_t>(x0 * scan.channels));
          std::copy_n(source.begin(), to.width(), to.row(y).begin());
        }
      },
      crop.samples);
  return crop;
}

Image<float> difference_of(const PageSurface& surface) {
  Image<float> difference(surface.columns(), surface.rows(), not_a_number);
  for (int j = 0; j < surface.rows(); ++j)
    for (int i = 0; i < surface.columns(); ++i) {
      if (surface.status(i, j) != PixelStatus::ok) continue;
      const auto node = [&](int a, int b) -> const Eigen::Vector3f& {
        return surface.model(std::clamp(a, 0, surface.columns() - 1), std::clamp(b, 0, surface.rows() - 1));
      };
      // s points to the right and t down the page: t x s points out of it, towards its reader.
      const Eigen::Vector3f along_s = node(i + 1, j) - node(i - 1, j), along_t = node(i, j + 1) - node(i, j - 1);
      const Eigen::Vector3f normal = along_t.cross(along_s).normalized();
      difference(i, j) = normal.dot(surface.measured(i, j) - surface.model(i, j));
    }
  return difference;
}

}  // namespace pagesweep
