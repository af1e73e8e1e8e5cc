#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "bytes.h"
#include "mr/core/parallel.h"
#include "mr/merge/overlap/occlusion_rule.h"
#include "overlap_contenders.h"
#include "stage.h"

namespace mr::bench {
namespace {

const std::string kOverlapRoom = "room_bench", kOverlapTwin = "rooms/5";

double share(std::size_t part, std::size_t of) {
  return of == 0 ? 1 : std::round(1e6 * static_cast<double>(part) / static_cast<double>(of)) / 1e6;
}

/// The merge stage's cases with few sensors; room_bench is the default one, or a rig where that is
/// missing.
std::vector<CaseInfo> overlap_cases() {
  std::vector<CaseInfo> out;
  for (CaseInfo& c : merge_cases()) {
    if (c.name != kOverlapRoom && !c.name.ends_with("/5") && !c.name.ends_with("/20")) continue;
    c.by_default = c.name == kOverlapRoom || (c.name == kOverlapTwin && !no_room_bench().empty());
    out.push_back(std::move(c));
  }
  return out;
}

/// How both ways to find hits compare, ray by ray. Takes threads: for a child.
Message compare_ways(const MergeCase& input) {
  std::size_t rays = 0, same = 0, drawn_hits = 0, cast_hits = 0;
  Arena arena(0);
  arena.run([&] {
    const auto verdicts = [&](merge::MergeConfig::Overlap how) {
      return merge::ray_verdicts(input.parts, paper_config(input, how));
    };
    const auto drawn = verdicts(merge::MergeConfig::Overlap::raster);
    const auto cast = verdicts(merge::MergeConfig::Overlap::rays);
    for (std::size_t i = 0; i < drawn.size(); ++i) {
      const std::size_t pixels = drawn[i].first.size() - 1;
      rays += pixels, drawn_hits += drawn[i].verdicts.size(), cast_hits += cast[i].verdicts.size();
      for (std::size_t p = 0; p < pixels; ++p)
        same += std::ranges::equal(drawn[i].at(p), cast[i].at(p));
    }
  });
  return {{"rays", rays},
          {"same_decision", share(same, rays)},
          {"ours_hits", drawn_hits},
          {"embree_hits", cast_hits}};
}

/// Adds what a contender found: how many triangles, and how many of them go.
void add_findings(const Message& result, Message& row) {
  if (result.is_null()) return;
  const bool with_time = result.is_object();
  const auto gone = array_from<std::uint8_t>(with_time ? result.at("gone") : result);
  row["triangles"] = gone.size();
  row["removed"] = std::ranges::count(gone, 1);
  if (with_time) row["with_decisions_ms"] = result.at("with_decisions_ms");
}

Status measure_overlap_case(const MergeCase& input, const Request& request, cli::ProgressBar& bar,
                            Report& report) {
  std::vector<Contender> contenders;
  for (const int threads : request.threads) {
    contenders.push_back(overlap_ours(input, threads));
    contenders.push_back(overlap_embree(input, threads));
  }
  const auto outcomes =
      race(contenders, {.runs = request.runs},
           [&](std::size_t done, std::size_t of) { bar.show(input.name, done, of); });
  bar.show(input.name + ": comparing decisions", 0, 1);
  const auto compared = apart([&] { return compare_ways(input); });
  if (!compared) return compared.error();
  report.input[input.name] = {{"parts", input.parts.size()},
                              {"voxel_m", input.voxel_m},
                              {"mb", megabytes(input.parts)},
                              {"rays", compared->at("rays")}};
  for (std::size_t i = 0; i < contenders.size(); ++i) {
    Message row = result_row(contenders[i], input.name, outcomes[i]);
    add_findings(outcomes[i].result, row);
    row["rays"] = compared->at("rays");
    row["hits"] = compared->at(contenders[i].impl + "_hits");  // with fronts of triangles
    row["same_decision"] = compared->at("same_decision");
    report.results.push_back(std::move(row));
  }
  return {};
}

Result<std::vector<MergeCase>> load_overlap_cases(const Request& request, cli::ProgressBar& bar) {
  std::vector<MergeCase> out;
  if (!request.input.empty()) {
    auto one = load_merge_scene(request.input);
    if (!one) return one.error();
    out.push_back(*std::move(one));
    return out;
  }
  const auto names = wanted_cases(overlap_cases(), request, "overlap has");
  if (!names) return names.error();
  for (const std::string& name : *names) {
    bar.show("loading", out.size(), names->size());
    auto one = load_merge_case(name);
    if (!one) return one.error();
    out.push_back(*std::move(one));
  }
  return out;
}

Result<Report> run_overlap(const Request& request, cli::ProgressBar& bar) {
  const auto inputs = load_overlap_cases(request, bar);
  if (!inputs) return inputs.error();
  Report report{.stage = "overlap",
                .columns = {{"removed", "removed", 0},
                            {"rays", "rays", 0},
                            {"hits", "hits", 0},
                            {"same", "same_decision", 5},
                            {"all ms", "with_decisions_ms", 1}}};
  for (const MergeCase& input : *inputs)
    if (const Status measured = measure_overlap_case(input, request, bar, report); !measured)
      return measured.error();
  return report;
}

}  // namespace

Stage overlap_stage() {
  return {"overlap", "the paper's overlap removal; peer: Embree's build and all hits",
          overlap_cases, run_overlap};
}

}  // namespace mr::bench
