#include "mr/simplify/spatial_order.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include "mr/simplify/working_mesh.h"

namespace mr::simplify {

namespace {

constexpr int kBits = 5;  // per axis
constexpr float kMostSpanning = 0.3f;
constexpr std::size_t kSampleStep = 16;

std::uint32_t spread(std::uint32_t x) {
  std::uint32_t out = 0;
  for (int bit = 0; bit < kBits; ++bit) out |= (x >> bit & 1) << 3 * bit;
  return out;
}

/// [V] the cell of each vertex along the curve.
std::vector<std::uint32_t> cells_of(const std::vector<Vec3f>& positions) {
  Vec3f low = positions.front(), high = low;
  for (const Vec3f p : positions) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  const Vec3f size = high - low;
  const float per_m = (1 << kBits) / std::max({size.x, size.y, size.z, 1e-6f});
  const auto cell = [&](float at, float from) {
    return spread(std::min(static_cast<std::uint32_t>((at - from) * per_m), (1u << kBits) - 1));
  };
  std::vector<std::uint32_t> out;
  out.reserve(positions.size());
  for (const Vec3f p : positions)
    out.push_back(cell(p.x, low.x) | cell(p.y, low.y) << 1 | cell(p.z, low.z) << 2);
  return out;
}

}  // namespace

bool is_scattered(const Mesh& mesh) {
  if (mesh.positions.size() <= WorkingMesh::kRange) return false;
  std::size_t seen = 0, spanning = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); t += kSampleStep) {
    const auto& [a, b, c] = mesh.triangles[t];
    const auto range = [](std::uint32_t v) { return v / WorkingMesh::kRange; };
    ++seen, spanning += range(a) != range(b) || range(b) != range(c);
  }
  return static_cast<float>(spanning) > kMostSpanning * static_cast<float>(seen);
}

ReorderedMesh sort_in_space(const Mesh& mesh, std::span<const float> weights) {
  const std::vector<std::uint32_t> cells = cells_of(mesh.positions);
  std::vector<std::uint32_t> next((1u << 3 * kBits) + 1, 0);
  for (const std::uint32_t cell : cells) ++next[cell];
  std::uint32_t sum = 0;
  for (std::uint32_t& n : next) sum += std::exchange(n, sum);
  std::vector<std::uint32_t> number(cells.size());
  ReorderedMesh out;
  out.mesh.positions.resize(cells.size()), out.weights.resize(weights.size());
  for (std::size_t v = 0; v < cells.size(); ++v) {
    const std::uint32_t to = number[v] = next[cells[v]]++;
    out.mesh.positions[to] = mesh.positions[v];
    if (!weights.empty()) out.weights[to] = weights[v];
  }
  out.mesh.triangles = mesh.triangles;
  for (Triangle& triangle : out.mesh.triangles)
    for (std::uint32_t& v : triangle) v = number[v];
  return out;
}

}  // namespace mr::simplify
