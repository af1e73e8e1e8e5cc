#include "mr/core/camera.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace mr {
namespace {

constexpr double kPi = std::numbers::pi;

/// Radial factor of the lens model at squared radius r2.
double radial_factor(const Camera& c, double r2) {
  if (c.distortion == DistortionModel::none) return 1;
  const double up = 1 + r2 * (c.k[0] + r2 * (c.k[1] + r2 * c.k[2]));
  if (c.distortion == DistortionModel::brown) return up;
  return up / (1 + r2 * (c.k[3] + r2 * (c.k[4] + r2 * c.k[5])));
}

/// Normalised image coordinates → distorted ones (OpenCV's order of coefficients).
Vec2d distort(const Camera& c, Vec2d n) {
  const double r2 = n.x * n.x + n.y * n.y, f = radial_factor(c, r2);
  const double mixed = c.distortion == DistortionModel::rational_6kt ? 1 : 2;
  return {n.x * f + mixed * c.p[0] * n.x * n.y + c.p[1] * (r2 + 2 * n.x * n.x),
          n.y * f + c.p[0] * (r2 + 2 * n.y * n.y) + mixed * c.p[1] * n.x * n.y};
}

/// Whether the distorted radius decreases at `r`: points farther out would be projected back into
/// the picture.
bool folds_back(const Camera& c, double r) {
  if (c.distortion == DistortionModel::none) return false;
  const double step = 1e-3 * (r + 1e-3);
  return (r + step) * radial_factor(c, (r + step) * (r + step)) <= r * radial_factor(c, r * r) ||
         radial_factor(c, r * r) <= 0;
}

/// Inverts distort() by Newton steps on a numerical Jacobian.
Vec2d undistort(const Camera& c, Vec2d distorted) {
  Vec2d n = distorted;
  for (int i = 0; i < 20; ++i) {
    const Vec2d f = distort(c, n) - distorted;
    if (std::abs(f.x) + std::abs(f.y) < 1e-12) break;
    constexpr double h = 1e-6;
    const Vec2d dx = (distort(c, {n.x + h, n.y}) - distort(c, {n.x - h, n.y})) * (0.5 / h);
    const Vec2d dy = (distort(c, {n.x, n.y + h}) - distort(c, {n.x, n.y - h})) * (0.5 / h);
    const double det = dx.x * dy.y - dy.x * dx.y;
    if (std::abs(det) < 1e-9) break;
    n = {n.x - (f.x * dy.y - dy.x * f.y) / det, n.y - (dx.x * f.y - f.x * dx.y) / det};
  }
  return n;
}

std::optional<Vec2d> project_lidar(const Camera& c, Vec3d p) {
  const double altitude = std::atan2(-p.y, std::hypot(p.x, p.z));
  int row = -1;
  double best = std::numeric_limits<double>::max();
  for (int r = 0; r < c.height; ++r) {
    const double off = std::abs(c.beam_altitude_rad[r] - altitude);
    if (off < best) best = off, row = r;
  }
  if (row < 0) return std::nullopt;
  double turn = (std::atan2(p.x, p.z) - c.beam_azimuth_rad[row]) / (2 * kPi) + 0.5;
  turn -= std::floor(turn);
  return Vec2d{turn * c.width - 0.5, static_cast<double>(row)};
}

}  // namespace

std::optional<Vec2d> project(const Camera& c, Vec3d p) {
  if (!is_finite(p) || dot(p, p) == 0) return std::nullopt;
  switch (c.model) {
    case CameraModel::pinhole: {
      if (p.z <= 1e-9) return std::nullopt;
      Vec2d n{p.x / p.z, p.y / p.z};
      if (c.distortion != DistortionModel::none) {
        if (c.most_radius > 0 && std::hypot(n.x, n.y) > c.most_radius) return std::nullopt;
        if (folds_back(c, std::hypot(n.x, n.y))) return std::nullopt;
        n = distort(c, n);
      }
      return Vec2d{n.x * c.fx + c.cx, n.y * c.fy + c.cy};
    }
    case CameraModel::equirectangular:
      return Vec2d{(std::atan2(p.x, p.z) / (2 * kPi) + 0.5) * c.width - 0.5,
                   (std::atan2(p.y, std::hypot(p.x, p.z)) / kPi + 0.5) * c.height - 0.5};
    case CameraModel::lidar:
      return project_lidar(c, p);
  }
  return std::nullopt;
}

Vec3d unproject(const Camera& c, Vec2d pixel) {
  const auto direction = [](double longitude, double down) {
    return Vec3d{std::sin(longitude) * std::cos(down), std::sin(down),
                 std::cos(longitude) * std::cos(down)};
  };
  if (c.model == CameraModel::pinhole) {
    const Vec2d d{(pixel.x - c.cx) / c.fx, (pixel.y - c.cy) / c.fy};
    const Vec2d n = c.distortion == DistortionModel::none ? d : undistort(c, d);
    return {n.x, n.y, 1};
  }
  const double longitude = ((pixel.x + 0.5) / c.width - 0.5) * 2 * kPi;
  if (c.model == CameraModel::equirectangular)
    return direction(longitude, ((pixel.y + 0.5) / c.height - 0.5) * kPi);
  const int row = std::clamp(static_cast<int>(std::lround(pixel.y)), 0, c.height - 1);
  return direction(longitude + c.beam_azimuth_rad[row], -c.beam_altitude_rad[row]);
}

Camera undistorted(const Camera& camera) {
  Camera straight = camera;
  straight.distortion = DistortionModel::none;
  straight.k = {};
  straight.p = {};
  straight.most_radius = 0;
  return straight;
}

namespace {

/// The ray farthest out from the middle of the picture to the middle of an edge for which the lens
/// model holds.
Vec2d edge_ray(const Camera& c, Vec2d edge) {
  constexpr double kMost = 2.14;  // tan 65 degrees
  constexpr int kSteps = 100;
  const Vec2d middle{c.cx, c.cy};
  Vec2d best;
  for (int i = 1; i <= kSteps; ++i) {
    const Vec2d pixel = middle + (edge - middle) * (static_cast<double>(i) / kSteps);
    const Vec3d ray = unproject(c, pixel);
    const auto back = project(c, ray);
    const bool holds = back && std::hypot(back->x - pixel.x, back->y - pixel.y) < 0.1 &&
                       std::hypot(ray.x, ray.y) <= kMost;
    if (!holds) break;
    best = {ray.x, ray.y};
  }
  return best;
}

}  // namespace

Camera undistorted_whole(const Camera& camera) {
  Camera out = undistorted(camera);
  if (camera.model != CameraModel::pinhole || camera.distortion == DistortionModel::none)
    return out;
  const double right = camera.width - 1, bottom = camera.height - 1;
  const double x0 = edge_ray(camera, {0, camera.cy}).x, x1 = edge_ray(camera, {right, camera.cy}).x;
  const double y0 = edge_ray(camera, {camera.cx, 0}).y,
               y1 = edge_ray(camera, {camera.cx, bottom}).y;
  if (x1 <= x0 || y1 <= y0) return out;
  const double scale =
      std::min({1.0, right / (camera.fx * (x1 - x0)), bottom / (camera.fy * (y1 - y0))});
  if (scale == 1) return out;
  out.fx *= scale, out.fy *= scale;
  out.cx = right / 2 - out.fx * (x0 + x1) / 2;
  out.cy = bottom / 2 - out.fy * (y0 + y1) / 2;
  return out;
}

std::vector<std::string> Camera::problems() const {
  std::vector<std::string> out;
  constexpr int kMaxSide = 16384;
  if (width < 1 || height < 1 || width > kMaxSide || height > kMaxSide)
    out.push_back("size must be between 1 and 16384 pixels a side");
  if (model == CameraModel::lidar &&
      (beam_altitude_rad.size() != static_cast<std::size_t>(height) ||
       beam_azimuth_rad.size() != static_cast<std::size_t>(height)))
    out.push_back("a LiDAR needs one altitude and one azimuth per row");
  const auto within = [](double angle, double most) { return std::abs(angle) <= most; };  // not NaN
  if (model == CameraModel::lidar &&
      !(std::all_of(beam_altitude_rad.begin(), beam_altitude_rad.end(),
                    [&](double a) { return within(a, kPi / 2 + 1e-9); }) &&
        std::all_of(beam_azimuth_rad.begin(), beam_azimuth_rad.end(),
                    [&](double a) { return within(a, 2 * kPi); })))
    out.push_back("a LiDAR's altitudes must lie within 90 degrees, its azimuths within 360");
  if (model != CameraModel::pinhole) return out;
  for (const double v :
       {fx, fy, cx, cy, k[0], k[1], k[2], k[3], k[4], k[5], p[0], p[1], most_radius})
    if (!std::isfinite(v)) return {"intrinsics hold a number that is not finite"};
  if (fx <= 0 || fy <= 0) out.push_back("focal lengths fx and fy must be positive");
  if (fx > 100.0 * width || fy > 100.0 * height || fx < 0.05 * width || fy < 0.05 * height)
    out.push_back(
        "focal lengths do not fit the size: the field of view would be under 0.6 or over 168 "
        "degrees");
  if (cx < 0 || cy < 0 || cx > width - 1 || cy > height - 1)
    out.push_back("principal point cx, cy lies outside the picture");
  if (out.empty() && distortion != DistortionModel::none) {
    // Only the picture's inner half must be usable: vendors' models may fold beyond the field of
    // view.
    const double r = 0.5 * std::hypot(width / (2 * fx), height / (2 * fy));
    if (folds_back(*this, r)) out.push_back("distortion folds the picture over");
  }
  return out;
}

}  // namespace mr
