#pragma once

// The part of the Azure Kinect Sensor SDK's interface (1.4) that src/mr/sensor/k4a uses, for builds
// without the SDK: the names, values and signatures of its public header, and nothing else of it.
// tests/support/fake_k4a/fake_k4a.cpp implements it.

#include <cstddef>
#include <cstdint>

#define K4A_FAKE_HANDLE(name) \
  typedef struct _##name {    \
    std::size_t _rsvd;        \
  } * name
K4A_FAKE_HANDLE(k4a_device_t);
K4A_FAKE_HANDLE(k4a_capture_t);
K4A_FAKE_HANDLE(k4a_image_t);
#undef K4A_FAKE_HANDLE

extern "C" {

typedef enum { K4A_RESULT_SUCCEEDED = 0, K4A_RESULT_FAILED } k4a_result_t;
typedef enum {
  K4A_BUFFER_RESULT_SUCCEEDED = 0,
  K4A_BUFFER_RESULT_FAILED,
  K4A_BUFFER_RESULT_TOO_SMALL
} k4a_buffer_result_t;
typedef enum {
  K4A_WAIT_RESULT_SUCCEEDED = 0,
  K4A_WAIT_RESULT_FAILED,
  K4A_WAIT_RESULT_TIMEOUT
} k4a_wait_result_t;
typedef enum {
  K4A_LOG_LEVEL_CRITICAL = 0,
  K4A_LOG_LEVEL_ERROR,
  K4A_LOG_LEVEL_WARNING,
  K4A_LOG_LEVEL_INFO,
  K4A_LOG_LEVEL_TRACE,
  K4A_LOG_LEVEL_OFF
} k4a_log_level_t;
typedef enum {
  K4A_DEPTH_MODE_OFF = 0,
  K4A_DEPTH_MODE_NFOV_2X2BINNED,
  K4A_DEPTH_MODE_NFOV_UNBINNED,
  K4A_DEPTH_MODE_WFOV_2X2BINNED,
  K4A_DEPTH_MODE_WFOV_UNBINNED,
  K4A_DEPTH_MODE_PASSIVE_IR
} k4a_depth_mode_t;
typedef enum {
  K4A_COLOR_RESOLUTION_OFF = 0,
  K4A_COLOR_RESOLUTION_720P,
  K4A_COLOR_RESOLUTION_1080P,
  K4A_COLOR_RESOLUTION_1440P,
  K4A_COLOR_RESOLUTION_1536P,
  K4A_COLOR_RESOLUTION_2160P,
  K4A_COLOR_RESOLUTION_3072P
} k4a_color_resolution_t;
typedef enum {
  K4A_IMAGE_FORMAT_COLOR_MJPG = 0,
  K4A_IMAGE_FORMAT_COLOR_NV12,
  K4A_IMAGE_FORMAT_COLOR_YUY2,
  K4A_IMAGE_FORMAT_COLOR_BGRA32,
  K4A_IMAGE_FORMAT_DEPTH16,
  K4A_IMAGE_FORMAT_IR16,
  K4A_IMAGE_FORMAT_CUSTOM8,
  K4A_IMAGE_FORMAT_CUSTOM16,
  K4A_IMAGE_FORMAT_CUSTOM
} k4a_image_format_t;
typedef enum {
  K4A_FRAMES_PER_SECOND_5 = 0,
  K4A_FRAMES_PER_SECOND_15,
  K4A_FRAMES_PER_SECOND_30
} k4a_fps_t;
typedef enum {
  K4A_COLOR_CONTROL_EXPOSURE_TIME_ABSOLUTE = 0,
  K4A_COLOR_CONTROL_AUTO_EXPOSURE_PRIORITY,
  K4A_COLOR_CONTROL_BRIGHTNESS,
  K4A_COLOR_CONTROL_CONTRAST,
  K4A_COLOR_CONTROL_SATURATION,
  K4A_COLOR_CONTROL_SHARPNESS,
  K4A_COLOR_CONTROL_WHITEBALANCE,
  K4A_COLOR_CONTROL_BACKLIGHT_COMPENSATION,
  K4A_COLOR_CONTROL_GAIN,
  K4A_COLOR_CONTROL_POWERLINE_FREQUENCY
} k4a_color_control_command_t;
typedef enum {
  K4A_COLOR_CONTROL_MODE_AUTO = 0,
  K4A_COLOR_CONTROL_MODE_MANUAL
} k4a_color_control_mode_t;
typedef enum {
  K4A_WIRED_SYNC_MODE_STANDALONE = 0,
  K4A_WIRED_SYNC_MODE_MASTER,
  K4A_WIRED_SYNC_MODE_SUBORDINATE
} k4a_wired_sync_mode_t;
typedef enum { K4A_FIRMWARE_BUILD_RELEASE, K4A_FIRMWARE_BUILD_DEBUG } k4a_firmware_build_t;
typedef enum {
  K4A_FIRMWARE_SIGNATURE_MSFT,
  K4A_FIRMWARE_SIGNATURE_TEST,
  K4A_FIRMWARE_SIGNATURE_UNSIGNED
} k4a_firmware_signature_t;

typedef struct _k4a_device_configuration_t {
  k4a_image_format_t color_format;
  k4a_color_resolution_t color_resolution;
  k4a_depth_mode_t depth_mode;
  k4a_fps_t camera_fps;
  bool synchronized_images_only;
  std::int32_t depth_delay_off_color_usec;
  k4a_wired_sync_mode_t wired_sync_mode;
  std::uint32_t subordinate_delay_off_master_usec;
  bool disable_streaming_indicator;
} k4a_device_configuration_t;

static const k4a_device_configuration_t K4A_DEVICE_CONFIG_INIT_DISABLE_ALL = {
    K4A_IMAGE_FORMAT_COLOR_MJPG,
    K4A_COLOR_RESOLUTION_OFF,
    K4A_DEPTH_MODE_OFF,
    K4A_FRAMES_PER_SECOND_30,
    false,
    0,
    K4A_WIRED_SYNC_MODE_STANDALONE,
    0,
    false};

typedef struct _k4a_version_t {
  std::uint32_t major, minor, iteration;
} k4a_version_t;
typedef struct _k4a_hardware_version_t {
  k4a_version_t rgb, depth, audio, depth_sensor;
  k4a_firmware_build_t firmware_build;
  k4a_firmware_signature_t firmware_signature;
} k4a_hardware_version_t;

typedef void(k4a_logging_message_cb_t)(void* context, k4a_log_level_t level, const char* file,
                                       const int line, const char* message);

k4a_result_t k4a_set_debug_message_handler(k4a_logging_message_cb_t* message_cb,
                                           void* message_cb_context, k4a_log_level_t min_level);
std::uint32_t k4a_device_get_installed_count(void);
k4a_result_t k4a_device_open(std::uint32_t index, k4a_device_t* device_handle);
void k4a_device_close(k4a_device_t device_handle);
k4a_buffer_result_t k4a_device_get_serialnum(k4a_device_t device_handle, char* serial_number,
                                             std::size_t* serial_number_size);
k4a_result_t k4a_device_get_version(k4a_device_t device_handle, k4a_hardware_version_t* version);
k4a_result_t k4a_device_get_sync_jack(k4a_device_t device_handle, bool* sync_in_jack_connected,
                                      bool* sync_out_jack_connected);
k4a_buffer_result_t k4a_device_get_raw_calibration(k4a_device_t device_handle, std::uint8_t* data,
                                                   std::size_t* data_size);
k4a_result_t k4a_device_set_color_control(k4a_device_t device_handle,
                                          k4a_color_control_command_t command,
                                          k4a_color_control_mode_t mode, std::int32_t value);
k4a_result_t k4a_device_start_cameras(k4a_device_t device_handle,
                                      const k4a_device_configuration_t* config);
void k4a_device_stop_cameras(k4a_device_t device_handle);
k4a_wait_result_t k4a_device_get_capture(k4a_device_t device_handle, k4a_capture_t* capture_handle,
                                         std::int32_t timeout_in_ms);
void k4a_capture_release(k4a_capture_t capture_handle);
k4a_image_t k4a_capture_get_color_image(k4a_capture_t capture_handle);
k4a_image_t k4a_capture_get_depth_image(k4a_capture_t capture_handle);
std::uint8_t* k4a_image_get_buffer(k4a_image_t image_handle);
std::size_t k4a_image_get_size(k4a_image_t image_handle);
int k4a_image_get_width_pixels(k4a_image_t image_handle);
int k4a_image_get_height_pixels(k4a_image_t image_handle);
int k4a_image_get_stride_bytes(k4a_image_t image_handle);
std::uint64_t k4a_image_get_device_timestamp_usec(k4a_image_t image_handle);
std::uint64_t k4a_image_get_system_timestamp_nsec(k4a_image_t image_handle);
void k4a_image_release(k4a_image_t image_handle);

}  // extern "C"
