#pragma once

#include <filesystem>

#include "mr/scene/scene.h"

namespace mr::bench {

/// The data folder: $MR_DATA, or the first existing ../shared/data relative to the working folder
/// or the sources; it may be missing.
std::filesystem::path data_folder();

/// Loads and prepares a scene file; throws if it cannot be used. Prints its problems on standard
/// error, one line each. Starts threads: to be called in a child.
Scene load_or_throw(const std::filesystem::path& file);

}  // namespace mr::bench
