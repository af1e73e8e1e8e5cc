#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace mr::yaml {

/// Something wrong in a scene file; prints as "file:line: message". Or with what was set beside it;
/// prints as "--set 'key=value': message".
struct Problem {
  std::filesystem::path file;
  int line = 0;  ///< 1-based; 0: the file as a whole
  std::string message;
  std::optional<std::string> option = {};  ///< "key=value"; none: it stands in the file
};
std::string to_string(const Problem& problem);

}  // namespace mr::yaml
