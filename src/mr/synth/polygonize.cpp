#include "mr/synth/polygonize.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "mr/core/parallel.h"

namespace mr::synth {
namespace {

constexpr std::uint32_t kNone = 0xFFFFFFFFu;
constexpr int kBlock = 4;  // nodes per side that one evaluation of the distance may decide
constexpr double kSteepest = 1.4;
constexpr int kRelaxRounds = 4;

/// Distances at the nodes of a grid.
struct DistanceGrid {
  const Grid& grid;
  Vec3i size;
  std::vector<double> value;

  std::size_t node(int x, int y, int z) const {
    return (static_cast<std::size_t>(z) * size.y + y) * size.x + x;
  }
  Vec3d place(int x, int y, int z) const {
    return grid.T_person_grid * Vec3d{grid.planes[0][x], grid.planes[1][y], grid.planes[2][z]};
  }
};

/// Fills a block; where its centre is far from the surface all nodes get the centre's distance.
void sample_block(const DistanceFunction& distance, DistanceGrid& distances, Vec3i low) {
  const Vec3i high = min(low + Vec3i{kBlock, kBlock, kBlock}, distances.size);
  const Vec3d first = distances.place(low.x, low.y, low.z),
              last = distances.place(high.x - 1, high.y - 1, high.z - 1);
  const double middle = distance((first + last) * 0.5);
  const bool far_away = std::abs(middle) > kSteepest * 0.5 * length(last - first) + 0.012;
  for (int z = low.z; z < high.z; ++z)
    for (int y = low.y; y < high.y; ++y)
      for (int x = low.x; x < high.x; ++x)
        distances.value[distances.node(x, y, z)] =
            far_away ? middle : distance(distances.place(x, y, z));
}

DistanceGrid sample(const DistanceFunction& distance, const Grid& grid) {
  const auto count = [&](int axis) { return static_cast<std::int32_t>(grid.planes[axis].size()); };
  DistanceGrid distances{grid, {count(0), count(1), count(2)}, {}};
  const Vec3i size = distances.size;
  distances.value.resize(static_cast<std::size_t>(size.x) * size.y * size.z);
  const int columns = (size.x + kBlock - 1) / kBlock, rows = (size.y + kBlock - 1) / kBlock,
            layers = (size.z + kBlock - 1) / kBlock;
  const auto blocks = static_cast<std::size_t>(columns) * rows * layers;
  parallel_for(blocks, 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const int b = static_cast<int>(i);
      sample_block(
          distance, distances,
          {b % columns * kBlock, b / columns % rows * kBlock, b / columns / rows * kBlock});
    }
  });
  return distances;
}

/// Corners of a cell are numbered by their bits: x + 2y + 4z. Faces counter-clockwise from outside.
constexpr std::array<std::array<int, 4>, 6> kFaces{
    {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}}};

/// The edge between two corners: its axis and lower corner, as 8 * axis + corner.
int cell_edge(int a, int b) {
  const int difference = a ^ b;
  return 8 * (difference == 1 ? 0 : difference == 2 ? 1 : 2) + std::min(a, b);
}

constexpr int kCellEdges = 24;  // room for 8 * axis + corner

/// For every crossed edge of a cell the next one around its polygon, by walking the faces: corners
/// inside are kept apart on ambiguous faces, so that neighbours agree.
std::array<int, kCellEdges> polygon_steps(unsigned inside) {
  std::array<int, kCellEdges> next;
  next.fill(-1);
  const auto is_in = [&](int corner) { return (inside >> corner & 1) != 0; };
  for (const auto& face : kFaces)
    for (int i = 0; i < 4; ++i) {
      const int before = face[(i + 3) % 4], here = face[i];
      if (is_in(before) || !is_in(here)) continue;
      int last = i;  // of the run of inside corners
      while (is_in(face[(last + 1) % 4])) ++last;
      next[cell_edge(before, here)] = cell_edge(face[last % 4], face[(last + 1) % 4]);
    }
  return next;
}

class MarchingCubes {
 public:
  explicit MarchingCubes(const DistanceGrid& distances)
      : distances_(distances), vertex_(3 * distances.value.size(), kNone) {}

  Mesh run() {
    const Vec3i size = distances_.size;
    for (int z = 0; z + 1 < size.z; ++z)
      for (int y = 0; y + 1 < size.y; ++y)
        for (int x = 0; x + 1 < size.x; ++x) cell(x, y, z);
    return std::move(mesh_);
  }

 private:
  double value(int x, int y, int z) const { return distances_.value[distances_.node(x, y, z)]; }

  void cell(int x, int y, int z) {
    unsigned inside = 0;
    for (int c = 0; c < 8; ++c)
      if (value(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)) < 0) inside |= 1u << c;
    if (inside == 0 || inside == 0xFF) return;
    auto next = polygon_steps(inside);
    for (int start = 0; start < kCellEdges; ++start) {
      if (next[start] < 0) continue;
      polygon_.clear();
      for (int edge = start; next[edge] >= 0;) {
        polygon_.push_back(vertex(x, y, z, edge));
        const int following = next[edge];
        next[edge] = -1;
        edge = following;
      }
      fill();
    }
  }

  /// Index of the vertex on an edge of the cell at (x, y, z).
  std::uint32_t vertex(int x, int y, int z, int edge) {
    const int axis = edge / 8, c = edge % 8;
    x += c & 1, y += c >> 1 & 1, z += c >> 2;
    std::uint32_t& index = vertex_[3 * distances_.node(x, y, z) + axis];
    if (index != kNone) return index;
    index = static_cast<std::uint32_t>(mesh_.positions.size());
    const int x2 = x + (axis == 0), y2 = y + (axis == 1), z2 = z + (axis == 2);
    const double from = value(x, y, z), to = value(x2, y2, z2);
    const double t = std::clamp(from / (from - to), 0.1, 0.9);
    mesh_.positions.push_back(
        vec_cast<float>(distances_.place(x, y, z) * (1 - t) + distances_.place(x2, y2, z2) * t));
    return index;
  }

  void fill() {
    const std::size_t n = polygon_.size();
    if (n <= 4) {
      for (std::size_t i = 2; i < n; ++i)
        mesh_.triangles.push_back({polygon_[0], polygon_[i - 1], polygon_[i]});
      return;
    }
    Vec3f sum;
    for (const auto v : polygon_) sum += mesh_.positions[v];
    const auto middle = static_cast<std::uint32_t>(mesh_.positions.size());
    mesh_.positions.push_back(sum / static_cast<float>(n));
    for (std::size_t i = 0; i < n; ++i)
      mesh_.triangles.push_back({middle, polygon_[i], polygon_[(i + 1) % n]});
  }

  const DistanceGrid& distances_;
  std::vector<std::uint32_t> vertex_;  ///< [3 * nodes] of the edge from a node along an axis
  Mesh mesh_;
  std::vector<std::uint32_t> polygon_;
};

/// Direction and slope of the distance, by four looks.
Vec3d gradient(const DistanceFunction& distance, Vec3d p) {
  constexpr double h = 5e-4;
  constexpr std::array<Vec3d, 4> kCorners{{{1, -1, -1}, {-1, -1, 1}, {-1, 1, -1}, {1, 1, 1}}};
  Vec3d sum;
  for (const Vec3d c : kCorners) sum += c * distance(p + c * h);
  return sum / (4 * h);
}

Vec3d onto_surface(const DistanceFunction& distance, Vec3d p, double most_m) {
  const Vec3d slope = gradient(distance, p);
  const double step = distance(p) / std::max(dot(slope, slope), 0.05);
  const Vec3d move = slope * -step;
  const double far = length(move);
  return p + (far > most_m ? move * (most_m / far) : move);
}

/// Moves vertices towards the middle of their neighbours, then back onto the surface.
void relax(const DistanceFunction& distance, Mesh& mesh, double most_m) {
  std::vector<Vec3f> sum(mesh.positions.size());
  std::vector<float> count(mesh.positions.size());
  for (const Triangle& t : mesh.triangles)
    for (int i = 0; i < 3; ++i) {
      sum[t[i]] += mesh.positions[t[(i + 1) % 3]] + mesh.positions[t[(i + 2) % 3]];
      count[t[i]] += 2;
    }
  parallel_for(sum.size(), 512, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      const Vec3f middle = sum[v] / count[v];
      const Vec3f p = mesh.positions[v] * 0.4f + middle * 0.6f;
      mesh.positions[v] = vec_cast<float>(onto_surface(distance, vec_cast<double>(p), most_m));
    }
  });
}

void add_planes(std::vector<double>& out, double to, double step) {
  const double from = out.back();
  const int n = std::max(1, static_cast<int>(std::ceil((to - from) / step - 1e-6)));
  for (int i = 1; i <= n; ++i) out.push_back(from + (to - from) * i / n);
}

}  // namespace

std::vector<double> planes(double low, double high, double step) {
  std::vector<double> out{low};
  add_planes(out, high, step);
  return out;
}

std::vector<double> planes(double low, double high, double coarse, double fine_low,
                           double fine_high, double fine) {
  std::vector<double> out{low};
  if (fine_low > low) add_planes(out, fine_low, coarse);
  add_planes(out, fine_high, fine);
  if (high > fine_high) add_planes(out, high, coarse);
  return out;
}

Mesh polygonize(const DistanceFunction& distance, const Grid& grid) {
  const DistanceGrid distances = sample(distance, grid);
  Mesh mesh = MarchingCubes(distances).run();
  const auto& x = grid.planes[0];
  const double most_m = (x.back() - x.front()) / static_cast<double>(x.size());
  for (int i = 0; i < kRelaxRounds; ++i) relax(distance, mesh, 0.5 * most_m);
  return mesh;
}

}  // namespace mr::synth
