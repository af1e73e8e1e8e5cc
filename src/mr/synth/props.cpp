#include "mr/synth/props.h"

#include <array>
#include <functional>
#include <utility>

#include "mr/synth/pieces.h"

namespace mr::synth {
namespace {

Prop prop_of(const std::function<void(Builder&)>& build) {
  Room room;
  Builder builder(room);
  builder.place({});
  build(builder);
  return {std::move(room.mesh),    builder.normals(),         std::move(room.material),
          std::move(room.surface), std::move(room.surface_m), std::move(room.materials)};
}

}  // namespace

Prop chair_prop(std::uint32_t seat_color) {
  return prop_of([&](Builder& b) { chair(b, seat_color); });
}

Prop box_prop() {
  return prop_of([](Builder& b) {
    b.place({}, kBoxHalf_m / 0.25);
    carton(b);
  });
}

Prop screen_prop() {
  return prop_of([](Builder& b) {
    const MaterialId dark = b.add(plain(0x3A3A3E, 0.05f));
    b.box({-0.3, -0.2, 0}, {0.3, 0.2, 0.02}, dark);
    b.box({-0.03, 0.0, 0.02}, {0.03, 0.04, 0.8}, dark);
    b.box({-0.55, -0.03, 0.7}, {0.55, 0.02, 1.36}, dark);
    Material film = plain(0x9FB8D8, 0);
    film.pattern = Pattern::film;
    film.size_m = {1.04f, 0.6f};
    film.emission = 0.8f;
    b.panel({-0.52, -0.032, 0.73}, {1.04, 0, 0}, {0, 0, 0.6}, b.add(film));
  });
}

Prop door_leaf_prop() {
  return prop_of([](Builder& b) {
    const double w = kDoorway_m.x, h = kDoorway_m.y;
    Material leaf = plain(0x8F5B34, 0.3f);
    leaf.grain_scale = {9, 0.8f};
    const MaterialId wood = b.add(leaf), brass = b.add(plain(0xC9A548, 0.05f));
    b.box({0, -0.015, 0.005}, {w, 0.025, h}, wood);
    for (const double z : {0.2, 1.15})
      b.box({w / 2 - 0.3, -0.032, z}, {w / 2 + 0.3, -0.01, z + 0.72}, wood);
    for (const double y : {-0.07, 0.08}) b.sphere({w - 0.07, y, 1.02}, 0.03, brass);
  });
}

}  // namespace mr::synth
