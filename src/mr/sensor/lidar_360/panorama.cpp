#include "mr/sensor/lidar_360/panorama.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "mr/core/file.h"
#include "mr/kit/image_io.h"
#include "mr/kit/panorama_info.h"
#include "mr/kit/video_file.h"
#include "mr/yaml/files.h"

namespace mr::sensor {
namespace {

constexpr std::uintmax_t kMostPictureBytes = std::uintmax_t{1} << 30;

/// A turn of the camera to its right: what it sees straight ahead lies to the right of before.
Pose turned_right(double degrees) {
  const double a = degrees * std::numbers::pi / 180, c = std::cos(a), s = std::sin(a);
  return {{{c, 0, -s, 0, 1, 0, s, 0, c}}, {}};
}

/// A picture of the whole sphere with what its file states.
struct StatedPicture {
  ImageRgb image;
  kit::PanoramaInfo info;
};

Error named(const std::filesystem::path& file, const Error& error) {
  return {error.cause, file.string() + ": " + error.message};
}

/// Fits a picture onto the whole sphere; an Error if it is none.
Result<StatedPicture> whole(ImageRgb image, kit::PanoramaInfo info,
                            const std::filesystem::path& file) {
  if (!info.projection.empty() && !info.equirectangular())
    return Error{Error::Cause::unsupported, file.string() + ": the projection is '" +
                                                info.projection +
                                                "'; equirectangular pictures are read"};
  auto sphere = kit::uncropped(std::move(image), info);
  if (!sphere) return named(file, sphere.error());
  if (!kit::is_2_to_1(sphere->width, sphere->height))
    return Error{Error::Cause::unsupported,
                 file.string() + ": " + std::to_string(sphere->width) + "x" +
                     std::to_string(sphere->height) +
                     " pixels are no equirectangular picture, which is twice as wide as high; two "
                     "circles side by side must be stitched by the vendor's program"};
  return StatedPicture{*std::move(sphere), std::move(info)};
}

Result<StatedPicture> read_picture(const std::filesystem::path& file) {
  const auto bytes = read_file(file, kMostPictureBytes);
  if (!bytes) return bytes.error();
  auto image = kit::decode_color(*bytes);
  if (!image) return named(file, image.error());
  auto info = kit::read_panorama_info(*bytes);
  if (!info) return named(file, info.error());
  return whole(*std::move(image), *std::move(info), file);
}

Result<StatedPicture> first_picture(const PanoramaConfig& config) {
  if (config.video.empty()) {
    if (config.pictures.empty())
      return Error{Error::Cause::empty, "a panorama camera without pictures"};
    return read_picture(config.pictures.front());
  }
  auto video = kit::VideoFile::open(config.video);
  if (!video) return video.error();
  auto picture = video->next();
  if (!picture) return picture.error();
  if (!*picture)
    return Error{Error::Cause::empty, config.video.string() + ": the video has no picture"};
  return whole(std::move((*picture)->image), video->info().panorama, config.video);
}

}  // namespace

std::vector<std::string> PanoramaConfig::problems() const {
  std::vector<std::string> out = out_of_range(
      {{"fps", fps, kFps}, {"offset_ms", offset_ms, kOffset_ms}, {"yaw_deg", yaw_deg, kYaw_deg}});
  if (int{!video.empty()} + int{!pictures.empty()} + int{device.has_value()} != 1)
    out.push_back("one of video, pictures and device must be named");
  if (device) append(out, prefixed("device.", device->problems()));
  return out;
}

Result<PanoramaStart> panorama_start(const PanoramaConfig& config) {
  PanoramaStart out;
  out.camera.model = CameraModel::equirectangular;
  out.T_picture_camera = turned_right(config.yaw_deg);
  if (config.device) {
    out.camera.width = config.device->width, out.camera.height = config.device->height;
    return out;
  }
  const auto first = first_picture(config);
  if (!first) return first.error();
  out.camera.width = first->image.width, out.camera.height = first->image.height;
  if (config.stated_pose)
    out.T_picture_camera = kit::T_upright_picture(first->info).inverse() * out.T_picture_camera;
  return out;
}

/// A video that is read forward, with the picture before and after the wanted time.
struct Panorama::Video {
  kit::VideoFile file;
  std::optional<kit::TimedImage> before, after;
  bool ended = false;

  /// Reads on until `after` lies beyond `time`, or the end. The newest picture is `before`.
  Status read_to(Duration time) {
    while (!ended && (!after || after->time <= time)) {
      auto next = file.next();
      if (!next) return next.error();
      if (after) before = std::move(after), after.reset();
      if (*next)
        after = **std::move(next);
      else
        ended = true;
    }
    return {};
  }

  Status go_back() {
    before.reset(), after.reset();
    ended = false;
    return file.seek(Duration{});
  }
};

Panorama::Panorama(PanoramaConfig config) : config_(std::move(config)) {}
Panorama::~Panorama() = default;

Result<ImageRgb> Panorama::at(Duration scene_time) {
  if (config_.device) return newest();
  const Duration since = scene_time - Duration(std::llround(config_.offset_ms * 1e6));
  return config_.video.empty() ? file_at(since) : frame_at(since);
}

/// Of the live camera: what it delivered since the last call; it is waited for once.
Result<ImageRgb> Panorama::newest() {
  constexpr Duration kFirst = std::chrono::seconds(1);
  if (!live_) {
    auto opened = kit::V4l2Camera::open(*config_.device);
    if (!opened) return opened.error();
    live_.emplace(*std::move(opened));
  }
  while (true) {
    auto picture = live_->next(image_.empty() ? kFirst : Duration{});
    if (!picture) {
      if (picture.error().cause == Error::Cause::io) live_.reset();  // to be opened again
      return picture.error();
    }
    if (*picture)
      image_ = std::move((*picture)->color);
    else if (image_.empty())
      return Error{Error::Cause::io, config_.device->device + ": no picture for a second"};
    else
      return image_;
  }
}

/// Of the picture files.
Result<ImageRgb> Panorama::file_at(Duration since_start) {
  const auto count = static_cast<std::int64_t>(config_.pictures.size());
  auto item = std::llround(static_cast<double>(since_start.count()) * 1e-9 * config_.fps);
  item =
      config_.loop ? (item % count + count) % count : std::clamp<std::int64_t>(item, 0, count - 1);
  if (loaded_ == static_cast<std::size_t>(item)) return image_;
  auto picture = read_picture(config_.pictures[static_cast<std::size_t>(item)]);
  if (!picture) return picture.error();
  loaded_ = static_cast<std::size_t>(item);
  return image_ = std::move(picture->image);
}

/// Of the video.
Result<ImageRgb> Panorama::frame_at(Duration since_start) {
  if (!video_) {
    auto opened = kit::VideoFile::open(config_.video);
    if (!opened) return opened.error();
    video_ = std::make_unique<Video>(Video{*std::move(opened), {}, {}, false});
  }
  const kit::VideoFileInfo& info = video_->file.info();
  Duration time = since_start;
  if (config_.loop && info.duration > Duration{})
    time = (time % info.duration + info.duration) % info.duration;
  time += info.start;
  if (video_->before && time < video_->before->time)
    if (const Status back = video_->go_back(); !back) return back.error();
  if (const Status read = video_->read_to(time); !read) return read.error();
  const auto& before = video_->before;
  const auto& after = video_->after;
  if (!before && !after)
    return Error{Error::Cause::empty, config_.video.string() + ": no picture can be read"};
  const bool takes_after = after && (!before || after->time - time < time - before->time);
  auto picture = whole(takes_after ? after->image : before->image, info.panorama, config_.video);
  if (!picture) return picture.error();
  return std::move(picture->image);
}

namespace {

/// The keys of a live camera.
kit::V4l2Config read_device(yaml::Report& report, const yaml::Node& node) {
  kit::V4l2Config out;
  yaml::MapReader map(report, node, "device");
  if (map.need("path")) map.text("path", out.device);
  const bool has_size =
      map.need("size") && map.size("size", kit::V4l2Config::kSide_px, out.width, out.height);
  map.choice<kit::V4l2Config::Format>(
      "format", out.format,
      {{"mjpg", kit::V4l2Config::Format::mjpg}, {"yuyv", kit::V4l2Config::Format::yuyv}});
  map.number("fps", out.fps, kit::V4l2Config::kFps);
  const auto locked = [&](const char* key, std::optional<int>& value, Range range) {
    int number = 0;
    if (map.has(key) && map.integer(key, number, range)) value = number;
  };
  locked("exposure_us", out.exposure_us, kit::V4l2Config::kExposure_us);
  locked("gain", out.gain, kit::V4l2Config::kGain);
  locked("white_balance_k", out.white_balance_k, kit::V4l2Config::kWhiteBalance_k);
  if (has_size && !kit::is_2_to_1(out.width, out.height))
    report.problem(map.line("size"), "size of a panorama must be twice as wide as high");
  return out;
}

}  // namespace

std::optional<PanoramaConfig> read_panorama(yaml::Report& report, const yaml::Node& node,
                                            const std::string& key) {
  PanoramaConfig out;
  yaml::MapReader map(report, node, "color");
  const yaml::Node* video = map.find("video");
  const yaml::Node* pictures = map.find("pictures");
  const yaml::Node* device = map.find("device");
  map.number("fps", out.fps, PanoramaConfig::kFps);
  map.number("offset_ms", out.offset_ms, PanoramaConfig::kOffset_ms);
  map.number("yaw_deg", out.yaw_deg, PanoramaConfig::kYaw_deg);
  map.flag("stated_pose", out.stated_pose);
  map.flag("loop", out.loop);
  if ((video != nullptr) + (pictures != nullptr) + (device != nullptr) != 1) {
    if (node.kind == yaml::Node::Kind::map)
      report.problem(node.line, "color must hold one of video, pictures, device");
    return std::nullopt;
  }
  if (device) {
    out.device = read_device(report, *device);
    return out;
  }
  auto files = video ? yaml::read_one_file(report, *video, "video")
                     : yaml::read_files(report, *pictures, "pictures");
  if (!files || files->unusable.size() == files->paths.size()) return std::nullopt;
  yaml::report_unusable(report, *files, key + (video ? ".video" : ".pictures"));
  if (video)
    out.video = files->paths.front();
  else
    out.pictures = std::move(files->paths);
  return out;
}

}  // namespace mr::sensor
