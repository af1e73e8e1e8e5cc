#pragma once

#include <filesystem>
#include <string>

#include "mr/core/result.h"

namespace mr {

/// Where a secret stands: in an environment variable or in a file, never in the scene file itself.
struct SecretSource {
  std::string env;             ///< name of the variable; empty: not there
  std::filesystem::path file;  ///< empty: not there
  bool empty() const { return env.empty() && file.empty(); }
  friend bool operator==(const SecretSource&, const SecretSource&) = default;
};

/// "environment variable NAME" or "file PATH": what a message may say of a secret.
std::string to_string(const SecretSource& source);

/// The secret, without white space around it; 64 kB at most. A file must be readable by its owner
/// alone. not_found, invalid (empty, or others may read it), too_large, io: one line that names the
/// source and never shows what stands in it.
Result<std::string> read_secret(const SecretSource& source);

}  // namespace mr
