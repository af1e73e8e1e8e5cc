#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "fuse_contenders.h"
#include "mr/core/parallel.h"
#include "mr/kit/raycast.h"
#include "race.h"
#include "report.h"
#include "simplify_contenders.h"
#include "simplify_plot.h"
#include "stage.h"
#include "surfaces.h"

namespace mr::bench {
namespace {

std::vector<Contender> contenders_of(const SimplifyCase& input, const Request& request) {
  std::vector<Contender> out;
  const auto add = [&](std::vector<Contender> some) {
    std::ranges::move(some, std::back_inserter(out));
  };
  for (const int threads : request.threads) add({simplify_ours(input, threads)});
  add(simplify_meshoptimizer(input, request.threads));
  add(simplify_open3d(input));
  add(simplify_cgal(input));
  add({simplify_heap(input)});
  return out;
}

/// Triangles that face away from the part of the input that is nearest to their middle. A few are
/// found on any surface that is rougher than they are large.
std::size_t flipped_triangles(const Mesh& mesh, const Mesh& input, const kit::RayScene& rays) {
  std::vector<std::uint8_t> flipped(mesh.triangles.size());
  parallel_for(flipped.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const auto nearest = rays.nearest(mesh.centroid(t));
      flipped[t] = nearest && dot(mesh.area_normal(t), input.area_normal(nearest->triangle)) < 0;
    }
  });
  return static_cast<std::size_t>(std::ranges::count(flipped, 1));
}

void add_distance(const std::string& way, const eval::SurfaceDistance& d, Message& fields) {
  const auto add = [&](const char* name, double mm) {
    fields[way + "_" + name] = rounded(mm, 4);
    const double other = fields.value(name, 0.0);
    fields[name] = rounded(std::max(other, mm), 4);  // the larger of both ways
  };
  add("mean_mm", d.mean_mm), add("rms_mm", d.rms_mm);
  add("p95_mm", d.p95_mm), add("max_mm", d.max_mm);
}

Message evaluate_one(const Message& result, const Mesh& input, const kit::RayScene& rays) {
  const Mesh mesh = mesh_from(result);
  Message fields = surface_figures(mesh);
  if (!mesh.empty()) {
    add_distance("to_input", distance(mesh, input), fields);
    add_distance("from_input", distance(input, mesh), fields);
    fields["flipped"] = flipped_triangles(mesh, input, rays);
  }
  for (const auto& [name, value] : result.items())  // the contender's own fields
    if (value.is_number()) fields[name] = value;
  return fields;
}

/// Fields about the surfaces, one object per contender; who made the same mesh as another is not
/// evaluated again. Takes threads: for a child.
Message evaluate(const SimplifyCase& input, const std::vector<Outcome>& outcomes) {
  Message fields = Message::array();
  Arena arena(0);
  arena.run([&] {
    const Mesh* meshes[] = {input.mesh.get()};
    const kit::RayScene rays(meshes);
    for (std::size_t i = 0; i < outcomes.size(); ++i) {
      const Message& result = outcomes[i].result;
      const auto same =
          std::ranges::find(outcomes.begin(), outcomes.begin() + i, result, &Outcome::result);
      const auto earlier = static_cast<std::size_t>(same - outcomes.begin());
      fields.push_back(result.is_null() ? Message::object()
                       : earlier < i    ? Message(fields[earlier])
                                        : evaluate_one(result, *input.mesh, rays));
    }
  });
  return fields;
}

Message describe(const SimplifyCase& c) {
  return {{"mesh", c.input},
          {"vertices", c.mesh->positions.size()},
          {"triangles", c.mesh->triangles.size()},
          {"area_m2", rounded(surface_area_m2(*c.mesh), 4)},
          {"wanted_triangles", c.triangles}};
}

Status measure_case(const SimplifyCase& input, const Request& request, cli::ProgressBar& bar,
                    Report& report) {
  const auto contenders = contenders_of(input, request);
  // One warm-up: some take seconds, and ours has its memory after the first.
  const auto outcomes =
      race(contenders, {.warm_ups = 1, .runs = request.runs},
           [&](std::size_t done, std::size_t of) { bar.show(input.name, done, of); });
  bar.show(input.name + ": comparing surfaces", 0, 1);
  const auto evaluated = apart([&] { return evaluate(input, outcomes); });
  if (!evaluated) return evaluated.error();
  report.input[input.name] = describe(input);
  for (std::size_t i = 0; i < contenders.size(); ++i) {
    Message row = result_row(contenders[i], input.name, outcomes[i]);
    row.update(evaluated->at(i));
    report.results.push_back(std::move(row));
  }
  return {};
}

Result<Report> run_simplify(const Request& request, cli::ProgressBar& bar) {
  const auto inputs = load_simplify_cases(request, bar);
  if (!inputs) return inputs.error();
  Report report{.stage = "simplify",
                .columns = {{"rms mm", "rms_mm"},
                            {"to in", "to_input_rms_mm"},
                            {"from in", "from_input_rms_mm"},
                            {"p95 mm", "p95_mm"},
                            {"worst mm", "max_mm", 2},
                            {"m2", "area_m2"},
                            {"flipped", "flipped", 0},
                            {"nonman.", "nonmanifold_edges", 0}}};
  if (!has_meshoptimizer()) report.absent.push_back("meshoptimizer");
  if (!has_open3d()) report.absent.push_back("open3d");
  if (!has_cgal()) report.absent.push_back("cgal");
  for (const SimplifyCase& input : *inputs)
    if (const Status measured = measure_case(input, request, bar, report); !measured)
      return measured.error();
  return report;
}

}  // namespace

Stage simplify_stage() {
  return {"simplify", "decimation; peers: meshoptimizer, Open3D, CGAL, a heap of edges",
          simplify_cases, run_simplify, plot_simplify};
}

}  // namespace mr::bench
