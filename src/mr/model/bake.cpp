#include "mr/model/bake.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <string>
#include <unordered_map>

namespace mr::model {
namespace {

using Corners = std::array<Vec2f, 3>;
using Color = std::array<std::uint8_t, 3>;

Error invalid_scene(std::string message) { return {Error::Cause::invalid, std::move(message)}; }

/// A view with what baking needs to know about its picture.
struct BakeView {
  const View* view = nullptr;
  Camera camera;
  Pose T_camera_world;
  int atlas_width = 0, atlas_height = 0;
};

bool fits(const Rect& tile, int width, int height) {
  return !tile.empty() && tile.x >= 0 && tile.y >= 0 && tile.width <= width - tile.x &&
         tile.height <= height - tile.y;
}

Result<BakeView> find_view(const DecodedScene& scene, ViewId id, Layer layer) {
  const std::string name = "view " + std::to_string(number_of(id));
  const View* const view = texturing_view(scene.views, id, layer);
  if (!view) return invalid_scene("triangles name " + name + ", which the scene does not have");
  const auto picture = scene.textures.find(view->stream);
  if (picture == scene.textures.end() || !picture->second || picture->second->empty())
    return invalid_scene(name + " has no picture: texture stream " +
                         std::to_string(number_of(view->stream)) + " is missing");
  const int width = picture->second->width, height = picture->second->height;
  if (view->width < 1 || view->height < 1 || view->image_rect.empty() ||
      !fits(view->atlas_rect, width, height))
    return invalid_scene(name + " has a tile outside the picture of texture stream " +
                         std::to_string(number_of(view->stream)));
  return BakeView{view, view->camera(), view->T_world_camera.inverse(), width, height};
}

/// Columns of a panorama: all corners on one turn, the one whose middle is nearest to the tile's.
void unwrap(const View& view, std::array<Vec2d, 3>& pixels) {
  const double turn = view.width;
  double sum = 0;
  for (Vec2d& p : pixels) {
    p.x -= turn * std::round((p.x - pixels[0].x) / turn);
    sum += p.x;
  }
  const double tile_middle = view.image_rect.x + 0.5 * view.image_rect.width - 0.5;
  const double shift = turn * std::round((sum / 3 - tile_middle) / turn);
  for (Vec2d& p : pixels) p.x -= shift;
}

/// Texture coordinates of a triangle's corners; nothing when the view cannot see one of them.
std::optional<Corners> corner_uvs(const BakeView& bake_view, const std::array<Vec3f, 3>& corners) {
  const View& view = *bake_view.view;
  std::array<Vec2d, 3> pixels;
  for (int i = 0; i < 3; ++i) {
    const auto pixel =
        project(bake_view.camera, bake_view.T_camera_world * vec_cast<double>(corners[i]));
    if (!pixel || !std::isfinite(pixel->x) || !std::isfinite(pixel->y)) return std::nullopt;
    pixels[i] = *pixel;
  }
  if (view.kind == View::Kind::equirectangular) unwrap(view, pixels);
  const Rect& tile = view.atlas_rect;
  const double w = bake_view.atlas_width, h = bake_view.atlas_height;
  Corners out;
  for (int i = 0; i < 3; ++i) {
    const Vec2d uv = atlas_uv(view, pixels[i], bake_view.atlas_width, bake_view.atlas_height);
    out[i].x =
        static_cast<float>(std::clamp(uv.x, (tile.x + 0.5) / w, (tile.x + tile.width - 0.5) / w));
    out[i].y =
        static_cast<float>(std::clamp(uv.y, (tile.y + 0.5) / h, (tile.y + tile.height - 0.5) / h));
  }
  return out;
}

/// Position and coordinate as bits; -0 counts as 0.
struct VertexKey {
  std::array<std::uint32_t, 5> bits;

  VertexKey(Vec3f p, Vec2f uv) {
    int i = 0;
    for (const float v : {p.x, p.y, p.z, uv.x, uv.y})
      bits[i++] = std::bit_cast<std::uint32_t>(v + 0.f);
  }
  friend bool operator==(const VertexKey&, const VertexKey&) = default;
};

struct VertexKeyHash {
  std::size_t operator()(const VertexKey& key) const {
    const auto cell = [](std::uint32_t v) { return static_cast<std::int32_t>(v); };
    const auto& b = key.bits;
    return hash_cell({cell(b[0]), cell(b[1]), cell(b[2])}) * 31 +
           hash_cell({cell(b[3]), cell(b[4]), 0});
  }
};

/// A colour in place of a coordinate, for telling vertices apart.
Vec2f as_coordinate(Color c) { return {static_cast<float>(c[0] << 16 | c[1] << 8 | c[2]), 0}; }

/// Collects the triangles of one part.
struct PartBuilder {
  BakedPart part;
  std::unordered_map<VertexKey, std::uint32_t, VertexKeyHash> seen;

  void add(const std::array<Vec3f, 3>& corners, const Corners& uvs) {
    Triangle triangle{};
    for (int i = 0; i < 3; ++i) {
      const auto [vertex, is_new] = vertex_at(corners[i], uvs[i]);
      triangle[i] = vertex;
      if (is_new && part.stream) part.uvs.push_back(uvs[i]);
    }
    part.triangles.push_back(triangle);
  }

  void add(const std::array<Vec3f, 3>& corners, const std::array<Color, 3>& colors) {
    Triangle triangle{};
    for (int i = 0; i < 3; ++i) {
      const auto [vertex, is_new] = vertex_at(corners[i], as_coordinate(colors[i]));
      triangle[i] = vertex;
      if (is_new) part.colors.push_back(colors[i]);
    }
    part.triangles.push_back(triangle);
  }

  std::pair<std::uint32_t, bool> vertex_at(Vec3f position, Vec2f uv) {
    const auto next = static_cast<std::uint32_t>(part.positions.size());
    const auto [at, is_new] = seen.try_emplace(VertexKey(position, uv), next);
    if (is_new) part.positions.push_back(position);
    return {at->second, is_new};
  }
};

struct Baker {
  const DecodedScene& scene;
  std::map<std::pair<ViewId, Layer>, BakeView> views;
  std::map<StreamId, PartBuilder> textured;  // by stream
  PartBuilder colored, plain;

  Status add(const Mesh& mesh, Layer layer) {
    const std::vector<ViewRun> unlabelled{
        {0, static_cast<std::uint32_t>(mesh.triangles.size()), kNoView}};
    for (const ViewRun& run : mesh.views.empty() ? unlabelled : mesh.views)
      if (auto ok = add(mesh, run, layer); !ok) return ok;
    return {};
  }

  Status add(const Mesh& mesh, const ViewRun& run, Layer layer) {
    if (std::uint64_t{run.first} + run.count > mesh.triangles.size())
      return invalid_scene("a view run ends after the last triangle");
    const BakeView* view = nullptr;
    if (run.id != kNoView && run.count > 0) {
      const auto [known, is_new] = views.try_emplace({run.id, layer});
      if (is_new) {
        auto found = find_view(scene, run.id, layer);
        if (!found) return found.error();
        known->second = *found;
      }
      view = &known->second;
    }
    for (std::size_t t = run.first; t < std::size_t{run.first} + run.count; ++t) {
      const auto corners = corners_of(mesh, t);
      if (!corners) return corners.error();
      add(*corners, view);
    }
    return {};
  }

  Status add(const Mesh& mesh, const std::vector<Color>& colors) {
    if (colors.size() != mesh.positions.size())
      return invalid_scene("a chunk has colours for some of its vertices only");
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      const auto corners = corners_of(mesh, t);
      if (!corners) return corners.error();
      const Triangle& v = mesh.triangles[t];
      colored.add(*corners, {colors[v[0]], colors[v[1]], colors[v[2]]});
    }
    return {};
  }

  static Result<std::array<Vec3f, 3>> corners_of(const Mesh& mesh, std::size_t triangle) {
    std::array<Vec3f, 3> corners;
    for (int i = 0; i < 3; ++i) {
      if (mesh.triangles[triangle][i] >= mesh.positions.size())
        return invalid_scene("a triangle names a vertex it does not have");
      corners[i] = mesh.corner(triangle, i);
      if (!is_finite(corners[i]))
        return invalid_scene("a vertex has a position that is not finite");
    }
    return corners;
  }

  void add(const std::array<Vec3f, 3>& corners, const BakeView* view) {
    const auto uvs = view ? corner_uvs(*view, corners) : std::nullopt;
    if (!uvs) return plain.add(corners, Corners{});
    PartBuilder& builder = textured[view->view->stream];
    builder.part.stream = view->view->stream;
    builder.add(corners, *uvs);
  }
};

}  // namespace

Result<std::vector<BakedPart>> bake(const DecodedScene& scene) {
  Baker baker{scene, {}, {}, {}, {}};
  for (const auto& chunk : scene.chunks) {
    const Status ok = chunk->colors.empty() ? baker.add(chunk->mesh, chunk->key.id.layer)
                                            : baker.add(chunk->mesh, chunk->colors);
    if (!ok) return ok.error();
  }
  std::vector<BakedPart> parts;
  for (auto& [stream, builder] : baker.textured) parts.push_back(std::move(builder.part));
  if (!baker.colored.part.triangles.empty()) parts.push_back(std::move(baker.colored.part));
  if (!baker.plain.part.triangles.empty()) parts.push_back(std::move(baker.plain.part));
  if (parts.empty()) return Error{Error::Cause::empty, "the scene has no triangles"};
  return parts;
}

Pictures shown_textures(const DecodedScene& scene) {
  Pictures out = scene.textures;
  std::map<StreamId, std::shared_ptr<ImageRgb>> copies;
  for (const View& view : scene.views) {
    const auto found = scene.textures.find(view.stream);
    if (view.gain == Vec3f{1, 1, 1} || found == scene.textures.end() || !found->second ||
        !fits(view.atlas_rect, found->second->width, found->second->height))
      continue;
    std::shared_ptr<ImageRgb>& copy = copies[view.stream];
    if (!copy) out[view.stream] = copy = std::make_shared<ImageRgb>(*found->second);
    const Rect& tile = view.atlas_rect;
    for (int y = tile.y; y < tile.y + tile.height; ++y) {
      const std::uint8_t* const from = found->second->at(tile.x, y);
      std::uint8_t* const to = copy->at(tile.x, y);
      for (int i = 0; i < 3 * tile.width; ++i)
        to[i] = static_cast<std::uint8_t>(
            std::clamp(static_cast<float>(from[i]) * view.gain[i % 3] + 0.5f, 0.f, 255.f));
    }
  }
  return out;
}

std::array<std::uint8_t, 3> sample(const ImageRgb& picture, Vec2f uv) {
  return sample_bilinear(picture, {0, 0, picture.width, picture.height},
                         double{uv.x} * picture.width - 0.5, double{uv.y} * picture.height - 0.5);
}

}  // namespace mr::model
