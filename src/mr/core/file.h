#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "mr/core/result.h"

namespace mr {

/// A whole file; not_found, io, or too_large beyond `max_bytes`.
Result<std::vector<std::byte>> read_file(const std::filesystem::path& file,
                                         std::uintmax_t max_bytes = std::uintmax_t{1} << 30);

/// Writes beside the target and renames, so a full disk or a crash leaves no partial file.
Status write_file(const std::filesystem::path& file, std::span<const std::byte> bytes);
Status write_file(const std::filesystem::path& file, const std::string& text);

}  // namespace mr
