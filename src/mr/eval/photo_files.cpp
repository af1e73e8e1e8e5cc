#include "mr/eval/photo_files.h"

#include <fmt/format.h>

#include <cstring>
#include <map>
#include <utility>

#include "mr/core/hash.h"
#include "mr/core/user_text.h"
#include "mr/kit/image_io.h"
#include "mr/node/sources.h"
#include "mr/scene/pose_file.h"
#include "mr/yaml/files.h"

namespace mr::eval {
namespace {

constexpr int kNumbersTried = 100'000;

std::uint64_t hash_of(const ImageRgb& picture) {
  Hash hash;
  hash.add(static_cast<std::uint64_t>(picture.width));
  hash.add(static_cast<std::uint64_t>(picture.height));
  for (std::size_t i = 0; i < picture.data.size(); i += 8) {
    std::uint64_t eight = 0;
    std::memcpy(&eight, picture.data.data() + i, std::min<std::size_t>(8, picture.data.size() - i));
    hash.add(eight);
  }
  return hash.value();
}

Result<yaml::NumberedPattern> pattern_of(const char* option, const std::string& text) {
  auto pattern = yaml::parse_pattern(text);
  if (pattern) return *std::move(pattern);
  return Error{Error::Cause::invalid,
               fmt::format("{} must hold {}, not {}", option, yaml::kPatternRule, in_quotes(text))};
}

Result<std::vector<int>> numbers(const PhotoSelection& selection,
                                 const yaml::NumberedPattern& color) {
  if (!selection.frames.empty()) return selection.frames;
  std::vector<int> out;
  std::error_code ignored;
  for (int n = 0; n < kNumbersTried; ++n)
    if (std::filesystem::is_regular_file(color.name(n), ignored)) out.push_back(n);
  if (out.empty())
    return Error{Error::Cause::not_found,
                 fmt::format("no picture matches {} with a number up to {}",
                             in_quotes(selection.color), kNumbersTried - 1)};
  return out;
}

Result<PhotoFile> photo_file(const std::filesystem::path& file, int number,
                             const std::filesystem::path& pose_file, const Camera& camera) {
  const auto picture = kit::read_color(file);
  if (!picture) return picture.error();
  if (picture->width != camera.width || picture->height != camera.height)
    return Error{
        Error::Cause::invalid,
        fmt::format("{}: expected {}x{} pixels of the colour camera, found {}x{}", file.string(),
                    camera.width, camera.height, picture->width, picture->height)};
  const auto pose = read_pose_file(pose_file);
  if (!pose) return pose.error();
  return PhotoFile{file, number, *pose, hash_of(*picture)};
}

Error delivered(const PhotoFile& photo, const std::string& how, const SensorConfig& sensor) {
  return {Error::Cause::invalid,
          fmt::format("photograph {} {} sensor '{}': choose others with --frames",
                      in_quotes(photo.file.string()), how, sensor.id)};
}

/// Refuses files that a sensor's source names.
Status check_files(const std::vector<PhotoFile>& photographs, const Scene& scene) {
  std::error_code ignored;
  std::map<std::filesystem::path, const SensorConfig*> sources;
  for (const SensorConfig& sensor : scene.sensors)
    for (const auto& file : sensor.source.files())
      sources.emplace(std::filesystem::weakly_canonical(file, ignored), &sensor);
  for (const PhotoFile& photo : photographs) {
    const auto found = sources.find(std::filesystem::weakly_canonical(photo.file, ignored));
    if (found != sources.end()) return delivered(photo, "is a picture of", *found->second);
  }
  return {};
}

}  // namespace

Result<std::vector<PhotoFile>> find_photographs(const PhotoSelection& selection,
                                                const Camera& camera) {
  const auto color = pattern_of("--color", selection.color);
  if (!color) return color.error();
  const auto pose = pattern_of("--pose", selection.pose);
  if (!pose) return pose.error();
  const auto wanted = numbers(selection, *color);
  if (!wanted) return wanted.error();
  std::vector<PhotoFile> out;
  for (const int n : *wanted) {
    auto photo = photo_file(color->name(n), n, pose->name(n), camera);
    if (!photo) return photo.error();
    out.push_back(*std::move(photo));
  }
  return out;
}

Status check_not_delivered(const std::vector<PhotoFile>& photographs, const Scene& scene,
                           int captures, const std::filesystem::path& rig_cache) {
  if (const Status ok = check_files(photographs, scene); !ok) return ok;
  std::map<std::uint64_t, const PhotoFile*> by_pixels;
  for (const PhotoFile& photo : photographs) by_pixels.emplace(photo.pixels_hash, &photo);
  const auto sources = node::open_sources(scene, all_sensors(scene.sensors), rig_cache);
  for (int c = 0; c < captures; ++c)
    for (std::size_t s = 0; s < sources.size(); ++s) {
      const auto frame = sources[s]->next();
      if (!frame || !*frame || (**frame).color.empty()) continue;
      const auto found = by_pixels.find(hash_of((**frame).color));
      if (found != by_pixels.end())
        return delivered(*found->second, "has the pixels of a picture of", scene.sensors[s]);
    }
  return {};
}

}  // namespace mr::eval
