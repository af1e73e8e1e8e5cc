#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "mr/core/image.h"
#include "mr/core/pose.h"
#include "mr/core/result.h"

namespace mr::kit {

/// What the file of a 360-degree picture or video says about how it was taken.
///
/// Angles turn the picture's content into the upright world: heading (yaw) to the right, pitch up,
/// roll so that the picture's right side goes down. For JPEGs that is the compass heading, the
/// height above the horizon and the roll of GPano (developers.google.com/streetview/
/// spherical-metadata); for video what libavutil's spherical.h and Matroska (RFC 9559,
/// ProjectionPose*) describe. Later drafts of Google's Spherical Video V2 for MP4 turn the signs of
/// yaw and roll around; files with a pose other than zero are rare, so check the first one.
struct PanoramaInfo {
  std::string projection{};  ///< as the file names it, such as "equirectangular"; empty: not stated
  double heading_deg = 0, pitch_deg = 0, roll_deg = 0;

  int full_width = 0, full_height = 0;  ///< of the whole sphere in pixels; 0: it is not cropped
  Rect crop{};                          ///< where in it the picture lies

  bool equirectangular() const { return projection == "equirectangular"; }
  bool cropped() const { return full_width > 0; }
  friend bool operator==(const PanoramaInfo&, const PanoramaInfo&) = default;
};

/// Whether a size is that of a whole equirectangular sphere, to two pixels.
bool is_2_to_1(int width, int height);

/// Reads the Photo Sphere XMP (GPano) of a JPEG's APP1 segments; nothing stated where there is none
/// or where the bytes are no JPEG. Error: corrupt, with the name of the wrong field.
Result<PanoramaInfo> read_panorama_info(std::span<const std::byte> jpeg);

/// Maps the picture's equirectangular camera frame (x right, y down, z through its centre) to an
/// upright one: y along gravity, z to the north, or to where the heading is counted from.
/// The rotation is heading · pitch · roll; no translation.
Pose T_upright_picture(const PanoramaInfo& info);

/// Pastes a cropped picture into the whole sphere; what was not taken is black. Pictures that are
/// not cropped are returned as they are. A picture that was made smaller or larger after it was
/// cropped gets a sphere of its own scale. Errors: corrupt (the crop does not fit the sphere or the
/// picture, the sphere is not 2:1), too_large.
Result<ImageRgb> uncropped(ImageRgb image, const PanoramaInfo& info);

}  // namespace mr::kit
