#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "mr/kit/image_io.h"

/// Any bytes as a picture: an error or a picture within the caps, never a crash.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const int file = ::memfd_create("image", MFD_CLOEXEC);
  if (file < 0) std::abort();
  if (size > 0 && ::write(file, data, size) != static_cast<::ssize_t>(size)) std::abort();
  const std::string path = "/proc/self/fd/" + std::to_string(file);
  const auto color = mr::kit::read_color(path);
  const auto depth = mr::kit::read_depth16(path);
  if (color && (color->empty() || color->width > 16384 || color->height > 16384)) std::abort();
  if (depth && (depth->empty() || depth->width > 16384 || depth->height > 16384)) std::abort();
  ::close(file);
  return 0;
}
