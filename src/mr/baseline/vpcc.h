#pragma once

#include <chrono>
#include <filesystem>
#include <optional>

#include "mr/baseline/points.h"

namespace mr::baseline {

/// MPEG's V-PCC reference programs (TMC2), where they are installed.
struct VpccPrograms {
  std::filesystem::path encoder, decoder;
  std::filesystem::path config;  ///< TMC2's `cfg` folder beside the programs' `bin`; may be empty
  std::chrono::seconds limit{600};
};

/// `PccAppEncoder` and `PccAppDecoder` on the PATH; nothing unless both are there.
std::optional<VpccPrograms> find_vpcc();

/// One capture by the encoder, through a private temporary folder. V-PCC codes whole numbers, so
/// points go as voxels: `voxel_m` is its finest step.
Result<Bytes> encode_vpcc_points(const VpccPrograms& programs, const PointSet& points,
                                 double voxel_m);

/// Decodes such a capture. V-PCC is lossy and may return more or fewer points; at most `most` are
/// read.
Result<PointSet> decode_vpcc_points(const VpccPrograms& programs, std::span<const std::byte> bytes,
                                    std::uint32_t most);

}  // namespace mr::baseline
