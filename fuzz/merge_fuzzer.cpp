// Overlap removal, islands and zipping of any small parts: what comes out is a mesh, and a manifold
// one.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <utility>
#include <vector>

#include "mr/merge/holes/close_holes.h"
#include "mr/merge/islands.h"
#include "mr/merge/overlap/overlap.h"
#include "mr/merge/seam/zipper.h"

namespace {

using namespace mr;
using kit::Part;
using merge::OverlapConfig;

/// Reads numbers from the input; zeros after its end.
class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}

  std::uint8_t byte() { return at_ < size_ ? data_[at_++] : 0; }
  std::uint32_t below(std::uint32_t n) { return byte() % n; }
  bool one_in(std::uint32_t n) { return below(n) == n - 1; }
  std::uint32_t word() {
    std::uint32_t out = 0;
    for (int i = 0; i < 4; ++i) out = out << 8 | byte();
    return out;
  }
  float between(float low, float high) {
    return low + (high - low) * static_cast<float>(byte()) / 255;
  }

 private:
  const std::uint8_t* data_;
  std::size_t size_, at_ = 0;
};

/// A grid before the cameras, on steps of 1 mm so that sheets may coincide; perhaps bumpy.
void add_grid(Input& in, Mesh& mesh) {
  const std::uint32_t nx = 1 + in.below(10), ny = 1 + in.below(10);
  const float left_m = in.between(-0.6f, 0.3f), top_m = in.between(-0.6f, 0.3f);
  const float depth_m = 2 + 0.001f * static_cast<float>(in.below(40));
  const float cell_m = in.one_in(2) ? 0.05f : in.between(0.001f, 0.3f);
  const float bumps_m = in.one_in(2) ? in.between(0, 0.02f) : 0, slope = in.between(-1.5f, 1.5f);
  const bool slanted = in.one_in(3);
  const auto base = static_cast<std::uint32_t>(mesh.positions.size());
  for (std::uint32_t y = 0; y <= ny; ++y)
    for (std::uint32_t x = 0; x <= nx; ++x) {
      const float u = cell_m * static_cast<float>(x), v = cell_m * static_cast<float>(y);
      const float bump = bumps_m > 0 ? in.between(-bumps_m, bumps_m) : 0;
      mesh.positions.push_back({left_m + u, top_m + v, depth_m + bump + (slanted ? slope * u : 0)});
    }
  const auto at = [&](std::uint32_t x, std::uint32_t y) { return base + y * (nx + 1) + x; };
  for (std::uint32_t y = 0; y < ny; ++y)
    for (std::uint32_t x = 0; x < nx; ++x) {
      mesh.triangles.push_back({at(x, y), at(x + 1, y + 1), at(x + 1, y)});
      mesh.triangles.push_back({at(x, y), at(x, y + 1), at(x + 1, y + 1)});
    }
}

/// Spoils a mesh here and there; corners stay vertices and positions finite, as a caller promises.
void edit(Input& in, Mesh& mesh) {
  if (mesh.triangles.empty()) return;
  const auto vertices = static_cast<std::uint32_t>(mesh.positions.size());
  const std::size_t t = in.word() % mesh.triangles.size();
  Triangle& triangle = mesh.triangles[t];
  Vec3f& position = mesh.positions[in.word() % vertices];
  switch (in.below(9)) {
    case 0:
      triangle[in.below(3)] = in.word() % vertices;
      break;
    case 1:
      std::swap(triangle[0], triangle[1]);
      break;
    case 2:
      mesh.triangles.push_back(Triangle(triangle));
      break;
    case 3:
      mesh.triangles.push_back({triangle[1], triangle[0], in.word() % vertices});
      break;
    case 4:
      position = mesh.positions[in.word() % vertices];
      break;
    case 5:
      position = position +
                 Vec3f{in.between(-0.2f, 0.2f), in.between(-0.2f, 0.2f), in.between(-0.5f, 0.5f)};
      break;
    case 6:
      position = Vec3f{in.between(-10, 10), in.between(-10, 10), in.between(-10, 10)};
      break;
    default:
      mesh.triangles.erase(mesh.triangles.begin() + static_cast<std::ptrdiff_t>(t));
      break;
  }
}

SourceInfo any_source(Input& in, std::uint32_t sensor) {
  SourceInfo out;
  out.sensor = SensorId{sensor};
  Camera& c = out.depth_camera;
  c.width = 24, c.height = 20, c.fx = c.fy = 20, c.cx = 11.5, c.cy = 9.5;
  const std::uint32_t kind = in.below(8);
  if (kind == 6) c.model = CameraModel::equirectangular;
  if (kind == 7) {
    c.model = CameraModel::lidar;
    for (int row = 0; row < c.height; ++row) c.beam_altitude_rad.push_back(0.5 - 0.05 * row);
    c.beam_azimuth_rad.assign(20, 0);
  }
  const Vec3d eye{in.between(-1, 1), in.between(-1, 1), in.between(-1, 2.5f)};
  const Vec3d target{in.between(-0.5f, 0.5f), in.between(-0.5f, 0.5f), 3};
  out.T_world_depth = look_at(eye, target, {0, -1, 0});
  out.precision = {in.between(0, 0.01f), in.between(0, 0.002f)};
  return out;
}

Part any_part(Input& in, std::uint32_t number) {
  Part part;
  for (std::uint32_t grids = in.below(3); grids > 0; --grids) add_grid(in, part.mesh);
  if (in.one_in(2))
    for (std::uint32_t edits = in.below(12); edits > 0; --edits) edit(in, part.mesh);
  part.error_m = in.between(0, 0.01f);
  const std::uint32_t sources = 1 + in.below(2);
  for (std::uint32_t i = 0; i < sources; ++i)
    part.sources.push_back(any_source(in, 2 * number + i));
  if (in.one_in(3)) {
    std::vector<SensorId> sensors;
    const std::uint32_t block = 1 + in.below(30);
    for (std::uint32_t t = 0; t < part.mesh.triangles.size(); ++t)
      sensors.push_back(t / block % 3 == 2 ? kNoSensor : SensorId{2 * number + t / block % 3});
    set_triangle_sensors(part.mesh, sensors);
  }
  return part;
}

OverlapConfig any_config(Input& in) {
  OverlapConfig out;
  out.owner = in.one_in(2) ? merge::MergeConfig::Owner::paper : merge::MergeConfig::Owner::coherent;
  out.overlap =
      in.one_in(2) ? merge::MergeConfig::Overlap::rays : merge::MergeConfig::Overlap::raster;
  out.voxel_m = in.between(0.005f, 0.1f);
  out.calibration_error_m = in.between(0, 0.03f);
  return out;
}

void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "not so: %s\n", what);
  std::abort();
}

void require_whole(const Mesh& mesh) {
  for (const Triangle& t : mesh.triangles)
    for (const std::uint32_t v : t) require(v < mesh.positions.size(), "corners are vertices");
  for (const Vec3f p : mesh.positions) require(is_finite(p), "positions are finite");
}

/// Edges that more than two triangles share, or that two have in the same direction.
std::size_t count_bad_edges(const Mesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> uses, ways;
  for (const Triangle& t : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t a = t[i], b = t[(i + 1) % 3];
      ++uses[std::minmax(a, b)], ++ways[{a, b}];
    }
  std::size_t bad = 0;
  for (const auto& [edge, count] : uses) bad += count > 2;
  for (const auto& [edge, count] : ways) bad += count > 1;
  return bad;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input in(data, size);
  const OverlapConfig config = any_config(in);
  std::vector<Part> parts;
  const std::uint32_t count = 1 + (in.one_in(4) ? in.below(10) : in.below(4));
  for (std::uint32_t i = 0; i < count; ++i) parts.push_back(any_part(in, i));
  std::size_t bad_before = 0;
  for (const Part& part : parts) bad_before += count_bad_edges(part.mesh);

  const std::vector<Mesh> owned = merge::remove_overlap(parts, config);
  require(owned.size() == parts.size(), "one mesh per part");
  for (const Mesh& mesh : owned) {
    require_whole(mesh);
    require(bad_before > 0 || count_bad_edges(mesh) == 0, "removal makes no non-manifold edge");
  }
  const Mesh zipped = merge::zip(owned, merge::zipper_config(config.voxel_m));
  require_whole(zipped);
  require(bad_before > 0 || count_bad_edges(zipped) == 0, "zipping makes no non-manifold edge");
  Mesh closed = zipped;
  merge::close_holes(closed, parts, {.fill_m = 10 * config.voxel_m, .voxel_m = config.voxel_m});
  require_whole(closed);
  require(bad_before > 0 || count_bad_edges(closed) == 0, "closed holes make no such edge");
  require_whole(merge::remove_islands(zipped, merge::island_area_m2(config.voxel_m)));
  return 0;
}
