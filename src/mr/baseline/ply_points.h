#pragma once

#include "mr/baseline/points.h"

namespace mr::baseline {

/// Points as a binary .ply file: float x y z, uchar red green blue.
Bytes to_ply(const PointSet& points);

/// The points of a .ply file, ascii or binary little-endian; other properties of its vertices are
/// skipped, and so is whatever follows them. corrupt, or too_large for more than `most`.
Result<PointSet> from_ply(std::span<const std::byte> bytes, std::uint32_t most);

}  // namespace mr::baseline
