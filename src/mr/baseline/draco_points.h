#pragma once

#include "mr/baseline/points.h"

namespace mr::baseline {

/// Points on the lattice as one Draco kd-tree stream. invalid: a point is outside the lattice's
/// cube. Coinciding points are kept.
Result<Bytes> encode_draco_points(const PointSet& points, const Lattice& lattice);

/// The points of such a stream, in the tree's order; they must be `count`.
Result<PointSet> decode_draco_points(std::span<const std::byte> bytes, std::uint32_t count,
                                     const Lattice& lattice);

}  // namespace mr::baseline
