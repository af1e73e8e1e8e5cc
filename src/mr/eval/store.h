#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/pose.h"
#include "mr/scene/scene.h"

namespace mr::eval {

/// A cache on disk for results of long computations, one file each, so that an interrupted sweep
/// can resume. What cannot be written is computed again next time.
class Store {
 public:
  /// An empty folder disables the cache. The folder is created at the first put().
  explicit Store(std::filesystem::path folder) : folder_(std::move(folder)) {}

  std::optional<std::vector<std::byte>> get(const std::string& name) const;
  void put(const std::string& name, std::span<const std::byte> bytes) const;

 private:
  std::filesystem::path folder_;
};

/// A hash of everything that a result depends on (FNV-1a, 64 bits): the key of a cache.
class Fingerprint {
 public:
  Fingerprint& add(std::span<const std::byte> bytes);
  Fingerprint& add(std::string_view text);
  Fingerprint& add(double v);
  Fingerprint& add(const Camera& camera);
  Fingerprint& add(const Pose& pose);
  Fingerprint& add_file(const std::filesystem::path& file);  ///< its name, size and time
  std::string hex() const;

 private:
  std::uint64_t sum_ = 0xCBF29CE484222325ull;
};

/// A hash of the running executable, so that results of another build are not reused.
const std::string& program_fingerprint();

/// Creates `cache_folder`/`name` for a store. Evicts the oldest other folders while all together
/// hold more than 8 GiB. Returns an empty path if `cache_folder` is empty or cannot be written.
std::filesystem::path store_folder(const std::filesystem::path& cache_folder,
                                   const std::string& name);

/// ${XDG_CACHE_HOME:-~/.cache}/meshreduce/eval; empty where the environment names neither.
std::filesystem::path default_eval_cache();

}  // namespace mr::eval
