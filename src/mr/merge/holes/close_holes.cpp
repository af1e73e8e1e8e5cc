#include "mr/merge/holes/close_holes.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

#include "mr/core/parallel.h"
#include "mr/kit/borders.h"
#include "mr/kit/topology.h"
#include "mr/merge/holes/loop_filling.h"
#include "mr/merge/holes/seen_through.h"
#include "mr/merge/seam/point_grid.h"

namespace mr::merge {
namespace {

constexpr std::size_t kMostRimCorners = 300;
constexpr float kRimsAgree = 0.5f;  // cosine: rims that face like what closes them
constexpr float kSlit_voxels = 3;   // triangles with shorter edges need only face the same way
constexpr float kClear_voxels = 3;  // above and below a hole: other surface there is in it
constexpr float kBehind_voxels = 5;
constexpr float kSliver_m2 = 1e-9f;
constexpr float kWide_voxels = 4, kBent_voxels = 0.25f;  // of holes that get a vertex

/// What closes a hole.
struct Filling {
  std::vector<Triangle> triangles;                  ///< of the mesh's vertices; kMiddle: `middle`
  std::optional<Vec3f> middle;                      ///< a vertex of its own
  std::vector<std::array<std::uint32_t, 2>> joins;  ///< new edges between vertices of the mesh
  static constexpr std::uint32_t kMiddle = 0xFFFFFFFFu;
};

using kit::BorderLoop;

/// A mesh with its holes.
class Holes {
 public:
  Holes(const Mesh& mesh, const HolesConfig& config)
      : mesh_(mesh), config_(config), normals_(kit::vertex_normals(mesh)), borders_(mesh) {
    for (const BorderLoop& loop : borders_.loops())
      if (loop.size() <= kMostRimCorners && may_be_narrow(loop)) loops_.push_back(loop);
  }

  const std::vector<BorderLoop>& loops() const { return loops_; }

  /// What closes a loop, if it is a small hole.
  std::optional<Filling> filling(const BorderLoop& loop) const {
    const FillingRule rule{
        [&](std::uint32_t i, std::uint32_t k) { return may_join(loop[i], loop[k]); },
        [&](std::uint32_t i, std::uint32_t j, std::uint32_t k) {
          return cost(loop[i], loop[j], loop[k]);
        }};
    const auto found = least_filling(static_cast<std::uint32_t>(loop.size()), rule);
    if (!found) return std::nullopt;
    if (auto bent = with_middle(loop)) return bent;
    Filling out;
    for (const auto& [k, j, i] : *found) {  // i < j < k
      out.triangles.push_back({loop[k], loop[j], loop[i]});
      if (j - i > 1) out.joins.push_back({loop[i], loop[j]});
      if (k - j > 1) out.joins.push_back({loop[j], loop[k]});
    }
    return out;
  }

  /// Whether a filling still fits: another one may have made an edge between the same vertices.
  bool fits(const Filling& filling) const {
    return std::ranges::all_of(
        filling.joins, [&](const auto& edge) { return !borders_.has_edge(edge[0], edge[1]); });
  }
  /// Takes over a filling's edges.
  void add(const Filling& filling) {
    for (const auto& [a, b] : filling.joins) borders_.add_edge(a, b);
  }

  /// Corners of one of its triangles.
  GuessedTriangle corners(const Filling& filling, const Triangle& t) const {
    GuessedTriangle out;
    for (int i = 0; i < 3; ++i)
      out[i] = t[i] == Filling::kMiddle ? *filling.middle : mesh_.positions[t[i]];
    return out;
  }

 private:
  Vec3f at(std::uint32_t v) const { return mesh_.positions[v]; }

  /// Whether a loop's area is not too large for its length; saves time.
  bool may_be_narrow(const BorderLoop& loop) const {
    Vec3f area;
    float around = 0;
    for (std::size_t i = 0; i < loop.size(); ++i) {
      const Vec3f a = at(loop[i]) - at(loop[0]), b = at(loop[(i + 1) % loop.size()]) - at(loop[0]);
      area += cross(b, a), around += length(b - a);
    }
    return 0.5f * length(area) <= static_cast<float>(config_.fill_m) * around;
  }

  bool may_join(std::uint32_t a, std::uint32_t b) const {
    return length(at(a) - at(b)) <= static_cast<float>(config_.fill_m) && !borders_.has_edge(a, b);
  }

  /// Of the triangle {c, b, a} over a hole: its area.
  std::optional<double> cost(std::uint32_t a, std::uint32_t b, std::uint32_t c) const {
    const float size = agreeing_size(at(c), at(b), at(a), {normals_[c], normals_[b], normals_[a]});
    if (size <= 0) return std::nullopt;
    return 0.5 * size;
  }

  /// Twice the area of a triangle; 0: it is too wide, a sliver, or faces another way than the
  /// surface at its corners.
  float agreeing_size(Vec3f p, Vec3f q, Vec3f r, const std::array<Vec3f, 3>& normals) const {
    const Vec3f n = cross(q - p, r - p);
    const float size = length(n);
    const float longest = std::max({length(q - p), length(r - q), length(p - r)});
    if (size < 2 * kSliver_m2 || size > static_cast<float>(config_.fill_m) * longest) return 0;
    if (longest <= kSlit_voxels * static_cast<float>(config_.voxel_m))
      return dot(n, normals[0] + normals[1] + normals[2]) > 0 ? size : 0;
    for (const Vec3f& around : normals)
      if (dot(n, around) < kRimsAgree * size) return 0;
    return size;
  }

  /// A fan around a vertex in the middle of a wide hole in a bent surface. The tangent planes of a
  /// sphere, a cylinder or a paraboloid at the rim pass its middle at twice its height.
  std::optional<Filling> with_middle(const BorderLoop& loop) const {
    Vec3f middle, normal;
    for (const std::uint32_t v : loop) middle += at(v), normal += normals_[v];
    middle = middle / static_cast<float>(loop.size()), normal = normalized(normal);
    float height = 0, width = 0;
    for (const std::uint32_t v : loop) {
      const float along = dot(normals_[v], normal);
      if (along < kRimsAgree) return std::nullopt;
      height += dot(at(v) - middle, normals_[v]) / along / static_cast<float>(loop.size());
      width = std::max(width, 2 * length(at(v) - middle));
    }
    const auto voxel_m = static_cast<float>(config_.voxel_m);
    if (width < kWide_voxels * voxel_m || std::abs(height) < 2 * kBent_voxels * voxel_m)
      return std::nullopt;
    Filling out;
    out.middle = config_.lattice.snap(middle + normal * (0.5f * height));
    for (std::size_t i = 0; i < loop.size(); ++i) {
      const std::uint32_t a = loop[i], b = loop[(i + 1) % loop.size()];
      if (agreeing_size(at(b), at(a), *out.middle, {normals_[b], normals_[a], normal}) <= 0)
        return std::nullopt;
      out.triangles.push_back({b, a, Filling::kMiddle});
    }
    return out;
  }

  const Mesh& mesh_;
  const HolesConfig& config_;
  std::vector<Vec3f> normals_;
  kit::Borders borders_;
  std::vector<BorderLoop> loops_;
};

/// The ends of all borders, to find what lies in a hole.
class BorderPoints {
 public:
  BorderPoints(const Mesh& mesh, double cell_m)
      : points_(ends(mesh)), grid_(places(mesh, points_), cell_m), mesh_(mesh) {}

  /// Whether a border other than the loop's ends above or below a triangle.
  bool any_over(const GuessedTriangle& t, const BorderLoop& loop, float clear_m) const {
    const Vec3f middle = (t[0] + t[1] + t[2]) / 3.0f;
    const Vec3f normal = normalized(cross(t[1] - t[0], t[2] - t[0]));
    const float reach =
        clear_m + std::max({length(t[0] - middle), length(t[1] - middle), length(t[2] - middle)});
    bool found = false;
    grid_.within(middle, reach, [&](std::uint32_t i) {
      const Vec3f p = mesh_.positions[points_[i]];
      bool over = std::abs(dot(p - middle, normal)) < clear_m;
      for (int k = 0; k < 3 && over; ++k)
        over = dot(cross(t[(k + 1) % 3] - t[k], p - t[k]), normal) > 0;
      found |= over && std::ranges::find(loop, points_[i]) == loop.end();
    });
    return found;
  }

 private:
  static std::vector<std::uint32_t> ends(const Mesh& mesh) {
    const std::vector<std::uint8_t> border = kit::border_vertices(mesh);
    std::vector<std::uint32_t> out;
    for (std::uint32_t v = 0; v < border.size(); ++v)
      if (border[v]) out.push_back(v);
    return out;
  }
  static std::vector<Vec3f> places(const Mesh& mesh, const std::vector<std::uint32_t>& vertices) {
    std::vector<Vec3f> out;
    for (const std::uint32_t v : vertices) out.push_back(mesh.positions[v]);
    return out;
  }

  std::vector<std::uint32_t> points_;
  PointGrid grid_;
  const Mesh& mesh_;
};

/// Adds triangles and their vertices; each has the sensor of a triangle at its rim.
void append_fillings(Mesh& mesh, const std::vector<Filling>& fillings) {
  const bool labelled = !mesh.sensors.empty();
  std::vector<SensorId> sensor = triangle_sensors(mesh),
                        at_vertex(mesh.positions.size(), kNoSensor);
  for (std::size_t t = 0; labelled && t < mesh.triangles.size(); ++t)
    for (const std::uint32_t v : mesh.triangles[t]) at_vertex[v] = sensor[t];
  for (const Filling& filling : fillings) {
    const auto middle = static_cast<std::uint32_t>(mesh.positions.size());
    if (filling.middle) mesh.positions.push_back(*filling.middle);
    for (Triangle t : filling.triangles) {
      sensor.push_back(at_vertex[t[0]]);
      for (std::uint32_t& v : t)
        if (v == Filling::kMiddle) v = middle;
      mesh.triangles.push_back(t);
    }
  }
  clear_labels(mesh);
  if (labelled) set_triangle_sensors(mesh, sensor);
}

}  // namespace

std::vector<GuessedTriangle> close_holes(Mesh& mesh, std::span<const kit::Part> parts,
                                         const HolesConfig& config) {
  std::vector<GuessedTriangle> out;
  if (config.fill_m <= 0 || mesh.empty()) return out;
  Holes holes(mesh, config);
  const std::vector<BorderLoop>& loops = holes.loops();
  if (loops.empty()) return out;
  const BorderPoints borders(mesh, config.fill_m);
  const SeenThrough through(parts, kBehind_voxels * config.voxel_m, config.is_moving);
  const auto clear_m = static_cast<float>(kClear_voxels * config.voxel_m);
  std::vector<std::optional<Filling>> found(loops.size());
  parallel_for(loops.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      auto filling = holes.filling(loops[i]);
      const bool sound =
          filling && std::ranges::none_of(filling->triangles, [&](const Triangle& triangle) {
            const GuessedTriangle t = holes.corners(*filling, triangle);
            return borders.any_over(t, loops[i], clear_m) ||
                   through.at((t[0] + t[1] + t[2]) / 3.0f, cross(t[1] - t[0], t[2] - t[0]));
          });
      if (sound) found[i] = std::move(filling);
    }
  });
  std::vector<Filling> fillings;
  for (std::size_t i = 0; i < loops.size(); ++i) {
    if (!found[i] || !holes.fits(*found[i])) continue;
    holes.add(*found[i]);
    for (const Triangle& t : found[i]->triangles) out.push_back(holes.corners(*found[i], t));
    fillings.push_back(*std::move(found[i]));
  }
  if (!fillings.empty()) append_fillings(mesh, fillings);
  return out;
}

}  // namespace mr::merge
