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

/// Results of long computations, as files in a folder, so that an interrupted sweep goes on where
/// it was. What cannot be written is computed again next time.
class Store {
 public:
  /// empty: keeps nothing. The folder is made when it is first written to.
  explicit Store(std::filesystem::path folder) : folder_(std::move(folder)) {}

  std::optional<std::vector<std::byte>> get(const std::string& name) const;
  void put(const std::string& name, std::span<const std::byte> bytes) const;

 private:
  std::filesystem::path folder_;
};

/// Names what a result depends on (FNV-1a, 64 bits).
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

/// Of the running program: what another build computed is not taken for this one's.
const std::string& program_fingerprint();

/// Makes `cache_folder`/`name` for a store; the oldest others go while all need more than 8 GiB.
/// empty where `cache_folder` is, or cannot be written.
std::filesystem::path store_folder(const std::filesystem::path& cache_folder,
                                   const std::string& name);

/// ${XDG_CACHE_HOME:-~/.cache}/meshreduce/eval; empty where the environment names neither.
std::filesystem::path default_eval_cache();

}  // namespace mr::eval
