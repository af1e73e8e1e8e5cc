#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "mr/core/result.h"

namespace mr::net {

struct StaticFile {
  std::filesystem::path path;
  std::string mime;
  bool immutable = false;  ///< its name contains a hash of its content: may be cached for ever
};

/// Finds the file below `root` for the target of an HTTP request ("/assets/a.js?x"; "/" is
/// /index.html). invalid: the target is malformed. not_found: there is no such file, or it lies
/// outside `root` by ".." or a symbolic link (path traversal).
Result<StaticFile> find_static_file(const std::filesystem::path& root, std::string_view target);

/// The path of a request's target: without the query, percent-decoded. invalid: there is no path,
/// or it holds bytes that are not allowed in one.
Result<std::string> target_path(std::string_view target);

}  // namespace mr::net
