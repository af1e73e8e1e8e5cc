#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "mr/synth/builder.h"
#include "mr/synth/furniture.h"
#include "mr/synth/hash.h"

/// Things to furnish a room with. Each is built where the builder stands: on the floor, or with its
/// back to the wall in whose frame the builder is (x right, y into the wall, z up).
namespace mr::synth {

inline constexpr int kBrightColors = 10;
std::uint32_t bright_color(int i);

// --- materials; colours as 0xRRGGBB
Material plain(std::uint32_t srgb, float grain = 0.15f);
/// Wood with its grain upright (on sides) or along x (on tops).
Material timber(std::uint32_t light, std::uint32_t dark, bool upright);
Material cloth(std::uint32_t srgb);
/// Lines of print with a frame around.
Material lettered(const std::string& text, std::uint32_t paper, std::uint32_t ink);
Material landscape(std::uint32_t seed);

// --- on tables and the floor
void table(Builder& b);
/// Faces -y, towards someone sitting down on it.
void chair(Builder& b, std::uint32_t seat_color);
/// On five feet; faces -y.
void swivel_chair(Builder& b, std::uint32_t seat_color);
/// Turned from a profile, open at the top.
void cup(Builder& b, Vec3d foot, double radius, double height, std::uint32_t color);
void books_lying(Builder& b, Vec3d place, int count, Random& random);
void fruit_bowl(Builder& b, Vec3d foot);
void laptop(Builder& b, Vec3d place);
/// A screen on a foot that faces -y; `text` shines from it.
void monitor(Builder& b, Vec3d foot, const std::string& text);
/// An articulated lamp with a thin arm.
void desk_lamp(Builder& b, Vec3d foot);
/// A sheet of print that lies flat.
void paper(Builder& b, Vec3d middle, double turn_degrees, Random& random);
/// A cable or rod through points, as a tube.
void tube(Builder& b, std::span<const Vec3d> points, double radius, MaterialId material);
void plant(Builder& b, Random& random);
void carton(Builder& b);
void bin(Builder& b, Vec3d foot);
void ball(Builder& b, Vec3d place, double radius, std::uint32_t color, std::uint32_t other);
void toys(Builder& b, Vec3d middle, int count, double scale, Random& random);

// --- along the walls
void bookshelf(Builder& b, double detail, Random& random);
void sofa(Builder& b);
void sideboard(Builder& b);
void bench(Builder& b, double width);
void radiator(Builder& b, double width);

// --- on the walls
/// A picture or poster with a rim.
void hang_picture(Builder& b, Material front, std::uint32_t rim_color, double x, double z,
                  double width, double height, double rim_m);
/// With curtains; a light of the room. In the frame of wall 0.
void window(Builder& b, const RigConfig& rig, double x, std::vector<Light>& lights);
/// The frame alone where events open it (doorway.h). In the frame of a wall.
void door(Builder& b, const RigConfig& rig, int wall, double x);
/// Sheets of print pinned on cork.
void notice_board(Builder& b, double x, double z, double width, double height, Random& random);

// --- shell
/// Materials of the six sides.
struct Sides {
  Material floor, ceiling, walls[4];  ///< walls numbered as in at_wall()
};
void six_sides(Builder& b, const RigConfig& rig, const Sides& sides);
void skirting(Builder& b, const RigConfig& rig, int wall, double left, double right);
/// Shining panels below the ceiling, columns by rows of them.
void ceiling_panels(Builder& b, const RigConfig& rig, int columns, int rows,
                    std::vector<Light>& lights);

}  // namespace mr::synth
