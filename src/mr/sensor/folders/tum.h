#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mr/sensor/rgbd_images.h"

/// Folders of the TUM RGB-D benchmark: rgb.txt and depth.txt list pictures with their times
/// (FORMATS, section 8).
namespace mr::sensor {

/// A line of rgb.txt or depth.txt.
struct TimedFile {
  TimePoint at{};
  std::string name;  ///< as the list has it, relative to its folder
};

/// The lines "time name" of a list, by time; of several with one time the first is kept. Errors
/// name the line; too_large beyond 100,000 lines. `name`: of the list, for messages.
Result<std::vector<TimedFile>> parse_file_list(std::string_view text, const std::string& name);

/// For each depth picture the colour picture that belongs to it: of all pairs at most `most` apart
/// the nearest first, no colour twice, as the benchmark's tool associate.py. Both by time.
std::vector<std::optional<std::size_t>> associate(std::span<const TimedFile> depth,
                                                  std::span<const TimedFile> color, Duration most);

struct TumSource {
  static constexpr std::string_view kType = "tum";
  static constexpr double kDepthUnit_m = 1.0 / 5000, kMaxApart_ms = 20;
  static constexpr Range kApart_ms{0, 1000, true};

  RgbdImagesSource pictures;      ///< depth with its colour and its time
  std::size_t without_color = 0;  ///< depth pictures that are left out, for none is near in time

  std::vector<std::string> problems() const { return pictures.problems(); }
  SourceContent content() const { return pictures.content(); }
  std::vector<std::filesystem::path> files() const { return pictures.files(); }
  std::optional<std::string> depth_hint(double median_m) const {
    return pictures.depth_hint(median_m);
  }
  std::optional<SourceClock> clock() const { return pictures.clock(); }
  friend bool operator==(const TumSource&, const TumSource&) = default;
};

/// Reads both lists of a folder. Errors: a list is missing or wrong; no two pictures of the lists
/// are as near. The pictures themselves are not looked at.
Result<TumSource> read_tum_folder(const std::filesystem::path& folder,
                                  double max_apart_ms = TumSource::kMaxApart_ms);

/// The keys folder, depth_unit_m, invalid, loop and max_apart_ms.
SourceKeys read_tum(yaml::MapReader& map, const std::string& key);

std::unique_ptr<FrameSource> open_tum(const SensorConfig& sensor, SensorId id,
                                      const Timeline& timeline);

}  // namespace mr::sensor
