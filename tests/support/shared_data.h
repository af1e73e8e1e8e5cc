#pragma once

#include <cstdlib>
#include <filesystem>

namespace mr::test {

/// The folder of real recordings, which are not part of the repository: $MR_DATA, or ../shared/data
/// beside the sources. Tests that need one that is not there are skipped.
inline std::filesystem::path shared_data() {
  const char* set = std::getenv("MR_DATA");
  return std::filesystem::absolute(set ? std::filesystem::path(set)
                                       : std::filesystem::path(MR_SOURCE_DIR) / "../shared/data");
}

}  // namespace mr::test
