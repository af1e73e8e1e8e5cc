#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "mr/core/frame.h"
#include "mr/core/image.h"
#include "mr/core/result.h"

/// Recordings of k4arecorder, and of what writes the same files (Azure Kinect Viewer, Open3D,
/// cwipc, Orbbec's Femto through the K4A wrapper): Matroska with tags and a calibration, read by
/// libavformat. Names are those of the Azure Kinect Sensor SDK (record.cpp, matroska_read.cpp).
namespace mr::sensor {

inline constexpr std::size_t kMostKinectCalibrationBytes = 1 << 20;

enum class KinectTrack { color, depth, infrared, imu };

/// How colour is coded, by the FOURCC of its track.
enum class KinectColorFormat { mjpg, nv12, yuy2, bgra };

/// A track of pictures.
struct KinectPictures {
  int width = 0, height = 0;
  std::string mode;            ///< of the tag: "MJPG_720P", "NFOV_UNBINNED"; empty: no tag
  bool little_endian = false;  ///< of 16 bits: very early files, whose track is labelled YUY2
  KinectColorFormat format = KinectColorFormat::mjpg;  ///< of colour
};

/// What the recording's header, tags and first blocks say.
struct KinectHeader {
  std::optional<KinectPictures> color, depth, infrared;
  bool has_imu = false;
  std::string calibration;  ///< the attachment calibration.json; empty: missing
  std::string serial, color_firmware, depth_firmware, writer;
  enum class Sync { standalone, master, subordinate } sync = Sync::standalone;
  Duration depth_delay{};          ///< of the depth exposure after colour; may be negative
  Duration subordinate_delay{};    ///< of a subordinate after its master
  Duration start_offset{};         ///< device time of the file's time 0
  Duration period{};               ///< between frames
  std::optional<TimePoint> first;  ///< device time of the first picture; nothing: there is none
  std::optional<TimePoint> last;   ///< by the file's duration; nothing: it was never closed
  std::vector<std::string> notes;  ///< what is missing or odd, one line each
};

/// A block: a picture as coded, or samples of the IMU.
struct KinectBlock {
  KinectTrack track = KinectTrack::depth;
  TimePoint at{};  ///< device time: the block's plus the file's start offset
  std::span<const std::byte> bytes;
  std::shared_ptr<const void> owner{};  ///< of `bytes`
};

/// Reads one file forward, a block at a time; files of any size, also without an index and with
/// an end that was cut off.
class KinectRecording {
 public:
  /// Errors: not_found, io; corrupt: no Matroska file; unsupported: none of its tracks is known.
  static Result<KinectRecording> open(const std::filesystem::path& file);
  KinectRecording(KinectRecording&&) noexcept;
  KinectRecording& operator=(KinectRecording&&) noexcept;
  ~KinectRecording();

  const KinectHeader& header() const;
  /// Tracks whose blocks are passed over from now on.
  void leave_out(KinectTrack track);
  /// The next block; nothing at the end, also where the file was cut off there. Error corrupt: the
  /// rest cannot be read.
  Result<std::optional<KinectBlock>> next();
  /// Goes to a place before a device time, from where next() reaches it: the beginning, or nearer
  /// where the file has an index.
  Status seek(TimePoint at);

 private:
  struct Impl;
  explicit KinectRecording(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// A depth or infrared picture from its bytes, by a table of 65,536 values, one for each count.
/// Error corrupt: another number of bytes than the picture has.
Result<ImageDepth> decode_counts(std::span<const std::byte> bytes, const KinectPictures& of,
                                 std::span<const float> table);

/// A colour picture from its bytes. Errors: corrupt, also a truncated JPEG; invalid: another size.
Result<ImageRgb> decode_kinect_color(std::span<const std::byte> bytes, const KinectPictures& of);

/// A sample of the accelerometer and the gyroscope. Times are device times.
struct KinectImuSample {
  TimePoint accelerometer_at{}, gyroscope_at{};
  std::array<float, 3> acceleration_mps2{}, rotation_radps{};
};
/// Whole samples of 40 bytes; what is left over is ignored.
std::vector<KinectImuSample> decode_imu(std::span<const std::byte> bytes);

}  // namespace mr::sensor
