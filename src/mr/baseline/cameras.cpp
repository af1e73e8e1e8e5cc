#include "mr/baseline/cameras.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "mr/atlas/labels.h"
#include "mr/core/parallel.h"
#include "mr/node/sensor_node.h"

namespace mr::baseline {
namespace {

/// The source pixels that one pixel of a smaller row or column averages.
struct Span {
  int first = 0;
  std::vector<float> weights;  ///< sum 1
};

std::vector<Span> spans(int first, int from, int to) {
  std::vector<Span> out(to);
  const double scale = static_cast<double>(from) / to;
  for (int i = 0; i < to; ++i) {
    const double low = i * scale, high = (i + 1) * scale;
    const int begin = static_cast<int>(low),
              end = std::min(from, static_cast<int>(std::ceil(high)));
    out[i].first = first + begin;
    for (int p = begin; p < end; ++p)
      out[i].weights.push_back(static_cast<float>(
          (std::min<double>(high, p + 1) - std::max<double>(low, p)) / (high - low)));
  }
  return out;
}

/// One row of the tile: source rows first, columns then.
void average_row(const ImageRgb& from, const Span& rows, const std::vector<Span>& columns,
                 std::uint8_t* out) {
  std::vector<float> line(static_cast<std::size_t>(from.width) * 3);
  for (std::size_t r = 0; r < rows.weights.size(); ++r) {
    const std::uint8_t* row = from.row(rows.first + static_cast<int>(r));
    for (std::size_t i = 0; i < line.size(); ++i) line[i] += rows.weights[r] * row[i];
  }
  for (const Span& span : columns)
    for (int c = 0; c < 3; ++c) {
      float sum = 0;
      for (std::size_t p = 0; p < span.weights.size(); ++p)
        sum += span.weights[p] * line[3 * (span.first + p) + c];
      *out++ = static_cast<std::uint8_t>(std::clamp(sum + 0.5f, 0.0f, 255.0f));
    }
}

/// The precision of the noisiest of several sensors, as seen from 2 m.
Precision noisiest(std::span<const SourceInfo> sources) {
  Precision worst;
  double sigma_m = 0;
  for (const SourceInfo& source : sources)
    if (source.precision.sigma_m(2) > sigma_m) worst = source.precision, sigma_m = worst.sigma_m(2);
  return worst;
}

int even(int size) { return (size + 1) / 2 * 2; }

}  // namespace

Cameras::Cameras(const Scene& scene) : scene_(&scene) {
  for (const SensorId id : all_sensors(scene.sensors))
    registrations_.emplace_back(scene.sensor(id), id);
}

std::vector<View> Cameras::views(std::span<const SensorHead> heads) const {
  std::vector<View> out;
  for (const SensorHead& head : heads) {
    if (!head.has_color) continue;
    auto view = registrations_[index_of(head.sensor)].color_view(head.T_world_depth);
    if (!view || view->image_rect.empty()) continue;
    view->stream = stream_of(head.sensor);
    out.push_back(*view);
  }
  return out;
}

std::vector<View> Cameras::tiles(std::span<const SensorHead> heads) const {
  std::vector<View> out = views(heads);
  for (View& view : out) {
    const auto scaled = [&](int size) {
      return std::max(2, static_cast<int>(std::lround(size * scene_->coding.texture_scale)));
    };
    view.atlas_rect = {0, 0, scaled(view.image_rect.width), scaled(view.image_rect.height)};
  }
  return out;
}

std::vector<SourceInfo> Cameras::sources(std::span<const SensorHead> heads) const {
  std::vector<SourceInfo> out;
  for (const SensorHead& head : heads)
    out.push_back({head.sensor, head.captured_at,
                   registrations_[index_of(head.sensor)].depth_camera(), head.T_world_depth,
                   scene_->sensor(head.sensor).precision});
  return out;
}

Mesh Cameras::label(const Mesh& mesh, std::span<const View> views,
                    std::span<const SourceInfo> sources, AtlasConfig::Views choice,
                    float error_m) const {
  return atlas::label_triangles(mesh, views,
                                {.views = choice,
                                 .geometry_error_m = node::texturing_error_m(*scene_, error_m),
                                 .precision = noisiest(sources),
                                 .min_edge_m = 2 * scene_->voxel_m});
}

const Frame& frame_of(std::span<const Frame> capture, SensorId sensor) {
  const auto found = std::find_if(capture.begin(), capture.end(),
                                  [&](const Frame& frame) { return frame.sensor == sensor; });
  MR_ASSERT(found != capture.end());
  return *found;
}

ImageRgb tile_picture(const ImageRgb& color, const View& tile) {
  const Rect &from = tile.image_rect, &to = tile.atlas_rect;
  ImageRgb out(to.width, to.height);
  const std::vector<Span> columns = spans(from.x, from.width, to.width),
                          rows = spans(from.y, from.height, to.height);
  const bool same_size = from.width == to.width && from.height == to.height;
  parallel_for(to.height, 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y) {
      std::uint8_t* const row = out.row(static_cast<int>(y));
      if (same_size)
        std::copy_n(color.at(from.x, from.y + static_cast<int>(y)), 3 * to.width, row);
      else
        average_row(color, rows[y], columns, row);
    }
  });
  return out;
}

CameraVideo::CameraVideo(const Scene& scene) : scene_(&scene), decoders_(scene.sensors.size()) {
  for (const SensorId id : all_sensors(scene.sensors))
    encoders_.push_back(std::make_unique<node::TextureStream>(scene, stream_of(id)));
}

Result<TextureUnit> CameraVideo::encode(const Frame& frame, const View& tile) {
  return encoders_[index_of(frame.sensor)]->encode(tile_picture(frame.color, tile),
                                                   scene_->coding.texture_qp, 0);
}

Bytes video_message(Message kind, const Scene& scene, std::span<const Frame> capture,
                    std::span<const TextureUnit> units) {
  ByteWriter out;
  write_heads(scene, capture, out);
  for (const TextureUnit& unit : units) out.block(unit.data);
  return seal(kind, out.take());
}

Result<ImageRgb> decode_unit(std::unique_ptr<kit::VideoDecoder>& decoder,
                             std::span<const std::byte> unit, int width, int height) {
  if (!decoder) {
    auto made = kit::VideoDecoder::create();
    if (!made) return made.error();
    decoder = std::make_unique<kit::VideoDecoder>(*std::move(made));
  }
  auto picture = decoder->decode(unit);
  if (picture && (picture->width != width || picture->height != height))
    return corrupt("a picture of another size than the camera's");
  return picture;
}

Result<Texture> CameraVideo::decode(const Cameras& cameras, std::span<const std::byte> message) {
  const auto body = open_seal(Message::video_texture, message);
  if (!body) return body.error();
  ByteReader in(*body);
  const auto heads = read_heads(*scene_, in);
  if (!heads) return heads.error();
  Texture out{cameras.tiles(*heads), {}};
  std::vector<std::span<const std::byte>> units(out.views.size());
  for (auto& unit : units) unit = in.block();
  if (!in.at_end()) return corrupt("the message ends early, or late");
  std::vector<std::optional<Result<ImageRgb>>> pictures(units.size());
  parallel_for(units.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const View& view = out.views[i];
      pictures[i] = decode_unit(decoders_[index_of(sensor_of(view.id))], units[i],
                                even(view.atlas_rect.width), even(view.atlas_rect.height));
    }
  });
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    if (!*pictures[i]) return pictures[i]->error();
    out.pictures[out.views[i].stream] = std::make_shared<const ImageRgb>(**std::move(pictures[i]));
  }
  return out;
}

Geometry whole(Mesh mesh, float error_m, std::vector<View> views, std::vector<SourceInfo> sources) {
  Chunk chunk;
  chunk.key.version = 1;
  chunk.error_m = error_m;
  chunk.mesh = std::move(mesh);
  return {{std::make_shared<const Chunk>(std::move(chunk))}, std::move(views), std::move(sources)};
}

}  // namespace mr::baseline
