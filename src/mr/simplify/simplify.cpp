#include "mr/simplify/simplify.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"
#include "mr/simplify/chunk_lines.h"
#include "mr/simplify/output.h"
#include "mr/simplify/reduce.h"
#include "mr/simplify/spatial_order.h"
#include "mr/simplify/working_mesh_builder.h"

namespace mr::simplify {

namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr float kFarthest_m = 1e6f;
constexpr std::size_t kGrain = 65536;
constexpr std::chrono::hours kLongest(24);

template <typename T, typename Test>
bool all_of(std::span<const T> values, const Test& test) {
  std::atomic<bool> holds = true;
  parallel_for(values.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    if (!std::all_of(values.begin() + static_cast<std::ptrdiff_t>(begin),
                     values.begin() + static_cast<std::ptrdiff_t>(end), test))
      holds = false;
  });
  return holds;
}

Error invalid(const std::string& message) {
  return {Error::Cause::invalid, "simplify: " + message};
}

Status check_options(const Mesh& mesh, const SimplifyOptions& options) {
  if (!(options.error_m >= 0)) return invalid("error_m is negative or no number");
  if (!(options.border_error_m >= 0)) return invalid("border_error_m is negative or no number");
  if (!options.weights.empty() && options.weights.size() != mesh.positions.size())
    return invalid(std::to_string(options.weights.size()) + " weights for " +
                   std::to_string(mesh.positions.size()) + " vertices");
  if (!options.chunks.empty() && options.chunks.size() != mesh.triangles.size())
    return invalid(std::to_string(options.chunks.size()) + " chunks for " +
                   std::to_string(mesh.triangles.size()) + " triangles");
  if (!all_of(options.weights, [](float w) { return w > 0 && w <= 1e6f; }))
    return invalid("a weight is not over 0, or over a million");
  return {};
}

Status check_mesh(const Mesh& mesh) {
  const std::size_t vertices = mesh.positions.size();
  if (vertices >= kNoVertex || mesh.triangles.size() >= kNoVertex / 3)
    return Error{Error::Cause::too_large, "simplify: the mesh has too many vertices or triangles"};
  if (!all_of<Triangle>(mesh.triangles, [&](const Triangle& t) {
        return t[0] < vertices && t[1] < vertices && t[2] < vertices;
      }))
    return invalid("a triangle names a vertex that is not there");
  if (!all_of<Vec3f>(mesh.positions, [](Vec3f p) {
        return std::abs(p.x) <= kFarthest_m && std::abs(p.y) <= kFarthest_m &&
               std::abs(p.z) <= kFarthest_m;
      }))
    return invalid("a position is not finite, or over 1000 km away");
  std::size_t covered = 0;
  for (const SensorRun& run : mesh.sensors) {
    if (run.first != covered) return invalid("the runs of the mesh do not cover its triangles");
    covered += run.count;
  }
  if (!mesh.sensors.empty() && covered != mesh.triangles.size())
    return invalid("the runs of the mesh do not cover its triangles");
  return {};
}

/// Labels of triangles, and the meaning of each label.
struct Labels {
  std::vector<std::uint32_t> of_triangle;
  std::vector<Label> meaning;
};

Labels find_labels(const Mesh& mesh, std::span<const std::uint32_t> chunks) {
  Labels out;
  if (mesh.sensors.empty() && chunks.empty()) return out;
  std::map<Label, std::uint32_t> known;
  const std::vector<SensorId> sensors = triangle_sensors(mesh);
  out.of_triangle.resize(mesh.triangles.size());
  Label last;
  for (std::size_t t = 0; t < out.of_triangle.size(); ++t) {
    const Label label{chunks.empty() ? 0 : chunks[t], sensors[t]};
    if (t > 0 && label == last) {
      out.of_triangle[t] = out.of_triangle[t - 1];
      continue;
    }
    last = label;
    const auto [found, is_new] = known.try_emplace(label, static_cast<std::uint32_t>(known.size()));
    if (is_new) out.meaning.push_back(label);
    out.of_triangle[t] = found->second;
  }
  return out;
}

}  // namespace

struct Simplifier::Impl {
  WorkingMesh mesh, spare;
  WorkingMeshBuilder builder;
  ParallelSweep sweep;
  std::vector<std::uint32_t> number;

  Labels start(const Mesh& mesh, const SimplifyOptions& options);
  std::vector<Simplified> run(const Mesh& mesh, std::span<const std::size_t> triangles,
                              const SimplifyOptions& options);
};

/// Builds the working mesh and simplifies the lines between chunks.
Labels Simplifier::Impl::start(const Mesh& input, const SimplifyOptions& options) {
  Labels labels = find_labels(input, options.chunks);
  if (is_scattered(input)) {
    const ReorderedMesh sorted = sort_in_space(input, options.weights);
    builder.run(sorted.mesh, labels.of_triangle, sorted.weights, mesh);
  } else {
    builder.run(input, labels.of_triangle, options.weights, mesh);
  }
  sweep.start(mesh);
  if (!options.chunks.empty()) simplify_chunk_lines(labels.meaning, options.border_error_m, mesh);
  return labels;
}

std::vector<Simplified> Simplifier::Impl::run(const Mesh& input,
                                              std::span<const std::size_t> triangles,
                                              const SimplifyOptions& options) {
  const SteadyClock::time_point started = SteadyClock::now();
  const Labels labels = start(input, options);
  StopCriteria goal{.triangles = 0, .error_m = options.error_m};
  // The way out takes about half as long as the way in.
  if (options.time)
    goal.deadline = started + std::min<std::chrono::nanoseconds>(*options.time, kLongest) -
                    (SteadyClock::now() - started) / 2;
  std::vector<Simplified> out;
  for (const std::size_t level : triangles) {
    goal.triangles = level;
    reduce(goal, sweep, mesh, spare, number);
    relax(sweep, mesh);
    out.push_back(
        output(mesh, labels.meaning, !options.chunks.empty(), !input.sensors.empty(), number));
  }
  return out;
}

Simplifier::Simplifier() : impl_(std::make_unique<Impl>()) {}
Simplifier::~Simplifier() = default;
Simplifier::Simplifier(Simplifier&&) noexcept = default;
Simplifier& Simplifier::operator=(Simplifier&&) noexcept = default;

Result<Simplified> Simplifier::run(const Mesh& mesh, const SimplifyOptions& options) {
  auto levels = run(mesh, std::span(&options.triangles, 1), options);
  if (!levels) return levels.error();
  return std::move(levels->front());
}

Result<std::vector<Simplified>> Simplifier::run(const Mesh& mesh,
                                                std::span<const std::size_t> triangles,
                                                const SimplifyOptions& options) {
  if (const Status fits = check_options(mesh, options); !fits) return fits.error();
  if (const Status usable = check_mesh(mesh); !usable) return usable.error();
  if (!std::is_sorted(triangles.rbegin(), triangles.rend()))
    return invalid("levels of detail do not fall");
  // Levels that need no decimation return the input.
  std::vector<Simplified> out;
  std::size_t whole = 0;
  while (options.chunks.empty() && whole < triangles.size() &&
         triangles[whole] >= mesh.triangles.size()) {
    out.push_back({mesh, {}, std::vector<float>(mesh.positions.size()), 0});
    ++whole;
  }
  if (whole == triangles.size()) return out;
  for (Simplified& level : impl_->run(mesh, triangles.subspan(whole), options))
    out.push_back(std::move(level));
  return out;
}

Result<Simplified> simplify(const Mesh& mesh, const SimplifyOptions& options) {
  return Simplifier().run(mesh, options);
}

std::size_t triangles_at(const Mesh& mesh, double ratio) {
  MR_ASSERT(ratio > 0 && ratio <= 1);
  return static_cast<std::size_t>(std::ceil(static_cast<double>(mesh.triangles.size()) * ratio));
}

}  // namespace mr::simplify
