#include "mr/sensor/ouster/recording.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "mr/core/assert.h"

namespace mr::sensor {

Result<std::optional<IpAddress>> sender_address(const std::string& sender) {
  if (sender.empty()) return std::optional<IpAddress>();
  const auto address = parse_ip_address(sender);
  if (!address) return address.error();
  return std::optional(*address);
}

ScanTime time_of(const LidarScan& scan) {
  std::vector<std::uint64_t> times;
  for (std::size_t column = 0; column < scan.valid.size(); ++column)
    if (scan.valid[column]) times.push_back(scan.timestamp_ns[column]);
  MR_ASSERT(!times.empty());
  const auto middle = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2);
  std::ranges::nth_element(times, middle);
  // Columns that are stamped farther than a turn from most others are damaged.
  constexpr std::uint64_t kTurn = 1'000'000'000;
  const std::uint64_t most = *middle;
  std::uint64_t first = most, last = most;
  for (const std::uint64_t time : times) {
    if (time > most ? time - most > kTurn : most - time > kTurn) continue;
    first = std::min(first, time), last = std::max(last, time);
  }
  constexpr std::uint64_t kMost = std::uint64_t{1} << 61;  // sums stay in range
  const auto point = [kMost](std::uint64_t ns) {
    return TimePoint(Duration(static_cast<std::int64_t>(std::min(ns, kMost))));
  };
  return {point(first), point(last)};
}

std::string turn_mismatch(const OusterMetadata& metadata, const LidarScan& scan) {
  const ScanTime time = time_of(scan);
  const double columns = std::max(1, scan.valid_columns());
  const double turn_s =
      std::chrono::duration<double>(time.end - time.start).count() * metadata.width / columns;
  const double stated_s = 1 / metadata.rate_hz;
  // Of few columns the time between the first and the last says little.
  if (columns < metadata.width / 2 || std::abs(turn_s - stated_s) < 0.2 * stated_s) return {};
  return "a turn takes " + std::to_string(std::lround(turn_s * 1e3)) + " ms where mode " +
         metadata.mode + " says " + std::to_string(std::lround(stated_s * 1e3)) +
         " ms: is the metadata of this recording?";
}

Result<OusterRecording> OusterRecording::open(const std::filesystem::path& file,
                                              const OusterMetadata& metadata,
                                              const std::string& sender) {
  const auto address = sender_address(sender);
  if (!address) return address.error();
  auto reader = PcapReader::open(file);
  if (!reader) return reader.error();
  return OusterRecording(*std::move(reader), ScanAssembler(metadata, *address));
}

Result<std::optional<LidarScan>> OusterRecording::next() {
  while (!ended_) {
    std::optional<LidarScan> scan;
    const auto datagram = reader_.next();
    if (!datagram || !*datagram) {
      if (!datagram) error_ = datagram.error();
      ended_ = true;
      scan = assembler_.flush();
    } else {
      scan = assembler_.accept((*datagram)->payload, (*datagram)->from.address);
    }
    if (scan && scan->valid_columns() > 0) return std::optional(*std::move(scan));
  }
  if (error_) return *std::exchange(error_, std::nullopt);
  return std::optional<LidarScan>();
}

}  // namespace mr::sensor
