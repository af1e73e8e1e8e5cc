#include "mr/synth/view.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <utility>

#include "mr/synth/hash.h"

namespace mr::synth {
namespace {

constexpr float kGrazingSine = 0.1392f;  // 8 degrees
constexpr double kShadow_m = 0.42;       // radius under someone's feet
constexpr float kShadowDepth = 0.4f;

std::uint8_t flags_of(const Mesh& mesh, std::uint32_t triangle, Vec3f ray, bool dark) {
  const Vec3f normal = normalized(mesh.area_normal(triangle));
  const bool grazing = std::abs(dot(normal, normalized(ray))) < kGrazingSine;
  return static_cast<std::uint8_t>((grazing ? DepthTruth::kGrazing : 0) |
                                   (dark ? DepthTruth::kDark : 0));
}

/// Whether the surface changes between a pixel and one of its neighbours.
template <typename SurfaceAt>
bool is_edge(const SurfaceAt& surface, int x, int y) {
  const std::uint32_t here = surface(x, y);
  return surface(x - 1, y) != here || surface(x + 1, y) != here || surface(x, y - 1) != here ||
         surface(x, y + 1) != here;
}

/// A pixel's light: at the edge of a surface each quarter has a ray of its own.
Vec3f room_light(const PixelShader& shader, std::uint32_t triangle, bool edge, int x, int y) {
  if (!edge) return triangle == kNothing ? Vec3f{} : shader.shade_pixel(triangle, x, y);
  Vec3f sum;
  for (const Vec2d quarter : kQuarters) {
    const Vec3f ray = shader.camera().ray(x + quarter.x, y + quarter.y);
    const PixelShader::Hit hit = shader.cast(ray);
    if (hit.triangle != kNothing) sum += shader.shade(hit.triangle, ray);
  }
  return sum * 0.25f;
}

/// A disc on the floor around someone's feet.
Mesh shadow_disc(const Pose& T_world_room, Vec3d feet) {
  constexpr std::uint32_t kSides = 16;
  Mesh disc;
  for (std::uint32_t i = 0; i < kSides; ++i) {
    const double a = 2 * std::numbers::pi * i / kSides;
    disc.positions.push_back(vec_cast<float>(
        T_world_room * (feet + Vec3d{kShadow_m * std::cos(a), kShadow_m * std::sin(a), 0})));
    if (i >= 2) disc.triangles.push_back({0, i - 1, i});
  }
  return disc;
}

}  // namespace

SensorView::SensorView(std::shared_ptr<const Room> room, ViewSetup setup)
    : room_(std::move(room)), setup_(std::move(setup)), tone_(setup_.gain) {
  cast_empty_room_depth();
  if (setup_.color) render_empty_room_color();
}

void SensorView::cast_empty_room_depth() {
  const Camera& camera = setup_.depth.camera;
  const TexturedSurface surface = textured_surface(*room_);
  const PixelShader shader(surface, setup_.depth);
  empty_ = DepthTruth(camera.width, camera.height);
  empty_.rows_touch = camera.model != CameraModel::lidar;
  for_rows(camera.height, [&](int y) {
    for (int x = 0; x < camera.width; ++x) {
      const Vec3f ray = setup_.depth.ray(x, y);
      const PixelShader::Hit hit = shader.cast(ray);
      if (hit.triangle == kNothing) continue;
      const std::size_t pixel = static_cast<std::size_t>(y) * camera.width + x;
      const bool shines = surface.material_of(hit.triangle).emission > 0;
      const Vec3f color = shines ? Vec3f{1, 1, 1} : shader.albedo(hit.triangle, ray);
      empty_.z_mm[pixel] = hit.distance * 1000;
      empty_.flags[pixel] = flags_of(room_->mesh, hit.triangle, ray, is_dark(color));
    }
  });
  for_rows(camera.height, [&](int y) { find_edges(empty_, {0, y, camera.width, 1}); });
  depth_ = empty_;
}

void SensorView::render_empty_room_color() {
  const PosedCamera& eye = *setup_.color;
  const int width = eye.camera.width, height = eye.camera.height;
  const TexturedSurface surface = textured_surface(*room_);
  const PixelShader shader(surface, eye);
  hits_ = ImageId(width, height, kNothing);
  color_distance_.resize(static_cast<std::size_t>(width) * height);
  for_rows(height, [&](int y) {
    for (int x = 0; x < width; ++x) {
      const PixelShader::Hit hit = shader.cast(eye.ray(x, y));
      *hits_.at(x, y) = hit.triangle;
      color_distance_[static_cast<std::size_t>(y) * width + x] =
          hit.triangle == kNothing ? kFarAway_m : hit.distance;
    }
  });
  const auto surface_at = [&](int x, int y) {
    const std::uint32_t t = *hits_.at(std::clamp(x, 0, width - 1), std::clamp(y, 0, height - 1));
    return t == kNothing ? kNothing : surface.surface[t];
  };
  empty_color_ = ImageRgb(width, height);
  for_rows(height, [&](int y) {
    for (int x = 0; x < width; ++x) {
      const auto rgb = tone_(room_light(shader, *hits_.at(x, y), is_edge(surface_at, x, y), x, y));
      std::copy(rgb.begin(), rgb.end(), empty_color_.at(x, y));
    }
  });
  color_ = empty_color_;
}

Shot SensorView::render(const PosedPeople* people, std::uint64_t frame) {
  Shot shot;
  shot.depth_mm.resize(empty_.z_mm.size());
  TileCoverage cover(empty_.width, empty_.height);
  if (people != nullptr) {
    cover.add(people->mesh, setup_.depth);
    cast_depth(*people, cover);
  }
  measure(depth_, setup_.noise, mix(setup_.seed, frame), shot.depth_mm);
  cover.for_tiles([&](Rect tile) {  // the empty room again
    for (int y = tile.y; y < tile.y + tile.height; ++y) {
      const std::size_t at = static_cast<std::size_t>(y) * empty_.width + tile.x;
      std::copy_n(&empty_.z_mm[at], tile.width, &depth_.z_mm[at]);
      std::copy_n(&empty_.beyond_mm[at], tile.width, &depth_.beyond_mm[at]);
      std::copy_n(&empty_.flags[at], tile.width, &depth_.flags[at]);
    }
  });
  if (people == nullptr || !setup_.color) return shot;
  TileCoverage seen(empty_color_.width, empty_color_.height);
  TileCoverage touched = seen;
  shade_shadows(*people, touched);
  seen.add(people->mesh, *setup_.color);
  cast_color(*people, seen);
  touched.add(seen);
  take_changes(touched, shot);
  return shot;
}

void SensorView::cast_depth(const PosedPeople& people, const TileCoverage& cover) {
  const TexturedSurface surface = people.surface(1);
  const PixelShader shader(surface, setup_.depth);
  cover.for_tiles([&](Rect tile) {
    for (int y = tile.y; y < tile.y + tile.height; ++y)
      for (int x = tile.x; x < tile.x + tile.width; ++x) {
        const Vec3f ray = setup_.depth.ray(x, y);
        const PixelShader::Hit hit = shader.cast(ray);
        const std::size_t pixel = static_cast<std::size_t>(y) * depth_.width + x;
        const float room_mm = empty_.z_mm[pixel];
        if (hit.triangle == kNothing || (room_mm > 0 && hit.distance * 1000 >= room_mm)) continue;
        const bool dark = people.topology->dark[surface.material[hit.triangle]] != 0;
        depth_.z_mm[pixel] = hit.distance * 1000;
        depth_.flags[pixel] = flags_of(people.mesh, hit.triangle, ray, dark);
      }
  });
  cover.for_tiles([&](Rect tile) { find_edges(depth_, tile); });
}

void SensorView::cast_color(const PosedPeople& people, const TileCoverage& cover) {
  const TexturedSurface surface = people.surface(static_cast<float>(2 * room_->detail));
  const PixelShader shader(surface, *setup_.color);
  cover.for_tiles([&](Rect tile) {
    for (int y = tile.y; y < tile.y + tile.height; ++y)
      for (int x = tile.x; x < tile.x + tile.width; ++x) {
        const PixelShader::Hit hit = shader.cast(setup_.color->ray(x, y));
        const float room = color_distance_[static_cast<std::size_t>(y) * hits_.width + x];
        *hits_.at(x, y) = hit.distance < room ? hit.triangle : kNothing;
      }
  });
  cover.for_tiles([&](Rect tile) { shade_color(shader, cover, tile); });
}

void SensorView::shade_color(const PixelShader& shader, const TileCoverage& cover, Rect tile) {
  const PosedCamera& eye = *setup_.color;
  const auto surface_at = [&](int x, int y) {
    if (!hits_.contains(x, y) || !cover.holds(x, y)) return kNothing;
    const std::uint32_t t = *hits_.at(x, y);
    return t == kNothing ? kNothing : shader.surface().surface[t];
  };
  for (int y = tile.y; y < tile.y + tile.height; ++y)
    for (int x = tile.x; x < tile.x + tile.width; ++x) {
      const std::uint32_t middle = *hits_.at(x, y);
      std::uint8_t* pixel = color_.at(x, y);
      if (!is_edge(surface_at, x, y)) {
        if (middle == kNothing) continue;
        const auto rgb = tone_(shader.shade(middle, eye.ray(x, y)));
        std::copy(rgb.begin(), rgb.end(), pixel);
        continue;
      }
      const float room = color_distance_[static_cast<std::size_t>(y) * hits_.width + x];
      std::array<int, 3> sum{2, 2, 2};  // rounds
      for (const Vec2d quarter : kQuarters) {
        const Vec3f ray = eye.ray(x + quarter.x, y + quarter.y);
        const PixelShader::Hit hit = shader.cast(ray);
        const bool person = hit.triangle != kNothing && hit.distance < room;
        const std::array<std::uint8_t, 3> rgb =
            person ? tone_(shader.shade(hit.triangle, ray))
                   : std::array<std::uint8_t, 3>{pixel[0], pixel[1], pixel[2]};
        for (int c = 0; c < 3; ++c) sum[c] += rgb[c];
      }
      for (int c = 0; c < 3; ++c) pixel[c] = static_cast<std::uint8_t>(sum[c] / 4);
    }
}

void SensorView::shade_shadows(const PosedPeople& people, TileCoverage& cover) {
  const PosedCamera& eye = *setup_.color;
  for (const Vec3d feet : people.feet) cover.add(shadow_disc(room_->T_world_room, feet), eye);
  const Pose T_room_world = room_->T_world_room.inverse();
  cover.for_tiles([&](Rect tile) {
    for (int y = tile.y; y < tile.y + tile.height; ++y)
      for (int x = tile.x; x < tile.x + tile.width; ++x) {
        const float distance = color_distance_[static_cast<std::size_t>(y) * hits_.width + x];
        const Vec3d p = T_room_world * vec_cast<double>(eye.origin() + eye.ray(x, y) * distance);
        if (std::abs(p.z) > 0.03) continue;
        float light = 1;
        for (const Vec3d feet : people.feet) {
          const double r = std::hypot(p.x - feet.x, p.y - feet.y) / kShadow_m;
          if (r < 1) light *= 1 - kShadowDepth * static_cast<float>((1 - r * r) * (1 - r * r));
        }
        for (int c = 0; c < 3; ++c) {
          std::uint8_t& value = color_.at(x, y)[c];
          value = static_cast<std::uint8_t>(static_cast<float>(value) * light + 0.5f);
        }
      }
  });
}

/// Notes what differs from the empty room and makes it empty again.
void SensorView::take_changes(const TileCoverage& cover, Shot& shot) {
  constexpr int kGap = 4;  // unchanged pixels that are cheaper to copy than to leave out
  cover.for_runs([&](int y, int begin, int end) {
    const auto changed = [&](int x) {
      return std::memcmp(color_.at(x, y), empty_color_.at(x, y), 3) != 0;
    };
    for (int x = begin; x < end; ++x) {
      if (!changed(x)) continue;
      int last = x;
      for (int i = x + 1; i < end && i <= last + kGap; ++i)
        if (changed(i)) last = i;
      const auto first = static_cast<std::uint32_t>(y) * static_cast<std::uint32_t>(color_.width) +
                         static_cast<std::uint32_t>(x);
      shot.spans.push_back({first, static_cast<std::uint32_t>(last - x + 1)});
      shot.rgb.insert(shot.rgb.end(), color_.at(x, y), color_.at(last, y) + 3);
      x = last;
    }
    std::copy(empty_color_.at(begin, y), empty_color_.at(end - 1, y) + 3, color_.at(begin, y));
  });
}

}  // namespace mr::synth
