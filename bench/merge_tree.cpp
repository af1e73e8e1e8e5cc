#include "merge_tree.h"

#include <algorithm>

#include "bytes.h"
#include "merge_contenders.h"
#include "surfaces.h"

namespace mr::bench {
namespace {

Outcome measure_one(std::span<const kit::Part> parts, const MergeCase& input, int threads,
                    const RaceConfig& config) {
  return race({merge_ours("merger", parts, overlap_config(input), threads)}, config).front();
}

double megabytes_of(std::span<const kit::Part> parts) {
  return megabytes({parts.begin(), parts.end()});
}

/// What a merger hands on.
kit::Part part_of(const Message& merged, std::span<const kit::Part> parts) {
  kit::Part out;
  out.mesh = mesh_from(merged);
  out.mesh.sensors = array_from<SensorRun>(merged.at("sensors"));
  for (const kit::Part& part : parts) {
    out.error_m = std::max(out.error_m, part.error_m);
    out.sources.insert(out.sources.end(), part.sources.begin(), part.sources.end());
  }
  return out;
}

/// Run by run: the slowest below the root, and the root.
void add_runs(const std::vector<Outcome>& groups, const Outcome& root, TreeOutcome& out) {
  std::size_t runs = root.ms.size();
  for (const Outcome& group : groups) runs = std::min(runs, group.ms.size());
  std::vector<double> slowest(runs), last(runs);
  out.whole.cpu_ms.assign(runs, 0);
  for (std::size_t r = 0; r < runs; ++r) {
    for (const Outcome& group : groups) {
      slowest[r] = std::max(slowest[r], group.ms[r]);
      out.whole.cpu_ms[r] += group.cpu_ms[r];
    }
    last[r] = root.ms[r];
    out.whole.cpu_ms[r] += root.cpu_ms[r];
    out.whole.ms.push_back(slowest[r] + last[r]);
  }
  out.whole.stage_ms = {{"groups", slowest}, {"root", last}};
  for (const Outcome& group : groups) out.slowest_ms = std::max(out.slowest_ms, median(group.ms));
}

void add_merger(const Outcome& merger, double input_mb, TreeOutcome& out) {
  out.sum_ms += median(merger.ms);
  out.whole.peak_mb = std::max(out.whole.peak_mb, merger.peak_mb);
  out.largest_mb = std::max(out.largest_mb, merger.peak_mb + input_mb);
  if (!merger.aborted.empty()) out.whole.aborted = merger.aborted;
}

}  // namespace

TreeOutcome measure_tree(const MergeCase& input, int threads, const RaceConfig& config,
                         const std::function<void(std::size_t, std::size_t)>& progress) {
  TreeOutcome out;
  std::vector<Outcome> groups;
  std::vector<kit::Part> merged;
  std::size_t at = 0;
  for (const std::size_t size : input.groups) {
    progress(groups.size(), input.groups.size() + 1);
    const auto parts = std::span(input.parts).subspan(at, size);
    groups.push_back(measure_one(parts, input, threads, config));
    add_merger(groups.back(), megabytes_of(parts), out);
    if (!out.whole.aborted.empty()) return out;
    merged.push_back(part_of(std::exchange(groups.back().result, {}), parts));
    at += size;
  }
  progress(groups.size(), input.groups.size() + 1);
  Outcome root = measure_one(merged, input, threads, config);
  add_merger(root, megabytes_of(merged), out);
  if (!out.whole.aborted.empty()) return out;
  add_runs(groups, root, out);
  out.root_ms = median(root.ms);
  out.whole.result = std::move(root.result);
  return out;
}

}  // namespace mr::bench
