// Fusion of any depth from any camera, anywhere, under any configuration that problems() would let
// pass: what comes out is a mesh, in chunks that are meshes, and memory stays bounded.
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <optional>

#include "mr/fusion/fuse.h"

namespace {

using namespace mr;

/// Reads numbers from the input; zeros after its end.
class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}

  std::uint8_t byte() { return at_ < size_ ? data_[at_++] : 0; }
  int below(int n) { return byte() % n; }
  std::uint32_t word() {
    std::uint32_t out = 0;
    for (int i = 0; i < 4; ++i) out = out << 8 | byte();
    return out;
  }
  float any_float() { return std::bit_cast<float>(word()); }
  double between(double low, double high) { return low + (high - low) * byte() / 255.0; }
  /// Mostly sensible.
  double number(double low, double high) {
    return below(16) == 0 ? any_float() : between(low, high);
  }
  bool empty() const { return at_ >= size_; }

 private:
  const std::uint8_t* data_;
  std::size_t size_, at_ = 0;
};

Camera any_camera(Input& in) {
  Camera c;
  c.model = static_cast<CameraModel>(in.below(3));
  c.width = 1 + in.below(32), c.height = 1 + in.below(32);
  if (c.model == CameraModel::pinhole) {
    c.fx = in.number(0.1, 64), c.fy = in.number(0.1, 64);
    c.cx = in.number(0, c.width - 1), c.cy = in.number(0, c.height - 1);
  }
  if (c.model != CameraModel::lidar) return c;
  const int beams = in.below(16) == 0 ? in.below(40) : c.height;
  for (int y = 0; y < beams; ++y) {
    c.beam_altitude_rad.push_back(in.number(-1.6, 1.6));
    c.beam_azimuth_rad.push_back(in.number(-0.5, 0.5));
  }
  return c;
}

Pose any_pose(Input& in) {
  const Vec3d eye{in.number(-2, 2), in.number(-2, 2), in.number(-2, 2)};
  Pose pose = look_at(eye, eye + Vec3d{in.between(-1, 1), in.between(-1, 1), 1.5},
                      {in.between(-0.3, 0.3), -1, 0});
  if (in.below(16) == 0) pose.rotation.m[in.below(9)] = in.any_float();
  return pose;
}

ImageDepth any_depth(Input& in, const Camera& camera) {
  const bool other_size = in.below(32) == 0;
  ImageDepth depth(other_size ? in.below(33) : camera.width, camera.height);
  const int kind = in.below(4);
  const float flat = static_cast<float>(in.between(0.01, 5));
  for (float& d : depth.data) {
    if (kind == 0) d = in.any_float();
    if (kind == 1) d = static_cast<float>(in.between(0, 3));
    if (kind == 2) d = flat + static_cast<float>(in.between(0, 0.1));
    if (kind == 3) d = flat;
  }
  return depth;
}

Rect any_region(Input& in, const ImageDepth& depth) {
  if (in.below(4) != 0) return {0, 0, depth.width, depth.height};
  const auto place = [&] { return in.below(16) == 0 ? static_cast<int>(in.word()) : in.below(33); };
  return {place(), place(), place(), place()};
}

fusion::VolumeConfig any_config(Input& in) {
  fusion::VolumeConfig c;
  constexpr double kVoxel_m[] = {0.002, 0.01, 0.02, 0.03, 0.05, 0.2, 1, 7};
  c.voxel_m = kVoxel_m[in.below(8)];
  c.truncation_m = c.voxel_m * in.between(1, 8);
  if (in.below(16) == 0) c.truncation_m *= 1000;
  if (in.below(2) == 0) c.chunk_m = c.voxel_m * in.between(0.5, 40);
  if (in.below(8) == 0)
    c.bounds = Box3d{{in.number(-2, 2), in.number(-2, 2), in.number(-2, 2)},
                     {in.number(-2, 4), in.number(-2, 4), in.number(-2, 4)}};
  c.history = static_cast<fusion::History>(in.below(2));
  c.most_blocks = in.below(8) == 0 ? in.below(4) : 200;
  return c;
}

void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "not so: %s\n", what);
  std::abort();
}

void require_mesh(const Mesh& mesh) {
  for (const Vec3f p : mesh.positions) require(is_finite(p), "positions are finite");
  for (const Triangle& t : mesh.triangles) {
    for (const std::uint32_t v : t) require(v < mesh.positions.size(), "corners are vertices");
    require(t[0] != t[1] && t[1] != t[2] && t[2] != t[0], "corners differ");
  }
}

void require_surface(const fusion::Surface& surface) {
  require_mesh(surface.mesh);
  std::uint32_t vertices = 0, triangles = 0;
  for (const fusion::SurfacePiece& piece : surface.pieces) {
    require(piece.first_vertex == vertices && piece.first_triangle == triangles,
            "pieces follow each other");
    vertices += piece.vertices, triangles += piece.triangles;
  }
  require(vertices == surface.mesh.positions.size() && triangles == surface.mesh.triangles.size(),
          "pieces cover the mesh");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input in(data, size);
  const fusion::VolumeConfig config = any_config(in);
  fusion::VoxelVolume volume(config);
  const auto edges = in.below(2) == 0 ? fusion::DepthEdges::cut : fusion::DepthEdges::bridge;
  fusion::MarchingCubes marching_cubes(edges);
  fusion::Surface surface;
  const int frames = 1 + in.below(3);
  for (int f = 0; f < frames; ++f) {
    const Camera camera = any_camera(in);
    const Pose pose = any_pose(in);
    const ImageDepth depth = any_depth(in, camera);
    std::optional<Precision> precision;
    if (in.below(2) == 0) precision = Precision{in.between(0, 0.01), in.between(0, 0.01)};
    const auto report = volume.integrate({depth, camera, pose, any_region(in, depth), precision});
    require(report.refused_pixels <= depth.data.size(), "refused pixels are pixels");
    require(volume.order().size() <= config.most_blocks, "blocks are bounded");
    require(volume.memory_bytes() < (32u << 20), "memory is bounded");
    marching_cubes.run(volume, surface);
    require_surface(surface);
  }
  return 0;
}
