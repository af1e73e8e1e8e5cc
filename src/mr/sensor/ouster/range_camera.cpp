#include "mr/sensor/ouster/range_camera.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <numeric>

#include "mr/kit/srgb.h"

namespace mr::sensor {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;
constexpr float kNearest_m = 0.01f;       ///< from the axis; nearer points have no heading
constexpr double kSteepest_rad = 1.5620;  ///< 89.5 degrees: tangents stay small numbers

/// Two neighbouring samples of inverse distance are on one surface if they differ by so much.
/// Sensor noise is up to 3 cm.
bool is_near(float a, float b) {
  const float smaller = std::min(a, b);
  return std::abs(a - b) <= std::max(0.02f * smaller, 0.03f * smaller * smaller);
}

/// Inverse distance at `at`, on the plane through the samples at 0 and 1 (fraction of the way).
float on_line(float at0, float at1, float fraction) { return at0 + (at1 - at0) * fraction; }

/// The beams by altitude, the highest first. Entries (0, 0) after the first stand for no beam.
std::vector<int> beams_by_altitude(const OusterMetadata& metadata) {
  const auto& altitude = metadata.beam_altitude_rad;
  std::vector<int> rows;
  bool had_zero = false;
  for (int row = 0; row < metadata.height; ++row) {
    const auto i = static_cast<std::size_t>(row);
    const bool is_zero = altitude[i] == 0 && metadata.beam_azimuth_rad[i] == 0;
    if (!is_zero || !had_zero) rows.push_back(row);
    had_zero |= is_zero;
  }
  std::ranges::stable_sort(rows, [&](int a, int b) {
    return altitude[static_cast<std::size_t>(a)] > altitude[static_cast<std::size_t>(b)];
  });
  return rows;
}

/// The heading in the lidar frame that the camera looks along: the sensor's x axis, turned by less
/// than half a column so that the columns' centres lie where most beams do.
double camera_heading(const OusterMetadata& metadata, const std::vector<int>& rows) {
  const Vec3d ahead = transposed(metadata.T_sensor_lidar.rotation) * Vec3d{1, 0, 0};
  const double heading = std::atan2(ahead.y, ahead.x), column = kTurn / metadata.width;
  std::complex<double> mean;  // of the beams' places within a column, as angles
  for (const int row : rows) {
    const double azimuth = metadata.beam_azimuth_rad[static_cast<std::size_t>(row)];
    mean += std::polar(1.0, kTurn * ((azimuth + heading) / column + metadata.width * 0.5 - 0.5));
  }
  return std::abs(mean) < 1e-6 ? heading : heading - std::arg(mean) / kTurn * column;
}

std::uint32_t percentile(const std::vector<std::uint32_t>& histogram, double count) {
  double seen = 0;
  for (std::size_t value = 0; value < histogram.size(); ++value)
    if ((seen += histogram[value]) >= count) return static_cast<std::uint32_t>(value);
  return static_cast<std::uint32_t>(histogram.size() - 1);
}

}  // namespace

void GreyExposure::update(const LidarScan& scan) {
  constexpr double kFollow = 0.1;
  std::vector<std::uint32_t> histogram(65536);
  for (int row = 0; row < scan.height(); ++row)
    for (int x = 0; x < scan.width(); ++x)
      histogram[*scan.near_ir.at(x, row)] += scan.valid[static_cast<std::size_t>(x)];
  const double count = static_cast<double>(scan.height()) * scan.valid_columns();
  if (count == 0) return;
  const double new_black = percentile(histogram, 0.01 * count);
  const double new_white = percentile(histogram, 0.99 * count);
  black = is_set ? black + kFollow * (new_black - black) : new_black;
  white = is_set ? white + kFollow * (new_white - white) : new_white;
  is_set = true;
}

RangeCamera::RangeCamera(const OusterMetadata& metadata)
    : beam_reach_m_(0.001 * std::hypot(metadata.beam_to_lidar[3], metadata.beam_to_lidar[11])),
      width_(metadata.width),
      scan_rows_(metadata.height) {
  const double heading = camera_heading(metadata, beams_by_altitude(metadata));
  make_cameras(metadata, heading);
  make_beams(metadata, heading);
  make_color_rows();
}

void RangeCamera::make_cameras(const OusterMetadata& metadata, double ahead_rad) {
  depth_camera_.model = CameraModel::lidar;
  depth_camera_.width = width_;
  for (const int row : beams_by_altitude(metadata))
    depth_camera_.beam_altitude_rad.push_back(
        metadata.beam_altitude_rad[static_cast<std::size_t>(row)]);
  depth_camera_.height = static_cast<int>(depth_camera_.beam_altitude_rad.size());
  depth_camera_.beam_azimuth_rad.assign(depth_camera_.beam_altitude_rad.size(), 0);
  color_camera_.model = CameraModel::equirectangular;
  color_camera_.width = width_;
  color_camera_.height = width_ / 2;
  const double c = std::cos(ahead_rad), s = std::sin(ahead_rad);
  const Pose T_lidar_camera{Mat3{{s, 0, c, -c, 0, s, 0, -1, 0}},
                            {0, 0, 0.001 * metadata.beam_to_lidar[11]}};
  T_sensor_camera_ = metadata.T_sensor_lidar * T_lidar_camera;
}

void RangeCamera::make_beams(const OusterMetadata& metadata, double ahead_rad) {
  const double origin_m = 0.001 * metadata.beam_to_lidar[3];
  for (const int row : beams_by_altitude(metadata)) {
    const double azimuth = metadata.beam_azimuth_rad[static_cast<std::size_t>(row)];
    const double altitude = metadata.beam_altitude_rad[static_cast<std::size_t>(row)];
    const double bounded = std::clamp(altitude, -kSteepest_rad, kSteepest_rad);
    const double shift = (azimuth + ahead_rad) / kTurn * width_ + width_ * 0.5 - 0.5;
    Beam beam;
    beam.row = row;
    beam.shift = static_cast<int>(std::lround(shift));
    beam.shift_rest = static_cast<float>(shift - beam.shift);
    beam.shift = (beam.shift % width_ + width_) % width_;
    beam.origin_ahead_m = static_cast<float>(origin_m * std::cos(azimuth));
    beam.origin_clockwise_m = static_cast<float>(-origin_m * std::sin(azimuth));
    beam.cos_altitude = static_cast<float>(std::cos(altitude));
    beam.sin_altitude = static_cast<float>(std::sin(altitude));
    beam.tangent = static_cast<float>(std::tan(bounded));
    beam.secant = static_cast<float>(1 / std::cos(bounded));
    beams_.push_back(beam);
  }
  for (std::size_t i = 0; i + 1 < beams_.size(); ++i)
    beams_[i].lower = beams_[i + 1].upper = 0.5f * (beams_[i].tangent + beams_[i + 1].tangent);
  Beam &first = beams_.front(), &last = beams_.back();
  constexpr float kHalfOfOnlyBeam = 0.01f;
  const bool is_only = beams_.size() == 1;
  first.upper = is_only ? first.tangent + kHalfOfOnlyBeam : 2 * first.tangent - first.lower;
  last.lower = is_only ? last.tangent - kHalfOfOnlyBeam : 2 * last.tangent - last.upper;
}

void RangeCamera::make_color_rows() {
  const auto& altitude = depth_camera_.beam_altitude_rad;
  const int last = depth_camera_.height - 1;
  color_rows_.resize(static_cast<std::size_t>(color_camera_.height));
  int upper = 0;
  for (std::size_t y = 0; y < color_rows_.size(); ++y) {
    const double at = (0.5 - (static_cast<double>(y) + 0.5) / color_camera_.height) * kTurn / 2;
    const auto tangent = static_cast<float>(std::tan(at));
    if (tangent > beams_.front().upper || tangent < beams_.back().lower) continue;
    while (upper < last && altitude[static_cast<std::size_t>(upper) + 1] >= at) ++upper;
    const int lower = std::min(upper + 1, last);
    const double from = altitude[static_cast<std::size_t>(upper)];
    const double gap = from - altitude[static_cast<std::size_t>(lower)];
    const double weight = gap > 0 ? std::clamp((from - at) / gap, 0.0, 1.0) : 0;
    color_rows_[y] = {upper, lower, static_cast<float>(weight)};
  }
}

void RangeCamera::Samples::reset(std::size_t count) {
  inverse.assign(count, 0);
  tangent.resize(count);  // counts where inverse is not 0
  grey.resize(count);     // ditto, or is written for every pixel
}

/// Keeps the nearer of two surfaces at one place.
bool RangeCamera::Samples::put(std::size_t at, float new_inverse, float new_tangent,
                               float new_grey) {
  if (new_inverse <= inverse[at]) return false;
  inverse[at] = new_inverse;
  tangent[at] = new_tangent;
  grey[at] = new_grey;
  return true;
}

/// Counts are proportional to light, pictures are sRGB.
void RangeCamera::make_grey_levels(const LidarScan& scan, GreySource color) {
  double black = 0, white = 100;
  if (color == GreySource::near_ir) {
    exposure_.update(scan);
    black = exposure_.black;
    white = std::max(exposure_.white, black + 1);
  }
  grey_levels_.resize(static_cast<std::size_t>(std::ceil(white)) + 1);
  for (std::size_t count = 0; count < grey_levels_.size(); ++count) {
    const double light = (static_cast<double>(count) - black) / (white - black);
    grey_levels_[count] = kit::to_srgb(std::clamp(light, 0.0, 1.0));
  }
}

/// A beam's points all around, as seen from the centre.
void RangeCamera::measure_row(const Beam& beam, const LidarScan& scan, GreySource color) {
  const auto columns_per_rad = static_cast<float>(width_ / kTurn);
  const auto reach_m = static_cast<float>(beam_reach_m_);
  const float clockwise_m = beam.origin_clockwise_m;
  const std::uint32_t* const range = scan.first.range_mm.row(beam.row);
  for (std::size_t v = 0; v < static_cast<std::size_t>(width_); ++v) {
    const float along_m = 0.001f * static_cast<float>(range[v]) - reach_m;
    const float ahead_m = along_m * beam.cos_altitude + beam.origin_ahead_m;
    const bool is_point = range[v] > 0 && along_m > 0 && ahead_m > kNearest_m;
    const float inverse = 1 / (is_point ? ahead_m : 1);
    const float turn = clockwise_m * inverse;  // tangent of the angle
    const float shorten = 1 - 0.5f * turn * turn;
    measured_.inverse[v] = is_point ? inverse * shorten : 0;
    measured_.tangent[v] = along_m * beam.sin_altitude * inverse * shorten;
    const float angle = std::abs(turn) < 0.1f ? turn : std::atan(turn);
    position_[v] = beam.shift_rest + (is_point ? angle * columns_per_rad : 0);
  }
  if (color == GreySource::none) return;
  for (std::size_t v = 0; v < static_cast<std::size_t>(width_); ++v) {
    const int x = static_cast<int>(v);
    const std::size_t count = color == GreySource::near_ir
                                  ? *scan.near_ir.at(x, beam.row)
                                  : *scan.first.reflectivity.at(x, beam.row);
    measured_.grey[v] =
        scan.valid[v] != 0 ? grey_levels_[std::min(count, grey_levels_.size() - 1)] : 0.f;
  }
}

/// Samples of one beam → column centres.
void RangeCamera::align_columns(const Beam& beam, std::size_t row) {
  const std::size_t first = row * static_cast<std::size_t>(width_);
  const auto column = [&](int v, int beside) {
    int x = v + beam.shift + beside;
    while (x >= width_) x -= width_;
    while (x < 0) x += width_;
    return first + static_cast<std::size_t>(x);
  };
  const auto& [inverse, tangent, grey] = measured_;
  nearest_.reset(static_cast<std::size_t>(width_));
  for (int v = 0; v < width_; ++v) {
    const auto a = static_cast<std::size_t>(v), b = v + 1 < width_ ? a + 1 : 0;
    if (inverse[a] == 0) continue;
    const std::size_t nearest = column(v, static_cast<int>(std::lrint(position_[a])));
    nearest_.put(nearest - first, inverse[a], tangent[a], grey[a]);
    if (inverse[b] == 0) continue;
    const std::size_t before = v > 0 ? a - 1 : static_cast<std::size_t>(width_) - 1;
    const std::size_t after = b + 1 < static_cast<std::size_t>(width_) ? b + 1 : 0;
    if (!is_near(inverse[a], inverse[b]) &&
        !(inverse[before] > 0 && is_near(2 * inverse[a] - inverse[before], inverse[b])) &&
        !(inverse[after] > 0 && is_near(2 * inverse[b] - inverse[after], inverse[a])))
      continue;
    const float from = position_[a], length = 1 + position_[b] - from;
    if (!(length > 0.1f && length < 4)) continue;
    for (int t = static_cast<int>(std::ceil(from)); static_cast<float>(t) <= from + length; ++t) {
      const float f = (static_cast<float>(t) - from) / length;
      aligned_.put(column(v, t), on_line(inverse[a], inverse[b], f),
                   on_line(tangent[a], tangent[b], f), on_line(grey[a], grey[b], f));
    }
  }
  for (int v = 0; v < width_; ++v) {
    const std::size_t at = column(v, 0), x = at - first;
    if (aligned_.inverse[at] > 0) continue;
    aligned_.grey[at] = measured_.grey[static_cast<std::size_t>(v)];
    if (nearest_.inverse[x] > 0)
      aligned_.put(at, nearest_.inverse[x], nearest_.tangent[x], nearest_.grey[x]);
  }
}

/// Whether the beam of a row and the one below hit one surface: their distances are alike, or lie
/// on the line of a neighbour. On a line of a plane, inverse distance is linear in the tangent.
bool RangeCamera::is_one_surface(std::size_t upper_row, std::size_t x) const {
  const auto width = static_cast<std::size_t>(width_);
  const float* const inverse = aligned_.inverse.data() + x;
  const float* const tangent = aligned_.tangent.data() + x;
  const std::size_t a = upper_row * width, b = a + width;
  if (is_near(inverse[a], inverse[b])) return true;
  const auto fits = [&](std::size_t outer, std::size_t from, std::size_t to) {
    const float run = tangent[from] - tangent[outer];
    if (inverse[outer] == 0 || std::abs(run) < 1e-6f) return false;
    const float fraction = (tangent[to] - tangent[outer]) / run;
    return is_near(on_line(inverse[outer], inverse[from], fraction), inverse[to]);
  };
  return (upper_row > 0 && fits(a - width, a, b)) ||
         (upper_row + 2 < beams_.size() && fits(b + width, b, a));
}

/// Fills the picture's rows whose altitude lies between the points of a row and of the next.
void RangeCamera::interpolate_rows(std::size_t upper_row) {
  const auto width = static_cast<std::size_t>(width_);
  const auto& [inverse, tangent, grey] = aligned_;
  for (std::size_t x = 0; x < width; ++x) {
    const std::size_t a = upper_row * width + x, b = a + width;
    const float drop = tangent[a] - tangent[b];
    if (inverse[a] == 0 || inverse[b] == 0 || !(drop > 1e-6f) || !is_one_surface(upper_row, x))
      continue;
    // Beyond the outermost points the surface goes on, for less than a beam.
    const float from = tangent[a] + (upper_row == 0 ? 0.75f * drop : 0);
    const float to = tangent[b] - (upper_row + 2 == beams_.size() ? 0.75f * drop : 0);
    std::size_t row = upper_row;
    while (row > 0 && beams_[row - 1].tangent <= from) --row;
    while (row < beams_.size() && beams_[row].tangent > from) ++row;
    for (; row < beams_.size() && beams_[row].tangent >= to; ++row) {
      const float f = (tangent[a] - beams_[row].tangent) / drop;
      picture_.put(row * width + x, on_line(inverse[a], inverse[b], f), beams_[row].tangent,
                   std::clamp(on_line(grey[a], grey[b], f), 0.f, 255.f));
    }
  }
}

void RangeCamera::nearest_rows(std::size_t sample_row) {
  const auto width = static_cast<std::size_t>(width_);
  for (std::size_t x = 0; x < width; ++x) {
    const std::size_t at = sample_row * width + x;
    const float tangent = aligned_.tangent[at];
    if (aligned_.inverse[at] == 0) continue;
    std::size_t row = sample_row;
    while (row > 0 && tangent > beams_[row].upper) --row;
    while (row + 1 < beams_.size() && tangent < beams_[row].lower) ++row;
    if (tangent <= beams_[row].upper && tangent >= beams_[row].lower)
      nearest_.put(row * width + x, aligned_.inverse[at], tangent, aligned_.grey[at]);
  }
}

RangeCamera::Picture RangeCamera::picture(const LidarScan& scan, GreySource color) {
  MR_ASSERT(scan.width() == width_ && scan.height() == scan_rows_);
  const auto width = static_cast<std::size_t>(width_);
  const std::size_t pixels = beams_.size() * width;
  if (color != GreySource::none) make_grey_levels(scan, color);
  measured_.reset(width);
  position_.assign(width, 0);
  aligned_.reset(pixels);
  for (std::size_t row = 0; row < beams_.size(); ++row) {
    measure_row(beams_[row], scan, color);
    align_columns(beams_[row], row);
  }
  picture_.reset(pixels);
  nearest_.reset(pixels);
  for (std::size_t row = 0; row + 1 < beams_.size(); ++row) interpolate_rows(row);
  for (std::size_t row = 0; row < beams_.size(); ++row) nearest_rows(row);
  for (std::size_t at = 0; at < pixels; ++at) {
    if (picture_.inverse[at] > 0) continue;
    picture_.grey[at] = aligned_.grey[at];
    picture_.put(at, nearest_.inverse[at], nearest_.tangent[at], nearest_.grey[at]);
  }
  return {depth_picture(), color == GreySource::none ? ImageRgb() : color_picture()};
}

ImageDepth RangeCamera::depth_picture() const {
  ImageDepth out(width_, depth_camera_.height);
  for (int row = 0; row < out.height; ++row) {
    const float* const inverse =
        picture_.inverse.data() + static_cast<std::size_t>(row) * static_cast<std::size_t>(width_);
    const float secant = beams_[static_cast<std::size_t>(row)].secant;
    for (int x = 0; x < width_; ++x) *out.at(x, row) = inverse[x] > 0 ? secant / inverse[x] : 0.f;
  }
  return out;
}

ImageRgb RangeCamera::color_picture() const {
  ImageRgb out(color_camera_.width, color_camera_.height);
  for (int y = 0; y < out.height; ++y) {
    const ColorRow& between = color_rows_[static_cast<std::size_t>(y)];
    if (between.upper < 0) continue;
    const float* const upper =
        picture_.grey.data() + static_cast<std::ptrdiff_t>(between.upper) * width_;
    const float* const lower =
        picture_.grey.data() + static_cast<std::ptrdiff_t>(between.lower) * width_;
    std::uint8_t* pixel = out.row(y);
    for (int x = 0; x < width_; ++x, pixel += 3) {
      const float grey = on_line(upper[x], lower[x], between.lower_weight);
      pixel[0] = pixel[1] = pixel[2] = static_cast<std::uint8_t>(grey + 0.5f);
    }
  }
  return out;
}

}  // namespace mr::sensor
