#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "mr/core/frame.h"
#include "mr/core/image.h"
#include "mr/core/range.h"
#include "mr/core/result.h"

/// Colour cameras of Linux (Video for Linux 2): webcams, capture cards.
namespace mr::kit {

struct V4l2Config {
  enum class Format { mjpg, yuyv };

  std::string device = "/dev/video0";
  Format format = Format::mjpg;
  int width = 1280, height = 720;  ///< pixels; YUYV: an even width
  double fps = 30;
  // Nothing: the camera sets them itself.
  std::optional<int> exposure_us{}, gain{}, white_balance_k{};

  static constexpr Range kSide_px{16, 16384}, kFps{1, 240}, kExposure_us{100, 1e6}, kGain{0, 65535},
      kWhiteBalance_k{1000, 20000};
  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const;
  friend bool operator==(const V4l2Config&, const V4l2Config&) = default;
};

/// The system calls that a camera makes; a test has others. As those of the C library, but for
/// wait_readable: 1 where `fd` is readable, 0 after `timeout_ms`, negative with errno.
struct V4l2Calls {
  int (*open)(const char* path);
  int (*close)(int fd);
  int (*ioctl)(int fd, unsigned long request, void* argument);
  void* (*mmap)(std::size_t length, int fd, off_t offset);  ///< shared, to be read; null: failed
  int (*munmap)(void* start, std::size_t length);
  int (*wait_readable)(int fd, int timeout_ms);

  static const V4l2Calls& of_system();
};

struct TimedColor {
  ImageRgb color;
  /// By this computer's clock, from the driver's: of the start of the exposure or, with most
  /// drivers, of the end of the transfer of the picture.
  TimePoint at{};
  std::uint32_t sequence = 0;  ///< of the driver; numbers that are left out were lost
};

/// A camera that is streaming. Not thread-safe: one reader.
class V4l2Camera {
 public:
  /// Opens a camera and starts it. Errors, which name the device: not_found, io (in use, no
  /// permission), unsupported (no camera, another size or format, a control that is refused, with
  /// what it takes), invalid (the first of problems()).
  static Result<V4l2Camera> open(const V4l2Config& config,
                                 const V4l2Calls& calls = V4l2Calls::of_system());
  V4l2Camera(V4l2Camera&&) noexcept;
  V4l2Camera& operator=(V4l2Camera&&) noexcept;
  ~V4l2Camera();

  /// The next picture; nothing after `timeout`. Errors: corrupt: this picture is lost; io: the
  /// camera is lost (unplugged) and has to be opened again.
  Result<std::optional<TimedColor>> next(Duration timeout);

 private:
  class Stream;
  explicit V4l2Camera(std::unique_ptr<Stream> stream);
  std::unique_ptr<Stream> stream_;
};

struct V4l2Device {
  std::string path, name;
  std::vector<std::string> formats;  ///< "MJPG 1280x720 640x480"
};

/// The cameras of /dev/video0 to /dev/video63.
std::vector<V4l2Device> find_v4l2_cameras(const V4l2Calls& calls = V4l2Calls::of_system());

}  // namespace mr::kit
