#include "mr/sensor/k4a/k4a_source.h"

#include <fmt/format.h>
#include <k4a/k4a.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstring>
#include <mutex>
#include <span>
#include <thread>
#include <type_traits>
#include <utility>

#include "mr/core/assert.h"
#include "mr/kit/device_clock.h"
#include "mr/kit/image_io.h"
#include "mr/sensor/k4a/calibration_check.h"
#include "mr/sensor/rgbd_items.h"

namespace mr::sensor {
namespace {

using Steady = std::chrono::steady_clock;
using Sync = K4aSource::Sync;

constexpr auto kFrameWait = std::chrono::milliseconds(1000), kRetry = kFrameWait;
constexpr int kSilentWaits = 5;  ///< of a device that needs no master, before it is opened again

// -------------------------------------------------- the SDK's handles and log

struct CloseK4aDevice {
  void operator()(k4a_device_t device) const { k4a_device_close(device); }
};
struct ReleaseK4aCapture {
  void operator()(k4a_capture_t capture) const { k4a_capture_release(capture); }
};
struct ReleaseK4aImage {
  void operator()(k4a_image_t image) const { k4a_image_release(image); }
};
template <typename T, typename Release>
using K4aHandle = std::unique_ptr<std::remove_pointer_t<T>, Release>;
using DeviceHandle = K4aHandle<k4a_device_t, CloseK4aDevice>;
using CaptureHandle = K4aHandle<k4a_capture_t, ReleaseK4aCapture>;
using ImageHandle = K4aHandle<k4a_image_t, ReleaseK4aImage>;

/// What the SDK says beside its return values. It would print it on stdout.
class K4aLog {
 public:
  static K4aLog& get() {
    static K4aLog log;
    return log;
  }
  ~K4aLog() { k4a_set_debug_message_handler(nullptr, nullptr, K4A_LOG_LEVEL_OFF); }
  K4aLog(const K4aLog&) = delete;
  K4aLog& operator=(const K4aLog&) = delete;

  /// " (the SDK: …)" with its newest message, once; empty: it has said nothing.
  std::string newest() {
    const std::lock_guard lock(mutex_);
    return message_.empty() ? "" : " (the SDK: " + std::exchange(message_, {}) + ")";
  }

 private:
  K4aLog() { k4a_set_debug_message_handler(&K4aLog::take, this, K4A_LOG_LEVEL_ERROR); }

  static void take(void* log, k4a_log_level_t, const char*, int, const char* message) {
    constexpr std::size_t kMost = 160;
    std::string text(message ? std::string_view(message).substr(0, kMost) : "");
    std::ranges::replace_if(
        text, [](unsigned char c) { return c < 0x20 || c == 0x7f; }, ' ');
    auto* self = static_cast<K4aLog*>(log);
    const std::lock_guard lock(self->mutex_);
    self->message_ = std::move(text);
  }

  std::mutex mutex_;
  std::string message_;
};

std::string k4a_serial(k4a_device_t device) {
  constexpr std::size_t kMost = 256;
  std::size_t size = 0;
  if (k4a_device_get_serialnum(device, nullptr, &size) != K4A_BUFFER_RESULT_TOO_SMALL ||
      size == 0 || size > kMost)
    return {};
  std::string out(size, '\0');
  if (k4a_device_get_serialnum(device, out.data(), &size) != K4A_BUFFER_RESULT_SUCCEEDED) return {};
  return out.c_str();  // up to the zero at its end
}

Result<KinectCalibration> k4a_calibration(k4a_device_t device) {
  constexpr std::size_t kMost = 1u << 20;
  std::size_t size = 0;
  if (k4a_device_get_raw_calibration(device, nullptr, &size) != K4A_BUFFER_RESULT_TOO_SMALL ||
      size == 0 || size > kMost)
    return Error{Error::Cause::io, "it tells no calibration" + K4aLog::get().newest()};
  std::string json(size, '\0');
  if (k4a_device_get_raw_calibration(device, reinterpret_cast<std::uint8_t*>(json.data()), &size) !=
      K4A_BUFFER_RESULT_SUCCEEDED)
    return Error{Error::Cause::io, "it tells no calibration" + K4aLog::get().newest()};
  return parse_kinect_calibration(std::string_view(json).substr(0, size));
}

/// One at a time: looking for a serial number opens other devices for a moment.
std::mutex& k4a_opening() {
  static std::mutex mutex;
  return mutex;
}

DeviceHandle open_k4a_number(std::uint32_t number) {
  k4a_device_t device = nullptr;
  if (k4a_device_open(number, &device) != K4A_RESULT_SUCCEEDED) return nullptr;
  return DeviceHandle(device);
}

Result<DeviceHandle> open_k4a_device(const K4aSource& source) {
  const std::lock_guard lock(k4a_opening());
  K4aLog::get();
  const std::uint32_t count = k4a_device_get_installed_count();
  std::uint32_t closed = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    if (source.serial.empty() && i != static_cast<std::uint32_t>(source.device)) continue;
    DeviceHandle device = open_k4a_number(i);
    if (!device)
      ++closed;
    else if (source.serial.empty() || k4a_serial(device.get()) == source.serial)
      return device;
  }
  return Error{closed > 0 ? Error::Cause::io : Error::Cause::not_found,
               fmt::format("{} cannot be opened: {} {} plugged in, of which {} cannot be opened "
                           "(in use, or no permission: udev rules){}",
                           source.name(), count, count == 1 ? "device is" : "devices are", closed,
                           K4aLog::get().newest())};
}

// -------------------------------------------------- configuration

k4a_depth_mode_t k4a_mode(K4aSource::DepthMode mode) {
  switch (mode) {
    case K4aSource::DepthMode::nfov:
      return K4A_DEPTH_MODE_NFOV_UNBINNED;
    case K4aSource::DepthMode::nfov_binned:
      return K4A_DEPTH_MODE_NFOV_2X2BINNED;
    case K4aSource::DepthMode::wfov:
      return K4A_DEPTH_MODE_WFOV_UNBINNED;
    case K4aSource::DepthMode::wfov_binned:
      return K4A_DEPTH_MODE_WFOV_2X2BINNED;
  }
  return K4A_DEPTH_MODE_OFF;
}

k4a_color_resolution_t k4a_resolution(K4aSource::Color color) {
  switch (color) {
    case K4aSource::Color::off:
      return K4A_COLOR_RESOLUTION_OFF;
    case K4aSource::Color::p720:
      return K4A_COLOR_RESOLUTION_720P;
    case K4aSource::Color::p1080:
      return K4A_COLOR_RESOLUTION_1080P;
    case K4aSource::Color::p1440:
      return K4A_COLOR_RESOLUTION_1440P;
    case K4aSource::Color::p1536:
      return K4A_COLOR_RESOLUTION_1536P;
    case K4aSource::Color::p2160:
      return K4A_COLOR_RESOLUTION_2160P;
    case K4aSource::Color::p3072:
      return K4A_COLOR_RESOLUTION_3072P;
  }
  return K4A_COLOR_RESOLUTION_OFF;
}

k4a_device_configuration_t k4a_configuration(const K4aSource& source) {
  k4a_device_configuration_t out = K4A_DEVICE_CONFIG_INIT_DISABLE_ALL;
  out.color_format = K4A_IMAGE_FORMAT_COLOR_MJPG;
  out.color_resolution = k4a_resolution(source.color);
  out.depth_mode = k4a_mode(source.depth_mode);
  out.camera_fps = source.fps == 5    ? K4A_FRAMES_PER_SECOND_5
                   : source.fps == 15 ? K4A_FRAMES_PER_SECOND_15
                                      : K4A_FRAMES_PER_SECOND_30;
  out.depth_delay_off_color_usec = source.depth_delay_us;
  out.wired_sync_mode = source.sync == Sync::master        ? K4A_WIRED_SYNC_MODE_MASTER
                        : source.sync == Sync::subordinate ? K4A_WIRED_SYNC_MODE_SUBORDINATE
                                                           : K4A_WIRED_SYNC_MODE_STANDALONE;
  out.subordinate_delay_off_master_usec = static_cast<std::uint32_t>(source.subordinate_delay_us);
  return out;
}

/// Sets one control of the colour camera; nothing: automatic. Adds to `problems` if it is refused.
void set_control(k4a_device_t device, k4a_color_control_command_t command, const char* key,
                 std::optional<int> value, std::vector<std::string>& problems) {
  const auto mode = value ? K4A_COLOR_CONTROL_MODE_MANUAL : K4A_COLOR_CONTROL_MODE_AUTO;
  if (k4a_device_set_color_control(device, command, mode, value.value_or(0)) ==
      K4A_RESULT_SUCCEEDED)
    return;
  problems.push_back(
      value ? fmt::format("{} {} is refused{}", key, *value, K4aLog::get().newest())
            : fmt::format("{} cannot be made automatic again{}", key, K4aLog::get().newest()));
}

/// The device keeps what was set until its power is off: what the scene leaves out is automatic.
std::vector<std::string> set_controls(k4a_device_t device, const K4aSource& source) {
  std::vector<std::string> problems;
  if (source.color == K4aSource::Color::off) return problems;
  if (source.powerline_hz)
    set_control(device, K4A_COLOR_CONTROL_POWERLINE_FREQUENCY, "powerline_hz",
                *source.powerline_hz == 50 ? 1 : 2, problems);
  set_control(device, K4A_COLOR_CONTROL_EXPOSURE_TIME_ABSOLUTE, "exposure_us", source.exposure_us,
              problems);
  set_control(device, K4A_COLOR_CONTROL_WHITEBALANCE, "white_balance_k", source.white_balance_k,
              problems);
  if (source.gain) set_control(device, K4A_COLOR_CONTROL_GAIN, "gain", source.gain, problems);
  return problems;
}

// -------------------------------------------------- the device

/// A device that is opened when it is needed, and again when it was lost. Any thread.
class K4aDevice {
 public:
  K4aDevice(const SensorConfig& sensor, K4aSource source)
      : sensor_(sensor), source_(std::move(source)) {}
  ~K4aDevice() { close(); }

  bool is_running() const { return running_; }
  /// Opens it and starts its cameras, a master after the subordinates of this process.
  Status start();
  /// The next capture; waits for it.
  Result<CaptureHandle> capture();
  /// What does not fit the scene's keys; each is told once.
  std::optional<Error> take_notice();

 private:
  Error error(Error::Cause cause, const std::string& what) const {
    return {cause, "sensor '" + sensor_.id + "': k4a " + source_.name() + ": " + what};
  }
  void note(std::vector<std::string> problems);
  void close();

  const SensorConfig sensor_;
  const K4aSource source_;
  std::atomic<bool> running_ = false;
  std::mutex mutex_;  // guards what follows
  DeviceHandle device_;
  std::vector<Error> notices_;
  bool is_known_ = false;  ///< it was started before
  int silent_ = 0;         ///< waits without a frame
};

/// The subordinates of this process, for their masters.
class K4aSubordinates {
 public:
  static K4aSubordinates& get() {
    static K4aSubordinates all;
    return all;
  }
  void add(const std::shared_ptr<K4aDevice>& device) {
    const std::lock_guard lock(mutex_);
    std::erase_if(devices_, [](const auto& d) { return d.expired(); });
    devices_.push_back(device);
  }
  /// Their own readers report what fails.
  void start() {
    std::vector<std::weak_ptr<K4aDevice>> devices;
    {
      const std::lock_guard lock(mutex_);
      devices = devices_;
    }
    for (const auto& weak : devices)
      if (const auto device = weak.lock())
        if (const Status started = device->start(); !started) continue;
  }

 private:
  std::mutex mutex_;
  std::vector<std::weak_ptr<K4aDevice>> devices_;
};

Status K4aDevice::start() {
  if (running_) return {};
  if (source_.sync == Sync::master) K4aSubordinates::get().start();
  const std::lock_guard lock(mutex_);
  if (running_) return {};
  auto device = open_k4a_device(source_);
  if (!device)
    return Error{device.error().cause,
                 "sensor '" + sensor_.id + "': k4a " + device.error().message + "; trying again"};
  std::vector<std::string> problems = set_controls(device->get(), source_);
  const auto calibration = k4a_calibration(device->get());
  append(problems, calibration ? calibration_differences(sensor_, source_, *calibration)
                               : std::vector{calibration.error().message});
  const k4a_device_configuration_t configuration = k4a_configuration(source_);
  if (k4a_device_start_cameras(device->get(), &configuration) != K4A_RESULT_SUCCEEDED)
    return error(Error::Cause::io,
                 "its cameras do not start; trying again" + K4aLog::get().newest());
  note(std::move(problems));
  device_ = *std::move(device);
  silent_ = 0;
  running_ = true;
  return {};
}

void K4aDevice::note(std::vector<std::string> problems) {
  if (std::exchange(is_known_, true)) return;
  for (const std::string& problem : problems)
    notices_.push_back(error(Error::Cause::invalid,
                             problem + "; frames go on (meshreduce devices prints what fits)"));
}

std::optional<Error> K4aDevice::take_notice() {
  const std::lock_guard lock(mutex_);
  if (notices_.empty()) return std::nullopt;
  Error out = std::move(notices_.front());
  notices_.erase(notices_.begin());
  return out;
}

Result<CaptureHandle> K4aDevice::capture() {
  const std::lock_guard lock(mutex_);
  if (!device_) return error(Error::Cause::io, "it is not open");
  k4a_capture_t capture = nullptr;
  const auto waited = static_cast<std::int32_t>(kFrameWait.count());
  switch (k4a_device_get_capture(device_.get(), &capture, waited)) {
    case K4A_WAIT_RESULT_SUCCEEDED:
      silent_ = 0;
      return CaptureHandle(capture);
    case K4A_WAIT_RESULT_TIMEOUT: {
      if (source_.sync == Sync::subordinate)
        return error(Error::Cause::io,
                     "no frame for 1 s: a subordinate waits for its master's pulses");
      const bool is_given_up = ++silent_ >= kSilentWaits;
      if (is_given_up) close();
      return error(Error::Cause::io, is_given_up ? "no frame for 5 s: opening it again"
                                                 : "no frame for 1 s" + K4aLog::get().newest());
    }
    default:
      close();
      return error(Error::Cause::io,
                   "the connection is lost; trying again" + K4aLog::get().newest());
  }
}

/// The mutex must be held, or nobody else know this.
void K4aDevice::close() {
  running_ = false;
  if (device_) k4a_device_stop_cameras(device_.get());
  device_.reset();
}

// -------------------------------------------------- frames

/// The middle of an image's exposure by the device's clock.
Duration k4a_device_time(k4a_image_t image) {
  constexpr std::uint64_t kMost = 1ull << 52;  // 140 years
  return std::chrono::microseconds(std::min(k4a_image_get_device_timestamp_usec(image), kMost));
}

/// When this computer received an image. The SDK stamps it by the monotonic clock and Orbbec's
/// wrapper may by the time of day; where it is neither, now.
TimePoint k4a_arrival(k4a_image_t image) {
  constexpr Duration kOldest = std::chrono::seconds(5);
  const TimePoint now = std::chrono::time_point_cast<Duration>(std::chrono::system_clock::now());
  const std::uint64_t stamp = k4a_image_get_system_timestamp_nsec(image);
  if (stamp == 0 || stamp > (1ull << 62)) return now;
  const Duration given(static_cast<std::int64_t>(stamp));
  for (const Duration clock :
       {std::chrono::duration_cast<Duration>(Steady::now().time_since_epoch()),
        now.time_since_epoch()})
    if (const Duration age = clock - given; age >= Duration{} && age < kOldest) return now - age;
  return now;
}

/// How long the depth camera exposes: Microsoft's hardware specification.
Duration depth_exposure(K4aSource::DepthMode mode) {
  return std::chrono::microseconds(mode == K4aSource::DepthMode::wfov ? 20'300 : 12'800);
}

std::span<const std::byte> k4a_bytes(k4a_image_t image) {
  const auto* bytes = reinterpret_cast<const std::byte*>(k4a_image_get_buffer(image));
  return {bytes, bytes ? k4a_image_get_size(image) : 0};
}

class K4aFrames final : public FrameSource {
 public:
  K4aFrames(const SensorConfig& sensor, SensorId id, const K4aSource& source)
      : sensor_(sensor),
        source_(source),
        id_(id),
        metres_(depth_table(sensor, source.depth_unit_m, {0})),
        device_(std::make_shared<K4aDevice>(sensor, source)) {
    if (source.sync == Sync::subordinate) K4aSubordinates::get().add(device_);
  }

  Result<std::optional<Frame>> next() override;
  void skip(std::uint64_t) override {}
  bool endless() const override { return true; }
  bool is_live() const override { return true; }

 private:
  Status sizes_fit() const;
  Status start();
  Result<std::optional<Frame>> frame_of(k4a_capture_t capture);
  Result<ImageDepth> depth_of(k4a_image_t image) const;
  Result<ImageRgb> color_of(k4a_image_t image) const;
  Error lost(const Error& error) const {
    return {error.cause, "sensor '" + sensor_.id + "': k4a " + source_.name() + ": " +
                             error.message + "; the frame is lost"};
  }

  const SensorConfig sensor_;
  const K4aSource source_;
  const SensorId id_;
  const std::vector<float> metres_;  ///< by count
  const std::shared_ptr<K4aDevice> device_;
  kit::DeviceClock clock_;
  std::optional<Steady::time_point> tried_;  ///< last start
  std::uint64_t index_ = 0;
  bool is_hopeless_ = false;
};

Result<std::optional<Frame>> K4aFrames::next() {
  if (is_hopeless_) return std::optional<Frame>();
  if (const Status fit = sizes_fit(); !fit) {
    is_hopeless_ = true;
    return fit.error();
  }
  if (const Status started = start(); !started) return started.error();
  if (auto notice = device_->take_notice()) return *std::move(notice);
  const auto capture = device_->capture();
  if (!capture) return capture.error();
  return frame_of(capture->get());
}

Status K4aFrames::sizes_fit() const {
  const KinectMode& depth = source_.depth();
  const std::string name = "sensor '" + sensor_.id + "'";
  const Status fits =
      check_size(depth.width, depth.height, sensor_.depth_camera, "depth",
                 fmt::format("{}: depth_mode {}", name, word_of(source_.depth_mode)));
  const KinectMode* color = source_.color_mode();
  if (!fits || !color || !sensor_.color_camera) return fits;
  return check_size(color->width, color->height, *sensor_.color_camera, "colour",
                    fmt::format("{}: color {}", name, word_of(source_.color)));
}

/// Not more often than once in kRetry.
Status K4aFrames::start() {
  if (device_->is_running()) return {};
  if (tried_) std::this_thread::sleep_until(*tried_ + kRetry);
  tried_ = Steady::now();
  clock_ = {};
  return device_->start();
}

Result<std::optional<Frame>> K4aFrames::frame_of(k4a_capture_t capture) {
  const ImageHandle depth(k4a_capture_get_depth_image(capture));
  const ImageHandle color(k4a_capture_get_color_image(capture));
  if (!depth) return lost({Error::Cause::io, "a capture without depth (USB is overloaded?)"});
  const TimePoint middle =
      clock_.system_time(k4a_device_time(depth.get()), k4a_arrival(depth.get())) +
      std::chrono::microseconds(std::llround(sensor_.clock_offset_ms * 1e3));
  Frame frame;
  frame.sensor = id_;
  frame.index = index_++;
  frame.exposure_start = middle - depth_exposure(source_.depth_mode) / 2;
  frame.exposure_end = middle + depth_exposure(source_.depth_mode) / 2;
  const auto pose = sensor_.pose_of(0, middle);
  if (!pose) return lost(pose.error());
  frame.T_world_depth = *pose;
  auto metres = depth_of(depth.get());
  if (!metres) return lost(metres.error());
  frame.depth = *std::move(metres);
  if (!sensor_.color_camera) return std::optional(std::move(frame));
  if (!color) return lost({Error::Cause::io, "a capture without colour (USB is overloaded?)"});
  auto picture = color_of(color.get());
  if (!picture) return lost(picture.error());
  frame.color = *std::move(picture);
  return std::optional(std::move(frame));
}

Result<ImageDepth> K4aFrames::depth_of(k4a_image_t image) const {
  const std::span<const std::byte> bytes = k4a_bytes(image);
  const int width = k4a_image_get_width_pixels(image), height = k4a_image_get_height_pixels(image);
  if (const Status fits = check_size(width, height, sensor_.depth_camera, "depth", "its picture");
      !fits)
    return fits.error();
  const auto stride = static_cast<std::size_t>(std::max(k4a_image_get_stride_bytes(image), 0));
  const std::size_t row = 2 * static_cast<std::size_t>(width);
  if (stride < row || bytes.size() < stride * (static_cast<std::size_t>(height) - 1) + row)
    return Error{Error::Cause::corrupt, "its depth picture is cut off"};
  ImageDepth out(width, height);
  std::vector<std::uint16_t> counts(static_cast<std::size_t>(width));
  for (int y = 0; y < height; ++y) {
    std::memcpy(counts.data(), bytes.data() + stride * static_cast<std::size_t>(y), row);
    std::ranges::transform(counts, out.row(y), [&](std::uint16_t c) { return metres_[c]; });
  }
  return out;
}

Result<ImageRgb> K4aFrames::color_of(k4a_image_t image) const {
  auto out = kit::decode_color(k4a_bytes(image));
  if (!out) return Error{out.error().cause, "its colour picture: " + out.error().message};
  if (const Status fits =
          check_size(out->width, out->height, *sensor_.color_camera, "colour", "its picture");
      !fits)
    return fits.error();
  return out;
}

// -------------------------------------------------- listing

std::string version_text(const k4a_version_t& version) {
  return fmt::format("{}.{}.{}", version.major, version.minor, version.iteration);
}

K4aDeviceInfo k4a_device_info(std::uint32_t number) {
  K4aDeviceInfo out;
  const DeviceHandle device = open_k4a_number(number);
  if (!device) {
    out.problem =
        "it cannot be opened: it is in use, or udev rules are missing" + K4aLog::get().newest();
    return out;
  }
  out.serial = k4a_serial(device.get());
  k4a_hardware_version_t version{};
  if (k4a_device_get_version(device.get(), &version) == K4A_RESULT_SUCCEEDED) {
    out.color_firmware = version_text(version.rgb);
    out.depth_firmware = version_text(version.depth);
  }
  if (k4a_device_get_sync_jack(device.get(), &out.sync_in, &out.sync_out) != K4A_RESULT_SUCCEEDED)
    out.sync_in = out.sync_out = false;
  const auto calibration = k4a_calibration(device.get());
  if (calibration)
    out.calibration = *calibration;
  else
    out.problem = calibration.error().message;
  return out;
}

}  // namespace

std::unique_ptr<FrameSource> open_k4a(const SensorConfig& sensor, SensorId id, const Timeline&) {
  const auto* source = sensor.source.get_if<K4aSource>();
  MR_ASSERT(source != nullptr);
  return std::make_unique<K4aFrames>(sensor, id, *source);
}

Result<std::vector<K4aDeviceInfo>> find_k4a_devices() {
  const std::lock_guard lock(k4a_opening());
  K4aLog::get();
  std::vector<K4aDeviceInfo> out;
  const std::uint32_t count = k4a_device_get_installed_count();
  for (std::uint32_t i = 0; i < count; ++i) out.push_back(k4a_device_info(i));
  return out;
}

}  // namespace mr::sensor
