#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "mr/core/range.h"
#include "mr/sensor/depth_to_color.h"
#include "mr/sensor/folders/picture_folder.h"
#include "mr/sensor/realsense/recording.h"
#include "mr/sensor/realsense/source.h"
#include "mr/yaml/flow_text.h"

namespace mr::sensor {
namespace {

double in_seconds(Duration d) { return std::chrono::duration<double>(d).count(); }

void add_stream(const std::string& name, const std::optional<RealSensePictures>& pictures,
                RecordingInfo& out) {
  if (!pictures) return;
  out.fields.push_back({name + "_size",
                        std::vector<double>{double(pictures->width), double(pictures->height)},
                        "px"});
  out.fields.push_back({name + "_encoding", pictures->encoding});
  if (!pictures->clock.empty()) out.fields.push_back({name + "_clock", pictures->clock});
  if (pictures->lens && !pictures->lens->model.empty())
    out.fields.push_back({name + "_lens_model", pictures->lens->model});
}

void add_realsense_cameras(const RealSenseHeader& header, const std::filesystem::path& file,
                           RecordingInfo& out) {
  const auto add = [&](const char* name, const Camera& c) {
    out.fields.push_back({name, std::vector<double>{c.fx, c.fy, c.cx, c.cy}, "px"});
  };
  const auto cameras = realsense_cameras(header, file);
  if (!cameras) {
    out.notes.push_back(cameras.error().message + "; state its camera in the scene");
    return;
  }
  add("depth_fx_fy_cx_cy", cameras->depth);
  if (!cameras->color) return;
  add("color_fx_fy_cx_cy", *cameras->color);
  const Vec3d t = cameras->T_color_depth.translation;
  out.fields.push_back({"color_from_depth", std::vector<double>{t.x, t.y, t.z}, "m"});
}

/// What goes through the whole file found.
struct WholeRecording {
  std::int64_t depth = 0, color = 0;
  std::optional<RealSensePicture> first_depth, first_color;
  TimePoint last_depth{};

  void add(RealSensePicture picture) {
    const bool is_depth = picture.stream == RealSenseStream::depth;
    ++(is_depth ? depth : color);
    if (is_depth) last_depth = picture.at;
    auto& first = is_depth ? first_depth : first_color;
    if (!first) first = std::move(picture);
  }
};

/// Metres of the first depth picture; nothing, with a note, where it is damaged.
std::optional<ImageDepth> add_first_depth(const RealSenseHeader& header,
                                          const WholeRecording& whole, RecordingInfo& out) {
  if (!whole.first_depth) return std::nullopt;
  std::vector<float> metres(65536);
  for (std::size_t i = 0; i < metres.size(); ++i)
    metres[i] = static_cast<float>(static_cast<double>(i) * header.depth_unit_m);
  auto picture = decode_realsense_depth(*whole.first_depth, metres);
  if (!picture) {
    out.notes.push_back("first depth picture: " + picture.error().message);
    return std::nullopt;
  }
  ImageDepth::Values values = picture->data;
  std::erase(values, 0.0f);
  const auto valid = static_cast<double>(values.size());
  out.fields.push_back({"first_valid_ratio", valid / static_cast<double>(picture->data.size())});
  if (!values.empty()) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::ranges::nth_element(values, middle);
    out.fields.push_back({"first_median", static_cast<double>(*middle), "m"});
  }
  return *std::move(picture);
}

/// How much of the first depth picture the colour camera sees.
void add_first_color(const RealSenseHeader& header, const std::filesystem::path& file,
                     const ImageDepth& depth, const RealSensePicture& first, RecordingInfo& out) {
  const auto cameras = realsense_cameras(header, file);
  const auto color = decode_realsense_color(first);
  if (!color) out.notes.push_back("first colour picture: " + color.error().message);
  if (!cameras || !cameras->color || !color) return;
  if (color->width != cameras->color->width || color->height != cameras->color->height) return;
  if (depth.width != cameras->depth.width || depth.height != cameras->depth.height) return;
  const DepthColors colors =
      color_for_depth(depth, *color, cameras->depth, *cameras->color, cameras->T_color_depth);
  const auto count = [](const auto& values) {
    return static_cast<double>(std::ranges::count_if(values, [](auto v) { return v > 0; }));
  };
  if (const double valid = count(depth.data); valid > 0)
    out.fields.push_back({"first_color_seen_ratio", count(colors.seen.data) / valid});
}

/// Goes through the whole file: how many pictures there are, and whether it can be read to its end.
WholeRecording read_whole(RealSenseRecording& recording, RecordingInfo& out) {
  WholeRecording whole;
  while (true) {
    auto picture = recording.next();
    if (!picture) out.notes.push_back(picture.error().message);
    if (!picture || !*picture) return whole;
    whole.add(**std::move(picture));
  }
}

void add_whole(const RealSenseHeader& header, const WholeRecording& whole, RecordingInfo& out) {
  out.fields.push_back({"depth_pictures", whole.depth});
  out.fields.push_back({"color_pictures", whole.color});
  if (!whole.first_depth) return;
  const Duration length = whole.last_depth - whole.first_depth->at;
  out.fields.push_back({"duration", in_seconds(length), "s"});
  const std::int64_t stated = (length + header.period / 2) / header.period + 1;
  if (whole.depth < stated)
    out.notes.push_back(
        fmt::format("{} of about {} depth pictures are there: it has gaps", whole.depth, stated));
}

}  // namespace

bool is_realsense_bag(const std::filesystem::path& path) {
  std::error_code failed;
  return path.extension() == ".bag" && std::filesystem::is_regular_file(path, failed);
}

Result<RecordingInfo> describe_realsense_bag(const std::filesystem::path& path) {
  auto recording = RealSenseRecording::open(path);
  if (!recording) return recording.error();
  const RealSenseHeader& header = recording->header();
  RecordingInfo out;
  out.format = "RealSense recording (bag)";
  out.notes = header.notes;
  append(out.notes, realsense_lens_notes(header));
  out.fields.push_back({"device", header.name});
  out.fields.push_back({"serial", header.serial});
  if (!header.firmware.empty()) out.fields.push_back({"firmware", header.firmware});
  add_stream("depth", header.depth, out);
  add_stream("color", header.color, out);
  out.fields.push_back({"fps", 1 / in_seconds(header.period)});
  if (header.depth) {
    out.fields.push_back({"depth_unit", header.depth_unit_m, "m"});
    out.fields.push_back({"depth_unit_from", header.depth_unit_from});
  }
  add_realsense_cameras(header, path, out);
  const WholeRecording whole = read_whole(*recording, out);
  if (const auto depth = add_first_depth(header, whole, out); depth && whole.first_color)
    add_first_color(header, path, *depth, *whole.first_color, out);
  add_whole(header, whole, out);
  return out;
}

Result<ImportedScene> import_realsense_bag(const std::filesystem::path& path) {
  const auto recording = RealSenseRecording::open(path);
  if (!recording) return recording.error();
  const RealSenseHeader& header = recording->header();
  const auto cameras = realsense_cameras(header, path);
  if (!cameras) return cameras.error();
  ImportedScene out;
  out.name = id_of(path.stem());
  out.fps = std::round(1e2 / in_seconds(header.period)) / 1e2;
  ImportedSensor sensor;
  sensor.id = id_of(path.stem());
  sensor.source =
      "{type: realsense-bag, file: " + yaml::quoted_text(path.string()) + ", loop: true}";
  sensor.comments.push_back(
      fmt::format("{}, serial {}; the recording does not say where the sensor stood",
                  header.name.empty() ? "RealSense" : header.name, header.serial));
  out.sensors.push_back(std::move(sensor));
  out.notes = header.notes;
  append(out.notes, realsense_lens_notes(header));
  return out;
}

}  // namespace mr::sensor
