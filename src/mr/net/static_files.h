#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "mr/core/result.h"

namespace mr::net {

struct StaticFile {
  std::filesystem::path path;
  std::string mime;
  bool immutable = false;  ///< its name changes with its content
};

/// The file below `root` that a request's target ("/assets/a.js?x", "/" for /index.html) names.
/// invalid: the target cannot be read. not_found: there is none, or it lies outside of `root`, by
/// ".." or a link.
Result<StaticFile> find_static_file(const std::filesystem::path& root, std::string_view target);

/// The path of a target: without query, %XX decoded. invalid: no path, or bytes that have no place
/// in one.
Result<std::string> target_path(std::string_view target);

}  // namespace mr::net
