#include <open3d/geometry/TriangleMesh.h>

#include <limits>
#include <memory>

#include "simplify_contenders.h"
#include "surfaces.h"

namespace mr::bench {
namespace {

using TheirMesh = open3d::geometry::TriangleMesh;

class SimplifyOpen3d final : public Work {
 public:
  explicit SimplifyOpen3d(const SimplifyCase& input) : input_(input) {
    for (const Vec3f p : input.mesh->positions) mesh_.vertices_.emplace_back(p.x, p.y, p.z);
    for (const Triangle& t : input.mesh->triangles)
      mesh_.triangles_.emplace_back(static_cast<int>(t[0]), static_cast<int>(t[1]),
                                    static_cast<int>(t[2]));
  }

  void clear() override { small_.reset(); }

  void run(StageClock&) override {
    constexpr double kBoundaryWeight = 1;  // its default
    small_ =
        mesh_.SimplifyQuadricDecimation(static_cast<int>(input_.triangles),
                                        std::numeric_limits<double>::infinity(), kBoundaryWeight);
  }

  Message result() override {
    Mesh mesh;
    for (const auto& p : small_->vertices_)
      mesh.positions.push_back(vec_cast<float>(Vec3d{p.x(), p.y(), p.z()}));
    for (const auto& t : small_->triangles_)
      mesh.triangles.push_back({static_cast<std::uint32_t>(t.x()),
                                static_cast<std::uint32_t>(t.y()),
                                static_cast<std::uint32_t>(t.z())});
    return to_message(mesh);
  }

 private:
  const SimplifyCase& input_;
  TheirMesh mesh_;
  std::shared_ptr<TheirMesh> small_;
};

}  // namespace

std::vector<Contender> simplify_open3d(const SimplifyCase& input) {
  return {{"open3d", 1, Message::object(),
           [&input] { return std::make_unique<SimplifyOpen3d>(input); }}};
}

}  // namespace mr::bench
