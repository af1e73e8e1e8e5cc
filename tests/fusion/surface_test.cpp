// What every surface must be, whatever was seen: a clean mesh without cracks, in chunks that fit.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "mr/fusion/fuse.h"
#include "mr/kit/topology.h"
#include "support/depth_pictures.h"

namespace mr {
namespace {

using fusion::DepthEdges;
using fusion::History;
using fusion::MarchingCubes;
using fusion::Surface;
using fusion::SurfacePiece;
using fusion::VoxelBlock;
using fusion::VoxelVolume;

// --- a mesh and its grid

/// An edge of the voxel grid, from voxel `low` one step along `axis`.
struct GridEdge {
  Vec3i low;
  int axis = 0;
};

/// The edge that a vertex lies on: vertices keep 1/256 voxel away from the ends.
GridEdge grid_edge(Vec3f p, double voxel_m) {
  GridEdge edge;
  double farthest = -1;
  for (int axis = 0; axis < 3; ++axis) {
    const double v = p[axis] / voxel_m, off = std::abs(v - std::round(v));
    if (off > farthest) farthest = off, edge.axis = axis;
    edge.low[axis] = static_cast<std::int32_t>(std::lround(v));
  }
  edge.low[edge.axis] = static_cast<std::int32_t>(std::floor(p[edge.axis] / voxel_m));
  return edge;
}

bool touches(Vec3i cell, const GridEdge& edge) {
  for (int axis = 0; axis < 3; ++axis) {
    const int step = edge.low[axis] - cell[axis];
    if (axis == edge.axis ? step != 0 : step < 0 || step > 1) return false;
  }
  return true;
}

/// The cells that have both edges.
std::vector<Vec3i> shared_cells(const GridEdge& a, const GridEdge& b) {
  std::vector<Vec3i> out;
  for (int i = 0; i < 8; ++i) {
    const Vec3i cell = a.low - Vec3i{i & 1, i >> 1 & 1, i >> 2};
    if (touches(cell, a) && touches(cell, b)) out.push_back(cell);
  }
  return out;
}

struct Voxel {
  bool seen = false, inside = false, near = false;
};
Voxel voxel_at(const VoxelVolume& volume, Vec3i at) {
  const std::uint32_t slot = volume.directory().find({at.x >> 3, at.y >> 3, at.z >> 3});
  if (slot == fusion::BlockDirectory::kNone) return {};
  const VoxelBlock& block = volume.block(slot);
  const int z = at.z & 7, bit = (at.y & 7) * 8 + (at.x & 7);
  const auto is_set = [&](const VoxelBlock::Bits& bits) { return (bits[z] >> bit & 1) != 0; };
  return {is_set(block.seen), is_set(block.inside), is_set(block.near)};
}

/// Whether a cell can hold triangles: all of it was seen, and no depth edge is cut there.
bool can_hold_surface(const VoxelVolume& volume, Vec3i cell, DepthEdges edges) {
  std::array<Voxel, 8> corners;
  for (int c = 0; c < 8; ++c) {
    corners[c] = voxel_at(volume, cell + Vec3i{c & 1, c >> 1 & 1, c >> 2});
    if (!corners[c].seen) return false;
  }
  for (int c = 0; c < 8 && edges == DepthEdges::cut; ++c)
    for (const int step : {1, 2, 4}) {
      const Voxel &a = corners[c], &b = corners[c | step];
      if (a.inside != b.inside && !(a.near && b.near)) return false;
    }
  return true;
}

// --- what may be wrong with a mesh

using Edge = std::array<std::uint32_t, 2>;

/// All edges as their triangles run through them, sorted.
std::vector<Edge> directed_edges(const Mesh& mesh) {
  std::vector<Edge> out;
  out.reserve(3 * mesh.triangles.size());
  for (const Triangle& t : mesh.triangles)
    for (int i = 0; i < 3; ++i) out.push_back({t[i], t[(i + 1) % 3]});
  std::sort(out.begin(), out.end());
  return out;
}

/// Edges of one triangle only.
std::vector<Edge> border(const Mesh& mesh) {
  const auto edges = directed_edges(mesh);
  std::vector<Edge> out;
  for (const Edge& e : edges)
    if (!std::binary_search(edges.begin(), edges.end(), Edge{e[1], e[0]})) out.push_back(e);
  return out;
}

template <typename T>
std::size_t count_repeated(std::vector<T> values) {
  std::sort(values.begin(), values.end());
  const auto end = std::unique(values.begin(), values.end());
  return static_cast<std::size_t>(values.end() - end);
}

struct Faults {
  std::size_t repeated_corner = 0, no_area = 0, doubled = 0, shared_by_many = 0, badly_wound = 0,
              unused = 0, same_place = 0;

  friend bool operator==(const Faults&, const Faults&) = default;
  friend std::ostream& operator<<(std::ostream& out, const Faults& f) {
    return out << "repeated corner " << f.repeated_corner << ", no area " << f.no_area
               << ", doubled " << f.doubled << ", edges of many " << f.shared_by_many
               << ", badly wound " << f.badly_wound << ", unused " << f.unused << ", same place "
               << f.same_place;
  }
};

Faults faults_of(const Mesh& mesh) {
  Faults faults;
  std::vector<Triangle> sorted = mesh.triangles;
  std::vector<bool> used(mesh.positions.size(), false);
  for (std::size_t t = 0; t < sorted.size(); ++t) {
    Triangle& corners = sorted[t];
    std::sort(corners.begin(), corners.end());
    faults.repeated_corner += corners[0] == corners[1] || corners[1] == corners[2];
    faults.no_area += !(length(mesh.area_normal(t)) > 0);
    for (const std::uint32_t v : corners) used[v] = true;
  }
  faults.doubled = count_repeated(std::move(sorted));
  faults.unused = static_cast<std::size_t>(std::count(used.begin(), used.end(), false));
  // Each edge at most once in each direction: so no more than two triangles share it.
  faults.badly_wound = count_repeated(directed_edges(mesh));
  faults.shared_by_many = kit::count_nonmanifold_edges(mesh);
  faults.same_place = count_repeated(mesh.positions);
  return faults;
}

/// Border edges between two cells that both can hold surface.
std::size_t count_cracks(const VoxelVolume& volume, const Mesh& mesh, DepthEdges edges) {
  const double voxel_m = volume.config().voxel_m;
  std::size_t cracks = 0;
  for (const Edge& edge : border(mesh)) {
    const auto cells = shared_cells(grid_edge(mesh.positions[edge[0]], voxel_m),
                                    grid_edge(mesh.positions[edge[1]], voxel_m));
    cracks += cells.size() < 2 || std::all_of(cells.begin(), cells.end(), [&](Vec3i cell) {
                return can_hold_surface(volume, cell, edges);
              });
  }
  return cracks;
}

/// Triangles whose normal, summed over those around each vertex, points to the inside there.
/// Vertices at which the field is flat may turn; whole sheets may not.
double turned_area_share(const VoxelVolume& volume, const Mesh& mesh) {
  double turned = 0, all = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vec3f normal = mesh.area_normal(t);
    float outward = 0;
    for (int i = 0; i < 3; ++i) {
      const GridEdge edge = grid_edge(mesh.corner(t, i), volume.config().voxel_m);
      outward += normal[edge.axis] * (voxel_at(volume, edge.low).inside ? 1.0f : -1.0f);
    }
    all += length(normal);
    if (outward <= 0) turned += length(normal);
  }
  return turned / all;
}

// --- scenes

struct Shot {
  std::string name;
  Camera camera;
  Pose pose;
  ImageDepth depth;
  fusion::VolumeConfig volume;
};

fusion::VolumeConfig surface_volume(double voxel_m, double truncation_m, double chunk_m = 0) {
  fusion::VolumeConfig config;
  config.voxel_m = voxel_m, config.truncation_m = truncation_m, config.chunk_m = chunk_m;
  config.history = History::none;
  return config;
}

Shot shot(std::string name, const test::Solids& solids, const Camera& camera, double noise_m,
          const fusion::VolumeConfig& volume, const Pose& pose = test::tilted_pose()) {
  return {std::move(name), camera, pose,
          test::with_noise(test::depth_picture(solids, camera, pose), noise_m, 1), volume};
}

std::vector<Shot> shots() {
  const test::Solids room = test::furnished_room();
  const test::Solids ball{{}, {}, {{{0.13, 0.09, 0.37}, 0.1}}};
  const test::Solids boxes{
      {},
      {Box3d{{-0.4, -0.3, 1.2}, {0.1, 0.3, 1.5}}, Box3d{{0.2, -0.4, 0.9}, {0.5, 0.4, 1.4}}},
      {}};
  const Camera camera = test::pinhole(80, 60, 65);
  std::vector<Shot> out;
  out.push_back(shot("noisy room, 2 cm", room, camera, 0.004, surface_volume(0.02, 0.08)));
  out.push_back(shot("noisy room, 5 cm", room, camera, 0.004, surface_volume(0.05, 0.2, 0.33)));
  out.push_back(shot("ball, 2 mm", ball, camera, 0.0005, surface_volume(0.002, 0.008),
                     test::tilted_pose({0.07, -0.08, 0.01})));
  out.push_back(shot("boxes, 1 cm", boxes, camera, 0.001, surface_volume(0.01, 0.03, 0.3)));
  out.push_back(
      shot("panorama, 8 cm", room, test::panorama(96, 48), 0.004, surface_volume(0.08, 0.3)));
  out.push_back(
      shot("panorama, 5 cm", room, test::panorama(96, 48), 0.004, surface_volume(0.05, 0.2)));
  out.push_back(
      shot("lidar, 5 cm", room, test::lidar(128, 24, 40, 40), 0.01, surface_volume(0.05, 0.2)));
  Shot noise =
      shot("random depth, 1 cm", {}, test::pinhole(48, 40, 60), 0, surface_volume(0.01, 0.04));
  noise.depth = test::random_depth(48, 40, 0.2, 0.6, 3);
  out.push_back(noise);
  noise.name = "random depth, 5 cm", noise.volume = surface_volume(0.05, 0.3, 0.17);
  noise.depth = test::random_depth(48, 40, 0.5, 2, 4);
  out.push_back(noise);
  return out;
}

fusion::DepthFrame frame_of(const Shot& s) {
  return {s.depth, s.camera, s.pose, test::whole(s.depth), {}};
}

TEST(Surface, IsACleanMeshInEveryScene) {
  for (const Shot& s : shots())
    for (const DepthEdges edges : {DepthEdges::cut, DepthEdges::bridge})
      for (const History history : {History::none, History::average}) {
        SCOPED_TRACE(s.name + (edges == DepthEdges::cut ? ", cut" : ", bridged") +
                     (history == History::none ? "" : ", averaged"));
        fusion::VolumeConfig config = s.volume;
        config.history = history;
        VoxelVolume volume(config);
        ASSERT_TRUE(volume.integrate(frame_of(s)).usable);
        const Mesh mesh = fusion::extract_surface(volume, edges);
        // Random depth has next to nothing but edges.
        const bool nothing_but_edges = s.name.starts_with("random") && edges == DepthEdges::cut;
        ASSERT_GT(mesh.triangles.size(), nothing_but_edges ? 0u : 500u);
        EXPECT_EQ(faults_of(mesh), Faults{});
        EXPECT_EQ(count_cracks(volume, mesh, edges), 0u);
        EXPECT_LT(turned_area_share(volume, mesh), 1e-3);
      }
}

TEST(Surface, FacesTheSensor) {
  // Voxels at least as far apart as pixels: else steps between pixels show.
  const test::Solids room = test::furnished_room();
  const Camera camera = test::pinhole(240, 180, 200);
  for (const Shot& s :
       {shot("room", room, camera, 0, surface_volume(0.02, 0.08)),
        shot("noisy room", room, camera, 0.002, surface_volume(0.03, 0.12)),
        shot("panorama", room, test::panorama(256, 128), 0, surface_volume(0.05, 0.2)),
        shot("lidar", room, test::lidar(256, 64, 40, 40), 0, surface_volume(0.05, 0.2))}) {
    VoxelVolume volume(s.volume);
    volume.integrate(frame_of(s));
    const Mesh mesh = fusion::extract_surface(volume);
    ASSERT_GT(mesh.triangles.size(), 1000u) << s.name;
    const Vec3f eye = vec_cast<float>(s.pose.translation);
    double away = 0;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
      if (dot(mesh.area_normal(t), mesh.centroid(t) - eye) > 0)
        away += length(mesh.area_normal(t)) / 2;
    EXPECT_LT(away, 0.005 * surface_area_m2(mesh)) << s.name;
  }
}

TEST(Surface, SphereSeenFromAllSidesIsClosed) {
  const Vec3d center{0.031, -0.017, 0.043};
  test::Solids solids{Box3d{{-3, -3, -3}, {3, 3, 3}}, {}, {{center, 0.31}}};
  const Camera camera = test::pinhole(160, 160, 160);
  fusion::VolumeConfig config = surface_volume(0.01, 0.04);
  config.history = History::average;
  config.bounds = Box3d{{-0.6, -0.6, -0.6}, {0.6, 0.6, 0.6}};
  VoxelVolume volume(config);
  for (int side = 0; side < 6; ++side) {
    Vec3d off{0.02, 0.03, 0.05};
    off[side / 2] += side % 2 == 0 ? 1.5 : -1.5;
    const Pose pose =
        look_at(center + off, center, off.y * off.y > 1 ? Vec3d{1, 0, 0} : Vec3d{0, -1, 0});
    const ImageDepth depth = test::depth_picture(solids, camera, pose);
    ASSERT_EQ(volume.integrate({depth, camera, pose, test::whole(depth), {}}).left_out_blocks, 0u);
  }
  const Mesh mesh = fusion::extract_surface(volume);
  EXPECT_EQ(faults_of(mesh), Faults{});
  EXPECT_EQ(border(mesh).size(), 0u);
  const auto count = [](std::size_t n) { return static_cast<long>(n); };
  EXPECT_EQ(count(mesh.positions.size()) - count(3 * mesh.triangles.size() / 2) +
                count(mesh.triangles.size()),
            2);  // Euler characteristic: one sphere
  double worst = 0;
  for (const Vec3f p : mesh.positions)
    worst = std::max(worst, std::abs(length(vec_cast<double>(p) - center) - 0.31));
  EXPECT_LT(worst, 0.015);
}

TEST(Surface, StaysItselfWhenTheGridIsMoved) {
  // Moved by a fraction of a block: other blocks, other borders, the same surface.
  const test::Solids room = test::furnished_room();
  const Camera camera = test::pinhole(120, 90, 98);
  std::vector<double> areas, borders;
  for (const Vec3d moved : {Vec3d{}, Vec3d{0.15, 0, 0}, Vec3d{0.03, 0.09, -0.06}}) {
    Shot s = shot("", room, camera, 0, surface_volume(0.03, 0.12));
    s.pose.translation = s.pose.translation + moved;
    VoxelVolume volume(s.volume);
    volume.integrate(frame_of(s));
    const Mesh mesh = fusion::extract_surface(volume);
    areas.push_back(surface_area_m2(mesh));
    borders.push_back(static_cast<double>(border(mesh).size()));
  }
  for (std::size_t i = 1; i < areas.size(); ++i) {
    // Whole surface_volume, so nothing but rounding differs.
    EXPECT_NEAR(areas[i] / areas[0], 1, 2e-3);
    EXPECT_NEAR(borders[i] / borders[0], 1, 2e-2);
  }
}

// --- chunks

void expect_pieces_cover(const Surface& surface) {
  std::uint32_t vertices = 0, triangles = 0;
  std::set<Vec3i> cubes;
  for (const SurfacePiece& piece : surface.pieces) {
    EXPECT_EQ(piece.first_vertex, vertices);
    EXPECT_EQ(piece.first_triangle, triangles);
    EXPECT_TRUE(cubes.insert(piece.cube).second);
    vertices += piece.vertices, triangles += piece.triangles;
  }
  EXPECT_EQ(vertices, surface.mesh.positions.size());
  EXPECT_EQ(triangles, surface.mesh.triangles.size());
}

/// Blocks belong to the cube of their middle: up to half of one may lie outside.
void expect_inside_its_cube(const SurfacePiece& piece, const Surface& surface,
                            const fusion::VolumeConfig& config) {
  const double reach_m = VoxelBlock::kSide / 2 * config.voxel_m + 1e-6;
  std::size_t outside = 0;
  for (std::uint32_t t = piece.first_triangle; t < piece.first_triangle + piece.triangles; ++t)
    for (int axis = 0; axis < 3 && config.chunk_m > 0; ++axis) {
      const double low_m = piece.cube[axis] * config.chunk_m, at_m = surface.mesh.centroid(t)[axis];
      outside += at_m < low_m - reach_m || at_m > low_m + config.chunk_m + reach_m;
    }
  EXPECT_EQ(outside, 0u) << "cube " << piece.cube.x << ' ' << piece.cube.y << ' ' << piece.cube.z;
}

TEST(Chunks, PiecesCoverTheSurfaceCubeByCubeWhateverTheirSize) {
  Shot s = shot("", test::furnished_room(), test::pinhole(96, 72, 80), 0.004,
                surface_volume(0.03, 0.12));
  for (const double chunk_m : {0.0, 0.16, 0.11, 0.5, 0.777, 100.0}) {
    SCOPED_TRACE(chunk_m);
    s.volume.chunk_m = chunk_m;
    VoxelVolume volume(s.volume);
    volume.integrate(frame_of(s));
    Surface surface;
    MarchingCubes().run(volume, surface);
    ASSERT_FALSE(surface.pieces.empty());
    // The cubes meet at the origin, which lies inside the room.
    const std::size_t least = chunk_m > 0 && chunk_m < 1 ? 9 : 1;
    const std::size_t most = chunk_m == 0 ? 1 : chunk_m < 1 ? 1000000 : 8;
    EXPECT_GE(surface.pieces.size(), least);
    EXPECT_LE(surface.pieces.size(), most);
    expect_pieces_cover(surface);
    for (const SurfacePiece& piece : surface.pieces)
      expect_inside_its_cube(piece, surface, s.volume);
  }
}

}  // namespace
}  // namespace mr
