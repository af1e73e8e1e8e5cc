#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

#include "mr/core/result.h"

namespace mr::synth {

/// Writes 16-bit counts, row by row, as a grey PNG; no partial file is left on failure.
Status write_depth_png(const std::filesystem::path& file, int width, int height,
                       std::span<const std::uint16_t> counts);

}  // namespace mr::synth
