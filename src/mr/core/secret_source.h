#pragma once

#include <filesystem>
#include <string>

#include "mr/core/result.h"

namespace mr {

/// The location of a secret: an environment variable or a file, never the scene file itself.
struct SecretSource {
  std::string env;             ///< name of the variable; empty: none
  std::filesystem::path file;  ///< empty: none
  bool empty() const { return env.empty() && file.empty(); }
  friend bool operator==(const SecretSource&, const SecretSource&) = default;
};

/// "environment variable NAME" or "file PATH": the only text about a secret that messages may show.
std::string to_string(const SecretSource& source);

/// Reads the secret without surrounding white space; 64 kB at most. A file must be readable by its
/// owner only. Errors: not_found, invalid (empty, or readable by others), too_large, io; the
/// message names the source and never shows its content.
Result<std::string> read_secret(const SecretSource& source);

}  // namespace mr
