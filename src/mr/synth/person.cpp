#include "mr/synth/person.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <tuple>

#include "mr/core/parallel.h"
#include "mr/synth/appearance.h"
#include "mr/synth/figure.h"
#include "mr/synth/gait.h"

namespace mr::synth {
namespace {

constexpr double kFigureStature_m = 1.75;

/// Puts parts together into one body.
class BodyAssembler {
 public:
  BodyAssembler(Body& body, double scale) : body_(body), scale_(scale) {}

  void add(const BodyPart& part) {
    const Mesh mesh = polygonize(part.distance, part.grid);
    const std::vector<SkinWeights> weights = skin_weights_of(part, mesh);
    const std::size_t first_wrap = add_materials(part);
    body_.parts.push_back(static_cast<std::uint32_t>(body_.rest.triangles.size()));
    copies_.clear();
    first_copy_.assign(mesh.positions.size(), kNone);
    for (const Triangle& t : mesh.triangles) {
      const Vec3d middle = vec_cast<double>(
          (mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3.0f);
      const int w = part.mapping_of(middle);
      Triangle out;
      for (int i = 0; i < 3; ++i)
        out[i] = vertex(mesh, weights, t[i], part.mappings[w], w, part.mappings[w].place(middle));
      body_.rest.triangles.push_back(out);
      body_.material.push_back(static_cast<std::uint16_t>(first_wrap + w));
      body_.surface.push_back(static_cast<std::uint32_t>(first_wrap + w));
    }
  }

 private:
  static constexpr std::uint32_t kNone = 0xFFFFFFFFu;

  static std::vector<SkinWeights> skin_weights_of(const BodyPart& part, const Mesh& mesh) {
    std::vector<SkinWeights> weights(mesh.positions.size());
    parallel_for(weights.size(), 512, [&](std::size_t begin, std::size_t end) {
      for (std::size_t v = begin; v < end; ++v)
        weights[v] =
            skin_weights(part.carried_by, vec_cast<double>(mesh.positions[v]), part.softness);
    });
    return weights;
  }

  /// Adds the part's materials, sized to their sheets; returns the first one's index.
  std::size_t add_materials(const BodyPart& part) {
    const std::size_t first = body_.materials.size();
    for (const CylinderMapping& mapping : part.mappings) {
      body_.materials.push_back(mapping.material);
      body_.materials.back().size_m = {static_cast<float>(mapping.around_m()),
                                       static_cast<float>(mapping.height_m)};
    }
    return first;
  }

  /// The copy of a vertex that lies on a mapping, on the side of the seam where `near` is.
  std::uint32_t vertex(const Mesh& mesh, const std::vector<SkinWeights>& weights, std::uint32_t v,
                       const CylinderMapping& mapping, int mapping_index, Vec2f near) {
    const auto around = static_cast<float>(mapping.around_m());
    Vec2f place = mapping.place(vec_cast<double>(mesh.positions[v]));
    const int laps = static_cast<int>(std::lround((near.x - place.x) / around));
    const auto [copy, is_new] = copies_.try_emplace(
        {v, mapping_index, laps}, static_cast<std::uint32_t>(body_.rest.positions.size()));
    if (!is_new) return copy->second;
    place.x += static_cast<float>(laps) * around;
    if (first_copy_[v] == kNone) first_copy_[v] = copy->second;
    body_.rest.positions.push_back(mesh.positions[v] * static_cast<float>(scale_));
    body_.surface_m.push_back(place);
    body_.place.push_back(first_copy_[v]);
    body_.bones.push_back(weights[v].bones);
    body_.weights.push_back(weights[v].weights);
    return copy->second;
  }

  Body& body_;
  const double scale_;
  std::map<std::tuple<std::uint32_t, int, int>, std::uint32_t> copies_;
  std::vector<std::uint32_t> first_copy_;  ///< [V] of the part's mesh
};

// --- skinning

/// A rotation and a translation as two quaternions (Kavan et al. 2008): blends of these neither
/// shrink a bent elbow nor wring a twisted wrist.
struct DualQuaternion {
  std::array<double, 4> real{}, dual{};  ///< w x y z

  void add(const DualQuaternion& other, double weight) {
    double cosine = 0;
    for (int i = 0; i < 4; ++i) cosine += real[i] * other.real[i];
    const double w = cosine < 0 ? -weight : weight;
    for (int i = 0; i < 4; ++i) real[i] += w * other.real[i], dual[i] += w * other.dual[i];
  }

  Vec3d transformed(Vec3d p) const {
    const auto [w, x, y, z] = real;
    const Vec3d r{x, y, z}, d{dual[1], dual[2], dual[3]};
    const double norm2 = w * w + dot(r, r);
    const Vec3d turned = p + cross(r, cross(r, p) + p * w) * (2 / norm2);
    return turned + (d * w - r * dual[0] + cross(r, d)) * (2 / norm2);
  }
};

std::array<double, 4> quaternion(const Mat3& m) {
  const double trace = m(0, 0) + m(1, 1) + m(2, 2);
  if (trace > 0) {
    const double s = 2 * std::sqrt(1 + trace);
    return {s / 4, (m(2, 1) - m(1, 2)) / s, (m(0, 2) - m(2, 0)) / s, (m(1, 0) - m(0, 1)) / s};
  }
  const int i = m(0, 0) > m(1, 1) && m(0, 0) > m(2, 2) ? 0 : m(1, 1) > m(2, 2) ? 1 : 2;
  const int j = (i + 1) % 3, k = (i + 2) % 3;
  const double s = 2 * std::sqrt(1 + m(i, i) - m(j, j) - m(k, k));
  std::array<double, 4> q{};
  q[0] = (m(k, j) - m(j, k)) / s, q[1 + i] = s / 4;
  q[1 + j] = (m(j, i) + m(i, j)) / s, q[1 + k] = (m(k, i) + m(i, k)) / s;
  return q;
}

DualQuaternion dual_quaternion(const Pose& pose) {
  DualQuaternion out;
  out.real = quaternion(pose.rotation);
  const auto [w, x, y, z] = out.real;
  const Vec3d t = pose.translation * 0.5, r{x, y, z}, d = t * w + cross(t, r);
  out.dual = {-dot(t, r), d.x, d.y, d.z};
  return out;
}

}  // namespace

Body make_body(std::uint64_t seed) {
  const Appearance appearance = make_appearance(seed);
  const Figure figure = make_figure(appearance.physique);
  Body body;
  BodyAssembler assembler(body, appearance.stature_m / kFigureStature_m);
  for (const BodyPart& part : body_parts(figure, appearance)) assembler.add(part);
  body.parts.push_back(static_cast<std::uint32_t>(body.rest.triangles.size()));
  body.skeleton = figure.skeleton;
  body.skeleton.scale = appearance.stature_m / kFigureStature_m;
  for (Vec3d& joint : body.skeleton.joint) joint = joint * body.skeleton.scale;
  return body;
}

std::vector<Vec3f> pose_body(const Body& body, const Walk& walk, double time_s) {
  return pose_body(body, posture_at(body.skeleton, walk, time_s));
}

std::vector<Vec3f> pose_body(const Body& body, const Posture& posture) {
  std::array<DualQuaternion, kBones> moves;
  for (std::size_t b = 0; b < kBones; ++b) moves[b] = dual_quaternion(posture[b]);
  std::vector<Vec3f> out(body.rest.positions.size());
  parallel_for(out.size(), 2048, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      DualQuaternion sum;
      for (int i = 0; i < 4; ++i) sum.add(moves[body.bones[v][i]], body.weights[v][i]);
      out[v] = vec_cast<float>(sum.transformed(vec_cast<double>(body.rest.positions[v])));
    }
  });
  return out;
}

std::vector<Vec3f> body_normals(const Body& body, const std::vector<Vec3f>& positions) {
  std::vector<Vec3f> normals(positions.size());
  for (const Triangle& t : body.rest.triangles) {
    const Vec3f a = positions[t[0]];
    const Vec3f normal = cross(positions[t[1]] - a, positions[t[2]] - a);
    for (const std::uint32_t v : t) normals[body.place[v]] += normal;
  }
  for (std::size_t v = 0; v < normals.size(); ++v) normals[v] = normals[body.place[v]];
  for (Vec3f& normal : normals) normal = normalized(normal);
  return normals;
}

}  // namespace mr::synth
