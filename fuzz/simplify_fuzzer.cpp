// Decimation of any small mesh under any options: what comes out is a mesh that is no worse than
// what went in.
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "mr/simplify/simplify.h"

namespace {

using namespace mr;
using simplify::Simplified;
using simplify::SimplifyOptions;

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
  float any_float() { return std::bit_cast<float>(word()); }
  float between(float low, float high) {
    return low + (high - low) * static_cast<float>(byte()) / 255;
  }

 private:
  const std::uint8_t* data_;
  std::size_t size_, at_ = 0;
};

std::uint32_t any_vertex(Input& in, const Mesh& mesh) {
  const auto vertices = static_cast<std::uint32_t>(mesh.positions.size());
  return vertices == 0 ? in.word() : in.word() % vertices;
}

/// Rows of vertices, each joined to the next; closed: into a tube.
void add_grid(Input& in, Mesh& mesh) {
  const std::uint32_t nx = 1 + in.below(24), ny = 1 + in.below(24);
  const float bumps_m = in.one_in(2) ? in.between(0, 0.2f) : 0, depth_m = in.between(-1, 1);
  const bool tube = nx > 2 && in.one_in(3), alternates = in.one_in(2);
  const auto base = static_cast<std::uint32_t>(mesh.positions.size());
  const std::uint32_t columns = tube ? nx : nx + 1;
  for (std::uint32_t y = 0; y <= ny; ++y)
    for (std::uint32_t x = 0; x < columns; ++x) {
      const float u = static_cast<float>(x) / static_cast<float>(nx),
                  v = static_cast<float>(y) / 10;
      const float bump = bumps_m == 0 ? 0 : in.between(-bumps_m, bumps_m);
      const float turn = 6.2831853f * u;
      if (tube)
        mesh.positions.push_back({std::cos(turn) + bump, std::sin(turn), v + depth_m});
      else
        mesh.positions.push_back({u, v, depth_m + bump});
    }
  const auto at = [&](std::uint32_t x, std::uint32_t y) {
    return base + y * columns + x % columns;
  };
  for (std::uint32_t y = 0; y < ny; ++y)
    for (std::uint32_t x = 0; x < nx; ++x) {
      const std::uint32_t a = at(x, y), b = at(x + 1, y), c = at(x + 1, y + 1), d = at(x, y + 1);
      if (alternates && (x + y) % 2 == 0) {
        mesh.triangles.push_back({a, b, d}), mesh.triangles.push_back({b, c, d});
      } else {
        mesh.triangles.push_back({a, b, c}), mesh.triangles.push_back({a, c, d});
      }
    }
}

void add_fan(Input& in, Mesh& mesh) {
  const std::uint32_t blades = 1 + in.below(40), closed = in.below(2);
  const auto base = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.push_back({0, 0, in.between(0, 1)});
  for (std::uint32_t i = 0; i < blades + 1 - closed; ++i) {
    const float turn = 6.2831853f * static_cast<float>(i) / static_cast<float>(blades);
    mesh.positions.push_back({std::cos(turn), std::sin(turn), 0});
  }
  for (std::uint32_t i = 0; i < blades; ++i)
    mesh.triangles.push_back(
        {base, base + 1 + i, base + 1 + (closed && i + 1 == blades ? 0 : i + 1)});
}

void add_soup(Input& in, Mesh& mesh) {
  const std::uint32_t vertices = in.below(20), triangles = in.below(40);
  for (std::uint32_t i = 0; i < vertices; ++i)
    mesh.positions.push_back({in.between(0, 1), in.between(0, 1), in.between(0, 1)});
  for (std::uint32_t i = 0; i < triangles; ++i)
    mesh.triangles.push_back({any_vertex(in, mesh), any_vertex(in, mesh), any_vertex(in, mesh)});
}

/// Spoils a mesh here and there.
void edit(Input& in, Mesh& mesh) {
  if (mesh.triangles.empty() || mesh.positions.empty()) return;
  const std::size_t t = in.word() % mesh.triangles.size();
  Triangle& triangle = mesh.triangles[t];
  Vec3f& position = mesh.positions[any_vertex(in, mesh)];
  switch (in.below(10)) {
    case 0:
      triangle[in.below(3)] = any_vertex(in, mesh);
      break;
    case 1:
      std::swap(triangle[0], triangle[1]);
      break;
    case 2:
      mesh.triangles.push_back(Triangle(triangle));
      break;
    case 3:
      mesh.triangles.push_back({triangle[1], triangle[0], any_vertex(in, mesh)});
      break;
    case 4:
      mesh.triangles.erase(mesh.triangles.begin() + static_cast<std::ptrdiff_t>(t));
      break;
    case 5:
      position = mesh.positions[any_vertex(in, mesh)];
      break;
    case 6:
      position.z += in.between(-0.5f, 0.5f);
      break;
    case 7:
      position[static_cast<int>(in.below(3))] = in.any_float();
      break;
    case 8:
      triangle[in.below(3)] = in.one_in(8) ? in.word() : triangle[in.below(3)];
      break;
    default:
      mesh.triangles.push_back({triangle[2], triangle[1], triangle[0]});
      break;
  }
}

Mesh any_mesh(Input& in) {
  Mesh mesh;
  for (std::uint32_t parts = 1 + in.below(3); parts > 0; --parts) {
    const std::uint32_t kind = in.below(6);
    if (kind < 4) add_grid(in, mesh);
    if (kind == 4) add_fan(in, mesh);
    if (kind == 5) add_soup(in, mesh);
  }
  if (in.one_in(2))
    for (std::uint32_t edits = in.below(12); edits > 0; --edits) edit(in, mesh);
  if (in.one_in(4)) {
    const float scale = in.one_in(4) ? in.any_float() : std::exp2(in.between(-60, 25));
    for (Vec3f& p : mesh.positions) p = p * scale;
  }
  if (in.one_in(3)) {
    std::vector<SensorId> sensors;
    const std::uint32_t block = 1 + in.below(60);
    for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t)
      sensors.push_back(t / block % 4 == 3 ? kNoSensor : SensorId{t / block % 4});
    set_triangle_sensors(mesh, sensors);
    if (in.one_in(16) && !mesh.sensors.empty())
      mesh.sensors[in.word() % mesh.sensors.size()] = {in.word(), in.word(), SensorId{in.word()}};
  }
  return mesh;
}

/// Options, and what they point to.
struct Settings {
  std::vector<float> weights;
  std::vector<std::uint32_t> chunks;
  std::vector<std::size_t> levels;
  SimplifyOptions options;
};

void choose_settings(Input& in, const Mesh& mesh, Settings& out) {
  SimplifyOptions& o = out.options;
  const std::size_t triangles = mesh.triangles.size();
  o.triangles = triangles * in.below(40) / 32;
  if (in.one_in(3)) o.error_m = in.one_in(8) ? in.any_float() : in.between(0, 0.3f);
  if (in.one_in(3)) o.border_error_m = in.one_in(8) ? in.any_float() : in.between(0, 0.3f);
  if (in.one_in(8)) {
    const std::uint64_t high = in.word(), nanoseconds = high << 32 | in.word();
    o.time = std::chrono::nanoseconds(
        static_cast<std::int64_t>(in.one_in(4) ? nanoseconds : nanoseconds % 100'000));
  }
  if (in.one_in(4)) {
    out.weights.resize(mesh.positions.size() + in.one_in(32), 1);
    for (float& w : out.weights) w = std::exp2(in.between(-10, 10));
    if (in.one_in(16) && !out.weights.empty())
      out.weights[in.below(255) % out.weights.size()] = in.any_float();
  }
  if (in.one_in(2)) {
    const std::uint32_t block = 1 + in.below(100), chunks = 1 + in.below(6);
    out.chunks.resize(triangles + in.one_in(32));
    for (std::uint32_t t = 0; t < out.chunks.size(); ++t)
      out.chunks[t] = in.one_in(64) ? in.word() : t / block % chunks;
  }
  for (std::uint32_t level = in.below(5); level > 0; --level)
    out.levels.push_back(out.levels.empty() || in.one_in(32)
                             ? triangles * in.below(40) / 32
                             : out.levels.back() * in.below(255) / 254);
  o.weights = out.weights, o.chunks = out.chunks;
}

void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "not so: %s\n", what);
  std::abort();
}

bool names_three(const Triangle& t) { return t[0] != t[1] && t[1] != t[2] && t[2] != t[0]; }

/// Edges that more than two triangles share.
std::size_t count_bad_edges(const Mesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> uses;
  for (const Triangle& t : mesh.triangles)
    for (std::size_t i = 0; names_three(t) && i < 3; ++i) ++uses[std::minmax(t[i], t[(i + 1) % 3])];
  std::size_t bad = 0;
  for (const auto& [edge, count] : uses) bad += count > 2;
  return bad;
}

void require_good(const Simplified& out, const Mesh& in, const Settings& settings) {
  require(out.mesh.triangles.size() <= in.triangles.size(), "no triangles are added");
  require(out.mesh.positions.size() <= in.positions.size(), "no vertices are added");
  require(std::isfinite(out.error_m) && out.error_m >= 0, "the error is a number");
  require(settings.chunks.empty() || out.chunks.size() == out.mesh.triangles.size(),
          "each triangle has a chunk");
  const std::set<std::uint32_t> known(settings.chunks.begin(), settings.chunks.end());
  for (const std::uint32_t chunk : out.chunks) require(known.contains(chunk), "chunks are known");
  std::size_t covered = 0;
  for (const SensorRun& run : out.mesh.sensors) {
    require(run.first == covered, "runs follow each other");
    covered += run.count;
  }
  require(out.mesh.sensors.empty() || covered == out.mesh.triangles.size(), "runs cover the mesh");
  require(in.sensors.empty() || !out.mesh.sensors.empty() || out.mesh.empty(), "sensors are kept");
  for (const Triangle& t : out.mesh.triangles)
    for (const std::uint32_t v : t) require(v < out.mesh.positions.size(), "corners are vertices");
  for (const Vec3f p : out.mesh.positions) require(is_finite(p), "positions are finite");
  if (out.mesh == in) return;
  for (const Triangle& t : out.mesh.triangles) require(names_three(t), "corners differ");
  require(count_bad_edges(out.mesh) <= count_bad_edges(in), "no edge becomes non-manifold");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input in(data, size);
  simplify::Simplifier simplifier;
  const int runs = 1 + static_cast<int>(in.below(2));  // the second finds what the first left
  for (int run = 0; run < runs; ++run) {
    const Mesh mesh = any_mesh(in);
    Settings settings;
    choose_settings(in, mesh, settings);
    if (settings.levels.empty()) {
      const auto out = simplifier.run(mesh, settings.options);
      if (out) require_good(*out, mesh, settings);
    } else {
      const auto out = simplifier.run(mesh, settings.levels, settings.options);
      if (!out) continue;
      require(out->size() == settings.levels.size(), "each level is there");
      for (const Simplified& level : *out) require_good(level, mesh, settings);
    }
  }
  return 0;
}
