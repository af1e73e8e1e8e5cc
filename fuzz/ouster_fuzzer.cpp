// What an Ouster sensor writes, from strangers: metadata, captures and packets. The first byte says
// which: 0 metadata, 1 a capture, others packets of one of the profiles.
#include <cstdlib>

#include "mr/sensor/ouster/range_camera.h"
#include "mr/sensor/ouster/udp_capture.h"
#include "patched.h"
#include "support/ouster_packets.h"

namespace {

using namespace mr::sensor;
using mr::test::ouster_metadata;

constexpr LidarProfile kProfiles[] = {
    LidarProfile::rng15_rfl8_nir8,        LidarProfile::legacy,
    LidarProfile::rng19_rfl8_sig16_nir16, LidarProfile::rng19_rfl8_sig16_nir16_dual,
    LidarProfile::rng15_rfl8_nir8_dual,   LidarProfile::fusa_rng15_rfl8_nir8_dual};

/// A sensor of small packets.
OusterMetadata sensor_of(LidarProfile profile) {
  return ouster_metadata({.profile = std::string(profile_name(profile)),
                          .height = 4,
                          .columns_per_packet = 4,
                          .window_first = 0,
                          .window_last = 7,
                          .azimuth_deg = 3});
}

/// What passes the checks holds what its users rely on.
void check_metadata(std::span<const std::byte> bytes) {
  const auto metadata =
      parse_ouster_metadata({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  if (!metadata) {
    if (metadata.error().message.find('\n') != std::string::npos) std::abort();
    return;
  }
  const auto rows = static_cast<std::size_t>(metadata->height);
  if (metadata->packet_format().packet_bytes() > 65507 || metadata->window_columns() < 1 ||
      metadata->window_columns() > metadata->width || metadata->pixel_shift_by_row.size() != rows ||
      metadata->beam_altitude_rad.size() != rows || metadata->beam_azimuth_rad.size() != rows)
    std::abort();
  const RangeCamera camera(*metadata);
  if (!camera.depth_camera().problems().empty() || !camera.color_camera().problems().empty() ||
      !mr::is_rigid(camera.T_sensor_camera()))
    std::abort();
}

void check_scan(const LidarScan& scan, RangeCamera& camera, GreySource color) {
  const auto picture = camera.picture(scan, color);
  for (const float depth_m : picture.depth.data)
    if (!(depth_m >= 0 && depth_m < 2000)) std::abort();
}

void check_capture(std::span<const std::byte> bytes) {
  static const OusterMetadata metadata = sensor_of(kProfiles[0]);
  ScanAssembler assembler(metadata);
  auto reader = PcapReader::open(bytes, "fuzz");
  if (!reader) return;
  for (auto datagram = reader->next(); datagram && *datagram; datagram = reader->next()) {
    if ((*datagram)->payload.size() > 65535) std::abort();
    const auto scan = assembler.accept((*datagram)->payload, (*datagram)->from.address);
    if (scan && scan->valid_columns() > metadata.width) std::abort();
  }
}

/// Packets one after the other; the last one may be cut.
void check_packets(std::span<const std::byte> bytes, LidarProfile profile) {
  const OusterMetadata metadata = sensor_of(profile);
  const std::size_t size = metadata.packet_format().packet_bytes();
  ScanAssembler assembler(metadata);
  RangeCamera camera(metadata);
  while (!bytes.empty()) {
    const auto packet = bytes.first(std::min(size, bytes.size()));
    if (const auto scan = assembler.accept(packet)) check_scan(*scan, camera, GreySource::near_ir);
    bytes = bytes.subspan(packet.size());
  }
  if (const auto scan = assembler.flush()) check_scan(*scan, camera, GreySource::reflectivity);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const auto bytes = mr::fuzz::as_bytes(data, size).subspan(1);
  if (data[0] == 0)
    check_metadata(bytes);
  else if (data[0] == 1)
    check_capture(bytes);
  else
    check_packets(bytes, kProfiles[data[0] % std::size(kProfiles)]);
  return 0;
}
