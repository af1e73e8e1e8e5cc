#include "mr/sensor/ouster/lidar_scan.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace mr::sensor {
namespace {

/// Packets of up to so many scans back are late; farther back, the sensor has started anew.
constexpr std::int64_t kLateScans = 8;

LidarReturn empty_return(const OusterMetadata& metadata) {
  LidarReturn out;
  out.range_mm = {metadata.width, metadata.height};
  out.reflectivity = {metadata.width, metadata.height};
  if (has_signal(metadata.profile)) out.signal = {metadata.width, metadata.height};
  return out;
}

/// Whether a header's number denies that of the metadata. Anonymised recordings have zeros.
template <typename T>
bool contradicts(const std::optional<T>& packet, const std::optional<T>& metadata) {
  return packet && metadata && *packet != 0 && *metadata != 0 && *packet != *metadata;
}

}  // namespace

int LidarScan::valid_columns() const {
  return static_cast<int>(std::ranges::count(valid, std::uint8_t{1}));
}

ScanAssembler::ScanAssembler(const OusterMetadata& metadata, std::optional<IpAddress> sender)
    : metadata_(metadata), format_(metadata.packet_format()), sender_(sender) {}

bool ScanAssembler::is_foreign(const LidarPacket& packet, const std::optional<IpAddress>& from) {
  if (sender_ && from && *sender_ != *from) return true;
  if (contradicts(packet.init_id(), metadata_.init_id) ||
      contradicts(packet.serial(), metadata_.serial_number))
    return true;
  if (metadata_.profile == LidarProfile::legacy && !sender_) sender_ = from;
  return false;
}

ScanAssembler::Age ScanAssembler::age(std::uint32_t frame_id) const {
  if (!frame_id_) return Age::newer;
  const std::uint32_t ahead = frame_id - *frame_id_;
  const std::int64_t steps = has_wide_frame_id(metadata_.profile)
                                 ? std::int64_t{static_cast<std::int32_t>(ahead)}
                                 : std::int64_t{static_cast<std::int16_t>(ahead)};
  if (steps == 0) return Age::same;
  return steps < 0 && steps >= -kLateScans ? Age::older : Age::newer;
}

void ScanAssembler::start(std::uint32_t frame_id) {
  const auto columns = static_cast<std::size_t>(metadata_.width);
  LidarScan scan;
  scan.frame_id = frame_id;
  scan.first = empty_return(metadata_);
  if (has_second_return(metadata_.profile)) scan.second = empty_return(metadata_);
  scan.near_ir = {metadata_.width, metadata_.height};
  scan.valid.assign(columns, 0);
  scan.timestamp_ns.assign(columns, 0);
  scan.status.assign(columns, 0);
  scan_ = std::move(scan);
  frame_id_ = frame_id;
  received_.assign(columns, 0);
  missing_ = metadata_.window_columns();
}

void ScanAssembler::store(const LidarPacket& packet) {
  targets_.assign(static_cast<std::size_t>(format_.columns), -1);
  for (int c = 0; c < format_.columns; ++c) {
    const LidarColumn column = packet.column(c);
    if (column.measurement_id >= metadata_.width || column.frame_id != scan_->frame_id) continue;
    const std::size_t at = column.measurement_id;
    if (received_[at] == 0 && metadata_.in_window(column.measurement_id)) --missing_;
    received_[at] = 1;
    if (!column.valid) continue;
    scan_->valid[at] = 1;
    scan_->timestamp_ns[at] = column.timestamp_ns;
    scan_->status[at] = column.status;
    targets_[static_cast<std::size_t>(c)] = column.measurement_id;
  }
  store_pixels(packet);
}

void ScanAssembler::store_pixels(const LidarPacket& packet) {
  const bool signal = has_signal(metadata_.profile), dual = has_second_return(metadata_.profile);
  for (int row = 0; row < format_.rows; ++row)
    for (int c = 0; c < format_.columns; ++c) {
      const int x = targets_[static_cast<std::size_t>(c)];
      if (x < 0) continue;
      const LidarPixel pixel = packet.pixel(c, row);
      *scan_->first.range_mm.at(x, row) = pixel.range_mm;
      *scan_->first.reflectivity.at(x, row) = pixel.reflectivity;
      *scan_->near_ir.at(x, row) = pixel.near_ir;
      if (signal) *scan_->first.signal.at(x, row) = pixel.signal;
      if (!dual) continue;
      *scan_->second.range_mm.at(x, row) = pixel.range2_mm;
      *scan_->second.reflectivity.at(x, row) = pixel.reflectivity2;
      if (signal) *scan_->second.signal.at(x, row) = pixel.signal2;
    }
}

std::optional<LidarScan> ScanAssembler::accept(std::span<const std::byte> payload,
                                               const std::optional<IpAddress>& from) {
  const auto packet = LidarPacket::view(format_, payload);
  if (!packet) return ++counts_.other_size, std::nullopt;
  if (is_foreign(*packet, from)) return ++counts_.foreign, std::nullopt;
  const std::uint32_t frame_id = packet->frame_id();
  const Age packet_age = age(frame_id);
  if (packet_age == Age::older || (packet_age == Age::same && !scan_))
    return ++counts_.late, std::nullopt;
  ++counts_.accepted;
  std::optional<LidarScan> finished;
  if (packet_age == Age::newer) {
    finished = flush();
    start(frame_id);
  }
  store(*packet);
  // With a window of one packet both scans may be finished; the other is handed out next time.
  if (!finished && missing_ == 0) finished = flush();
  return finished;
}

std::optional<LidarScan> ScanAssembler::flush() { return std::exchange(scan_, std::nullopt); }

Vec3d ouster_point(const OusterMetadata& metadata, int row, int column, std::uint32_t range_mm) {
  MR_ASSERT(row >= 0 && row < metadata.height && column >= 0 && column < metadata.width);
  const auto beam = static_cast<std::size_t>(row);
  const double out_mm = metadata.beam_to_lidar[3], up_mm = metadata.beam_to_lidar[11];
  const double along_mm = range_mm - std::hypot(out_mm, up_mm);
  const double encoder = 2 * std::numbers::pi * (1 - static_cast<double>(column) / metadata.width);
  const double heading = encoder - metadata.beam_azimuth_rad[beam];
  const double altitude = metadata.beam_altitude_rad[beam];
  const Vec3d lidar_mm{
      along_mm * std::cos(heading) * std::cos(altitude) + out_mm * std::cos(encoder),
      along_mm * std::sin(heading) * std::cos(altitude) + out_mm * std::sin(encoder),
      along_mm * std::sin(altitude) + up_mm};
  return metadata.T_sensor_lidar * (lidar_mm * 0.001);
}

}  // namespace mr::sensor
