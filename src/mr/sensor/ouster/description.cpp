#include <fmt/format.h>

#include <algorithm>
#include <numbers>

#include "mr/sensor/folders/picture_folder.h"
#include "mr/sensor/folders/text_lines.h"
#include "mr/sensor/ouster/recording.h"
#include "mr/sensor/ouster/source.h"
#include "mr/yaml/flow_text.h"

namespace mr::sensor {
namespace {

constexpr std::size_t kMostCandidates = 256;  // .json files of a folder that are looked at

double seconds(Duration d) { return std::chrono::duration<double>(d).count(); }

/// Whether a capture holds packets of the sensor.
bool fits(const std::filesystem::path& capture, const OusterMetadata& metadata) {
  auto recording = OusterRecording::open(capture, metadata, {});
  if (!recording) return false;
  const auto scan = recording->next();
  return scan && *scan;
}

/// The metadata beside a capture: of the same name, else the longest name with which the capture's
/// begins, else the only one that fits.
Result<std::filesystem::path> find_metadata(const std::filesystem::path& capture) {
  std::filesystem::path same = capture;
  same.replace_extension(".json");
  std::error_code failed;
  if (std::filesystem::exists(same, failed)) return same;
  std::vector<std::filesystem::path> named, others;
  const std::filesystem::path folder = capture.has_parent_path() ? capture.parent_path() : ".";
  const std::string stem = capture.stem().string();
  for (const auto& entry : std::filesystem::directory_iterator(folder, failed)) {
    if (entry.path().extension() != ".json" || others.size() >= kMostCandidates) continue;
    const bool begins = stem.starts_with(entry.path().stem().string());
    (begins ? named : others).push_back(entry.path());
  }
  std::ranges::sort(named, {}, [](const auto& path) {
    const std::string name = path.string();
    return std::pair(-static_cast<std::ptrdiff_t>(name.size()), name);
  });
  if (!named.empty()) return named.front();
  std::ranges::sort(others);
  std::erase_if(others, [&](const auto& path) {
    const auto metadata = read_ouster_metadata(path);
    return !metadata || !fits(capture, *metadata);
  });
  if (others.size() == 1) return others.front();
  return Error{Error::Cause::not_found,
               capture.string() + ": " +
                   (others.empty() ? "no metadata" : std::to_string(others.size()) + " metadata") +
                   " of its sensor beside it: put it there as " + same.filename().string()};
}

void add_metadata(const OusterMetadata& metadata, const std::filesystem::path& file,
                  RecordingInfo& out) {
  const auto [low, high] = std::ranges::minmax(metadata.beam_altitude_rad);
  constexpr double kDegrees = 180 / std::numbers::pi;
  out.fields.push_back({"metadata", file.string()});
  out.fields.push_back({"product", metadata.product});
  out.fields.push_back({"serial", metadata.serial});
  out.fields.push_back({"firmware", metadata.firmware});
  out.fields.push_back({"mode", metadata.mode});
  out.fields.push_back({"profile", std::string(profile_name(metadata.profile))});
  out.fields.push_back(
      {"size", std::vector<double>{double(metadata.width), double(metadata.height)}, "px"});
  out.fields.push_back({"altitudes", std::vector<double>{low * kDegrees, high * kDegrees}, "deg"});
  out.fields.push_back({"fps", metadata.rate_hz});
}

void add_first_scan(const LidarScan& scan, RecordingInfo& out) {
  ImageId::Values ranges = scan.first.range_mm.data;
  const auto pixels = static_cast<double>(ranges.size());
  std::erase(ranges, 0u);
  out.fields.push_back({"first_valid_ratio", static_cast<double>(ranges.size()) / pixels});
  if (ranges.empty()) return;
  const auto middle = ranges.begin() + static_cast<std::ptrdiff_t>(ranges.size() / 2);
  std::ranges::nth_element(ranges, middle);
  out.fields.push_back({"first_median", *middle * 0.001, "m"});
}

/// Goes through the whole capture.
void add_scans(OusterRecording& recording, const OusterMetadata& metadata, RecordingInfo& out) {
  std::int64_t scans = 0, lost = 0;
  std::optional<ScanTime> first, last;
  while (true) {
    const auto scan = recording.next();
    if (!scan) out.notes.push_back(scan.error().message);
    if (!scan || !*scan) break;
    if (scans == 0) {
      add_first_scan(**scan, out);
      if (std::string odd = turn_mismatch(metadata, **scan); !odd.empty())
        out.notes.push_back(std::move(odd));
    }
    if (!first) first = time_of(**scan);
    last = time_of(**scan);
    lost += metadata.window_columns() - (*scan)->valid_columns();
    ++scans;
  }
  const auto& packets = recording.packets();
  const auto count = [](std::uint64_t n) { return static_cast<std::int64_t>(n); };
  out.fields.push_back({"scans", scans});
  out.fields.push_back({"lidar_packets", count(packets.accepted)});
  out.fields.push_back({"other_packets", count(packets.other_size)});
  out.fields.push_back({"lost_columns", lost});
  if (first) {
    out.fields.push_back({"duration", seconds(last->end - first->start), "s"});
    out.fields.push_back({"sweep", seconds(first->end - first->start), "s"});
  }
  if (packets.foreign > 0)
    out.notes.push_back(
        fmt::format("{} packets of another sensor, or of this one before it "
                    "started anew",
                    packets.foreign));
  if (const auto n = recording.datagrams().incomplete; n > 0)
    out.notes.push_back(fmt::format("{} datagrams lack fragments", n));
}

}  // namespace

bool is_ouster_pcap(const std::filesystem::path& path) {
  std::error_code failed;
  const auto extension = path.extension();
  return (extension == ".pcap" || extension == ".pcapng") &&
         std::filesystem::is_regular_file(path, failed);
}

Result<RecordingInfo> describe_ouster_pcap(const std::filesystem::path& path) {
  const auto file = find_metadata(path);
  if (!file) return file.error();
  const auto metadata = read_ouster_metadata(*file);
  if (!metadata) return metadata.error();
  auto recording = OusterRecording::open(path, *metadata, {});
  if (!recording) return recording.error();
  RecordingInfo out;
  out.format = "Ouster recording (pcap)";
  add_metadata(*metadata, *file, out);
  add_scans(*recording, *metadata, out);
  if (recording->packets().accepted == 0)
    out.notes.push_back("no packet is of the sensor that " + file->filename().string() +
                        " describes: is it the metadata of this recording?");
  return out;
}

Result<ImportedScene> import_ouster_pcap(const std::filesystem::path& path) {
  const auto file = find_metadata(path);
  if (!file) return file.error();
  const auto metadata = read_ouster_metadata(*file);
  if (!metadata) return metadata.error();
  ImportedScene out;
  out.name = id_of(path.stem());
  out.up = Vec3d{0, 0, 1};
  out.fps = metadata->rate_hz;
  out.voxel_m = 0.05;  // beams lie centimetres apart
  ImportedSensor sensor;
  sensor.id = id_of(path.stem());
  sensor.source = "{type: ouster-pcap, file: " + yaml::quoted_text(path.string()) +
                  ", metadata: " + yaml::quoted_text(file->string()) +
                  ", texture: near_ir, loop: true}";
  std::string numbers;
  for (const double v : RangeCamera(*metadata).T_sensor_camera().matrix())
    numbers += (numbers.empty() ? "" : ", ") + fmt::format("{:.9g}", v);
  sensor.T_world_depth = "[" + numbers + "]";
  sensor.comments.push_back(metadata->product + " " + metadata->serial +
                            "; the world is the sensor's frame: x ahead, y left, z up");
  out.sensors.push_back(std::move(sensor));
  return out;
}

bool is_ouster_metadata(const std::filesystem::path& path) {
  return is_json_with_key(path, "beam_altitude_angles");
}

Result<RecordingInfo> describe_ouster_metadata(const std::filesystem::path& path) {
  const auto metadata = read_ouster_metadata(path);
  if (!metadata) return metadata.error();
  RecordingInfo out;
  out.format = "Ouster metadata (JSON)";
  add_metadata(*metadata, path, out);
  out.notes.push_back("it belongs to a recording (.pcap), or to a sensor that sends");
  return out;
}

}  // namespace mr::sensor
