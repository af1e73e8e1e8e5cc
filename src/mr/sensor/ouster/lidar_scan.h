#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "mr/core/image.h"
#include "mr/core/vec.h"
#include "mr/sensor/ouster/datagram.h"
#include "mr/sensor/ouster/metadata.h"

namespace mr::sensor {

/// What came back of one shot of every beam and column.
struct LidarReturn {
  Image<std::uint32_t, 1> range_mm;  ///< along the beam; 0: none
  Image<std::uint8_t, 1> reflectivity;
  Image<std::uint16_t, 1> signal;  ///< empty where the profile has none
};

/// One turn of the sensor. Pictures are [height x width], staggered: rows are beams, columns are
/// measurement ids, so the pixels of one column were measured at one time. Columns that were lost,
/// lie outside the window or are invalid hold zeros.
struct LidarScan {
  std::uint32_t frame_id = 0;
  LidarReturn first, second;                ///< second: empty pictures where the profile has none
  Image<std::uint16_t, 1> near_ir;          ///< ambient light, also where there is no return
  std::vector<std::uint8_t> valid;          ///< [width] 0 or 1
  std::vector<std::uint64_t> timestamp_ns;  ///< [width] by the sensor's clock; 0: not received
  std::vector<std::uint32_t> status;        ///< [width] as sent; 0: not received

  int width() const { return first.range_mm.width; }
  int height() const { return first.range_mm.height; }
  int valid_columns() const;
};

/// Builds scans of the packets of one sensor. Payloads are untrusted and may come in any order.
class ScanAssembler {
 public:
  /// Counts of payloads since the start; each is counted once.
  struct Counts {
    std::uint64_t accepted = 0;
    std::uint64_t other_size = 0;  ///< not a lidar packet of this sensor's format
    std::uint64_t foreign = 0;     ///< of another sensor, or of this one before it started anew
    std::uint64_t late = 0;        ///< of a scan that was handed out already
  };

  /// `sender`: packets of other addresses are foreign. Without it, packets are told apart by the
  /// serial number and initialization id in their headers; LEGACY packets have neither, so the
  /// first sender is the sensor.
  explicit ScanAssembler(const OusterMetadata& metadata, std::optional<IpAddress> sender = {});

  /// Takes a payload; returns the scan that is finished by it: because it was its last column, or
  /// because the payload belongs to a later scan. A scan with lost packets has invalid columns.
  std::optional<LidarScan> accept(std::span<const std::byte> payload,
                                  const std::optional<IpAddress>& from = {});

  /// The scan under construction, at the end of the packets.
  std::optional<LidarScan> flush();

  const Counts& counts() const { return counts_; }

 private:
  enum class Age { older, same, newer };

  bool is_foreign(const LidarPacket& packet, const std::optional<IpAddress>& from);
  Age age(std::uint32_t frame_id) const;
  void start(std::uint32_t frame_id);
  void store(const LidarPacket& packet);
  void store_pixels(const LidarPacket& packet);

  OusterMetadata metadata_;
  PacketFormat format_;
  std::optional<IpAddress> sender_;
  std::optional<LidarScan> scan_;          ///< under construction
  std::optional<std::uint32_t> frame_id_;  ///< of scan_, or of the last one handed out
  std::vector<std::uint8_t> received_;     ///< [width] columns of scan_, valid or not
  int missing_ = 0;                        ///< columns of the window not received yet
  std::vector<int> targets_;               ///< of a packet's columns; -1: not stored
  Counts counts_;
};

/// Moves each row by its pixel shift, so that the pixels of a column lie above each other in the
/// world: out[row][(v + shift) mod width] = in[row][v]. `image` has the metadata's size.
template <typename T>
Image<T, 1> destagger(const OusterMetadata& metadata, const Image<T, 1>& image) {
  MR_ASSERT(image.width == metadata.width && image.height == metadata.height);
  Image<T, 1> out(image.width, image.height);
  for (int row = 0; row < image.height; ++row) {
    const int shift =
        (metadata.pixel_shift_by_row[static_cast<std::size_t>(row)] + image.width) % image.width;
    std::copy_n(image.row(row), image.width - shift, out.row(row) + shift);
    std::copy_n(image.row(row) + image.width - shift, shift, out.row(row));
  }
  return out;
}

/// The point that a beam measured, metres in the sensor frame (x ahead, y left, z up). `column` is
/// the measurement id. Source: the vendor's `xyzlut.cpp` (BSD-3).
Vec3d ouster_point(const OusterMetadata& metadata, int row, int column, std::uint32_t range_mm);

}  // namespace mr::sensor
