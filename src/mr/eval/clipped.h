#pragma once

#include <optional>
#include <span>

#include "mr/core/decoded_scene.h"
#include "mr/core/frame.h"

namespace mr::eval {

/// The share of used pixels that clip as a client shows them (a channel of 254 or more, decoded
/// value times View::gain) and do not in the sensor's own picture: of the worst view of either
/// layer. Used: pixels of the camera's picture that a triangle with the view's label shows
/// (atlas::used_pixels). `capture`: undistorted frames of the same moment. Nothing: no view has
/// used pixels and a picture in the capture.
std::optional<double> clipped_ratio(const DecodedScene& shown, std::span<const Frame> capture);

}  // namespace mr::eval
