#include "mr/core/file.h"

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>

namespace mr {
namespace {

using FilePtr = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

Error io_error(const std::filesystem::path& file, const char* doing) {
  const auto cause = errno == ENOENT ? Error::Cause::not_found : Error::Cause::io;
  return {cause,
          std::string("cannot ") + doing + " " + file.string() + ": " + std::strerror(errno)};
}

}  // namespace

Result<std::vector<std::byte>> read_file(const std::filesystem::path& file,
                                         std::uintmax_t max_bytes) {
  std::error_code failed;
  if (std::filesystem::is_directory(file, failed))
    return Error{Error::Cause::io, "cannot read " + file.string() + ": it is a folder"};
  const FilePtr in(std::fopen(file.c_str(), "rb"), &std::fclose);
  if (!in) return io_error(file, "read");
  const std::uintmax_t size = std::filesystem::file_size(file, failed);
  if (failed)
    return Error{Error::Cause::io, "cannot read " + file.string() + ": " + failed.message()};
  if (size > max_bytes)
    return Error{Error::Cause::too_large, file.string() + " holds " + std::to_string(size) +
                                              " bytes, more than the " + std::to_string(max_bytes) +
                                              " allowed"};
  std::vector<std::byte> bytes(size);
  if (std::fread(bytes.data(), 1, size, in.get()) != size) return io_error(file, "read");
  return bytes;
}

Status write_file(const std::filesystem::path& file, std::span<const std::byte> bytes) {
  std::filesystem::path beside = file;
  beside += ".part" + std::to_string(::getpid());
  const auto fail = [&] {
    const Error error = io_error(file, "write");
    std::remove(beside.c_str());
    return error;
  };
  FilePtr out(std::fopen(beside.c_str(), "wb"), &std::fclose);
  if (!out) return io_error(file, "write");
  if (std::fwrite(bytes.data(), 1, bytes.size(), out.get()) != bytes.size()) return fail();
  if (std::fclose(out.release()) != 0) return fail();
  if (std::rename(beside.c_str(), file.c_str()) != 0) return fail();
  return {};
}

Status write_file(const std::filesystem::path& file, const std::string& text) {
  return write_file(file, std::as_bytes(std::span(text.data(), text.size())));
}

}  // namespace mr
