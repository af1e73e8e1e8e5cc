#pragma once

#include <filesystem>

#include "mr/scene/scene.h"

namespace mr::bench {

/// $MR_DATA, or the first ../shared/data that is there, from here or from the sources; it may be
/// missing.
std::filesystem::path data_folder();

/// A scene file, prepared; throws where it cannot be used. Several problems are told on standard
/// error, one line each. Takes threads: for a child.
Scene load_or_throw(const std::filesystem::path& file);

}  // namespace mr::bench
