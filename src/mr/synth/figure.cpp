#include "mr/synth/figure.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mr/synth/bones.h"

namespace mr::synth {
namespace {

/// Adds pieces to a group.
class FigureBuilder {
 public:
  FigureBuilder(BodyPrimitives& out, double blend_m) : out_(out), blend_m_(blend_m) {}

  void ball(std::size_t bone, Vec3d center, Vec3d radii) {
    out_.push_back({ellipsoid(center, radii), static_cast<std::uint8_t>(bone), blend_m_});
  }
  void limb(std::size_t bone, Vec3d a, Vec3d b, double radius_a, double radius_b,
            Vec3d stretch = {1, 1, 1}) {
    out_.push_back(
        {{a, b, radius_a, radius_b, stretch}, static_cast<std::uint8_t>(bone), blend_m_});
  }

 private:
  BodyPrimitives& out_;
  double blend_m_;
};

BodyPrimitives mirrored_primitives(const BodyPrimitives& of_left) {
  BodyPrimitives out = of_left;
  for (BodyPrimitive& primitive : out) {
    primitive.solid = mirrored(primitive.solid);
    primitive.bone = static_cast<std::uint8_t>(primitive.bone + side_bones);
  }
  return out;
}

void build_trunk(Figure& f) {
  const double k = f.physique.bulk, belly = f.physique.belly;
  const bool woman = f.physique.woman;
  const double hips = woman ? 1.07 : 1.0, girth = woman ? 0.88 : 1.0;
  FigureBuilder add(f.trunk, 0.06);
  add.ball(pelvis, {-0.012, 0, 0.955}, {0.108 * k, 0.155 * k * hips, 0.12});
  add.ball(waist, {-0.008 + 0.4 * belly, 0, 1.09},
           {0.100 * k * girth + 0.6 * belly, 0.135 * k * girth + 0.4 * belly, 0.14});
  add.ball(chest, {-0.015, 0, 1.27}, {0.112 * k, 0.158 * k * (woman ? 0.92 : 1.0), 0.185});
  for (const Side side : kSides) {
    const double y = side == left ? 1 : -1;
    const Vec3d joint = f.skeleton.joint[bone_of(side, shoulder)];
    add.ball(pelvis, {-0.065, y * 0.068 * hips, 0.915}, {0.072 * k, 0.078 * k, 0.085});
    if (woman)
      add.ball(chest, {0.068, y * 0.072, 1.262}, {0.062, 0.066, 0.062});
    else
      add.ball(chest, {0.045, y * 0.075, 1.305}, {0.06 * k, 0.085, 0.065});
    add.limb(bone_of(side, clavicle), {-0.022, y * 0.035, 1.435},
             joint + Vec3d{-0.008, -0.01 * y, 0}, 0.056, woman ? 0.040 : 0.047);
    add.limb(chest, {-0.03, y * 0.092, 1.35}, {-0.025, y * 0.085, 1.2}, 0.078 * k, 0.068 * k);
  }
}

void build_neck(Figure& f) {
  const double k = f.physique.woman ? 0.86 : 1.0;
  FigureBuilder add(f.neck, 0.03);
  add.limb(neck, {-0.028, 0, 1.43}, {-0.005, 0, 1.56}, 0.066 * k, 0.056 * k);
  for (const double y : {1.0, -1.0})  // trapezius
    add.limb(chest, {-0.03, y * 0.03, 1.475}, {-0.028, y * 0.11, 1.428}, 0.036 * k, 0.028 * k);
}

void build_skull(Figure& f) {
  const double jaw = f.physique.jaw * (f.physique.woman ? 0.92 : 1.0);
  FigureBuilder add(f.skull, 0.022);
  add.ball(head, {-0.002, 0, 1.668}, {0.097, 0.074, 0.083});
  add.ball(head, {0.040, 0, 1.625}, {0.055, 0.061, 0.075});
  for (const double y : {1.0, -1.0}) {
    add.limb(head, {0.005, y * 0.050 * jaw, 1.580}, {0.070, y * 0.014 * jaw, 1.551}, 0.017, 0.015);
    add.ball(head, {0.060, y * 0.038, 1.617}, {0.026, 0.026, 0.022});
    add.ball(head, {0.046, y * 0.036, 1.590}, {0.030, 0.024, 0.026});
  }
  add.ball(head, {0.072, 0, 1.549}, {0.020, 0.022, 0.017});
}

void build_arm(Figure& f) {
  const double k = f.physique.bulk * (f.physique.woman ? 0.84 : 1.0);
  const auto joint = [&](int bone) { return f.skeleton.joint[bone_of(left, bone)]; };
  const Vec3d top = joint(shoulder), elbow = joint(forearm), end = joint(hand);
  const Vec3d upper = elbow - top, lower = end - elbow;
  FigureBuilder add(f.arms[left], 0.025);
  add.limb(bone_of(left, shoulder), top, top + upper * 0.5, 0.053 * k, 0.046 * k);
  add.limb(bone_of(left, upper_arm), top + upper * 0.5, elbow, 0.047 * k, 0.038 * k);
  add.limb(bone_of(left, forearm), elbow, elbow + lower * 0.32, 0.037 * k, 0.042 * k);
  add.limb(bone_of(left, forearm), elbow + lower * 0.32, elbow + lower * 0.55, 0.042 * k,
           0.035 * k);
  add.limb(bone_of(left, wrist), elbow + lower * 0.55, end, 0.035 * k, 0.0255 * std::sqrt(k));
}

void build_hand(Figure& f) {
  const double k = f.physique.woman ? 0.9 : 1.0;
  const HandAxes axes = left_hand_axes(f.skeleton);
  const Vec3d root = f.skeleton.joint[bone_of(left, hand)];
  const auto joint = [&](int finger, int i) {
    return f.skeleton.joint[finger_bone(left, finger, i)];
  };
  FigureBuilder palm(f.hands[left], 0.014), finger(f.hands[left], 0.001);
  palm.limb(bone_of(left, hand), root, root + axes.ahead * 0.03, 0.0245 * k, 0.022 * k);
  for (int i = 1; i < kFingers; ++i) {
    const Vec3d heel = root + axes.ahead * 0.028 + axes.thumb * ((2.3 - i) * 0.011);
    palm.limb(bone_of(left, hand), heel, joint(i, 0), 0.0185 * k, 0.0115 * k);
  }
  for (int i = 0; i < kFingers; ++i) {
    const double r = k * (i == 0 ? 0.0118 : i == 4 ? 0.0076 : 0.0087);
    if (i == 0) palm.limb(bone_of(left, hand), root + axes.ahead * 0.02, joint(0, 0), 0.018 * k, r);
    finger.limb(finger_bone(left, i, 0), joint(i, 0), joint(i, 1), r, 0.93 * r);
    finger.limb(finger_bone(left, i, 1), joint(i, 1),
                left_finger_tip(f.skeleton, i) - axes.ahead * 0.006, 0.93 * r, 0.8 * r);
  }
}

void build_leg(Figure& f) {
  const double k = f.physique.bulk * (f.physique.woman ? 0.98 : 1.0);
  const auto joint = [&](int bone) { return f.skeleton.joint[bone_of(left, bone)]; };
  const Vec3d hip = joint(thigh), knee = joint(shin), ankle = joint(foot);
  const Vec3d calf = knee + (ankle - knee) * 0.3 + Vec3d{-0.012, 0, 0};
  FigureBuilder add(f.legs[left], 0.03);
  add.limb(bone_of(left, thigh), hip + Vec3d{-0.005, 0.004, -0.03}, knee, 0.088 * k, 0.054 * k);
  add.limb(bone_of(left, shin), knee, calf, 0.053 * k, 0.056 * k);
  add.limb(bone_of(left, shin), calf, ankle, 0.056 * k, 0.034);
}

void build_foot(Figure& f) {
  const auto joint = [&](int bone) { return f.skeleton.joint[bone_of(left, bone)]; };
  const Vec3d ankle = joint(foot), ball = joint(toes);
  const double y = ankle.y;
  FigureBuilder add(f.feet[left], 0.03);
  add.limb(bone_of(left, foot), ankle + Vec3d{0, 0, 0.03}, ankle, 0.040, 0.040);
  add.limb(bone_of(left, foot), {ankle.x - 0.028, y, 0.030}, {ball.x, y + 0.004, 0.026}, 0.036,
           0.044);
  add.limb(bone_of(left, foot), ankle + Vec3d{0.02, 0, -0.012}, {ball.x - 0.01, y + 0.002, 0.032},
           0.038, 0.034);
  add.limb(bone_of(left, toes), {ball.x, y + 0.004, 0.026}, {ball.x + 0.062, y - 0.002, 0.026},
           0.044, 0.034);
}

/// How far a bone's hold on a surface reaches over a joint.
double reach_m(std::size_t bone) {
  if (bone < middle_bones) return bone == neck || bone == head ? 0.025 : 0.04;
  const std::size_t of_side = (bone - middle_bones) % side_bones;
  if (of_side == clavicle) return 0.035;
  if (of_side == shoulder || of_side == upper_arm) return 0.027;
  if (of_side == thigh) return 0.032;
  if (of_side == forearm || of_side == wrist) return 0.018;
  if (of_side == hand) return 0.007;
  if (of_side == foot || of_side == toes) return 0.010;
  return of_side < thigh ? 0.0025 : 0.018;
}

constexpr double kWeakestHold = 0.12;

}  // namespace

Figure make_figure(const Physique& physique) {
  Figure f;
  f.physique = physique;
  f.skeleton = make_skeleton(physique.woman ? Proportions{0.90, 1.03} : Proportions{});
  build_trunk(f);
  build_neck(f);
  build_skull(f);
  build_arm(f);
  build_hand(f);
  build_leg(f);
  build_foot(f);
  for (auto* group : {&f.arms, &f.hands, &f.legs, &f.feet})
    (*group)[right] = mirrored_primitives((*group)[left]);
  for (const Side side : kSides) f.thighs[side] = {f.legs[side].front()};
  return f;
}

double distance(std::span<const BodyPrimitive> primitives, Vec3d p) {
  double d = distance(primitives.front().solid, p);
  for (const BodyPrimitive& primitive : primitives.subspan(1))
    d = smooth_min(d, distance(primitive.solid, p), primitive.blend_m);
  return d;
}

double head_distance(const Figure& f, Vec3d p) {
  const Vec3d q{p.x, std::abs(p.y), p.z};  // the face is symmetric
  double d = smooth_min(distance(f.skull, p), distance(f.neck, p), 0.02);
  const double long_nose = f.physique.nose_m;
  const auto add = [&](const Solid& solid, double blend) {
    d = smooth_min(d, distance(solid, q), blend);
  };
  const auto carve = [&](const Solid& solid, double blend) {
    d = smooth_max(d, -distance(solid, q), blend);
  };
  if (p.x > 0.02 && p.z > 1.52) {
    add({{0.083, 0, 1.660}, {0.076, 0.040, 1.663}, 0.0115, 0.009}, 0.012);  // brow
    carve(ellipsoid({0.104, 0.032, 1.640}, {0.016, 0.019, 0.0115}), 0.012);
    add(ellipsoid({0.0775, 0.032, 1.640}, {0.0135, 0.0140, 0.0125}), 0.002);  // eye
    add({{0.090, 0, 1.650}, {0.108 + long_nose, 0, 1.608}, 0.007, 0.0105}, 0.010);
    add(ellipsoid({0.100 + 0.6 * long_nose, 0.011, 1.605}, {0.010, 0.0075, 0.007}), 0.006);
    add({{0.0925, 0, 1.5805}, {0.083, 0.019, 1.577}, 0.0072, 0.003}, 0.005);  // lips
    add({{0.0905, 0, 1.5690}, {0.083, 0.017, 1.573}, 0.0085, 0.003}, 0.005);
  }
  if (q.y > 0.05 && std::abs(p.x) < 0.06) {
    add({{-0.004, 0.073, 1.652}, {0.004, 0.070, 1.610}, 0.019, 0.011, {1, 0.42, 1}}, 0.006);  // ear
    carve(ellipsoid({0.0, 0.086, 1.640}, {0.009, 0.007, 0.014}), 0.004);
  }
  return d;
}

double hand_distance(const Figure& f, int side, Vec3d p) {
  constexpr double kBetweenFingers_m = 0.002;
  std::array<double, kFingers> finger;
  finger.fill(1e9);
  double palm = 1e9;
  for (const BodyPrimitive& primitive : f.hands[side]) {
    const std::size_t bone = (primitive.bone - middle_bones) % side_bones;
    double& to = bone == hand ? palm : finger[(bone - fingers) / 2];
    const double d = distance(primitive.solid, p);
    to = to > 1e8 ? d : smooth_min(to, d, primitive.blend_m);
  }
  double tips = 1e9;
  for (const double d : finger) tips = tips > 1e8 ? d : smooth_min(tips, d, kBetweenFingers_m);
  return smooth_min(palm, tips, 0.010);
}

SkinWeights skin_weights(std::span<const BodyPrimitives* const> groups, Vec3d p, double softness) {
  std::array<double, kBones> nearest;
  nearest.fill(std::numeric_limits<double>::max());
  double least = std::numeric_limits<double>::max();
  for (const BodyPrimitives* group : groups)
    for (const BodyPrimitive& primitive : *group) {
      double& d = nearest[primitive.bone];
      d = std::min(d, distance(primitive.solid, p));
      least = std::min(least, d);
    }
  std::array<std::pair<double, std::uint8_t>, kBones> holds;
  for (std::size_t b = 0; b < kBones; ++b) {
    const double hold = std::exp((least - nearest[b]) / (softness * reach_m(b)));
    holds[b] = {std::max(hold - kWeakestHold, 0.0), static_cast<std::uint8_t>(b)};
  }
  std::partial_sort(holds.begin(), holds.begin() + 4, holds.end(), std::greater<>());
  double sum = 0;
  for (int i = 0; i < 4; ++i) sum += holds[i].first;
  SkinWeights weights;
  for (int i = 0; i < 4; ++i) {
    weights.bones[i] = holds[i].second;
    weights.weights[i] = static_cast<float>(holds[i].first / sum);
  }
  return weights;
}

}  // namespace mr::synth
