#include "mr/synth/appearance.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mr/synth/bones.h"

namespace mr::synth {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr Vec3d kFront{1, 0, 0};

Pose at_place(Vec3d origin) { return {{}, origin}; }

CylinderMapping upright_cylinder(Vec3d foot, double depth, double width, double height,
                                 const Material& m) {
  return {at_place(foot).inverse(), depth, width, height, m};
}

/// Around a limb, z against its direction, as a hanging limb is seen.
CylinderMapping limb_cylinder(Vec3d top, Vec3d end, double radius, const Material& m) {
  const Mat3 ahead = frame_along(top - end, kFront);  // columns: up, front, side
  const Vec3d up = ahead.column(0), front = ahead.column(1), side = cross(up, front);
  const Mat3 axes{{front.x, side.x, up.x, front.y, side.y, up.y, front.z, side.z, up.z}};
  return {Pose{axes, end}.inverse(), radius, radius, length(top - end), m};
}

Grid upright_grid(Box3d box, double step) {
  return {{},
          {planes(box.low.x, box.high.x, step), planes(box.low.y, box.high.y, step),
           planes(box.low.z, box.high.z, step)}};
}

double around(Vec3d p) { return std::atan2(p.y, p.x); }

/// Two crossing trains of soft waves: cloth pushed together along `along_m`.
double creases(double along_m, double angle, double length_m) {
  return std::sin(2 * kPi * along_m / length_m + 1.7 * std::sin(angle + 0.4)) *
         (0.65 + 0.35 * std::sin(2 * angle + 9 * along_m));
}

class ClothedBodyBuilder {
 public:
  ClothedBodyBuilder(const Figure& figure, const Appearance& appearance,
                     std::vector<BodyPart>& parts)
      : f_(figure), appearance_(appearance), parts_(parts) {}

  void add_all() {
    add_head();
    add_hair();
    for (const Side side : kSides) {
      add_arm(side);
      add_shoe(side);
    }
    add_top();
    if (appearance_.top == Top::coat) add_coat();
    if (appearance_.bottom == Bottom::skirt) {
      add_skirt();
      for (const Side side : kSides) add_bare_leg(side);
    } else {
      add_trousers();
    }
  }

 private:
  Vec3d joint(Side side, int bone) const { return f_.skeleton.joint[bone_of(side, bone)]; }

  void add(DistanceFunction distance, Grid grid, std::vector<CylinderMapping> mappings,
           std::vector<const BodyPrimitives*> carried_by, double softness = 1) {
    parts_.push_back({std::move(distance), std::move(grid), std::move(mappings),
                      [](Vec3d) { return 0; }, std::move(carried_by), softness});
  }

  void add_head() {
    const auto skin = [*this](Vec3d p) {
      return smooth_max(head_distance(f_, p), 1.415 - p.z + 1.2 * std::max(0.0, -0.05 - p.x), 0.01);
    };
    const Grid grid{{},
                    {planes(-0.12, 0.14, 0.014, 0.045, 0.14, 0.0060),
                     planes(-0.15, 0.15, 0.0105, -0.055, 0.055, 0.0055),
                     planes(1.39, 1.77, 0.013, 1.535, 1.69, 0.0055)}};
    // The face's pattern is centred between the eyes.
    add(skin, grid, {upright_cylinder({0, 0, 1.640 - 0.25}, 0.09, 0.075, 0.5, appearance_.face)},
        {&f_.trunk, &f_.neck, &f_.skull});
  }

  /// How thick hair is at a place, less than 0 where the skin shows.
  double hair_thickness(Vec3d p) const {
    const double angle = std::abs(around(p - Vec3d{-0.005, 0, 0}));  // 0 ahead, pi behind
    const double forehead = appearance_.hair == Hair::shorn ? 1.708 : 1.702;
    const double side =
        appearance_.hair == Hair::bob || appearance_.hair == Hair::long_hair ? 1.55 : 1.612;
    double line = forehead - (forehead - side) * smooth_step(0.85, 1.45, angle);
    line -= (side - std::min(side, 1.545)) * smooth_step(1.7, 2.3, angle);
    const double full = appearance_.hair == Hair::shorn    ? 0.009
                        : appearance_.hair == Hair::parted ? 0.020
                                                           : 0.017;
    const double waves = std::sin(34 * angle + 5 * std::sin(30 * p.z)) * 0.5 +
                         std::sin(57 * angle + 40 * p.z + 2 * std::sin(p.y * 60));
    double thick = full + 0.0016 * waves * (appearance_.hair == Hair::shorn ? 0.5 : 1.0);
    if (appearance_.hair == Hair::parted)
      thick += 0.010 * bump(p.x - 0.05, 0.05) * smooth_step(1.70, 1.74, p.z) -
               0.010 * bump(p.y - 0.03, 0.012) * smooth_step(1.72, 1.74, p.z);
    return -0.007 + (thick + 0.007) * smooth_step(line - 0.012, line + 0.02, p.z);
  }

  double beard_thickness(Vec3d p) const {
    const double below_ear = smooth_step(-0.02, 0.02, p.x) * smooth_step(1.52, 1.54, p.z);
    const double cheek = 1.578 + 0.03 * smooth_step(0.07, 0.02, p.x);
    const double moustache = bump(p.z - 1.590, 0.006) * smooth_step(0.034, 0.022, std::abs(p.y));
    const double mouth = bump(p.z - 1.574, 0.011) * smooth_step(0.030, 0.018, std::abs(p.y)) *
                         smooth_step(0.07, 0.08, p.x);
    const double chin = smooth_step(cheek + 0.008, cheek - 0.008, p.z) * (1 - mouth);
    const double strands = 0.0008 * std::sin(900 * p.y + 300 * p.z);
    return -0.006 + below_ear * std::max(chin, moustache) * (0.0125 + strands);
  }

  /// Hair that hangs or is tied: beyond the skull's cap.
  double locks_distance(Vec3d p) const {
    const double strands = 0.0025 * std::sin(520 * p.y + 4 * std::sin(25 * p.z)) +
                           0.0015 * std::sin(300 * p.x + 3 * std::sin(31 * p.z));
    if (appearance_.hair == Hair::bun) {
      const Vec3d middle{-0.118, 0, 1.700};
      const double spiral =
          0.003 * std::sin(4 * std::atan2(p.z - middle.z, p.y) + 160 * length(p - middle));
      return distance(ellipsoid(middle, {0.036, 0.043, 0.041}), p) - spiral;
    }
    if (appearance_.hair == Hair::tail)
      return smooth_min(distance({{-0.105, 0, 1.69}, {-0.145, 0, 1.64}, 0.018, 0.030}, p),
                        distance({{-0.145, 0, 1.64}, {-0.125, 0, 1.46}, 0.030, 0.010}, p), 0.02) -
             strands;
    const bool bob = appearance_.hair == Hair::bob;
    const double end = bob ? 1.545 : 1.44 + 0.012 * std::sin(110 * p.y);
    const double curtain = std::abs(distance({{-0.022, 0, 1.65},
                                              {-0.030, 0, bob ? 1.58 : 1.45},
                                              0.089,
                                              bob ? 0.096 : 0.103,
                                              {0.95, 1, 1}},
                                             p)) -
                           0.015 - strands;
    const double front = p.x - 0.028 + 0.25 * std::max(0.0, 1.62 - p.z) * (bob ? 0 : 1);
    return smooth_max(smooth_max(curtain, front, 0.02), std::max(end - p.z, p.z - 1.70), 0.015);
  }

  void add_hair() {
    const auto hair = [*this](Vec3d p) {
      const double scalp = distance(f_.skull, p);
      double d = scalp - hair_thickness(p);
      if (appearance_.beard) d = smooth_min(d, scalp - beard_thickness(p), 0.004);
      if (appearance_.hair != Hair::shorn && appearance_.hair != Hair::parted)
        d = smooth_min(d, locks_distance(p), 0.012);
      return d;
    };
    const bool hangs = appearance_.hair == Hair::long_hair || appearance_.hair == Hair::tail;
    const double low = hangs ? 1.41 : 1.51;
    const Grid grid = upright_grid({{-0.20, -0.13, low}, {0.14, 0.13, 1.80}},
                                   hangs || appearance_.hair == Hair::bob ? 0.0105 : 0.0085);
    const std::vector<const BodyPrimitives*> held =
        hangs ? std::vector{&f_.trunk, &f_.neck, &f_.skull} : std::vector{&f_.skull};
    add(hair, grid, {upright_cylinder({-0.005, 0, 1.40}, 0.11, 0.095, 0.4, appearance_.hairs)},
        held, 1.5);
  }

  /// Hand and forearm; with short sleeves up to the middle of the upper arm.
  void add_arm(Side side) {
    const Vec3d root = joint(side, hand), elbow = joint(side, forearm), top = joint(side, shoulder);
    const Vec3d ahead = normalized(root - elbow);
    const Vec3d cut = appearance_.long_sleeves ? root - ahead * 0.05 : elbow + (top - elbow) * 0.45;
    const Vec3d cut_normal = appearance_.long_sleeves ? ahead : normalized(elbow - top);
    const auto skin = [*this, side, cut, cut_normal](Vec3d p) {
      const double d = smooth_min(hand_distance(f_, side, p), distance(f_.arms[side], p), 0.012);
      return smooth_max(d, -dot(p - cut, cut_normal), 0.004);
    };
    HandAxes axes = left_hand_axes(f_.skeleton);
    if (side == right) axes = {mirrored(axes.ahead), mirrored(axes.thumb), mirrored(axes.palm)};
    const Vec3d third = cross(axes.ahead, axes.thumb);
    const Mat3 frame{{axes.ahead.x, axes.thumb.x, third.x, axes.ahead.y, axes.thumb.y, third.y,
                      axes.ahead.z, axes.thumb.z, third.z}};
    const double begin = appearance_.long_sleeves ? -0.06 : -0.42;
    const double wide = appearance_.long_sleeves ? 0.045 : 0.13;
    const double fine = appearance_.long_sleeves ? 0.0052 : 0.0060;
    const Grid grid{{frame, root},
                    {planes(begin, 0.195, 0.016, -0.015, 0.195, 0.0070),
                     planes(-wide - 0.01, std::max(wide, 0.10), 0.012, -0.055, 0.10, fine),
                     planes(-wide, wide, 0.012, -0.045, 0.045, fine)}};
    add(skin, grid, {limb_cylinder(elbow, root + ahead * 0.2, 0.04, appearance_.skin)},
        {&f_.arms[side], &f_.hands[side]});
  }

  void add_bare_leg(Side side) {
    const Vec3d ankle = joint(side, foot), knee = joint(side, shin), hip = joint(side, thigh);
    const auto skin = [*this, side](Vec3d p) {
      return smooth_max(distance(f_.legs[side], p), std::max(p.z - 0.62, 0.055 - p.z), 0.006);
    };
    const double y = knee.y;
    const Grid grid = upright_grid({{-0.10, y - 0.13, 0.04}, {0.10, y + 0.13, 0.64}}, 0.013);
    add(skin, grid, {limb_cylinder(hip, ankle, 0.055, appearance_.skin)}, {&f_.legs[side]});
  }

  // --- clothes

  void add_shoe(Side side) {
    const Vec3d ankle = joint(side, foot), ball = joint(side, toes);
    const auto shoe = [*this, side, ankle, ball](Vec3d p) {
      const double upper = distance(f_.feet[side], p) - 0.006;
      const double rim = 0.004 * smooth_step(0.026, 0.022, p.z);  // the sole stands out
      const double collar = p.z - 0.118 - 0.1 * (ankle.x - p.x);
      const double heel = 0.010 * smooth_step(0.012, 0.0, p.z) *
                          bump(p.x - 0.5 * (ankle.x + ball.x), 0.03);  // the arch
      return smooth_max(smooth_max(upper - rim + heel, collar, 0.008), -p.z, 0.004);
    };
    const Grid grid =
        upright_grid({{-0.12, ankle.y - 0.08, -0.02}, {0.25, ankle.y + 0.08, 0.14}}, 0.0118);
    const Vec3d middle{0.05, ankle.y, 0};
    add(shoe, grid,
        {upright_cylinder(middle, 0.14, 0.05, 0.14, appearance_.shoe),
         upright_cylinder(middle, 0.14, 0.05, 0.02, appearance_.sole)},
        {&f_.feet[side]});
    parts_.back().mapping_of = [](Vec3d p) { return p.z < 0.024 ? 1 : 0; };
  }

  /// Distance to a sleeve, and how far along the arm a place is: 0 shoulder, 1 wrist.
  double sleeve_distance(Side side, Vec3d p, double loose_m) const {
    const Vec3d top = joint(side, shoulder), elbow = joint(side, forearm), end = joint(side, hand);
    const Vec3d upper = elbow - top, lower = end - elbow;
    const double up = dot(p - top, upper) / length(upper),
                 low = dot(p - elbow, lower) / length(lower);
    const Vec3d off = p - top;
    const double angle = std::atan2(off.y * upper.z - off.z * upper.y, off.x * length(upper));
    const double at_elbow = bump(up - 0.285, 0.10);
    double d = distance(f_.arms[side], p) - loose_m - 0.4 * loose_m * at_elbow;
    const bool over_elbow = up > 0.2;
    d -= 0.0045 * creases(over_elbow ? low : up, angle, 0.062) *
         (0.25 + at_elbow + 0.7 * bump(low - 0.235, 0.05));
    if (!appearance_.long_sleeves)
      return smooth_max(d - 0.007 * smooth_step(0.02, 0.15, up), up - 0.175, 0.006);
    const double cuff = appearance_.top == Top::hoodie || appearance_.top == Top::sweater
                            ? 0.007 * smooth_step(0.195, 0.21, low)
                            : 0;
    return smooth_max(d + cuff, low - 0.243, 0.006);
  }

  /// Above the plane of the collar, which leans forward.
  double above_collar(Vec3d p) const { return p.z - 1.474 + 0.24 * (p.x + 0.018); }

  /// Distance to the hole that the neck leaves in clothes.
  double neck_hole(Vec3d p, double radius_m) const {
    return std::max(-above_collar(p), std::hypot(p.x + 0.018, p.y) - radius_m);
  }

  double collar_distance(Vec3d p) const {
    const double k = f_.physique.woman ? 0.88 : 1.0;
    // A ring around the neck, lower in front.
    const double up = above_collar(p) + 0.002;
    const double radial = std::hypot((p.x + 0.018) / 1.02, p.y) - 0.079 * k - 0.2 * up;
    if (appearance_.top == Top::hoodie) {
      const double hood =
          distance({{-0.105, -0.045, 1.455}, {-0.105, 0.045, 1.455}, 0.05, 0.05, {0.8, 1, 0.9}},
                   p) -
          0.004 * std::sin(70 * p.y + 60 * p.z);
      return smooth_min(std::hypot(radial - 0.006, 0.7 * up) - 0.017, hood, 0.03);
    }
    const double high = appearance_.top == Top::shirt || appearance_.top == Top::coat ? 0.42 : 1.0;
    const double thick = appearance_.top == Top::tee ? 0.009 : 0.011;
    return std::hypot(radial, high * up) - thick;
  }

  /// What a top hangs on: the hips with trousers on.
  double trunk_and_hips(Vec3d p) const {
    const double upper = smooth_min(distance(f_.trunk, p), distance(f_.neck, p), 0.03);
    if (p.z > 1.1) return upper;
    const double hips = std::min(distance(f_.legs[left], p), distance(f_.legs[right], p)) - 0.012;
    return smooth_min(upper, hips, 0.05);
  }

  double top_distance(Vec3d p) const {
    const double snug = appearance_.top == Top::coat     ? 0.007
                        : appearance_.top == Top::tee    ? 0.011
                        : appearance_.top == Top::hoodie ? 0.020
                                                         : 0.014;
    const double hem =
        appearance_.top == Top::hoodie || appearance_.top == Top::sweater ? 0.885 : 0.865;
    const double angle = around(p);
    // Cloth hangs from chest and shoulder blades.
    const double hang = 0.018 * bump(p.z - 1.06, 0.10);
    const double waist_folds = creases(p.z + 0.03 * std::sin(3 * angle), angle, 0.085) *
                               bump(p.z - 1.03, 0.10) * (0.6 + 0.4 * std::abs(std::sin(angle)));
    const double drapes =
        std::sin(7 * angle + 6 * std::sin(9 * p.z)) * smooth_step(1.25, 0.95, p.z);
    const double loose = appearance_.top == Top::coat ? 0.2 : 1;  // another garment presses it flat
    double d = trunk_and_hips(p) - snug - loose * (hang + 0.005 * waist_folds + 0.0035 * drapes);
    if (appearance_.top == Top::hoodie || appearance_.top == Top::sweater)
      d += 0.012 * smooth_step(hem + 0.055, hem + 0.035, p.z);  // ribbed waistband
    if (appearance_.top == Top::coat)                           // only its front shows
      d += 0.03 * smooth_step(0.09, 0.14, std::abs(p.y)) * smooth_step(1.42, 1.38, p.z);
    d = smooth_max(d, hem - p.z, 0.006);
    for (const Side side : kSides)
      if (appearance_.top != Top::coat && p.y * sign_of(side) > 0.02)
        d = smooth_min(d, sleeve_distance(side, p, snug), 0.03);
    d = smooth_max(d, -neck_hole(p, 0.088), 0.008);
    return smooth_min(d, collar_distance(p), 0.006);
  }

  CylinderMapping sleeve_cylinder(Side side, const Material& m) const {
    return limb_cylinder(joint(side, shoulder), joint(side, hand), 0.055, m);
  }

  /// 0 on the trunk, 1 and 2 on the sleeves: beyond a plane through the armpit.
  int sleeve_of(Vec3d p) const {
    const Side side = p.y > 0 ? left : right;
    const Vec3d top = joint(side, shoulder), elbow = joint(side, forearm);
    const Vec3d out{0, side == left ? 0.93 : -0.93, -0.37};
    const bool on_arm = distance(f_.arms[side], p) < distance(f_.trunk, p);
    return on_arm && dot(p - top - (elbow - top) * 0.12, out) > 0 ? 1 + side : 0;
  }

  void add_top() {
    const double reach = std::abs(joint(left, hand).y) + 0.07;
    const double low = appearance_.long_sleeves ? std::min(0.84, joint(left, hand).z - 0.06) : 0.84;
    const bool vest = appearance_.top == Top::coat;  // its sleeves would be hidden
    const double out = vest                       ? 0.27
                       : appearance_.long_sleeves ? reach
                                                  : joint(left, forearm).y + 0.06;
    const Box3d box{{-0.24, -out, low}, {0.27, out, 1.54}};
    // The print sits on the chest, in the middle of the sheet's height.
    add([*this](Vec3d p) { return top_distance(p); }, upright_grid(box, vest ? 0.021 : 0.0175),
        {upright_cylinder({-0.01, 0, 1.275 - 0.45}, 0.135, 0.175, 0.9, appearance_.print),
         sleeve_cylinder(left, appearance_.cloth), sleeve_cylinder(right, appearance_.cloth)},
        {&f_.trunk, &f_.neck, &f_.arms[left], &f_.arms[right], &f_.legs[left], &f_.legs[right]},
        1.6);
    parts_.back().mapping_of = [*this](Vec3d p) { return sleeve_of(p); };
  }

  /// Open in front, to the knees.
  void add_coat() {
    const auto coat = [*this](Vec3d p) {
      const double angle = around(p), low = std::max(0.0, 0.96 - p.z);
      const double folds = std::sin(6 * angle + 2) * (0.004 + 0.05 * low);
      const Solid tails{{-0.01, 0, 0.98}, {-0.015, 0, 0.50}, 0.175, 0.262, {0.82, 1, 1}};
      double d = smooth_min(trunk_and_hips(p) - 0.032, distance(tails, p) - 0.4 * folds, 0.08);
      d = smooth_max(d, 0.56 - p.z, 0.01);
      for (const Side side : kSides)
        if (p.y * sign_of(side) > 0.02) d = smooth_min(d, sleeve_distance(side, p, 0.022), 0.03);
      const double gap = std::abs(p.y) - 0.045 - 0.10 * low - 0.02 * smooth_step(1.2, 1.45, p.z);
      const double opening = std::max(gap, 0.015 - p.x);
      d = smooth_max(d, -opening, 0.012);
      const double hollow = std::max(distance(tails, p) - 0.4 * folds + 0.042, p.z - 0.70);
      d = smooth_max(d, -hollow, 0.01);
      d = smooth_max(d, -neck_hole(p - Vec3d{0, 0, -0.012}, 0.105), 0.01);
      const Vec3d lapel{std::max(p.x, 0.0), std::abs(p.y), p.z};
      const double turned =
          distance({{0.085, 0.060, 1.43}, {0.145, 0.075, 1.20}, 0.024, 0.012, {0.8, 1, 1}}, lapel);
      return p.x > 0.02 ? smooth_min(d, turned, 0.006) : d;
    };
    const double out = joint(left, hand).y + 0.08;
    const Box3d box{{-0.29, -out, 0.53}, {0.30, out, 1.53}};
    add(coat, upright_grid(box, 0.0245),
        {upright_cylinder({-0.01, 0, 0.5}, 0.16, 0.20, 1.0, appearance_.coat),
         sleeve_cylinder(left, appearance_.coat), sleeve_cylinder(right, appearance_.coat)},
        {&f_.trunk, &f_.neck, &f_.arms[left], &f_.arms[right], &f_.thighs[left], &f_.thighs[right]},
        1.6);
    parts_.back().mapping_of = [*this](Vec3d p) { return sleeve_of(p); };
  }

  double trouser_leg_distance(Side side, Vec3d p) const {
    const Vec3d knee = joint(side, shin), ankle = joint(side, foot);
    const double angle = std::atan2(p.y - knee.y, p.x);
    const double down = smooth_step(0.55, 0.10, p.z);
    const double loose = (appearance_.bottom == Bottom::jeans ? 0.012 : 0.016) + 0.016 * down;
    const double knee_folds = creases(p.z, angle, 0.07) * bump(p.z - 0.47, 0.09);
    const double stack =
        creases(p.z + 0.02 * std::sin(angle), angle + 1, 0.05) * bump(p.z - 0.10, 0.08);
    const double thigh_folds = creases(p.z + 0.3 * p.x, angle, 0.11) * bump(p.z - 0.80, 0.09);
    const double d = distance(f_.legs[side], p) - loose;
    const double hem = 0.062 + 0.3 * std::max(0.0, p.x - ankle.x - 0.02);
    return smooth_max(d - 0.005 * knee_folds - 0.005 * stack - 0.004 * thigh_folds, hem - p.z,
                      0.006);
  }

  void add_trousers() {
    const auto trousers = [*this](Vec3d p) {
      const double seat = distance(f_.trunk, p) - 0.006;
      const double legs =
          smooth_min(trouser_leg_distance(left, p), trouser_leg_distance(right, p), 0.012);
      return smooth_max(smooth_min(seat, legs, 0.03), p.z - 0.95, 0.006);
    };
    const double out = joint(left, foot).y + 0.12;
    add(trousers, upright_grid({{-0.20, -out, 0.03}, {0.21, out, 1.05}}, 0.0180),
        {upright_cylinder({-0.01, 0, 0}, 0.125, 0.165, 1.0, appearance_.legwear),
         limb_cylinder(joint(left, thigh), joint(left, foot), 0.085, appearance_.legwear),
         limb_cylinder(joint(right, thigh), joint(right, foot), 0.085, appearance_.legwear)},
        {&f_.trunk, &f_.legs[left], &f_.legs[right]}, 1.15);
    parts_.back().mapping_of = [](Vec3d p) { return p.z > 0.905 ? 0 : p.y > 0 ? 1 : 2; };
  }

  void add_skirt() {
    const auto skirt = [*this](Vec3d p) {
      const double down = std::clamp((1.0 - p.z) / 0.5, 0.0, 1.0);
      const double pleats = std::sin(14 * around(p)) * 0.012 * down;
      const Solid bell{{-0.015, 0, 0.99}, {-0.005, 0, 0.47}, 0.135, 0.245, {0.86, 1, 1}};
      const double outside =
          smooth_min(distance(bell, p) - pleats, distance(f_.trunk, p) - 0.008, 0.06);
      const double hollow = std::max(outside + 0.030, p.z - 0.64);
      return smooth_max(smooth_max(outside, std::max(0.53 - p.z, p.z - 0.91), 0.006), -hollow,
                        0.01);
    };
    add(skirt, upright_grid({{-0.29, -0.33, 0.50}, {0.29, 0.33, 0.95}}, 0.0175),
        {upright_cylinder({-0.01, 0, 0.5}, 0.16, 0.19, 0.55, appearance_.legwear)},
        {&f_.trunk, &f_.thighs[left], &f_.thighs[right]}, 2.6);
  }

  const Figure& f_;
  const Appearance& appearance_;
  std::vector<BodyPart>& parts_;
};

}  // namespace

double CylinderMapping::around_m() const { return kPi * (depth_m + width_m); }

Vec2f CylinderMapping::place(Vec3d p_person) const {
  const Vec3d q = T_cylinder_person * p_person;
  const double angle = std::atan2(q.y / width_m, q.x / depth_m);
  // Close to the length of the ellipse's arc, and exact in front and at the sides.
  const double u =
      0.5 * (depth_m + width_m) * (angle + kPi) + 0.25 * (width_m - depth_m) * std::sin(2 * angle);
  return {static_cast<float>(u), static_cast<float>(q.z)};
}

std::vector<BodyPart> body_parts(const Figure& figure, const Appearance& appearance) {
  std::vector<BodyPart> parts;
  ClothedBodyBuilder(figure, appearance, parts).add_all();
  return parts;
}

}  // namespace mr::synth
