#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>

#include "mr/core/parallel.h"
#include "simplify_contenders.h"
#include "surfaces.h"

namespace mr::bench {
namespace {

constexpr float kNoErrorLimit = 1e9f;  // in sizes of the mesh; the square of it is finite
constexpr std::size_t kPatchVertices = 25'000;
constexpr std::uint32_t kNone = 0xFFFFFFFFu;

using Indices = std::vector<std::uint32_t>;

Indices corners_of(const Mesh& mesh) {
  Indices out;
  out.reserve(mesh.triangles.size() * 3);
  for (const Triangle& t : mesh.triangles) out.insert(out.end(), t.begin(), t.end());
  return out;
}

/// The vertices that the triangles use, and those; what meshopt_optimizeVertexFetch() is for.
Mesh with_corners(const std::vector<Vec3f>& positions, const Indices& corners) {
  Mesh mesh;
  std::vector<std::uint32_t> place(positions.size(), kNone);
  for (std::size_t c = 0; c < corners.size(); ++c) {
    std::uint32_t& v = place[corners[c]];
    if (v == kNone) {
      v = static_cast<std::uint32_t>(mesh.positions.size());
      mesh.positions.push_back(positions[corners[c]]);
    }
    if (c % 3 == 0) mesh.triangles.emplace_back();
    mesh.triangles.back()[c % 3] = v;
  }
  return mesh;
}

Indices simplified(const Indices& corners, const std::vector<Vec3f>& positions,
                   std::size_t triangles, unsigned int options) {
  Indices out(corners.size());
  out.resize(meshopt_simplify(out.data(), corners.data(), corners.size(), &positions.data()->x,
                              positions.size(), sizeof(Vec3f), triangles * 3, kNoErrorLimit,
                              options, nullptr));
  return out;
}

/// Timed to the new list of corners: that it leaves unused vertices to another call is its way.
class Whole final : public Work {
 public:
  explicit Whole(const SimplifyCase& input) : input_(input), corners_(corners_of(*input.mesh)) {}

  void clear() override { small_ = {}; }
  void run(StageClock&) override {
    small_ = simplified(corners_, input_.mesh->positions, input_.triangles, 0);
  }
  Message result() override { return to_message(with_corners(input_.mesh->positions, small_)); }

 private:
  const SimplifyCase& input_;
  const Indices corners_;
  Indices small_;
};

/// Corners in a row of the mesh, with numbers of their own.
struct Patch {
  Indices vertices, corners;  ///< vertices: their numbers in the mesh
};

std::vector<Patch> cut_into_patches(const Mesh& mesh) {
  std::vector<Patch> out(1);
  std::vector<std::uint32_t> place(mesh.positions.size(), kNone);  // in the last patch
  for (const Triangle& triangle : mesh.triangles) {
    if (out.back().vertices.size() + 3 > kPatchVertices) {
      for (const std::uint32_t v : out.back().vertices) place[v] = kNone;
      out.emplace_back();
    }
    Patch& patch = out.back();
    for (const std::uint32_t v : triangle) {
      if (place[v] == kNone) {
        place[v] = static_cast<std::uint32_t>(patch.vertices.size());
        patch.vertices.push_back(v);
      }
      patch.corners.push_back(place[v]);
    }
  }
  return out;
}

/// Every patch to the same share of its triangles. Vertices only vanish, and those of a border not
/// even that: patches fit together as they are.
class Patches final : public Work {
 public:
  Patches(const SimplifyCase& input, int threads) : input_(input), arena_(threads) {}

  void clear() override { small_ = {}; }

  void run(StageClock& clock) override {
    arena_.run([&] {
      const std::vector<Patch> patches = cut_into_patches(*input_.mesh);
      clock.lap("cut");
      std::vector<Indices> parts(patches.size());
      parallel_for(patches.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) parts[i] = simplify(patches[i]);
      });
      clock.lap("simplify");
      for (const Indices& part : parts) small_.insert(small_.end(), part.begin(), part.end());
      clock.lap("join");
    });
  }

  Message result() override { return to_message(with_corners(input_.mesh->positions, small_)); }

 private:
  Indices simplify(const Patch& patch) const {
    const double share =
        static_cast<double>(input_.triangles) / static_cast<double>(input_.mesh->triangles.size());
    const double triangles = std::ceil(share * static_cast<double>(patch.corners.size()) / 3);
    std::vector<Vec3f> positions;
    positions.reserve(patch.vertices.size());
    for (const std::uint32_t v : patch.vertices) positions.push_back(input_.mesh->positions[v]);
    Indices corners = simplified(patch.corners, positions, static_cast<std::size_t>(triangles),
                                 meshopt_SimplifyLockBorder);
    for (std::uint32_t& v : corners) v = patch.vertices[v];
    return corners;
  }

  const SimplifyCase& input_;
  Arena arena_;
  Indices small_;
};

}  // namespace

bool has_meshoptimizer() { return true; }

std::vector<Contender> simplify_meshoptimizer(const SimplifyCase& input,
                                              const std::vector<int>& threads) {
  std::vector<Contender> out{
      {"meshoptimizer", 1, Message::object(), [&input] { return std::make_unique<Whole>(input); }}};
  for (const int n : threads)
    out.push_back({"meshoptimizer/patches", n, Message{{"patch_vertices", kPatchVertices}},
                   [&input, n] { return std::make_unique<Patches>(input, n); }});
  return out;
}

}  // namespace mr::bench
