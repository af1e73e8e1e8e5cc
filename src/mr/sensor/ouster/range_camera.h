#pragma once

#include <cstdint>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/pose.h"
#include "mr/sensor/ouster/lidar_scan.h"

namespace mr::sensor {

/// Which of a scan's pictures becomes the grey colour picture.
enum class GreySource {
  none,
  near_ir,      ///< ambient light: a photograph in the near infrared, exposed by GreyExposure
  reflectivity  ///< of the surface, by the sensor's own light; 100 (a white surface) and more:
                ///< white
};

/// Exposure of near-infrared pictures: the counts that become black and white. They follow the 1st
/// and 99th percentile of the scans' pixels, by a tenth each scan, so that pictures do not flicker.
struct GreyExposure {
  double black = 0, white = 0;  ///< counts
  bool is_set = false;          ///< by a first scan, whose percentiles are taken as they are

  void update(const LidarScan& scan);
};

/// Turns scans into the pictures of an ideal LiDAR camera: all rays start at one centre, and the
/// columns are evenly spaced. The sensor's own beams start up to 28 mm beside the axis and are
/// turned against each other, so that up close a point's direction from the centre is not its
/// beam's.
///
/// The centre lies in the lidar frame on the axis of rotation, at the height of the beams. The
/// camera looks along the sensor's x axis, to within half a column: so much it is turned that most
/// beams meet column centres. Column 0 is behind; the columns go clockwise seen from above, as in
/// every picture of this project (nothing is mirrored).
class RangeCamera {
 public:
  struct Picture {
    ImageDepth depth;  ///< [height x width of depth_camera()] metres from the centre; 0: none
    ImageRgb color;    ///< [color_camera()] grey; empty for GreySource::none
  };

  explicit RangeCamera(const OusterMetadata& metadata);

  /// Model lidar: a row per beam, the highest first, azimuths 0. Beams that an old 16-beam sensor
  /// only lists as zeros have no row.
  const Camera& depth_camera() const { return depth_camera_; }
  /// Model equirectangular, width x width / 2, with the same pose as the depth camera.
  const Camera& color_camera() const { return color_camera_; }
  const Pose& T_sensor_camera() const { return T_sensor_camera_; }

  /// The pictures of a scan of this sensor. Depth is of the first return. Between neighbouring
  /// beams on one surface it is interpolated (exactly, for a plane); elsewhere the nearest beam
  /// within half a beam counts; missing columns and returns stay holes. Colour comes along with
  /// depth, and from the beams at infinity where there is no return; above and below the beams it
  /// is black. Not thread-safe: uses buffers of its own. 2048x128: 11 ms, with colour 15 ms.
  Picture picture(const LidarScan& scan, GreySource color);

  const GreyExposure& exposure() const { return exposure_; }

 private:
  /// A beam, in the frame of a column: x ahead along the beam's heading, y clockwise, z up.
  struct Beam {
    int row = 0;               ///< in the scan
    int shift = 0;             ///< picture column - measurement id, for a point at infinity
    float shift_rest = 0;      ///< what `shift` leaves, columns
    float origin_ahead_m = 0;  ///< from the centre
    float origin_clockwise_m = 0;
    float cos_altitude = 1, sin_altitude = 0;
    float tangent = 0;  ///< of the altitude
    float secant = 1;
    float upper = 0, lower = 0;  ///< tangents half-way to the neighbouring beams
  };

  /// What one pixel of a picture row knows: 1 / distance from the axis (0: nothing), the tangent of
  /// its altitude, and its grey level.
  struct Samples {
    std::vector<float> inverse, tangent, grey;

    void reset(std::size_t count);
    bool put(std::size_t at, float new_inverse, float new_tangent, float new_grey);
  };

  void make_cameras(const OusterMetadata& metadata, double ahead_rad);
  void make_beams(const OusterMetadata& metadata, double ahead_rad);
  void make_color_rows();

  void make_grey_levels(const LidarScan& scan, GreySource color);
  void measure_row(const Beam& beam, const LidarScan& scan, GreySource color);
  void align_columns(const Beam& beam, std::size_t row);
  bool is_one_surface(std::size_t upper_row, std::size_t x) const;
  void interpolate_rows(std::size_t upper_row);
  void nearest_rows(std::size_t row);
  ImageDepth depth_picture() const;
  ImageRgb color_picture() const;

  double beam_reach_m_ = 0;  ///< from the beams' origin to where range 0 is: what range counts more
  int width_ = 0, scan_rows_ = 0;
  Camera depth_camera_, color_camera_;
  Pose T_sensor_camera_;
  std::vector<Beam> beams_;  ///< the highest first

  /// A row of the colour picture, between two beams; -1: black.
  struct ColorRow {
    int upper = -1, lower = -1;
    float lower_weight = 0;
  };
  std::vector<ColorRow> color_rows_;

  GreyExposure exposure_;
  std::vector<std::uint8_t> grey_levels_;  ///< of a count; higher counts as the last
  Samples measured_;                       ///< [width] one beam's, by measurement id
  std::vector<float> position_;            ///< [width] ditto: columns beside id + shift
  Samples aligned_;  ///< [beams * width] at column centres, in the beams' own altitudes
  Samples nearest_;  ///< [width] or [beams * width] where nothing was interpolated
  Samples picture_;  ///< [beams * width] at column centres and the ideal beams' altitudes
};

}  // namespace mr::sensor
