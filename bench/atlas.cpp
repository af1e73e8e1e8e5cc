#include <algorithm>
#include <numeric>

#include "atlas_case.h"
#include "atlas_contenders.h"
#include "bytes.h"
#include "mr/kit/topology.h"
#include "race.h"
#include "stage.h"
#include "surfaces.h"

namespace mr::bench {
namespace {

/// How a surface came out: its regions (connected triangles of one label), those under 50 cm²
/// beside a region of another view (patches), the length of the borders between two views, and what
/// no view textures.
Message label_figures(const Mesh& mesh, const std::vector<int>& label) {
  const auto twin = kit::edge_table(mesh).twin;
  std::vector<std::uint32_t> root(label.size());
  std::iota(root.begin(), root.end(), 0u);
  const auto find = [&](std::uint32_t t) {
    while (root[t] != t) t = root[t] = root[root[t]];
    return t;
  };
  double border_m = 0;
  for (std::uint32_t h = 0; h < twin.size(); ++h) {
    if (twin[h] == kit::kNoTwin || twin[h] < h) continue;
    const std::uint32_t a = h / 3, b = twin[h] / 3;
    if (label[a] == label[b])
      root[std::max(find(a), find(b))] = std::min(find(a), find(b));
    else if (label[a] >= 0 && label[b] >= 0)
      border_m +=
          length(mesh.positions[kit::edge_to(mesh, h)] - mesh.positions[kit::edge_from(mesh, h)]);
  }
  std::vector<double> area(label.size());
  std::vector<std::uint8_t> has_neighbour(label.size());
  for (std::uint32_t h = 0; h < twin.size(); ++h)
    if (twin[h] != kit::kNoTwin && label[twin[h] / 3] >= 0 && label[twin[h] / 3] != label[h / 3])
      has_neighbour[find(h / 3)] = 1;
  double none = 0, all = 0;
  for (std::uint32_t t = 0; t < label.size(); ++t) {
    const double a = 0.5 * length(mesh.area_normal(t));
    all += a, (label[t] < 0 ? none : area[find(t)]) += a;
  }
  const auto below = [&](double cm2) {
    return std::ranges::count_if(area, [&](double a) { return a > 0 && a < cm2 * 1e-4; });
  };
  std::size_t patches = 0;
  for (std::uint32_t t = 0; t < label.size(); ++t)
    patches += area[t] > 0 && area[t] < 50e-4 && has_neighbour[t];
  return {{"triangles", label.size()},
          {"patches", patches},
          {"regions", below(1e12)},
          {"under_50_cm2", below(50)},
          {"under_20_cm2", below(20)},
          {"border_m", rounded(border_m, 2)},
          {"untextured", rounded(all > 0 ? none / all : 0, 4)}};
}

Status measure_labels(const AtlasCase& input, const Request& request, cli::ProgressBar& bar,
                      Report& report) {
  std::vector<Contender> contenders;
  for (const int threads : request.threads) {
    contenders.push_back(atlas_ours(input, threads));
    contenders.push_back(atlas_waechter(input, threads));
  }
  const auto outcomes =
      race(contenders, {.runs = request.runs},
           [&](std::size_t done, std::size_t of) { bar.show(input.name, done, of); });
  report.input[input.name] = {{"triangles", input.surface.triangles.size()},
                              {"still_triangles", input.still.triangles.size()},
                              {"views", input.views.size()}};
  for (std::size_t i = 0; i < contenders.size(); ++i) {
    Message row = result_row(contenders[i], input.name, outcomes[i]);
    const Message& result = outcomes[i].result;
    if (!result.is_null()) {
      const auto figures = apart(
          [&] { return label_figures(mesh_from(result), array_from<int>(result.at("label"))); });
      if (!figures) return figures.error();
      row.update(*figures);
    }
    report.results.push_back(std::move(row));
  }
  return {};
}

Result<Report> run_atlas(const Request& request, cli::ProgressBar& bar) {
  const auto names = wanted_cases(atlas_cases(), request, "atlas has");
  if (!names) return names.error();
  Report report{.stage = "atlas",
                .columns = {{"triangles", "triangles", 0},
                            {"regions", "regions", 0},
                            {"<50 cm2", "under_50_cm2", 0},
                            {"<20 cm2", "under_20_cm2", 0},
                            {"patches", "patches", 0},
                            {"border m", "border_m", 1},
                            {"none", "untextured", 4}}};
  for (const std::string& name : *names) {
    bar.show("loading", 0, 1);
    const auto input = load_atlas_case(name);
    if (!input) return input.error();
    if (const Status measured = measure_labels(*input, request, bar, report); !measured)
      return measured.error();
  }
  return report;
}

}  // namespace

Stage atlas_stage() {
  return {"atlas", "view selection; peer: Waechter et al. 2014, with a graph cut", atlas_cases,
          run_atlas};
}

}  // namespace mr::bench
