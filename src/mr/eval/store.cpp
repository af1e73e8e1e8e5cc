#include "mr/eval/store.h"

#include <fmt/format.h>

#include <cstring>

#include "mr/core/file.h"
#include "mr/synth/room.h"
#include "mr/synth/shot_cache.h"

namespace mr::eval {

std::optional<std::vector<std::byte>> Store::get(const std::string& name) const {
  if (folder_.empty()) return std::nullopt;
  auto bytes = read_file(folder_ / name);
  return bytes ? std::optional(*std::move(bytes)) : std::nullopt;
}

void Store::put(const std::string& name, std::span<const std::byte> bytes) const {
  if (folder_.empty()) return;
  std::error_code failed;
  std::filesystem::create_directories(folder_, failed);
  static_cast<void>(write_file(folder_ / name, bytes).ok());
}

Fingerprint& Fingerprint::add(std::span<const std::byte> bytes) {
  for (const std::byte b : bytes) sum_ = (sum_ ^ static_cast<std::uint64_t>(b)) * 0x100000001B3ull;
  return *this;
}

Fingerprint& Fingerprint::add(std::string_view text) {
  return add(std::as_bytes(std::span(text))).add(static_cast<double>(text.size()));
}

Fingerprint& Fingerprint::add(double v) { return add(std::as_bytes(std::span(&v, 1))); }

Fingerprint& Fingerprint::add(const Camera& c) {
  for (const double v : {static_cast<double>(c.model), 1.0 * c.width, 1.0 * c.height, c.fx, c.fy,
                         c.cx, c.cy, static_cast<double>(c.distortion)})
    add(v);
  for (const double v : c.k) add(v);
  for (const double v : c.p) add(v);
  return *this;
}

Fingerprint& Fingerprint::add(const Pose& pose) {
  for (const double v : pose.matrix()) add(v);
  return *this;
}

Fingerprint& Fingerprint::add_file(const std::filesystem::path& file) {
  std::error_code none;
  add(file.string()).add(static_cast<double>(std::filesystem::file_size(file, none)));
  const auto time = std::filesystem::last_write_time(file, none);
  return add(static_cast<double>(time.time_since_epoch().count()));
}

std::string Fingerprint::hex() const { return fmt::format("{:016x}", sum_); }

const std::string& program_fingerprint() {
  static const std::string print = [] {
    const auto program = read_file("/proc/self/exe");
    return Fingerprint{}
        .add(program ? std::span<const std::byte>(*program) : std::span<const std::byte>{})
        .hex();
  }();
  return print;
}

std::filesystem::path store_folder(const std::filesystem::path& cache_folder,
                                   const std::string& name) {
  constexpr std::uintmax_t kMostBytes = std::uintmax_t{8} << 30;
  if (cache_folder.empty()) return {};
  std::error_code failed;
  std::filesystem::create_directories(cache_folder / name, failed);
  if (failed) return {};
  synth::trim_caches(cache_folder, cache_folder / name, kMostBytes);
  return cache_folder / name;
}

std::filesystem::path default_eval_cache() {
  const std::filesystem::path rigs = synth::default_rig_cache();
  return rigs.empty() ? rigs : rigs.parent_path() / "eval";
}

}  // namespace mr::eval
