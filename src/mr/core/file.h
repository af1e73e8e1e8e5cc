#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "mr/core/result.h"

namespace mr {

/// Reads a whole file. Errors: not_found, io; too_large beyond `max_bytes`.
Result<std::vector<std::byte>> read_file(const std::filesystem::path& file,
                                         std::uintmax_t max_bytes = std::uintmax_t{1} << 30);

/// Writes a temporary file beside the target and renames it, so that a full disk or a crash leaves
/// no partial file. Error: io.
Status write_file(const std::filesystem::path& file, std::span<const std::byte> bytes);
Status write_file(const std::filesystem::path& file, const std::string& text);

}  // namespace mr
