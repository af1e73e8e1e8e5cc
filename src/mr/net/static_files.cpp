#include "mr/net/static_files.h"

#include <algorithm>
#include <charconv>
#include <map>
#include <system_error>

namespace mr::net {
namespace {

namespace fs = std::filesystem;

std::string mime_of(const fs::path& path) {
  static const std::map<std::string, std::string> types = {
      {".html", "text/html; charset=utf-8"},
      {".js", "text/javascript; charset=utf-8"},
      {".mjs", "text/javascript; charset=utf-8"},
      {".css", "text/css; charset=utf-8"},
      {".json", "application/json"},
      {".map", "application/json"},
      {".webmanifest", "application/manifest+json"},
      {".wasm", "application/wasm"},
      {".svg", "image/svg+xml"},
      {".png", "image/png"},
      {".jpg", "image/jpeg"},
      {".webp", "image/webp"},
      {".ico", "image/x-icon"},
      {".woff2", "font/woff2"},
      {".glb", "model/gltf-binary"},
      {".txt", "text/plain; charset=utf-8"}};
  const auto at = types.find(path.extension().string());
  return at == types.end() ? "application/octet-stream" : at->second;
}

bool is_below(const fs::path& path, const fs::path& root) {
  return std::mismatch(root.begin(), root.end(), path.begin(), path.end()).first == root.end();
}

}  // namespace

Result<std::string> target_path(std::string_view target) {
  const Error error{Error::Cause::invalid, "not a path"};
  target = target.substr(0, target.find_first_of("?#"));
  if (!target.starts_with('/')) return error;
  std::string path;
  for (std::size_t i = 0; i < target.size(); ++i) {
    unsigned char c = static_cast<unsigned char>(target[i]);
    if (c == '%') {
      if (i + 2 >= target.size()) return error;
      const char* end = target.data() + i + 3;
      const auto read = std::from_chars(target.data() + i + 1, end, c, 16);
      if (read.ec != std::errc() || read.ptr != end) return error;
      i += 2;
    }
    if (c < 0x20 || c == 0x7F || c == '\\') return error;
    path += static_cast<char>(c);
  }
  return path;
}

Result<StaticFile> find_static_file(const fs::path& root, std::string_view target) {
  const auto path = target_path(target);
  if (!path) return path.error();
  const Error not_found{Error::Cause::not_found, "no such file"};
  std::error_code error;
  const fs::path base = fs::canonical(root, error);
  if (error) return not_found;
  const std::string name = path->ends_with('/') ? *path + "index.html" : *path;
  const fs::path file = fs::canonical(base / name.substr(1), error);
  if (error || !is_below(file, base) || !fs::is_regular_file(file, error)) return not_found;
  return StaticFile{file, mime_of(file), name.starts_with("/assets/")};
}

}  // namespace mr::net
