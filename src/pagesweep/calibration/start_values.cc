// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/calibration/start_values.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <cmath>
#include <numbers>

namespace pagesweep {
namespace {

/// Coordinates that have mean 0 and distance sqrt(dimension) on average: x -> scale (x - middle).
template <int dimension>
struct Normalisation {
  using Vector = Eigen::Matrix<double, dimension, 1>;
  Vector middle = Vector::Zero();
  double scale = 1;

  explicit Normalisation(std::span<const Vector> points) {
    for (const Vector& point : points) middle += point / static_cast<double>(points.size());
    double distance = 0;
    for (const Vector& point : points) distance += (point - middle).norm() / static_cast<double>(points.size());
    if (distance > 0) scale = std::sqrt(double(dimension)) / distance;
  }
  Vector operator()(const Vector& point) const { return scale * (point - middle); }
  Eigen::Matrix<double, dimension + 1, dimension + 1> matrix() const {
    Eigen::Matrix<double, dimension + 1, dimension + 1> m;
    m.setIdentity();
    m.template topLeftCorner<dimension, dimension>() *= scale;
    m.template topRightCorner<dimension, 1>() = -scale * middle;
    return m;
  }
};

/// The unit vector x that makes |A x| least; nothing if it is not the only one.
std::optional<Eigen::VectorXd> null_vector(const Eigen::MatrixXd& a) {
  const Eigen::Index n = a.cols();
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(a.transpose() * a, Eigen::ComputeFullV);
  if (!(svd.singularValues()[n - 2] > 1e-12 * svd.singularValues()[0])) return std::nullopt;
  return svd.matrixV().col(n - 1);
}

/// P with (u, v, 1) ~ P (X, 1), by the direct linear transform; its third row gives positive depths.
std::optional<Eigen::Matrix<double, 3, 4>> find_projection(const ScanPoints& points) {
  const auto count = static_cast<Eigen::Index>(points.pixels.size());
  if (count < 6) return std::nullopt;
  const Normalisation<3> in_space(points.rig_mm);
  const Normalisation<2> in_picture(points.pixels);
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(2 * count, 12);
  for (Eigen::Index k = 0; k < count; ++k) {
    const Eigen::RowVector4d x = in_space(points.rig_mm[std::size_t(k)]).homogeneous();
    const Eigen::Vector2d p = in_picture(points.pixels[std::size_t(k)]);
    a.block<1, 4>(2 * k, 0) = x;
    a.block<1, 4>(2 * k, 8) = -p.x() * x;
    a.block<1, 4>(2 * k + 1, 4) = x;
    a.block<1, 4>(2 * k + 1, 8) = -p.y() * x;
  }
  const auto solution = null_vector(a);
  if (!solution) return std::nullopt;
  const Eigen::Matrix<double, 3, 4> normalised =
      Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(solution->data());
  Eigen::Matrix<double, 3, 4> projection = in_picture.matrix().inverse() * normalised * in_space.matrix();
  projection /= projection.row(2).head<3>().norm();
  const double depth = projection.row(2) * in_space.middle.homogeneous();
  return depth < 0 ? Eigen::Matrix<double, 3, 4>(-projection) : projection;
}

/// A frame camera from its projection matrix: rows of K R orthogonalised from the last one up.
Camera camera_of(const Eigen::Matrix<double, 3, 4>& projection, const ScanPoints& points) {
  const Eigen::RowVector3d a = projection.row(0).head<3>(), b = projection.row(1).head<3>(),
                           c = projection.row(2).head<3>();
  Camera camera;
  camera.width = points.width, camera.height = points.height;
  camera.cx = a.dot(c), camera.cy = b.dot(c);
  Eigen::RowVector3d across = b - camera.cy * c;
  camera.fy = across.norm();
  across /= camera.fy;
  Eigen::Matrix3d& rotation = camera.cam_from_rig.rotation;
  rotation.row(2) = c;
  rotation.row(1) = across;
  rotation.row(0) = across.cross(c);  // what a skew would add to a is left out
  camera.fx = a.dot(rotation.row(0));
  const Eigen::Vector3d t(projection(0, 3), projection(1, 3), projection(2, 3));
  camera.cam_from_rig.translation = {(t.x() - camera.cx * t.z()) / camera.fx, (t.y() - camera.cy * t.z()) / camera.fy,
                                     t.z()};
  return camera;
}

/// Row v = a . X + b, and (u - cx) / f = X_c / Z_c as a quotient of two linear functions of X, alpha and beta; their
/// rows are R's, as seen along the step.
struct PushbroomForms {
  Eigen::Vector4d row, alpha, beta;
};

std::optional<PushbroomForms> find_pushbroom_forms(const ScanPoints& points) {
  const auto count = static_cast<Eigen::Index>(points.pixels.size());
  if (count < 8) return std::nullopt;
  const Normalisation<3> in_space(points.rig_mm);
  const Normalisation<2> in_picture(points.pixels);
  Eigen::MatrixXd x(count, 4), a(count, 8);
  Eigen::VectorXd rows(count);
  for (Eigen::Index k = 0; k < count; ++k) {
    x.row(k) = in_space(points.rig_mm[std::size_t(k)]).homogeneous();
    const Eigen::Vector2d p = in_picture(points.pixels[std::size_t(k)]);
    rows[k] = points.pixels[std::size_t(k)].y();
    a.row(k) << x.row(k), -p.x() * x.row(k);
  }
  const auto solution = null_vector(a);
  if (!solution) return std::nullopt;
  const Eigen::Matrix4d to_normal = in_space.matrix();
  const Eigen::Vector4d row = to_normal.transpose() * x.colPivHouseholderQr().solve(rows);
  Eigen::Vector4d alpha = to_normal.transpose() * solution->head<4>(),
                  beta = to_normal.transpose() * solution->tail<4>();
  alpha = alpha / in_picture.scale + in_picture.middle.x() * beta;  // u = u_n / scale + middle
  const double depth = beta.dot(in_space.middle.homogeneous());
  if (depth < 0) alpha = -alpha, beta = -beta;
  return PushbroomForms{row, alpha, beta};
}

std::optional<Scanner::Model> find_pushbroom(const ScanPoints& points) {
  const auto forms = find_pushbroom_forms(points);
  if (!forms) return std::nullopt;
  const Eigen::Vector3d a = forms->row.head<3>(), alpha = forms->alpha.head<3>(), beta = forms->beta.head<3>();
  const Eigen::Vector3d across = a.normalized();
  // alpha and beta vanish along the step, a . step = 1.
  const Eigen::Vector3d direction = alpha.cross(beta);
  Pushbroom line;
  line.width = points.width, line.height = points.height;
  line.step = direction / a.dot(direction);
  const Eigen::Vector3d beta_in_plane = beta - across.dot(beta) * across;
  const Eigen::Vector3d alpha_in_plane = alpha - across.dot(alpha) * across;
  const double scale = beta_in_plane.norm();
  const Eigen::Vector3d z = beta_in_plane / scale;
  line.cx = alpha_in_plane.dot(z) / scale;
  const Eigen::Vector3d x = alpha_in_plane / scale - line.cx * z;
  line.f = x.norm();
  line.rotation.row(0) = x / line.f;
  line.rotation.row(1) = z.cross(x / line.f);
  line.rotation.row(2) = z;
  Eigen::Matrix3d forms_at_center;
  forms_at_center << a.transpose(), alpha.transpose(), beta.transpose();
  line.center = forms_at_center.fullPivLu().solve(-Eigen::Vector3d(forms->row[3], forms->alpha[3], forms->beta[3]));
  if (!line.center.allFinite() || !line.step.allFinite() || !(line.f > 0)) return std::nullopt;
  return line;
}

/// A turning line is a central camera: for small angles it is a frame camera with fx = f, fy = 1 / angle_step.
std::optional<Scanner::Model> find_rotating_line(const ScanPoints& points) {
  const auto projection = find_projection(points);
  if (!projection) return std::nullopt;
  const Camera camera = camera_of(*projection, points);
  RotatingLine line;
  line.width = points.width, line.height = points.height;
  line.f = camera.fx, line.cx = camera.cx;
  line.rotation = camera.cam_from_rig.rotation;
  line.center = camera.center();
  line.angle_step = 1 / camera.fy;
  line.angle0 = -camera.cy / camera.fy;
  return line;
}

}  // namespace

std::optional<Eigen::Matrix3d> find_homography(std::span<const Eigen::Vector2d> plane,
                                               std::span<const Eigen::Vector2d> picture) {
  if (plane.size() < 4 || plane.size() != picture.size()) return std::nullopt;
  const Normalisation<2> in_plane(plane), in_picture(picture);
  const auto count = static_cast<Eigen::Index>(plane.size());
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(2 * count, 9);
  for (Eigen::Index k = 0; k < count; ++k) {
    const Eigen::RowVector3d x = in_plane(plane[std::size_t(k)]).homogeneous();
    const Eigen::Vector2d p = in_picture(picture[std::size_t(k)]);
    a.block<1, 3>(2 * k, 0) = x;
    a.block<1, 3>(2 * k, 6) = -p.x() * x;
    a.block<1, 3>(2 * k + 1, 3) = x;
    a.block<1, 3>(2 * k + 1, 6) = -p.y() * x;
  }
  const auto solution = null_vector(a);
  if (!solution) return std::nullopt;
  const Eigen::Matrix3d normalised = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(solution->data());
  Eigen::Matrix3d homography = in_picture.matrix().inverse() * normalised * in_plane.matrix();
  return homography / homography.norm();
}

std::optional<double> find_focal_length(std::span<const Eigen::Matrix3d> picture_from_plane) {
  // Both constraints are a w + b = 0 in w = 1 / f^2; each homography is scaled to columns of about unit size.
  double ab = 0, aa = 0;
  for (const Eigen::Matrix3d& h : picture_from_plane) {
    const Eigen::Vector3d h1 = h.col(0), h2 = h.col(1);
    const double size = h1.head<2>().squaredNorm() + h2.head<2>().squaredNorm();
    const auto constrain = [&](double a, double b) {
      ab += a * b / (size * size);
      aa += a * a / (size * size);
    };
    constrain(h1.head<2>().dot(h2.head<2>()), h1.z() * h2.z());
    constrain(h1.head<2>().squaredNorm() - h2.head<2>().squaredNorm(), h1.z() * h1.z() - h2.z() * h2.z());
  }
  if (!(-ab > 0 && aa > 0)) return std::nullopt;
  return std::sqrt(aa / -ab);
}

Rigid3 pose_from_homography(const Eigen::Matrix3d& image_from_plane) {
  Eigen::Matrix3d h = image_from_plane * (2 / (image_from_plane.col(0).norm() + image_from_plane.col(1).norm()));
  if (h(2, 2) < 0) h = -h;
  Eigen::Matrix3d axes;
  axes << h.col(0), h.col(1), h.col(0).cross(h.col(1));
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(axes, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return {svd.matrixU() * svd.matrixV().transpose(), h.col(2)};
}

std::optional<Scanner::Model> find_scanner(ScannerModel model, const ScanPoints& points) {
  switch (model) {
    case ScannerModel::pushbroom:
      return find_pushbroom(points);
    case ScannerModel::rotating_line:
      return find_rotating_line(points);
    case ScannerModel::brown_conrady:
      break;
  }
  const auto projection = find_projection(points);
  if (!projection) return std::nullopt;
  return camera_of(*projection, points);
}

bool is_mirrored(const ScanPoints& points) {
  const auto projection = find_projection(points);
  return projection && projection->leftCols<3>().determinant() < 0;
}

}  // namespace pagesweep
