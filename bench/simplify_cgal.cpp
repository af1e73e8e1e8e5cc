#include <CGAL/Polygon_mesh_processing/orient_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Bounded_normal_change_filter.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/GarlandHeckbert_plane_policies.h>
#include <CGAL/Surface_mesh_simplification/edge_collapse.h>

#include "simplify_contenders.h"
#include "surfaces.h"

namespace mr::bench {
namespace {

namespace sms = CGAL::Surface_mesh_simplification;
namespace pmp = CGAL::Polygon_mesh_processing;
using Kernel = CGAL::Simple_cartesian<double>;
using TheirMesh = CGAL::Surface_mesh<Kernel::Point_3>;

/// Its own predicates count edges, of which a mesh with borders has no fixed number.
struct EnoughTriangles {
  std::size_t triangles;

  template <typename Cost, typename Profile>
  bool operator()(const Cost&, const Profile& profile, std::size_t, std::size_t) const {
    return profile.surface_mesh().number_of_faces() <= triangles;
  }
};

/// It takes manifolds only: where triangles meet in a vertex, or more than two in an edge, they
/// come apart; nothing is dropped.
TheirMesh manifold(const Mesh& mesh) {
  std::vector<Kernel::Point_3> points;
  for (const Vec3f p : mesh.positions) points.emplace_back(p.x, p.y, p.z);
  std::vector<std::vector<std::size_t>> triangles;
  for (const Triangle& t : mesh.triangles) triangles.push_back({t[0], t[1], t[2]});
  pmp::orient_polygon_soup(points, triangles);
  TheirMesh out;
  pmp::polygon_soup_to_polygon_mesh(points, triangles, out);
  return out;
}

/// By planes, as in the paper: its rules by triangle, weighted by area, err more than twice as much
/// on frames of a depth camera. It works in place: the copy is not timed.
class Cgal final : public Work {
 public:
  explicit Cgal(const SimplifyCase& input) : input_(input), mesh_(manifold(*input.mesh)) {}

  void clear() override { small_ = mesh_; }

  void run(StageClock&) override {
    const sms::GarlandHeckbert_plane_policies<TheirMesh, Kernel> rules(small_);
    sms::edge_collapse(small_, EnoughTriangles{input_.triangles},
                       CGAL::parameters::get_cost(rules.get_cost())
                           .get_placement(rules.get_placement())
                           .filter(sms::Bounded_normal_change_filter<>()));
  }

  Message result() override {
    small_.collect_garbage();
    Mesh mesh;
    for (const auto v : small_.vertices()) {
      const auto& p = small_.point(v);
      mesh.positions.push_back(vec_cast<float>(Vec3d{p.x(), p.y(), p.z()}));
    }
    for (const auto f : small_.faces()) {
      Triangle& triangle = mesh.triangles.emplace_back();
      int corner = 0;
      for (const auto v : small_.vertices_around_face(small_.halfedge(f)))
        triangle[corner++] = static_cast<std::uint32_t>(v.idx());
    }
    Message out = to_message(mesh);
    out["vertices_doubled"] = mesh_.number_of_vertices() - input_.mesh->positions.size();
    return out;
  }

 private:
  const SimplifyCase& input_;
  const TheirMesh mesh_;
  TheirMesh small_;
};

}  // namespace

bool has_cgal() { return true; }

std::vector<Contender> simplify_cgal(const SimplifyCase& input) {
  return {{"cgal", 1, Message::object(), [&input] { return std::make_unique<Cgal>(input); }}};
}

}  // namespace mr::bench
