#pragma once

#include <lz4frame.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/frame.h"
#include "mr/core/pose.h"

/// Writes ROS bags, and in them recordings as a RealSense's recorder writes them, without any of
/// the readers' code.
namespace mr::test {

using Bytes = std::vector<std::byte>;

/// Appends values as ROS serializes them.
class RosWriter {
 public:
  template <typename T>
  RosWriter& put(T value) {
    return raw(std::as_bytes(std::span(&value, 1)));
  }
  RosWriter& raw(std::span<const std::byte> bytes) {
    out.insert(out.end(), bytes.begin(), bytes.end());
    return *this;
  }
  RosWriter& counted(std::span<const std::byte> bytes) {
    return put(static_cast<std::uint32_t>(bytes.size())).raw(bytes);
  }
  RosWriter& text(std::string_view text) { return counted(std::as_bytes(std::span(text))); }
  RosWriter& time(Duration d) {
    put(static_cast<std::uint32_t>(d / std::chrono::seconds(1)));
    return put(static_cast<std::uint32_t>((d % std::chrono::seconds(1)).count()));
  }
  /// A field `name=value` of a record's header.
  template <typename T>
  RosWriter& field(std::string_view name, T value) {
    RosWriter inner;
    inner.raw(std::as_bytes(std::span(name))).put('=');
    if constexpr (std::is_convertible_v<T, std::string_view>)
      inner.raw(std::as_bytes(std::span(std::string_view(value))));
    else
      inner.put(value);
    return counted(inner.out);
  }

  Bytes out;
};

enum class BagCompression { none, lz4, bz2 };

/// A bag of version 2.0, in memory.
class BagWriter {
 public:
  /// `header_bytes`: of the padded header, 4096 in files of recorders.
  explicit BagWriter(BagCompression compression, std::size_t chunk_bytes = 4096,
                     std::size_t header_bytes = 4096)
      : compression_(compression), chunk_bytes_(chunk_bytes), header_bytes_(header_bytes) {
    file_.raw(std::as_bytes(std::span(std::string_view("#ROSBAG V2.0\n"))));
    add_bag_header(file_, 0);
  }

  void message(const std::string& topic, const std::string& type, Duration recorded,
               const Bytes& data) {
    const auto [known, is_new] =
        connections_.try_emplace(topic, static_cast<std::uint32_t>(connections_.size()), type);
    if (is_new) add_connection(chunk_, topic, known->second);
    if (!begins_) begins_ = recorded;
    ends_ = recorded;
    ++counts_[known->second.first];
    RosWriter header;
    header.field("op", std::uint8_t{2}).field("conn", known->second.first);
    header.field("time", ros_time(recorded));
    chunk_.counted(header.out).counted(data);
    if (chunk_.out.size() >= chunk_bytes_) end_chunk();
  }

  /// With its index.
  Bytes close() {
    end_chunk();
    const std::uint64_t index = file_.out.size();
    for (const auto& [topic, connection] : connections_) add_connection(file_, topic, connection);
    file_.raw(chunk_infos_.out);
    RosWriter begin;
    begin.raw(std::as_bytes(std::span(std::string_view("#ROSBAG V2.0\n"))));
    add_bag_header(begin, index);
    std::memcpy(file_.out.data(), begin.out.data(), begin.out.size());
    return file_.out;
  }

  /// As of a recorder that was killed: its last chunk has a header that says 0.
  Bytes kill() {
    RosWriter header;
    header.field("op", std::uint8_t{5}).field("compression", name()).field("size", 0u);
    file_.counted(header.out).put(0u);
    if (compression_ == BagCompression::none) {
      file_.raw(chunk_.out);
    } else {
      const Bytes packed = compressed(chunk_.out);
      file_.raw(std::span(packed).first(packed.size() / 2));
    }
    return file_.out;
  }

 private:
  using Connection = std::pair<std::uint32_t, std::string>;  // number and type

  static std::uint64_t ros_time(Duration d) {
    RosWriter time;
    time.time(d);
    std::uint64_t out = 0;
    std::memcpy(&out, time.out.data(), sizeof out);
    return out;
  }

  const char* name() const {
    constexpr const char* kNames[] = {"none", "lz4", "bz2"};
    return kNames[static_cast<int>(compression_)];
  }

  void add_bag_header(RosWriter& to, std::uint64_t index) const {
    RosWriter header;
    header.field("op", std::uint8_t{3}).field("index_pos", index);
    header.field("conn_count", 0u).field("chunk_count", 0u);
    to.counted(header.out).counted(Bytes(header_bytes_ - header.out.size() - 8, std::byte{' '}));
  }

  static void add_connection(RosWriter& to, const std::string& topic, const Connection& c) {
    RosWriter header, data;
    header.field("op", std::uint8_t{7}).field("conn", c.first).field("topic", topic);
    data.field("topic", topic).field("type", c.second).field("md5sum", "0");
    data.field("message_definition", "as the type says");
    to.counted(header.out).counted(data.out);
  }

  static Bytes compressed(const Bytes& bytes) {
    LZ4F_preferences_t settings{};
    settings.frameInfo.blockMode = LZ4F_blockIndependent;
    settings.frameInfo.contentChecksumFlag = LZ4F_contentChecksumEnabled;
    Bytes out(LZ4F_compressFrameBound(bytes.size(), &settings));
    const std::size_t size =
        LZ4F_compressFrame(out.data(), out.size(), bytes.data(), bytes.size(), &settings);
    if (LZ4F_isError(size)) std::abort();
    out.resize(size);
    return out;
  }

  void end_chunk() {
    if (chunk_.out.empty()) return;
    RosWriter header, info, info_data, index, nothing;
    header.field("op", std::uint8_t{5}).field("compression", name());
    header.field("size", static_cast<std::uint32_t>(chunk_.out.size()));
    info.field("op", std::uint8_t{6}).field("ver", 1u);
    info.field("chunk_pos", static_cast<std::uint64_t>(file_.out.size()));
    info.field("start_time", ros_time(*begins_)).field("end_time", ros_time(ends_));
    info.field("count", static_cast<std::uint32_t>(counts_.size()));
    for (const auto& [connection, count] : counts_) info_data.put(connection).put(count);
    chunk_infos_.counted(info.out).counted(info_data.out);
    file_.counted(header.out)
        .counted(compression_ == BagCompression::lz4 ? compressed(chunk_.out) : chunk_.out);
    index.field("op", std::uint8_t{4}).field("ver", 1u).field("conn", 0u).field("count", 1u);
    file_.counted(index.out).counted(Bytes(12));
    chunk_.out.clear(), counts_.clear(), begins_.reset();
  }

  BagCompression compression_;
  std::size_t chunk_bytes_, header_bytes_;
  RosWriter file_, chunk_, chunk_infos_;
  std::map<std::string, Connection> connections_;
  std::map<std::uint32_t, std::uint32_t> counts_;  ///< of the chunk's messages, by connection
  std::optional<Duration> begins_;
  Duration ends_{};
};

/// sensor_msgs/Image of a RealSense.
struct RosImage {
  Duration stamp{};
  int width = 0, height = 0;
  std::string encoding;
  Bytes data;
  std::uint32_t step_bytes = 0;
  bool big_endian = false;
  std::optional<float> unit_m{};  ///< written by newer recorders

  Bytes bytes() const {
    RosWriter out;
    out.put(7u).time(stamp).text(unit_m ? "1" : "");
    out.put(static_cast<std::uint32_t>(height)).put(static_cast<std::uint32_t>(width));
    out.text(encoding).put(static_cast<std::uint8_t>(big_endian)).put(step_bytes);
    out.counted(data);
    if (unit_m) out.put(*unit_m);
    return out.out;
  }
};

/// What a recording is made of.
struct RealSenseMade {
  BagCompression compression = BagCompression::none;
  std::size_t header_bytes = 4096;
  std::uint32_t version = 4;
  std::string device = "Intel RealSense D435", serial = "123456789012";
  std::uint32_t fps = 30;
  Camera depth_camera, color_camera;  ///< of pictures; lenses are stated below
  std::string depth_model = "Brown Conrady", color_model = "Inverse Brown Conrady";
  std::array<double, 5> color_coefficients{};
  bool depth_info = true, color_info = true, tf = true;
  Pose T_color_depth;
  std::array<double, 4> quaternion{0, 0, 0, 1};  ///< x y z w of T_color_depth.rotation
  std::optional<float> unit_m = 0.001f;          ///< in the pictures
  std::optional<float> option_unit_m{};
  std::string option_name = "Depth_Units", clock = "Hardware Clock";
  std::string color_encoding = "rgb8";
  Duration recorded_after = std::chrono::milliseconds(-900);  ///< from stamp to recording
};

/// A recording of one depth and one colour stream, as the SDK's recorder writes it: transforms and
/// metadata follow the first picture of a stream.
class RealSenseBag {
 public:
  static constexpr const char* kDepth = "/device_0/sensor_0/Depth_0";
  static constexpr const char* kColor = "/device_0/sensor_1/Color_0";

  explicit RealSenseBag(RealSenseMade made)
      : made_(std::move(made)), bag(made_.compression, 4096, made_.header_bytes) {
    RosWriter version;
    bag.message("/file_version", "std_msgs/UInt32", {}, version.put(made_.version).out);
    key_value("/device_0/info", {}, "Name", made_.device);
    key_value("/device_0/info", {}, "Serial Number", made_.serial);
    key_value("/device_0/info", {}, "Firmware Version", "05.12.07.150");
    if (made_.option_unit_m && made_.version < 3)
      key_value("/device_0/sensor_0/property", {}, "Depth Units",
                std::to_string(*made_.option_unit_m));
    else if (made_.option_unit_m)
      bag.message("/device_0/sensor_0/option/" + made_.option_name + "/value", "std_msgs/Float32",
                  {}, RosWriter().put(*made_.option_unit_m).out);
    stream(kDepth, made_.depth_camera, "mono16", made_.depth_info, made_.depth_model, {});
    if (made_.color_camera.width > 0)
      stream(kColor, made_.color_camera, made_.color_encoding, made_.color_info, made_.color_model,
             made_.color_coefficients);
  }

  void depth(Duration stamp, std::span<const std::uint16_t> counts) {
    RosImage image{stamp, made_.depth_camera.width, made_.depth_camera.height, "mono16", {}};
    const auto bytes = std::as_bytes(counts);
    image.data.assign(bytes.begin(), bytes.end());
    image.step_bytes = static_cast<std::uint32_t>(2 * image.width);
    image.unit_m = made_.unit_m;
    picture(kDepth, image);
  }
  void color(Duration stamp, Bytes pixels) {
    RosImage image{stamp, made_.color_camera.width, made_.color_camera.height, made_.color_encoding,
                   std::move(pixels)};
    image.step_bytes = static_cast<std::uint32_t>(image.data.size()) /
                       static_cast<std::uint32_t>(std::max(1, image.height));
    picture(kColor, image);
  }
  void picture(const std::string& stream, RosImage image) {
    const Duration recorded = image.stamp + made_.recorded_after;
    image.stamp += stamp_error;
    bag.message(stream + "/image/data", "sensor_msgs/Image", recorded, image.bytes());
    key_value(stream + "/image/metadata", recorded, "system_time", "1500000000000.25");
    key_value(stream + "/image/metadata", recorded, "timestamp_domain", made_.clock);
    if (made_.tf && !written_tf_[stream]) transform(stream);
    written_tf_[stream] = true;
  }
  void key_value(const std::string& topic, Duration recorded, const std::string& key,
                 const std::string& value) {
    bag.message(topic, "diagnostic_msgs/KeyValue", recorded, RosWriter().text(key).text(value).out);
  }

 private:
  void stream(const std::string& topic, const Camera& camera, const std::string& encoding,
              bool with_info, const std::string& model, const std::array<double, 5>& coefficients) {
    bag.message(topic + "/info", "realsense_msgs/StreamInfo", {},
                RosWriter().put(made_.fps).text(encoding).put(std::uint8_t{1}).out);
    if (!with_info) return;
    RosWriter info;
    info.put(0u).time({}).text("");
    info.put(static_cast<std::uint32_t>(camera.height));
    info.put(static_cast<std::uint32_t>(camera.width)).text(model).put(5u);
    for (const double c : coefficients) info.put(c);
    for (const double k : {camera.fx, 0., camera.cx, 0., camera.fy, camera.cy, 0., 0., 1.})
      info.put(k);
    for (int i = 0; i < 9 + 12; ++i) info.put(0.0);
    for (int i = 0; i < 6; ++i) info.put(0u);
    info.put(std::uint8_t{0});
    bag.message(topic + "/info/camera_info", "sensor_msgs/CameraInfo", {}, info.out);
  }

  /// Depth is the reference of its group.
  void transform(const std::string& stream) {
    const bool is_color = stream == kColor;
    const Vec3d t = is_color ? made_.T_color_depth.translation : Vec3d{};
    const std::array<double, 4> q = is_color ? made_.quaternion : std::array<double, 4>{0, 0, 0, 1};
    RosWriter out;
    for (const double v : {t.x, t.y, t.z, q[0], q[1], q[2], q[3]}) out.put(v);
    bag.message(stream + "/tf/0", "geometry_msgs/Transform", {}, out.out);
  }

  RealSenseMade made_;
  std::map<std::string, bool> written_tf_;

 public:
  BagWriter bag;
  Duration stamp_error{};                  ///< of what follows
  RealSenseMade& made() { return made_; }  ///< what follows may differ
};

}  // namespace mr::test
