#include "support/fake_k4a/fake_k4a.h"

#include <algorithm>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <memory>
#include <mutex>

namespace mr::fake_k4a {
namespace {

using Steady = std::chrono::steady_clock;

/// A device as it is plugged in; handles keep it.
struct Plugged {
  FakeDevice what;
  bool is_there = true, is_open = false, runs = false;
  std::deque<FakeCapture> waiting;
  k4a_device_configuration_t configuration{};
  Steady::time_point started;
  std::uint64_t streamed = 0;
};

struct Bus {
  std::mutex mutex;
  std::condition_variable changed;
  std::vector<std::shared_ptr<Plugged>> devices;
  std::vector<SetControl> controls;
  std::vector<StartedCameras> started;
  int open = 0, live = 0;
  double patience = 0.02;
  k4a_logging_message_cb_t* log = nullptr;
  void* log_context = nullptr;
};

Bus& bus() {
  static Bus the_bus;
  return the_bus;
}

/// Behind the handles.
struct DeviceObject : _k4a_device_t {
  std::shared_ptr<Plugged> plugged;
};
struct CaptureObject : _k4a_capture_t {
  FakeCapture capture;
};
struct ImageObject : _k4a_image_t {
  FakeImage image;
};

Plugged& of(k4a_device_t handle) { return *static_cast<DeviceObject*>(handle)->plugged; }
FakeImage& of(k4a_image_t handle) { return static_cast<ImageObject*>(handle)->image; }

template <typename T>
k4a_buffer_result_t copy_out(const std::string& text, T* out, std::size_t* size,
                             std::size_t zeros) {
  const std::size_t needed = text.size() + zeros, room = *size;
  *size = needed;
  if (!out || room < needed) return K4A_BUFFER_RESULT_TOO_SMALL;
  std::memcpy(out, text.data(), text.size());
  std::memset(out + text.size(), 0, zeros);
  return K4A_BUFFER_RESULT_SUCCEEDED;
}

std::chrono::nanoseconds period(const Plugged& device) {
  constexpr int kFps[] = {5, 15, 30};
  return std::chrono::nanoseconds(1'000'000'000 / kFps[device.configuration.camera_fps]);
}

/// The next frame of a device's stream, when its time has come.
std::optional<FakeCapture> streamed(Plugged& device) {
  if (!device.what.stream) return std::nullopt;
  if (Steady::now() < device.started + device.streamed * period(device)) return std::nullopt;
  return device.what.stream(device.streamed++);
}

std::shared_ptr<Plugged> find(const std::string& serial) {
  for (const auto& device : bus().devices)
    if (device->what.serial == serial) return device;
  return nullptr;
}

}  // namespace

void reset(double patience) {
  const std::lock_guard lock(bus().mutex);
  for (const auto& device : bus().devices) device->is_there = false;
  bus().devices.clear(), bus().controls.clear(), bus().started.clear();
  bus().patience = patience;
}

void plug(FakeDevice device) {
  const std::lock_guard lock(bus().mutex);
  bus().devices.push_back(std::make_shared<Plugged>());
  bus().devices.back()->what = std::move(device);
}

void unplug(const std::string& serial) {
  {
    const std::lock_guard lock(bus().mutex);
    const auto device = find(serial);
    if (!device) return;
    device->is_there = false;
    std::erase(bus().devices, device);
  }
  bus().changed.notify_all();
}

void deliver(const std::string& serial, FakeCapture capture) {
  {
    const std::lock_guard lock(bus().mutex);
    if (const auto device = find(serial)) device->waiting.push_back(std::move(capture));
  }
  bus().changed.notify_all();
}

std::vector<SetControl> controls() {
  const std::lock_guard lock(bus().mutex);
  return bus().controls;
}
std::vector<StartedCameras> started() {
  const std::lock_guard lock(bus().mutex);
  return bus().started;
}
int open_devices() {
  const std::lock_guard lock(bus().mutex);
  return bus().open;
}
int live_handles() {
  const std::lock_guard lock(bus().mutex);
  return bus().live;
}

FakeImage flat_depth(int width, int height, std::uint16_t mm, std::uint64_t device_usec,
                     int padding_bytes) {
  FakeImage out;
  out.width = width, out.height = height, out.stride_bytes = 2 * width + padding_bytes;
  out.device_usec = device_usec;
  out.bytes.assign(static_cast<std::size_t>(out.stride_bytes) * height, 0xFF);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      std::memcpy(out.bytes.data() + static_cast<std::size_t>(y) * out.stride_bytes + 2 * x, &mm,
                  2);
  return out;
}

FakeImage image_of(std::span<const std::byte> bytes, int width, int height,
                   std::uint64_t device_usec) {
  FakeImage out;
  out.width = width, out.height = height;
  out.device_usec = device_usec;
  out.bytes.resize(bytes.size());
  std::memcpy(out.bytes.data(), bytes.data(), bytes.size());
  return out;
}

std::string example_calibration() {
  const auto camera = [](const char* location, const char* parameters, const char* size,
                         const char* rotation, const char* translation) {
    return std::string(R"({"Location": "CALIBRATION_CameraLocation)") + location +
           R"(", "Intrinsics": {"ModelType": "CALIBRATION_LensDistortionModelBrownConrady",
           "ModelParameterCount": 14, "ModelParameters": [)" +
           parameters + "]}, " + size + R"(, "MetricRadius": 0, "Rt": {"Rotation": [)" + rotation +
           R"(], "Translation": [)" + translation + "]}}";
  };
  return R"({"CalibrationInformation": {"Cameras": [)" +
         camera("D0",
                "0.49862006306648254, 0.49299359321594238, 0.49295613169670105, "
                "0.49312511086463928, 3.8691997528076172, 2.0663304328918457, "
                "0.086164794862270355, 4.2011380195617676, 3.3314094543457031, "
                "0.50915241241455078, 0, 0, 7.02285033185035E-5, 0.00015635808813385666",
                R"("SensorWidth": 1024, "SensorHeight": 1024)", "1, 0, 0, 0, 1, 0, 0, 0, 1",
                "0, 0, 0") +
         ", " +
         camera("PV0",
                "0.50041943788528442, 0.51068669557571411, 0.476089745759964, "
                "0.63471859693527222, 0.34417539834976196, -2.8604564666748047, "
                "1.8035205602645874, 0.21697279810905457, -2.6490097045898437, "
                "1.7056518793106079, 0, 0, -4.4145919673610479E-5, 0.00047436624299734831",
                R"("SensorWidth": 4096, "SensorHeight": 3072)",
                "0.99997377395629883, 0.0072122937999665737, -0.00064296292839571834, "
                "-0.007122507318854332, 0.99573004245758057, 0.092037834227085114, "
                "0.0013040214544162154, -0.0920308455824852, 0.99575531482696533",
                "-0.032023865729570389, -0.0021201763302087784, 0.0039135357365012169") +
         "]}}";
}

}  // namespace mr::fake_k4a

// -------------------------------------------------- the interface

using namespace mr::fake_k4a;

extern "C" {

k4a_result_t k4a_set_debug_message_handler(k4a_logging_message_cb_t* message_cb,
                                           void* message_cb_context, k4a_log_level_t) {
  const std::lock_guard lock(bus().mutex);
  bus().log = message_cb, bus().log_context = message_cb_context;
  return K4A_RESULT_SUCCEEDED;
}

std::uint32_t k4a_device_get_installed_count(void) {
  const std::lock_guard lock(bus().mutex);
  return static_cast<std::uint32_t>(bus().devices.size());
}

k4a_result_t k4a_device_open(std::uint32_t index, k4a_device_t* device_handle) {
  const std::lock_guard lock(bus().mutex);
  if (index >= bus().devices.size()) return K4A_RESULT_FAILED;
  const auto device = bus().devices[index];
  if (device->what.in_use || device->is_open) {
    if (bus().log)
      bus().log(bus().log_context, K4A_LOG_LEVEL_ERROR, "usb.cpp", 1, "device is\nbusy");
    return K4A_RESULT_FAILED;
  }
  auto* object = new DeviceObject();
  object->plugged = device;
  device->is_open = true;
  ++bus().open;
  *device_handle = object;
  return K4A_RESULT_SUCCEEDED;
}

void k4a_device_close(k4a_device_t device_handle) {
  const std::lock_guard lock(bus().mutex);
  of(device_handle).is_open = of(device_handle).runs = false;
  --bus().open;
  delete static_cast<DeviceObject*>(device_handle);
}

k4a_buffer_result_t k4a_device_get_serialnum(k4a_device_t device_handle, char* serial_number,
                                             std::size_t* serial_number_size) {
  const std::lock_guard lock(bus().mutex);
  return copy_out(of(device_handle).what.serial, serial_number, serial_number_size, 1);
}

k4a_result_t k4a_device_get_version(k4a_device_t, k4a_hardware_version_t* version) {
  *version = {};
  version->rgb = {1, 6, 110};
  version->depth = {1, 6, 79};
  return K4A_RESULT_SUCCEEDED;
}

k4a_result_t k4a_device_get_sync_jack(k4a_device_t device_handle, bool* sync_in_jack_connected,
                                      bool* sync_out_jack_connected) {
  const std::lock_guard lock(bus().mutex);
  *sync_in_jack_connected = of(device_handle).what.sync_in;
  *sync_out_jack_connected = of(device_handle).what.sync_out;
  return K4A_RESULT_SUCCEEDED;
}

k4a_buffer_result_t k4a_device_get_raw_calibration(k4a_device_t device_handle, std::uint8_t* data,
                                                   std::size_t* data_size) {
  const std::lock_guard lock(bus().mutex);
  return copy_out(of(device_handle).what.calibration, data, data_size, 1);
}

k4a_result_t k4a_device_set_color_control(k4a_device_t device_handle,
                                          k4a_color_control_command_t command,
                                          k4a_color_control_mode_t mode, std::int32_t value) {
  const std::lock_guard lock(bus().mutex);
  const FakeDevice& device = of(device_handle).what;
  if (device.refused.contains(command)) return K4A_RESULT_FAILED;
  bus().controls.push_back({device.serial, command, mode, value});
  return K4A_RESULT_SUCCEEDED;
}

k4a_result_t k4a_device_start_cameras(k4a_device_t device_handle,
                                      const k4a_device_configuration_t* config) {
  const std::lock_guard lock(bus().mutex);
  Plugged& device = of(device_handle);
  if (!device.is_there || !device.what.starts || device.runs) return K4A_RESULT_FAILED;
  device.runs = true;
  device.configuration = *config;
  device.started = Steady::now();
  bus().started.push_back({device.what.serial, *config});
  return K4A_RESULT_SUCCEEDED;
}

void k4a_device_stop_cameras(k4a_device_t device_handle) {
  const std::lock_guard lock(bus().mutex);
  of(device_handle).runs = false;
}

k4a_wait_result_t k4a_device_get_capture(k4a_device_t device_handle, k4a_capture_t* capture_handle,
                                         std::int32_t timeout_in_ms) {
  std::unique_lock lock(bus().mutex);
  Plugged& device = of(device_handle);
  const auto until = Steady::now() +
                     std::chrono::duration_cast<Steady::duration>(
                         std::chrono::duration<double, std::milli>(timeout_in_ms * bus().patience));
  while (device.is_there && device.runs) {
    std::optional<FakeCapture> capture;
    if (!device.waiting.empty()) {
      capture = std::move(device.waiting.front());
      device.waiting.pop_front();
    } else {
      capture = streamed(device);
    }
    if (capture) {
      auto* object = new CaptureObject();
      object->capture = *std::move(capture);
      ++bus().live;
      *capture_handle = object;
      return K4A_WAIT_RESULT_SUCCEEDED;
    }
    if (Steady::now() >= until) return K4A_WAIT_RESULT_TIMEOUT;
    bus().changed.wait_for(lock, std::chrono::milliseconds(1));
  }
  return K4A_WAIT_RESULT_FAILED;
}

void k4a_capture_release(k4a_capture_t capture_handle) {
  const std::lock_guard lock(bus().mutex);
  --bus().live;
  delete static_cast<CaptureObject*>(capture_handle);
}

static k4a_image_t image_handle_of(const std::optional<FakeImage>& image) {
  if (!image) return nullptr;
  const std::lock_guard lock(bus().mutex);
  auto* object = new ImageObject();
  object->image = *image;
  ++bus().live;
  return object;
}

k4a_image_t k4a_capture_get_color_image(k4a_capture_t capture_handle) {
  return image_handle_of(static_cast<CaptureObject*>(capture_handle)->capture.color);
}
k4a_image_t k4a_capture_get_depth_image(k4a_capture_t capture_handle) {
  return image_handle_of(static_cast<CaptureObject*>(capture_handle)->capture.depth);
}
std::uint8_t* k4a_image_get_buffer(k4a_image_t image_handle) {
  return of(image_handle).bytes.data();
}
std::size_t k4a_image_get_size(k4a_image_t image_handle) { return of(image_handle).bytes.size(); }
int k4a_image_get_width_pixels(k4a_image_t image_handle) { return of(image_handle).width; }
int k4a_image_get_height_pixels(k4a_image_t image_handle) { return of(image_handle).height; }
int k4a_image_get_stride_bytes(k4a_image_t image_handle) { return of(image_handle).stride_bytes; }
std::uint64_t k4a_image_get_device_timestamp_usec(k4a_image_t image_handle) {
  return of(image_handle).device_usec;
}
std::uint64_t k4a_image_get_system_timestamp_nsec(k4a_image_t image_handle) {
  const auto arrived = of(image_handle).arrived;
  const auto when =
      arrived.count() != 0 ? arrived : std::chrono::nanoseconds(Steady::now().time_since_epoch());
  return static_cast<std::uint64_t>(when.count());
}
void k4a_image_release(k4a_image_t image_handle) {
  const std::lock_guard lock(bus().mutex);
  --bus().live;
  delete static_cast<ImageObject*>(image_handle);
}

}  // extern "C"
