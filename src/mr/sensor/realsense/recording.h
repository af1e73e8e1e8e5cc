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
#include "mr/core/pose.h"
#include "mr/core/result.h"
#include "mr/sensor/realsense/bag.h"

/// Recordings of Intel RealSense cameras (.bag of the SDK's recorder and of RealSense Viewer).
/// Names of topics are those of librealsense (ros_file_format.h, ros_writer.cpp).
namespace mr::sensor {

enum class RealSenseStream { depth, color };

/// The camera of a stream, as its camera_info says.
struct RealSenseLens {
  int width = 0, height = 0;              ///< pixels
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< pixels
  std::string model;                      ///< "Brown Conrady", "Inverse Brown Conrady", "None", …
  std::array<double, 5> coefficients{};   ///< of Brown models k1 k2 p1 p2 k3
};

/// A stream of pictures.
struct RealSensePictures {
  std::string topic;          ///< without its last parts: "/device_0/sensor_0/Depth_0"
  int width = 0, height = 0;  ///< of the first picture; 0: there is none
  std::string encoding;       ///< of the first picture: "mono16", "rgb8", "YUYV", …
  double fps = 0;             ///< 0: not told
  std::optional<RealSenseLens> lens;
  std::string clock;  ///< that stamps its pictures: "Hardware Clock", "Global Time", …; empty: ?
};

/// What a recording says before and beside its first pictures.
struct RealSenseHeader {
  std::uint32_t version = 0;  ///< of the layout of topics
  std::string name, serial, firmware;
  std::optional<RealSensePictures> depth, color;
  double depth_unit_m = 0.001;
  std::string depth_unit_from;     ///< in words
  Pose T_color_depth;              ///< identity where it is not told
  Duration period{};               ///< between pictures of depth
  std::optional<TimePoint> first;  ///< stamp of the first depth picture; nothing: there is none
  std::optional<TimePoint> last;   ///< of the last; nothing: the bag has no index
  std::vector<std::string> notes;  ///< what is missing or unusual, one line each
};

/// A picture as it was recorded.
struct RealSensePicture {
  RealSenseStream stream = RealSenseStream::depth;
  TimePoint at{};             ///< by the clock of the stream, which does not start again
  int width = 0, height = 0;  ///< 0: the message is damaged
  std::string encoding;
  bool big_endian = false;
  std::uint32_t step_bytes = 0;  ///< from row to row
  double unit_m = 0;             ///< of a count of depth; 0: not told
  Duration recorded_after{};     ///< its stamp, by the recorder's clock
  std::shared_ptr<const std::vector<std::byte>> bytes;
};

/// Reads the pictures of the first depth and the first colour stream of the first device forward.
class RealSenseRecording {
 public:
  /// Errors: as BagReader::open(); unsupported: no stream of depth or colour.
  static Result<RealSenseRecording> open(const std::filesystem::path& file);

  const RealSenseHeader& header() const { return header_; }
  /// The next picture; nothing at the end. Errors: as BagReader::next().
  Result<std::optional<RealSensePicture>> next();
  /// Goes to a place from where next() reaches a time of header().depth's clock.
  Status seek(TimePoint at);

 private:
  RealSenseRecording(BagReader bag, std::string file);
  Status read_header();
  Status find_times(Duration first_recorded_after, Duration last_recorded_after);
  void read_clock();
  std::optional<TimePoint> on_clock(const RealSensePicture& picture) const;
  Status rewind();

  BagReader bag_;
  std::string file_;
  RealSenseHeader header_;
  std::optional<Duration> recorded_after_;  ///< from the clock of stamps to that of the recorder
  std::optional<TimePoint> read_until_;     ///< the last picture that was handed out
};

/// A depth picture, by a table of 65,536 values, one for each count. Errors: unsupported (no
/// encoding of 16 bits), corrupt (rows overlap, or another number of bytes than they take).
Result<ImageDepth> decode_realsense_depth(const RealSensePicture& picture,
                                          std::span<const float> table);

/// A colour picture. Errors: unsupported (its encoding), others as decode_raw_color() and
/// decode_jpeg().
Result<ImageRgb> decode_realsense_color(const RealSensePicture& picture);

}  // namespace mr::sensor
