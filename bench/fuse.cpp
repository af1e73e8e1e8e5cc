#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "fuse_case.h"
#include "fuse_contenders.h"
#include "mr/core/parallel.h"
#include "race.h"
#include "report.h"
#include "stage.h"
#include "surfaces.h"

namespace mr::bench {
namespace {

const std::string kOpen3d = "open3d";

/// Ours or a variant of it.
bool is_ours(const Contender& c) { return c.impl.starts_with(kOurs); }

/// What was raced, what each did, and its fields of the report.
struct Raced {
  std::vector<Contender> contenders;
  std::vector<Outcome> outcomes;
  std::vector<Message> rows;
};

std::vector<Contender> contenders_of(const FuseCase& input, const Request& request,
                                     cli::ProgressBar& bar) {
  std::vector<Contender> out;
  std::size_t sized = 0;
  for (const int threads : request.threads) {
    for (Contender& ours : fuse_ours(input, threads)) out.push_back(std::move(ours));
    if (has_open3d()) bar.show(input.name + ": sizing the peer", sized++, request.threads.size());
    for (Contender& peer : fuse_open3d(input, threads)) out.push_back(std::move(peer));
  }
  return out;
}

Raced race_case(const FuseCase& input, const Request& request, cli::ProgressBar& bar) {
  Raced raced{contenders_of(input, request, bar), {}, {}};
  raced.outcomes = race(raced.contenders, {.runs = request.runs},
                        [&](std::size_t done, std::size_t of) { bar.show(input.name, done, of); });
  for (std::size_t i = 0; i < raced.contenders.size(); ++i)
    raced.rows.push_back(result_row(raced.contenders[i], input.name, raced.outcomes[i]));
  return raced;
}

/// The peer's variant that is the fastest on so many threads, those that died last; nothing when
/// there is none.
std::optional<std::size_t> fastest_peer(const Raced& raced, int threads) {
  std::optional<std::size_t> best;
  const auto rank = [&](std::size_t i) {
    const Outcome& o = raced.outcomes[i];
    return std::tuple(!o.aborted.empty(), !o.usable(), median(o.ms));
  };
  for (std::size_t i = 0; i < raced.contenders.size(); ++i) {
    const Contender& c = raced.contenders[i];
    if (c.threads != threads || is_ours(c)) continue;
    if (!best || rank(i) < rank(*best)) best = i;
  }
  return best;
}

/// How far each peer's surface and ours on as many threads lie apart: the larger of both ways, and
/// in our row, of the fastest, also each way.
void compare_with_peers(const Raced& raced, const std::vector<Mesh>& meshes, Message& fields) {
  for (std::size_t ours = 0; ours < meshes.size(); ++ours) {
    if (!is_ours(raced.contenders[ours]) || meshes[ours].empty()) continue;
    const int threads = raced.contenders[ours].threads;
    for (std::size_t peer = 0; peer < meshes.size(); ++peer) {
      const Contender& other = raced.contenders[peer];
      if (is_ours(other) || other.threads != threads || meshes[peer].empty()) continue;
      const auto to = distance(meshes[ours], meshes[peer]);
      const auto from = distance(meshes[peer], meshes[ours]);
      if (raced.contenders[ours].impl == kOurs)
        fields[peer]["to_ours_rms_mm"] = rounded(std::max(to.rms_mm, from.rms_mm), 4);
      if (peer != fastest_peer(raced, threads)) continue;
      fields[ours]["to_peer_rms_mm"] = rounded(std::max(to.rms_mm, from.rms_mm), 4);
      fields[ours]["to_peer_p95_mm"] = rounded(std::max(to.p95_mm, from.p95_mm), 4);
      fields[ours]["to_peer_ways_mm"] = {rounded(to.rms_mm, 4), rounded(from.rms_mm, 4)};
    }
  }
}

/// Fields about the surfaces, one object per contender. Takes threads: for a child.
Message evaluate(const FuseCase& input, const Raced& raced) {
  std::vector<Mesh> meshes;
  for (const Outcome& outcome : raced.outcomes)
    meshes.push_back(outcome.result.is_null() ? Mesh{} : mesh_from(outcome.result));
  Message fields = Message::array();
  Arena arena(0);
  arena.run([&] {
    for (std::size_t i = 0; i < meshes.size(); ++i) {
      fields.push_back(raced.outcomes[i].result.is_null() ? Message::object()
                                                          : surface_figures(meshes[i]));
      if (!input.truth.empty() && !meshes[i].empty())
        fields[i]["to_truth_rms_mm"] = rounded(distance(meshes[i], input.truth).rms_mm, 4);
    }
    compare_with_peers(raced, meshes, fields);
  });
  return fields;
}

/// Rows of a case, the peer's fastest variant once more under the peer's own name.
std::vector<Message> rows_of(const Raced& raced, const Request& request) {
  std::vector<Message> out = raced.rows;
  for (const int threads : request.threads)
    if (const auto best = fastest_peer(raced, threads)) {
      Message row = raced.rows[*best];
      row["variant"] = row["impl"];
      row["impl"] = kOpen3d;
      out.push_back(std::move(row));
    }
  return out;
}

Message describe(const FuseCase& c) {
  return {{"width", c.depth.width},
          {"height", c.depth.height},
          {"valid_pixels", std::count_if(c.depth.data.begin(), c.depth.data.end(),
                                         [](float depth_m) { return depth_m > 0; })},
          {"voxel_m", c.voxel_m},
          {"truncation_m", c.truncation_m},
          {"limit_m", c.limit_m}};
}

Status measure_fuse_case(const FuseCase& input, const Request& request, cli::ProgressBar& bar,
                         Report& report) {
  Raced raced = race_case(input, request, bar);
  bar.show(input.name + ": comparing surfaces", 0, 1);
  const auto evaluated = apart([&] { return evaluate(input, raced); });
  if (!evaluated) return evaluated.error();
  for (std::size_t i = 0; i < raced.rows.size(); ++i) raced.rows[i].update(evaluated->at(i));
  report.input[input.name] = describe(input);
  for (Message& row : rows_of(raced, request)) report.results.push_back(std::move(row));
  return {};
}

/// A scene's cases, or those of them that the request names.
Result<std::vector<FuseCase>> scene_cases(const Request& request) {
  auto all = load_fuse_scene(request.input);
  if (!all) return all.error();
  if (request.cases.empty()) return all;
  std::vector<FuseCase> out;
  for (const std::string& name : request.cases) {
    const auto found =
        std::find_if(all->begin(), all->end(), [&](const FuseCase& c) { return c.name == name; });
    if (found == all->end())
      return Error{Error::Cause::not_found,
                   request.input.string() + " has no frame of a sensor '" + name + "'"};
    out.push_back(*found);
  }
  return out;
}

Result<std::vector<FuseCase>> load_fuse_cases(const Request& request, cli::ProgressBar& bar) {
  if (!request.input.empty()) return scene_cases(request);
  const auto names = wanted_cases(fuse_cases(), request, "fuse has");
  if (!names) return names.error();
  std::vector<FuseCase> out;
  for (const std::string& name : *names) {
    bar.show("loading", out.size(), names->size());
    auto one = load_fuse_case(name);
    if (!one) return one.error();
    out.push_back(*std::move(one));
  }
  return out;
}

Result<Report> run_fuse(const Request& request, cli::ProgressBar& bar) {
  const auto inputs = load_fuse_cases(request, bar);
  if (!inputs) return inputs.error();
  Report report{
      .stage = "fuse",
      .columns = {
          {"m2", "area_m2"}, {"peer mm", "to_peer_rms_mm"}, {"truth mm", "to_truth_rms_mm"}}};
  if (!has_open3d()) report.absent.push_back(kOpen3d);
  for (const FuseCase& input : *inputs)
    if (const Status measured = measure_fuse_case(input, request, bar, report); !measured)
      return measured.error();
  return report;
}

}  // namespace

Stage fuse_stage() {
  return {"fuse", "depth to an indexed mesh; peer: Open3D's VoxelBlockGrid", fuse_cases, run_fuse};
}

}  // namespace mr::bench
