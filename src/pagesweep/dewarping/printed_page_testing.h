// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "pagesweep/base/image.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/camera/scanner.h"
#include "pagesweep/data/page.h"
#include "pagesweep/data/page_surface.h"
#include "pagesweep/data/picture.h"

/// What the tests and benchmarks of this directory print on paper and scan.
namespace pagesweep {

/// Puts brightness 0 (black) to 1 (white) into all channels of a pixel.
inline void set_pixel(Picture& picture, int x, int y, double brightness) {
  for (int c = 0; c < picture.channels; ++c)
    std::visit(
        [&]<class T>(Image<T>& samples) {
          samples(x * picture.channels + c, y) =
              static_cast<T>(std::lround(brightness * double(std::numeric_limits<T>::max())));
        },
        picture.samples);
}

/// Brightness 0 to 1 of a pixel's first channel.
inline double pixel_at(const Picture& picture, int x, int y) {
  return std::visit(
      [&]<class T>(const Image<T>& samples) {
        return double(samples(x * picture.channels, y)) / double(std::numeric_limits<T>::max());
      },
      picture.samples);
}

/// Dark strokes like those of text, as a lens with a Gaussian point spread function shows them: known at every
/// position.
class StrokePattern {
 public:
  /// \param side_px   strokes cover the square from (0, 0) to (side, side)
  /// \param sigma_px  of the point spread function, pixel included
  StrokePattern(int side_px, double sigma_px) : side_(side_px), sigma_(sigma_px) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> shift(0, pitch - 8), length(4, 8), width(1.5, 3.5);
    const int count = side_px / pitch + 1;
    for (int i = 0; i < count * count; ++i) {
      const bool upright = random() % 2 == 0;
      const double x = (i % count) * pitch + shift(random), y = (i / count) * pitch + shift(random);
      const double l = length(random), w = width(random);
      strokes_.push_back({x, y, x + (upright ? w : l), y + (upright ? l : w)});
    }
  }

  double at(double u, double v) const {
    double ink = 0;
    const int count = side_ / pitch + 1;
    const int i = static_cast<int>(u) / pitch, j = static_cast<int>(v) / pitch;
    for (int b = std::max(0, j - 1); b <= std::min(count - 1, j + 1); ++b)
      for (int a = std::max(0, i - 1); a <= std::min(count - 1, i + 1); ++a) {
        const Stroke& stroke = strokes_[static_cast<std::size_t>(b * count + a)];
        ink += cover(stroke.left, stroke.right, u) * cover(stroke.top, stroke.bottom, v);
      }
    return 0.85 - 0.8 * ink;
  }

  Picture render(int width, int height, int channels, int bit_depth) const {
    Picture picture = make_picture(width, height, channels, bit_depth);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) set_pixel(picture, x, y, at(x, y));
    return picture;
  }

 private:
  struct Stroke {
    double left, top, right, bottom;
  };
  static constexpr int pitch = 16;
  double cover(double from, double to, double position) const {
    const auto step = [&](double edge) { return 0.5 * std::erf((position - edge) / (sigma_ * std::sqrt(2.0))); };
    return step(from) - step(to);
  }

  int side_;
  double sigma_;
  std::vector<Stroke> strokes_;
};

/// Peak signal to noise ratio of a page against the true brightness at the positions that it shows.
inline double psnr_db(const Picture& page, const ScanMap& map, const std::function<double(double u, double v)>& truth) {
  double squares = 0;
  for (int y = 0; y < page.height(); ++y)
    for (int x = 0; x < page.width(); ++x) {
      const double error = pixel_at(page, x, y) - truth(map.u(x, y), map.v(x, y));
      squares += error * error;
    }
  return -10 * std::log10(squares / (double(page.width()) * page.height()));
}

/// Paper (s, t) [mm] -> rig point [mm], in closed form.
using Sheet = std::function<Eigen::Vector3d(double s_mm, double t_mm)>;

/// s along rig x, t along -y, `rise` [mm/mm] along s.
inline Sheet tilted_plane(double rise, double height_mm = 10) {
  const double c = 1 / std::hypot(1.0, rise);
  return [=](double s, double t) { return Eigen::Vector3d(c * s, -t, height_mm + rise * c * s); };
}

/// A page bent about an axis along y through s = 0: arc length on the circle is arc length on the paper.
inline Sheet cylinder(double radius_mm, double height_mm = 30) {
  return [=](double s, double t) {
    return Eigen::Vector3d(radius_mm * std::sin(s / radius_mm), -t,
                           height_mm + radius_mm * (std::cos(s / radius_mm) - 1));
  };
}

/// A sheet with a bump of Gaussian shape along its normal.
inline Sheet dented(const Sheet& sheet, double depth_mm, double sigma_mm, Eigen::Vector2d center_mm) {
  return [=](double s, double t) -> Eigen::Vector3d {
    const double h = 1e-3;
    const Eigen::Vector3d normal =
        (sheet(s, t + h) - sheet(s, t - h)).cross(sheet(s + h, t) - sheet(s - h, t)).normalized();
    const double distance = (Eigen::Vector2d(s, t) - center_mm).norm() / sigma_mm;
    return sheet(s, t) + depth_mm * std::exp(-0.5 * distance * distance) * normal;
  };
}

/// The nodes of a surface from (s0, t0) to (s1, t1), all measured.
inline PageSurface make_surface(const Sheet& model, const Sheet& measured, Eigen::Vector2d from_mm,
                                Eigen::Vector2d to_mm) {
  PageSurface surface;
  surface.s0_mm = from_mm.x();
  surface.t0_mm = from_mm.y();
  const int columns = static_cast<int>(std::lround((to_mm.x() - from_mm.x()) / surface.spacing_mm)) + 1;
  const int rows = static_cast<int>(std::lround((to_mm.y() - from_mm.y()) / surface.spacing_mm)) + 1;
  surface.model = Image<Eigen::Vector3f>(columns, rows, Eigen::Vector3f::Zero());
  surface.measured = surface.model;
  surface.sigma = Image<float>(columns, rows, 0.02f);
  surface.status = Image<PixelStatus>(columns, rows, PixelStatus::ok);
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) {
      surface.model(i, j) = model(surface.s_of(i), surface.t_of(j)).cast<float>();
      surface.measured(i, j) = measured(surface.s_of(i), surface.t_of(j)).cast<float>();
    }
  return surface;
}

/// Small scanners of all three models, about `pixels_per_mm` at 660 mm distance, over a field around the rig's origin.
inline std::vector<std::pair<std::string, Scanner>> make_small_scanners(double pixels_per_mm, int width, int height) {
  const Eigen::Matrix3d down = Eigen::Vector3d(1, -1, -1).asDiagonal();
  const double distance = 700, f = pixels_per_mm * 660;
  const double cx = (width - 1) / 2.0, cy = (height - 1) / 2.0;
  Camera camera{"scan", width, height, f, f, cx, cy, {-0.02, 0.01, 1e-4, 2e-4, 0}, {}};
  camera.cam_from_rig = {down, {0, 0, distance}};
  const Pushbroom pushbroom{
      width, height, f, cx, -0.02, down, {0, cy / pixels_per_mm, distance}, {0, -1 / pixels_per_mm, 0}};
  const double angle_step = 1 / f;
  const RotatingLine rotating{width, height, f, cx, -0.02, down, {0, 0, distance}, -cy * angle_step, angle_step};
  return {{"frame_camera", Scanner(camera)}, {"pushbroom", Scanner(pushbroom)}, {"rotating_line", Scanner(rotating)}};
}

/// The picture that a scanner takes of a printed sheet: for every pixel the paper spot that it sees, by Newton's method
/// on G(sheet(s, t)) = (u, v).
/// \param print   brightness 0 to 1 at paper (s, t), beyond the paper too
/// \param smooth  samples a pixel along each axis
inline Picture render_scan(const Sheet& sheet, const Scanner& scanner,
                           const std::function<double(double s_mm, double t_mm)>& print, int smooth = 2,
                           int channels = 1, int bit_depth = 8) {
  Picture scan = make_picture(scanner.width(), scanner.height(), channels, bit_depth);
  const auto image = [&](const Eigen::Vector2d& at) { return *scanner.project(sheet(at.x(), at.y())); };
  const auto jacobian = [&](const Eigen::Vector2d& at) {
    const double h = 1e-3;
    const Eigen::Vector2d along_s(h, 0), along_t(0, h);
    Eigen::Matrix2d pixel_by_paper;
    pixel_by_paper << (image(at + along_s) - image(at - along_s)) / (2 * h),
        (image(at + along_t) - image(at - along_t)) / (2 * h);
    return pixel_by_paper;
  };
  parallel_rows(scanner.height(), [&](int y) {
    Eigen::Vector2d paper = Eigen::Vector2d::Zero();
    for (int x = 0; x < scanner.width(); ++x) {
      Eigen::Matrix2d paper_by_pixel = Eigen::Matrix2d::Zero();
      // From the neighbour's spot one derivative serves for two steps.
      for (int i = 0; i < (x == 0 ? 30 : 2); ++i) {
        if (x == 0 || i == 0) paper_by_pixel = jacobian(paper).inverse();
        paper -= paper_by_pixel * (image(paper) - Eigen::Vector2d(x, y));
      }
      double sum = 0;
      for (int k = 0; k < smooth * smooth; ++k) {
        const Eigen::Vector2d offset((k % smooth + 0.5) / smooth - 0.5, (k / smooth + 0.5) / smooth - 0.5);
        const Eigen::Vector2d at = paper + paper_by_pixel * offset;
        sum += print(at.x(), at.y());
      }
      set_pixel(scan, x, y, sum / (smooth * smooth));
    }
  });
  return scan;
}

}  // namespace pagesweep
