#include "mr/kit/v4l2_camera.h"

#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <span>
#include <system_error>
#include <utility>

#include "mr/kit/image_io.h"
#include "mr/kit/raw_color.h"

namespace mr::kit {
namespace {

constexpr std::uint32_t kBuffers = 4;
constexpr std::size_t kMostBufferBytes = 256'000'000;

std::uint32_t code_of(V4l2Config::Format format) {
  return format == V4l2Config::Format::mjpg ? V4L2_PIX_FMT_MJPEG : V4L2_PIX_FMT_YUYV;
}

/// "MJPG".
std::string fourcc_text(std::uint32_t code) {
  std::string out;
  for (int i = 0; i < 4; ++i) {
    const auto c = static_cast<char>(code >> (8 * i) & 0x7F);
    out += c > ' ' && c < 0x7F ? c : '?';
  }
  return out;
}

std::string size_text(std::uint32_t width, std::uint32_t height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

/// Text of a driver, which need not end with a zero.
template <std::size_t N>
std::string driver_text(const __u8 (&text)[N]) {
  std::string out(text, std::find(text, text + N, 0));
  std::ranges::replace_if(
      out, [](unsigned char c) { return c < 0x20 || c >= 0x7F; }, '?');
  return out;
}

/// A file descriptor of a device with its calls.
class V4l2File {
 public:
  V4l2File(const V4l2Calls& calls, std::string path)
      : calls_(calls), path_(std::move(path)), fd_(calls.open(path_.c_str())) {}
  ~V4l2File() {
    if (fd_ >= 0) calls_.close(fd_);
  }
  V4l2File(const V4l2File&) = delete;
  V4l2File& operator=(const V4l2File&) = delete;

  bool is_open() const { return fd_ >= 0; }
  int fd() const { return fd_; }
  const V4l2Calls& calls() const { return calls_; }

  /// Whether it was done; else errno says why.
  template <typename T>
  bool ask(unsigned long request, T& argument) const {
    int code = 0;
    do code = calls_.ioctl(fd_, request, &argument);
    while (code < 0 && errno == EINTR);
    return code >= 0;
  }
  Error error(Error::Cause cause, const std::string& what) const {
    return {cause, path_ + ": " + what};
  }
  /// With what the system says of errno.
  Error failed(const std::string& what) const {
    const int code = errno;
    return error(code == ENOENT ? Error::Cause::not_found : Error::Cause::io,
                 what + ": " + std::generic_category().message(code));
  }

 private:
  const V4l2Calls calls_;
  const std::string path_;
  const int fd_;
};

std::uint32_t capabilities_of(const v4l2_capability& asked) {
  return asked.capabilities & V4L2_CAP_DEVICE_CAPS ? asked.device_caps : asked.capabilities;
}

/// Sets a control; `unit`: what one step of it is, in units of the config.
Status set_control(const V4l2File& file, std::uint32_t id, const char* key, int value, int unit) {
  v4l2_control control{};
  control.id = id, control.value = std::max(1, (value + unit / 2) / unit);
  if (value == 0) control.value = 0;
  if (file.ask(VIDIOC_S_CTRL, control)) return {};
  v4l2_queryctrl range{};
  range.id = id;
  const std::string what = std::string(key) + " " + std::to_string(value) + " is refused";
  if (!file.ask(VIDIOC_QUERYCTRL, range) || range.flags & V4L2_CTRL_FLAG_DISABLED)
    return file.error(Error::Cause::unsupported, what + ": the camera cannot set it");
  const auto in_units = [&](int steps) { return std::to_string(static_cast<long>(steps) * unit); };
  return file.error(Error::Cause::unsupported, what + ": it takes " + in_units(range.minimum) +
                                                   " to " + in_units(range.maximum));
}

/// Cameras without this control have nothing to switch.
void try_control(const V4l2File& file, std::uint32_t id, int value) {
  v4l2_control control{};
  control.id = id, control.value = value;
  file.ask(VIDIOC_S_CTRL, control);
}

/// The camera keeps what was set: what the config leaves out is automatic.
Status set_controls(const V4l2File& file, const V4l2Config& config) {
  // One of the two ways to be automatic; most webcams know the second.
  if (!config.exposure_us) try_control(file, V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_AUTO);
  try_control(file, V4L2_CID_EXPOSURE_AUTO,
              config.exposure_us ? V4L2_EXPOSURE_MANUAL : V4L2_EXPOSURE_APERTURE_PRIORITY);
  try_control(file, V4L2_CID_AUTO_WHITE_BALANCE, config.white_balance_k ? 0 : 1);
  try_control(file, V4L2_CID_AUTOGAIN, config.gain ? 0 : 1);
  constexpr int kExposureStep_us = 100;
  if (config.exposure_us)
    if (const Status set = set_control(file, V4L2_CID_EXPOSURE_ABSOLUTE, "exposure_us",
                                       *config.exposure_us, kExposureStep_us);
        !set)
      return set;
  if (config.white_balance_k)
    if (const Status set = set_control(file, V4L2_CID_WHITE_BALANCE_TEMPERATURE, "white_balance_k",
                                       *config.white_balance_k, 1);
        !set)
      return set;
  if (config.gain) return set_control(file, V4L2_CID_GAIN, "gain", *config.gain, 1);
  return {};
}

Status set_format(const V4l2File& file, const V4l2Config& config, v4l2_pix_format& out) {
  v4l2_format format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  format.fmt.pix.width = static_cast<std::uint32_t>(config.width);
  format.fmt.pix.height = static_cast<std::uint32_t>(config.height);
  format.fmt.pix.pixelformat = code_of(config.format);
  format.fmt.pix.field = V4L2_FIELD_NONE;
  const v4l2_pix_format wanted = format.fmt.pix;
  if (!file.ask(VIDIOC_S_FMT, format)) return file.failed("the format is refused");
  out = format.fmt.pix;
  if (out.pixelformat == wanted.pixelformat && out.width == wanted.width &&
      out.height == wanted.height)
    return {};
  return file.error(Error::Cause::unsupported,
                    fourcc_text(wanted.pixelformat) + " " + size_text(wanted.width, wanted.height) +
                        " is not offered; nearest is " + fourcc_text(out.pixelformat) + " " +
                        size_text(out.width, out.height) + " (meshreduce devices lists all)");
}

/// Drivers that have one rate only refuse this.
void set_rate(const V4l2File& file, double fps) {
  v4l2_streamparm rate{};
  rate.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  rate.parm.capture.timeperframe.numerator = 1000;
  rate.parm.capture.timeperframe.denominator = static_cast<std::uint32_t>(std::lround(1000 * fps));
  file.ask(VIDIOC_S_PARM, rate);
}

v4l2_buffer buffer_number(std::uint32_t index) {
  v4l2_buffer out{};
  out.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  out.memory = V4L2_MEMORY_MMAP;
  out.index = index;
  return out;
}

/// A driver's stamp as a time of day.
TimePoint time_of(const v4l2_buffer& buffer) {
  const TimePoint now = std::chrono::time_point_cast<Duration>(std::chrono::system_clock::now());
  if ((buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) != V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC)
    return now;
  const Duration stamp = std::chrono::seconds(buffer.timestamp.tv_sec) +
                         std::chrono::microseconds(buffer.timestamp.tv_usec);
  const Duration age = std::chrono::steady_clock::now().time_since_epoch() - stamp;
  constexpr Duration kOldest = std::chrono::seconds(10);
  return age >= Duration{} && age < kOldest ? now - age : now;
}

}  // namespace

// -------------------------------------------------- streaming

class V4l2Camera::Stream {
 public:
  Stream(const V4l2Config& config, const V4l2Calls& calls)
      : config_(config), file_(calls, config.device) {}
  ~Stream();

  Status start();
  Result<std::optional<TimedColor>> next(Duration timeout);

 private:
  Status map_buffers();
  Result<ImageRgb> decode(std::span<const std::byte> bytes) const;

  const V4l2Config config_;
  const V4l2File file_;
  v4l2_pix_format format_{};
  std::vector<std::span<std::byte>> buffers_;
  std::vector<std::byte> picture_;  ///< a copy: the driver gets its buffer back at once
  bool is_streaming_ = false;
};

V4l2Camera::Stream::~Stream() {
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (is_streaming_) file_.ask(VIDIOC_STREAMOFF, type);
  for (const std::span<std::byte> buffer : buffers_)
    file_.calls().munmap(buffer.data(), buffer.size());
}

Status V4l2Camera::Stream::start() {
  if (!file_.is_open()) return file_.failed("cannot be opened");
  v4l2_capability capability{};
  if (!file_.ask(VIDIOC_QUERYCAP, capability))
    return file_.error(Error::Cause::unsupported, "is no video device");
  constexpr std::uint32_t kNeeded = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
  if ((capabilities_of(capability) & kNeeded) != kNeeded)
    return file_.error(Error::Cause::unsupported,
                       driver_text(capability.card) + " is no camera that streams");
  if (const Status set = set_format(file_, config_, format_); !set) return set;
  set_rate(file_, config_.fps);
  if (const Status set = set_controls(file_, config_); !set) return set;
  if (const Status mapped = map_buffers(); !mapped) return mapped;
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (!file_.ask(VIDIOC_STREAMON, type)) return file_.failed("it does not start");
  is_streaming_ = true;
  return {};
}

Status V4l2Camera::Stream::map_buffers() {
  v4l2_requestbuffers request{};
  request.count = kBuffers;
  request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  request.memory = V4L2_MEMORY_MMAP;
  if (!file_.ask(VIDIOC_REQBUFS, request)) return file_.failed("it gives no buffers");
  if (request.count == 0) return file_.error(Error::Cause::io, "it gives no buffers");
  for (std::uint32_t i = 0; i < std::min(request.count, kBuffers); ++i) {
    v4l2_buffer buffer = buffer_number(i);
    if (!file_.ask(VIDIOC_QUERYBUF, buffer)) return file_.failed("it does not tell its buffers");
    if (buffer.length == 0 || buffer.length > kMostBufferBytes)
      return file_.error(Error::Cause::too_large, "its buffers have an impossible size");
    void* start = file_.calls().mmap(buffer.length, file_.fd(), buffer.m.offset);
    if (!start) return file_.failed("its buffers cannot be mapped");
    buffers_.push_back({static_cast<std::byte*>(start), buffer.length});
    if (!file_.ask(VIDIOC_QBUF, buffer)) return file_.failed("it does not take its buffers");
  }
  return {};
}

Result<std::optional<TimedColor>> V4l2Camera::Stream::next(Duration timeout) {
  constexpr Duration kLongest = std::chrono::hours(1);
  const auto ms =
      std::chrono::ceil<std::chrono::milliseconds>(std::clamp(timeout, Duration{}, kLongest));
  const int readable = file_.calls().wait_readable(file_.fd(), static_cast<int>(ms.count()));
  if (readable == 0 || (readable < 0 && errno == EINTR)) return std::optional<TimedColor>();
  v4l2_buffer buffer = buffer_number(0);
  if (readable < 0 || !file_.ask(VIDIOC_DQBUF, buffer)) {
    if (errno == EAGAIN) return std::optional<TimedColor>();
    return file_.failed("the camera is lost");
  }
  if (buffer.index >= buffers_.size())
    return file_.error(Error::Cause::io, "the driver names a buffer that is not there");
  const std::span<const std::byte> bytes = buffers_[buffer.index];
  const bool is_whole = !(buffer.flags & V4L2_BUF_FLAG_ERROR) && buffer.bytesused <= bytes.size();
  if (is_whole) picture_.assign(bytes.begin(), bytes.begin() + buffer.bytesused);
  const TimePoint at = time_of(buffer);
  const std::uint32_t sequence = buffer.sequence;
  if (!file_.ask(VIDIOC_QBUF, buffer)) return file_.failed("the camera is lost");
  if (!is_whole)
    return file_.error(Error::Cause::corrupt, "picture " + std::to_string(sequence) +
                                                  " was broken on its way and is lost");
  auto color = decode(picture_);
  if (!color)
    return file_.error(Error::Cause::corrupt, "picture " + std::to_string(sequence) + ": " +
                                                  color.error().message + "; it is lost");
  return std::optional(TimedColor{*std::move(color), at, sequence});
}

Result<ImageRgb> V4l2Camera::Stream::decode(std::span<const std::byte> bytes) const {
  if (config_.format == V4l2Config::Format::yuyv) {
    const RawColorLayout layout{RawColorFormat::yuy2, config_.width, config_.height,
                                static_cast<int>(std::min(format_.bytesperline, 1u << 20))};
    // Drivers may give more than the picture: the end of its last row, or of a page.
    const std::size_t size =
        static_cast<std::size_t>(std::max(layout.stride_bytes, tight_stride_bytes(layout))) *
        static_cast<std::size_t>(config_.height);
    return decode_raw_color(bytes.first(std::min(size, bytes.size())), layout);
  }
  auto color = decode_color(bytes);
  if (color && (color->width != config_.width || color->height != config_.height))
    return Error{Error::Cause::corrupt, "it has another size"};
  return color;
}

// -------------------------------------------------- the camera

std::vector<std::string> V4l2Config::problems() const {
  std::vector<std::string> out =
      out_of_range({{"width", width, kSide_px},
                    {"height", height, kSide_px},
                    {"fps", fps, kFps},
                    {"exposure_us", exposure_us.value_or(1000), kExposure_us},
                    {"gain", gain.value_or(0), kGain},
                    {"white_balance_k", white_balance_k.value_or(5000), kWhiteBalance_k}});
  if (device.empty()) out.push_back("device must name a file, such as /dev/video0");
  if (format == Format::yuyv && width % 2 != 0) out.push_back("width must be even for YUYV");
  return out;
}

V4l2Camera::V4l2Camera(std::unique_ptr<Stream> stream) : stream_(std::move(stream)) {}
V4l2Camera::V4l2Camera(V4l2Camera&&) noexcept = default;
V4l2Camera& V4l2Camera::operator=(V4l2Camera&&) noexcept = default;
V4l2Camera::~V4l2Camera() = default;

Result<V4l2Camera> V4l2Camera::open(const V4l2Config& config, const V4l2Calls& calls) {
  const auto problems = config.problems();
  if (!problems.empty())
    return Error{Error::Cause::invalid, config.device + ": " + problems.front()};
  auto stream = std::make_unique<Stream>(config, calls);
  if (const Status started = stream->start(); !started) return started.error();
  return V4l2Camera(std::move(stream));
}

Result<std::optional<TimedColor>> V4l2Camera::next(Duration timeout) {
  return stream_->next(timeout);
}

// -------------------------------------------------- listing

namespace {

/// "MJPG 1280x720 640x480".
std::string format_text(const V4l2File& file, std::uint32_t code) {
  constexpr std::uint32_t kMost = 64;
  std::string out = fourcc_text(code);
  v4l2_frmsizeenum size{};
  size.pixel_format = code;
  for (size.index = 0; size.index < kMost && file.ask(VIDIOC_ENUM_FRAMESIZES, size); ++size.index) {
    if (size.type != V4L2_FRMSIZE_TYPE_DISCRETE)
      return out + " up to " + size_text(size.stepwise.max_width, size.stepwise.max_height);
    out += " " + size_text(size.discrete.width, size.discrete.height);
  }
  return out;
}

}  // namespace

std::vector<V4l2Device> find_v4l2_cameras(const V4l2Calls& calls) {
  constexpr int kNumbers = 64;
  constexpr std::uint32_t kMostFormats = 32;
  std::vector<V4l2Device> out;
  for (int i = 0; i < kNumbers; ++i) {
    const std::string path = "/dev/video" + std::to_string(i);
    const V4l2File file(calls, path);
    v4l2_capability capability{};
    if (!file.is_open() || !file.ask(VIDIOC_QUERYCAP, capability)) continue;
    if (!(capabilities_of(capability) & V4L2_CAP_VIDEO_CAPTURE)) continue;
    V4l2Device& device = out.emplace_back(V4l2Device{path, driver_text(capability.card), {}});
    v4l2_fmtdesc format{};
    format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    for (format.index = 0; format.index < kMostFormats && file.ask(VIDIOC_ENUM_FMT, format);
         ++format.index)
      device.formats.push_back(format_text(file, format.pixelformat));
  }
  return out;
}

const V4l2Calls& V4l2Calls::of_system() {
  static constexpr V4l2Calls kCalls{
      .open = [](const char* path) { return ::open(path, O_RDWR | O_NONBLOCK | O_CLOEXEC); },
      .close = ::close,
      .ioctl = [](int fd, unsigned long request,
                  void* argument) { return ::ioctl(fd, request, argument); },
      .mmap = [](std::size_t length, int fd, off_t offset) -> void* {
        void* start = ::mmap(nullptr, length, PROT_READ, MAP_SHARED, fd, offset);
        return start == MAP_FAILED ? nullptr : start;
      },
      .munmap = ::munmap,
      .wait_readable =
          [](int fd, int timeout_ms) {
            pollfd wait{.fd = fd, .events = POLLIN, .revents = 0};
            const int count = ::poll(&wait, 1, timeout_ms);
            if (count > 0 && !(wait.revents & POLLIN)) return errno = ENODEV, -1;
            return count;
          }};
  return kCalls;
}

}  // namespace mr::kit
