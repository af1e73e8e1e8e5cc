#include "mr/sensor/ouster/range_camera.h"

#include <gtest/gtest.h>

#include "support/ouster_packets.h"

namespace mr::sensor::ouster_range_camera_test {
namespace {

using test::lidar_scan;
using test::ouster_metadata;

/// Points with dot(normal, p) = distance, in the sensor frame; the normal has unit length.
struct Plane {
  Vec3d normal;
  double distance_m;
  double off(Vec3d p) const { return dot(normal, p) - distance_m; }
};

/// The range at which a beam meets a plane; 0: it does not, within 30 m.
std::uint32_t range_to(const OusterMetadata& metadata, const Plane& plane, int column, int row) {
  const Vec3d start = ouster_point(metadata, row, column, 0);
  const Vec3d per_mm = (ouster_point(metadata, row, column, 10000) - start) * 1e-4;
  const double range_mm = -plane.off(start) / dot(plane.normal, per_mm);
  return range_mm > 0 && range_mm < 30000 ? static_cast<std::uint32_t>(std::lround(range_mm)) : 0;
}

LidarScan scan_of(const OusterMetadata& metadata, const Plane& plane) {
  return lidar_scan(metadata, [&](int column, int row) {
    return LidarPixel{.range_mm = range_to(metadata, plane, column, row), .near_ir = 100};
  });
}

Vec3d point_at(const RangeCamera& camera, const ImageDepth& depth, int x, int row) {
  const Vec3d ray = unproject(camera.depth_camera(), {double(x), double(row)});
  return camera.T_sensor_camera() * (ray * double(*depth.at(x, row)));
}

test::OusterJson os0(int height = 64) {
  return {.product = "OS-0-64",
          .width = 1024,
          .height = height,
          .window_last = 1023,
          .top_deg = 45,
          .bottom_deg = -45,
          .azimuth_deg = 11,
          .origin_mm = 27.67};
}

TEST(OusterRangeCamera, CamerasAreValid) {
  const RangeCamera camera(ouster_metadata(os0()));
  EXPECT_TRUE(camera.depth_camera().problems().empty());
  EXPECT_TRUE(camera.color_camera().problems().empty());
  EXPECT_TRUE(is_rigid(camera.T_sensor_camera()));
  EXPECT_EQ(camera.depth_camera().width, 1024);
  EXPECT_EQ(camera.depth_camera().height, 64);
  EXPECT_EQ(camera.color_camera().width, 1024);
  EXPECT_EQ(camera.color_camera().height, 512);
  EXPECT_NEAR(camera.T_sensor_camera().translation.z, 0.03618, 1e-9);
}

/// The camera looks along the sensor's x axis, to half a column, and is not mirrored.
TEST(OusterRangeCamera, WhatIsLeftOfTheSensorIsLeftInThePicture) {
  for (const double azimuth_deg : {0.0, 1.3, 4.2}) {
    const auto metadata = ouster_metadata({.azimuth_deg = azimuth_deg});
    const RangeCamera camera(metadata);
    const Pose T_camera_sensor = camera.T_sensor_camera().inverse();
    const auto column_of = [&](Vec3d p, const Camera& c) {
      return project(c, T_camera_sensor * p)->x;
    };
    const double middle = 512 / 2 - 0.5;
    for (const Camera& c : {camera.depth_camera(), camera.color_camera()}) {
      EXPECT_NEAR(column_of({5, 0, 0}, c), middle, 0.51);
      EXPECT_NEAR(column_of({0, 5, 0}, c), middle - 128, 0.51);
      EXPECT_NEAR(column_of({0, -5, 0}, c), middle + 128, 0.51);
    }
    const Vec3d above = T_camera_sensor * Vec3d{5, 0, 1};
    EXPECT_LT(above.y, 0);
  }
}

/// Every beam's point is found in the picture where the camera sees it.
TEST(OusterRangeCamera, OneReturnAppearsAtItsDirection) {
  const auto metadata = ouster_metadata(os0());
  RangeCamera camera(metadata);
  const Pose T_camera_sensor = camera.T_sensor_camera().inverse();
  for (const auto& [column, row, range_mm] : {std::tuple{0, 20, 5000},
                                              {300, 3, 9000},
                                              {511, 31, 700},
                                              {900, 60, 20000},
                                              {1023, 44, 400}}) {
    const auto scan =
        lidar_scan(metadata, [&, at = column, beam = row, mm = range_mm](int x, int y) {
          return LidarPixel{.range_mm = x == at && y == beam ? static_cast<std::uint32_t>(mm) : 0u};
        });
    const auto depth = camera.picture(scan, GreySource::none).depth;
    const Vec3d point =
        T_camera_sensor * ouster_point(metadata, row, column, static_cast<std::uint32_t>(range_mm));
    const auto at = project(camera.depth_camera(), point);
    const int x = static_cast<int>(std::lround(at->x)) % 1024;
    int found = 0;
    for (int y = 0; y < depth.height; ++y)
      for (int u = 0; u < depth.width; ++u) {
        if (*depth.at(u, y) == 0) continue;
        ++found;
        EXPECT_LE(std::abs(u - (x + 1024) % 1024), 1);
        EXPECT_EQ(y, static_cast<int>(at->y));
        EXPECT_NEAR(*depth.at(u, y), length(point), 0.002 * length(point));
      }
    EXPECT_EQ(found, 1) << column << " " << row;
  }
}

struct OnPlane {
  int pixels = 0;
  double worst_m = 0;
};

OnPlane compare(const OusterMetadata& metadata, const Plane& plane, double far_m) {
  RangeCamera camera(metadata);
  const auto depth = camera.picture(scan_of(metadata, plane), GreySource::none).depth;
  OnPlane out;
  for (int row = 0; row < depth.height; ++row)
    for (int x = 0; x < depth.width; ++x) {
      if (*depth.at(x, row) == 0 || *depth.at(x, row) > far_m) continue;
      ++out.pixels;
      out.worst_m = std::max(out.worst_m, std::abs(plane.off(point_at(camera, depth, x, row))));
    }
  return out;
}

/// Pixels of the ideal camera that see a plane nearer than so.
int pixels_of(const OusterMetadata& metadata, const Plane& plane, double far_m) {
  const RangeCamera camera(metadata);
  const Camera& c = camera.depth_camera();
  int count = 0;
  for (int row = 0; row < c.height; ++row)
    for (int x = 0; x < c.width; ++x) {
      const Vec3d ray = camera.T_sensor_camera().rotation * unproject(c, {double(x), double(row)});
      const double depth =
          -plane.off(camera.T_sensor_camera().translation) / dot(plane.normal, ray);
      count += depth > 0 && depth < far_m;
    }
  return count;
}

/// A wall ahead, one at an angle, the floor and the ceiling: nothing leaves the plane, though the
/// beams start 28 mm beside the axis and are turned by up to 11 degrees.
TEST(OusterRangeCamera, PointsOfAPlaneOneMetreAwayStayOnIt) {
  const auto metadata = ouster_metadata(os0());
  const Plane planes[] = {{{1, 0, 0}, 1},
                          {{0, -1, 0}, 1},
                          {normalized(Vec3d{1, 1, 0.3}), 1},
                          {{0, 0, -1}, 1},
                          {normalized(Vec3d{0.2, 0.1, 1}), 1.5}};
  for (const Plane& plane : planes) {
    const OnPlane got = compare(metadata, plane, 2.5);
    EXPECT_LT(got.worst_m, 0.001) << plane.normal.x << " " << plane.normal.y;
    EXPECT_GT(got.pixels, 0.9 * pixels_of(metadata, plane, 2.5));
  }
}

/// The same without any correction is off by centimetres: the test above can fail.
TEST(OusterRangeCamera, TheBeamsOwnDirectionsWouldMissThePlane) {
  const auto metadata = ouster_metadata(os0());
  const RangeCamera camera(metadata);
  const Plane ceiling{{0, 0, 1}, 1};
  double worst_m = 0;
  for (int row = 0; row < 10; ++row) {
    const double range_m = 0.001 * range_to(metadata, ceiling, 0, row);
    const double altitude = metadata.beam_altitude_rad[static_cast<std::size_t>(row)];
    const double z = camera.T_sensor_camera().translation.z + range_m * std::sin(altitude);
    worst_m = std::max(worst_m, std::abs(z - 1));
  }
  EXPECT_GT(worst_m, 0.015);
}

TEST(OusterRangeCamera, ADomesRaisedBeamsKeepTheirPlane) {
  auto json = os0(32);
  json.origin_up_mm = 12;
  const Plane wall{{1, 0, 0}, 1};
  EXPECT_LT(compare(ouster_metadata(json), wall, 2.0).worst_m, 0.001);
}

/// Between a near and a far surface, no points in the air.
TEST(OusterRangeCamera, EdgesAreNotBridged) {
  const auto metadata = ouster_metadata(os0());
  RangeCamera camera(metadata);
  const auto scan = lidar_scan(metadata, [&](int column, int row) {
    const bool near = (column / 50 + row / 9) % 2 == 0;
    return LidarPixel{.range_mm = near ? 1500u : 4000u};
  });
  const auto depth = camera.picture(scan, GreySource::none).depth;
  int near = 0, far = 0;
  for (const float d : depth.data) {
    near += d > 1.44f && d < 1.52f;
    far += d > 3.94f && d < 4.02f;
    EXPECT_TRUE(d == 0 || (d > 1.44f && d < 1.52f) || (d > 3.94f && d < 4.02f)) << d;
  }
  EXPECT_GT(near, 20000);
  EXPECT_GT(far, 20000);
}

TEST(OusterRangeCamera, MissingReturnsAndLostColumnsStayHoles) {
  const auto metadata = ouster_metadata({.azimuth_deg = 3});
  const auto scan = lidar_scan(metadata, [](int column, int row) {
    const bool hole = (column >= 100 && column < 110) || row == 7;
    return LidarPixel{.range_mm = hole ? 0u : 3000u};
  });
  RangeCamera camera(metadata);
  const auto depth = camera.picture(scan, GreySource::none).depth;
  int holes_in_row_7 = 0, holes = 0;
  for (int x = 0; x < 512; ++x) {
    holes_in_row_7 += *depth.at(x, 7) == 0;
    holes += *depth.at(x, 3) == 0;
  }
  EXPECT_EQ(holes_in_row_7, 512);
  EXPECT_NEAR(holes, 10, 1);
}

TEST(OusterRangeCamera, RowsGoFromTheHighestBeamDown) {
  auto json = os0(16);
  std::swap(json.top_deg, json.bottom_deg);
  const RangeCamera camera(ouster_metadata(json));
  EXPECT_GT(camera.depth_camera().beam_altitude_rad.front(), 0.7);
  EXPECT_LT(camera.depth_camera().beam_altitude_rad.back(), -0.7);
  const Plane wall{{1, 0, 0}, 1};
  EXPECT_LT(compare(ouster_metadata(json), wall, 2.0).worst_m, 0.001);
}

/// Firmware 1.12 lists 64 beams of a 16-beam sensor, 48 of them as zeros.
TEST(OusterRangeCamera, BeamsListedAsZerosHaveNoRow) {
  auto metadata = ouster_metadata(os0(64));
  for (std::size_t row = 0; row < 64; ++row)
    if (row % 4 != 0) metadata.beam_altitude_rad[row] = metadata.beam_azimuth_rad[row] = 0;
  EXPECT_EQ(RangeCamera(metadata).depth_camera().height, 17);  // one zero may be a beam
}

// Colour ----------------------------------------------------------------------------------------

TEST(OusterRangeCamera, GreyPictureShowsNearInfraredWhereItIs) {
  const auto metadata = ouster_metadata({.azimuth_deg = 3});
  RangeCamera camera(metadata);
  // Left of the sensor bright, right dark, everywhere without a return.
  const auto scan = lidar_scan(metadata, [&](int column, int row) {
    const Vec3d p = ouster_point(metadata, row, column, 10000);
    return LidarPixel{.near_ir = static_cast<std::uint16_t>(p.y > 0 ? 4000 : 100)};
  });
  const auto picture = camera.picture(scan, GreySource::near_ir);
  ASSERT_EQ(picture.color.width, 512);
  ASSERT_EQ(picture.color.height, 256);
  EXPECT_GT(*picture.color.at(128, 128), 250);
  EXPECT_LT(*picture.color.at(384, 128), 5);
  EXPECT_EQ(*picture.color.at(128, 20), 0) << "above the beams";
  EXPECT_EQ(*picture.color.at(128, 235), 0) << "below the beams";
  EXPECT_GT(*picture.color.at(128, 128 - 30), 250) << "21 degrees up";
  for (const float d : picture.depth.data) ASSERT_EQ(d, 0);
}

/// A bright patch on a wall appears in the colour picture where its depth does.
TEST(OusterRangeCamera, GreyIsRegisteredWithDepthUpClose) {
  const auto metadata = ouster_metadata(os0());
  RangeCamera camera(metadata);
  const Plane wall{{1, 0, 0}, 0.8};
  const auto scan = lidar_scan(metadata, [&](int column, int row) {
    const std::uint32_t range_mm = range_to(metadata, wall, column, row);
    const Vec3d p = ouster_point(metadata, row, column, range_mm);
    const bool bright = range_mm > 0 && p.z > 0.5;
    return LidarPixel{.range_mm = range_mm,
                      .near_ir = static_cast<std::uint16_t>(bright ? 900 : 50)};
  });
  const auto picture = camera.picture(scan, GreySource::near_ir);
  const Pose T_camera_sensor = camera.T_sensor_camera().inverse();
  for (const double y : {-0.3, 0.0, 0.3}) {
    const auto grey_at = [&](double z) {
      const auto at = project(camera.color_camera(), T_camera_sensor * Vec3d{0.8, y, z});
      return int{*picture.color.at(static_cast<int>(std::lround(at->x)),
                                   static_cast<int>(std::lround(at->y)))};
    };
    EXPECT_GT(grey_at(0.518), 128);  // the beams are 15 mm apart here, and start 28 mm ahead
    EXPECT_LT(grey_at(0.482), 128);
  }
}

TEST(OusterRangeCamera, ReflectivityHasAFixedScale) {
  const auto metadata = ouster_metadata({});
  RangeCamera camera(metadata);
  const auto grey = [&](std::uint8_t reflectivity) {
    const auto scan = lidar_scan(metadata, [&](int, int) {
      return LidarPixel{.range_mm = 2000, .reflectivity = reflectivity};
    });
    return int{*camera.picture(scan, GreySource::reflectivity).color.at(100, 128)};
  };
  EXPECT_EQ(grey(0), 0);
  EXPECT_NEAR(grey(18), 118, 2);  // the photographer's grey card
  EXPECT_EQ(grey(100), 255);
  EXPECT_EQ(grey(255), 255);
}

TEST(OusterGreyExposure, FollowsSlowlyAndIgnoresLostColumns) {
  const auto metadata = ouster_metadata({});
  const auto scan_of_counts = [&](int low, int high) {
    return lidar_scan(metadata, [=](int column, int) {
      return LidarPixel{.near_ir = static_cast<std::uint16_t>(column % 2 == 0 ? low : high)};
    });
  };
  GreyExposure exposure;
  LidarScan lost = scan_of_counts(7, 7);
  std::ranges::fill(lost.valid, std::uint8_t{0});
  exposure.update(lost);
  EXPECT_FALSE(exposure.is_set);
  exposure.update(scan_of_counts(100, 1000));
  EXPECT_EQ(exposure.black, 100);
  EXPECT_EQ(exposure.white, 1000);
  exposure.update(scan_of_counts(100, 2000));
  EXPECT_NEAR(exposure.white, 1100, 1e-9);
  for (int i = 0; i < 60; ++i) exposure.update(scan_of_counts(100, 2000));
  EXPECT_NEAR(exposure.white, 2000, 5);
}

}  // namespace
}  // namespace mr::sensor::ouster_range_camera_test
