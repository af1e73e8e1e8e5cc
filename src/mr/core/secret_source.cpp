#include "mr/core/secret_source.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>

namespace mr {
namespace {

constexpr std::size_t kSecretBytes = 64 << 10;

/// An open file, closed with the object.
struct OpenFile {
  explicit OpenFile(const std::filesystem::path& file)
      : handle(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)) {}
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;
  ~OpenFile() {
    if (handle >= 0) ::close(handle);
  }
  int handle;
};

std::string trimmed(const std::string& text) {
  constexpr const char* kSpace = " \t\r\n\v\f";
  const std::size_t begin = text.find_first_not_of(kSpace);
  if (begin == std::string::npos) return {};
  return text.substr(begin, text.find_last_not_of(kSpace) + 1 - begin);
}

/// The open file is a plain one that only its owner may read.
Status check_file(const OpenFile& file, const std::string& path) {
  struct stat status {};
  if (file.handle < 0 || ::fstat(file.handle, &status) != 0)
    return Error{errno == ENOENT ? Error::Cause::not_found : Error::Cause::io,
                 "cannot read: " + std::string(std::strerror(errno))};
  if (!S_ISREG(status.st_mode)) return Error{Error::Cause::io, "is no file"};
  if ((status.st_mode & 077) != 0)
    return Error{Error::Cause::invalid, "others than its owner may use it; chmod 600 " + path};
  return {};
}

Result<std::string> read_secret_file(const std::filesystem::path& path) {
  const OpenFile file(path);
  if (auto ok = check_file(file, path.string()); !ok) return ok.error();
  std::string text;
  std::array<char, 4096> part;
  for (;;) {
    const ::ssize_t n = ::read(file.handle, part.data(), part.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return Error{Error::Cause::io, "cannot read: " + std::string(std::strerror(errno))};
    if (n == 0) return text;
    text.append(part.data(), static_cast<std::size_t>(n));
    if (text.size() > kSecretBytes)
      return Error{Error::Cause::too_large, "holds more than 64 kB; a secret is a short text"};
  }
}

Result<std::string> read_variable(const std::string& name) {
  const char* value = std::getenv(name.c_str());
  if (value == nullptr) return Error{Error::Cause::not_found, "is not set"};
  if (std::strlen(value) > kSecretBytes)
    return Error{Error::Cause::too_large, "holds more than 64 kB; a secret is a short text"};
  return std::string(value);
}

}  // namespace

std::string to_string(const SecretSource& source) {
  if (!source.env.empty()) return "environment variable " + source.env;
  return "file " + source.file.string();
}

Result<std::string> read_secret(const SecretSource& source) {
  if (source.empty()) return Error{Error::Cause::invalid, "no secret is named"};
  auto read = source.env.empty() ? read_secret_file(source.file) : read_variable(source.env);
  if (read) {
    std::string secret = trimmed(*read);
    if (!secret.empty()) return secret;
    read = Error{Error::Cause::invalid, "is empty"};
  }
  return Error{read.error().cause, "secret in " + to_string(source) + ": " + read.error().message};
}

}  // namespace mr
