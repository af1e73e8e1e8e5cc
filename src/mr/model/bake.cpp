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
  const Alpha* alpha = nullptr;  ///< null: all is shown
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
  BakeView out{view, view->camera(), view->T_world_camera.inverse(), width, height};
  const auto alpha = scene.alpha.find(view->stream);
  if (alpha == scene.alpha.end() || layer == Layer::still || view->kind != View::Kind::pinhole)
    return out;
  if (!alpha->second->fits(*picture->second))
    return invalid_scene("alpha of texture stream " + std::to_string(number_of(view->stream)) +
                         " is not of its picture's size");
  out.alpha = alpha->second.get();
  return out;
}

Vec2f middle_of(const Corners& uvs) { return (uvs[0] + uvs[1] + uvs[2]) * (1.0f / 3); }

/// Alpha at a texture coordinate.
bool is_shown(const BakeView& view, Vec2f uv) {
  return view.alpha->at(
      {double{uv.x} * view.atlas_width - 0.5, double{uv.y} * view.atlas_height - 0.5});
}

/// Whether the pixels of the alpha plane around a triangle differ.
bool crosses_outline(const BakeView& view, const Corners& uvs) {
  const auto [left, right] = std::minmax({uvs[0].x, uvs[1].x, uvs[2].x});
  const auto [top, bottom] = std::minmax({uvs[0].y, uvs[1].y, uvs[2].y});
  const Alpha& alpha = *view.alpha;
  const auto column = [&](float u) { return alpha.column(double{u} * view.atlas_width - 0.5); };
  const auto row = [&](float v) { return alpha.row(double{v} * view.atlas_height - 0.5); };
  const int x0 = column(left), x1 = column(right), y0 = row(top), y1 = row(bottom);
  for (int y = y0; y <= y1; ++y)
    for (int x = x0; x <= x1; ++x)
      if (*alpha.plane.at(x, y) != *alpha.plane.at(x0, y0)) return true;
  return false;
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
    if (view->alpha)
      add_shown(corners, *uvs, *view, kMostHalvings, builder);
    else
      builder.add(corners, *uvs);
  }

  /// Adds what alpha shows of a triangle: one that crosses an outline is halved at its longest edge
  /// until it hardly does.
  static constexpr int kMostHalvings = 12;
  static void add_shown(const std::array<Vec3f, 3>& corners, const Corners& uvs,
                        const BakeView& view, int halvings, PartBuilder& builder) {
    if (halvings == 0 || !crosses_outline(view, uvs)) {
      if (is_shown(view, middle_of(uvs))) builder.add(corners, uvs);
      return;
    }
    int longest = 0;  // the edge after this corner
    const auto edge = [&](int i) { return length(corners[(i + 1) % 3] - corners[i]); };
    for (int i = 1; i < 3; ++i)
      if (edge(i) > edge(longest)) longest = i;
    const auto half = halved(view, corners, longest);
    if (!half) return;
    for (const int i : {longest, (longest + 1) % 3}) {
      auto piece = corners;
      Corners piece_uvs = uvs;
      piece[i] = half->first, piece_uvs[i] = half->second;
      add_shown(piece, piece_uvs, view, halvings - 1, builder);
    }
  }

  /// The middle of an edge, the same for both of its triangles, with its coordinate.
  static std::optional<std::pair<Vec3f, Vec2f>> halved(const BakeView& view,
                                                       const std::array<Vec3f, 3>& corners,
                                                       int edge) {
    const Vec3f middle = (corners[edge] + corners[(edge + 1) % 3]) * 0.5f;
    const auto uvs = corner_uvs(view, {middle, middle, middle});
    return uvs ? std::optional(std::pair(middle, (*uvs)[0])) : std::nullopt;
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
