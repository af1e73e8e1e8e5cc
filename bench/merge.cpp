#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "merge_contenders.h"
#include "merge_plot.h"
#include "merge_tree.h"
#include "mr/core/parallel.h"
#include "mr/eval/geometry_error.h"
#include "report.h"
#include "stage.h"
#include "surfaces.h"

namespace mr::bench {
namespace {

constexpr std::size_t kMostJudged = 20;  // parts: with more, surfaces are only counted

std::vector<Contender> contenders_of(const MergeCase& input, const Request& request) {
  merge::OverlapConfig coherent = overlap_config(input), paper = coherent;
  coherent.owner = MergeConfig::Owner::coherent, paper.owner = MergeConfig::Owner::paper;
  std::vector<int> counts = request.threads;
  if (input.of_scale) counts = {std::ranges::max(counts)};
  std::vector<Contender> out;
  for (const int threads : counts)
    out.push_back(merge_ours(input.of_scale ? "flat" : "ours", input.parts, coherent, threads));
  if (input.of_scale && input.truth.empty()) return out;
  for (const int threads : counts) out.push_back(merge_ours("paper", input.parts, paper, threads));
  out.push_back(merge_clustering(input));
  return out;
}

// ------------------------------------------------------------ what takes threads: in a child

Mesh sum_of(const MergeCase& input) {
  Mesh out;
  for (const kit::Part& part : input.parts) append(out, part.mesh);
  return out;
}

std::vector<eval::SensorFrustum> frustums_of(const MergeCase& input) {
  std::vector<eval::SensorFrustum> out;
  for (const kit::Part& part : input.parts)
    for (const SourceInfo& source : part.sources)
      out.push_back({source.depth_camera, source.T_world_depth});
  return out;
}

void add_quality(const Mesh& mesh, const Mesh& reference,
                 const std::vector<eval::SensorFrustum>& frustums,
                 const eval::GeometryConfig& config, Message& fields) {
  const auto error = eval::geometry_error(mesh, reference, frustums, config);
  if (!error) throw std::runtime_error(error.error().message);
  fields["to_reference_rms_mm"] = rounded(error->to_reference.rms_mm, 5);
  fields["from_reference_rms_mm"] = rounded(error->from_reference.rms_mm, 5);
  fields["rms_mm"] = rounded(std::max(error->to_reference.rms_mm, error->from_reference.rms_mm), 5);
  fields["duplicate_ratio"] = rounded(error->duplicate_ratio, 5);
  fields["missing_ratio"] = rounded(error->missing_ratio, 5);
  fields["seam_gap_p95_mm"] = rounded(error->seam_gap_p95_mm, 5);
  fields["nonmanifold_edges"] = error->nonmanifold_edges;
  fields["components"] = error->components;
}

/// Fields about surfaces, one object per outcome; the last one is about all parts as they came.
Message evaluate(const MergeCase& input, const std::vector<Outcome>& outcomes) {
  Message fields = Message::array();
  Arena arena(0);
  arena.run([&] {
    const Mesh sum = sum_of(input);
    const auto frustums = frustums_of(input);
    const eval::GeometryConfig config{.voxel_m = input.voxel_m};
    const auto evaluate_one = [&](const Mesh& mesh) {
      Message of = surface_figures(mesh);
      of["saving"] = rounded(1 - static_cast<double>(mesh.triangles.size()) /
                                     static_cast<double>(sum.triangles.size()),
                             5);
      if (input.parts.size() <= kMostJudged)
        add_quality(mesh, input.truth.empty() ? sum : input.truth, frustums, config, of);
      else
        of["duplicate_ratio"] = rounded(eval::duplicate_ratio(mesh, config), 5);
      return of;
    };
    for (std::size_t i = 0; i < outcomes.size(); ++i) {
      const Message& result = outcomes[i].result;
      const auto same =
          std::ranges::find(outcomes.begin(), outcomes.begin() + i, result, &Outcome::result);
      const auto earlier = static_cast<std::size_t>(same - outcomes.begin());
      fields.push_back(result.is_null() ? Message::object()
                       : earlier < i    ? Message(fields[earlier])
                                        : evaluate_one(mesh_from(result)));
    }
    fields.push_back(evaluate_one(sum));
  });
  return fields;
}

// ------------------------------------------------------------ cases

void add_memory(const MergeCase& input, Message& row) {
  if (!row.contains("peak_mb")) return;
  row["input_mb"] = rounded(megabytes(input.parts), 5);
  row["total_mb"] = rounded(row["peak_mb"].get<double>() + megabytes(input.parts), 5);
}

/// A row for a tree of mergers.
Message tree_row(const MergeCase& input, int threads, const TreeOutcome& tree) {
  Message row =
      result_row({"hierarchical", threads, Message::object(), {}}, input.name, tree.whole);
  row["mergers"] = input.groups.size() + 1;
  row["slowest_merger_ms"] = rounded(tree.slowest_ms, 5);
  row["root_ms"] = rounded(tree.root_ms, 5);
  row["sum_ms"] = rounded(tree.sum_ms, 5);
  row["total_mb"] = rounded(tree.largest_mb, 5);
  return row;
}

Status measure_case(const MergeCase& input, const Request& request, cli::ProgressBar& bar,
                    Report& report) {
  const auto contenders = contenders_of(input, request);
  const auto progress = [&](std::size_t done, std::size_t of) { bar.show(input.name, done, of); };
  const RaceConfig config{.warm_ups = 1, .runs = request.runs};
  auto outcomes = race(contenders, config, progress);
  std::vector<Message> rows;
  for (std::size_t i = 0; i < contenders.size(); ++i) {
    rows.push_back(result_row(contenders[i], input.name, outcomes[i]));
    add_memory(input, rows.back());
  }
  if (input.groups.size() > 1) {
    const int threads = std::ranges::max(request.threads);
    TreeOutcome tree = measure_tree(input, threads, config, [&](std::size_t done, std::size_t of) {
      bar.show(input.name + ": mergers", done, of);
    });
    rows.push_back(tree_row(input, threads, tree));
    outcomes.push_back(std::move(tree.whole));
  }
  bar.show(input.name + ": comparing surfaces", 0, 1);
  const auto evaluated = apart([&] { return evaluate(input, outcomes); });
  if (!evaluated) return evaluated.error();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    rows[i].update(evaluated->at(i));
    report.results.push_back(std::move(rows[i]));
  }
  Message& about = report.input[input.name] = evaluated->back();
  about["sensors"] = input.parts.size();
  about["reference"] = input.truth.empty() ? "the parts" : "truth";
  return {};
}

Result<Report> run_merge(const Request& request, cli::ProgressBar& bar) {
  std::vector<std::string> names{request.input.string()};
  if (!request.input.empty() && !request.cases.empty())
    return Error{Error::Cause::invalid, "merge takes a scene as a whole: no --case with --input"};
  if (request.input.empty()) {
    auto wanted = wanted_cases(merge_cases(), request, "merge has");
    if (!wanted) return wanted.error();
    names = *std::move(wanted);
  }
  Report report{.stage = "merge",
                .columns = {{"duplic.", "duplicate_ratio", 5},
                            {"missing", "missing_ratio", 5},
                            {"to ref", "to_reference_rms_mm"},
                            {"from ref", "from_reference_rms_mm"},
                            {"gap p95", "seam_gap_p95_mm", 2},
                            {"saving", "saving"},
                            {"nonman.", "nonmanifold_edges", 0},
                            {"slowest", "slowest_merger_ms", 1},
                            {"root", "root_ms", 1},
                            {"total MB", "total_mb", 1}}};
  for (const std::string& name : names) {
    bar.show(name + ": loading", 0, 1);
    auto input = request.input.empty() ? load_merge_case(name) : load_merge_scene(request.input);
    if (!input) return input.error();
    if (const Status measured = measure_case(*input, request, bar, report); !measured)
      return measured.error();
  }
  return report;
}

}  // namespace

Stage merge_stage() {
  return {"merge",
          "overlap, islands and seams, flat and in a tree; also the paper's rule, clustering",
          merge_cases, run_merge, plot_merge};
}

}  // namespace mr::bench
