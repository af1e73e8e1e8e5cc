#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>

#include "bytes.h"
#include "fuse_contenders.h"
#include "mr/core/parallel.h"
#include "race.h"
#include "stage.h"
#include "surfaces.h"
#include "zipper_contenders.h"

namespace mr::bench {
namespace {

const std::string kNanoflann = "nanoflann";

std::vector<Contender> contenders_of(const ZipperCase& input, const Request& request) {
  std::vector<Contender> out;
  for (const int threads : request.threads) {
    if (!input.strips.parts.empty()) {
      out.push_back(zip_ours(input.strips, threads));
      continue;
    }
    out.push_back(match_ours(input.border, threads));
    std::ranges::move(match_nanoflann(input.border, threads), std::back_inserter(out));
    std::ranges::move(match_open3d(input.border, threads), std::back_inserter(out));
  }
  return out;
}

// ------------------------------------------------------------ matches

/// Whether two found the same, but for rounding: which of several equally near points is nearest
/// may differ.
bool is_same(const merge::PointGrid::Match& a, const merge::PointGrid::Match& b) {
  constexpr float kRounding_m = 1e-6f;
  const bool a_found = a.nearest != a.kNone, b_found = b.nearest != b.kNone;
  return a.neighbours == b.neighbours && a_found == b_found &&
         std::abs(a.distance_m - b.distance_m) < kRounding_m;
}

/// What was found, and for how many points it is not what the first contender found.
void add_found(const Matches& matches, const Matches& reference, Message& row) {
  std::size_t neighbours = 0, matched = 0, different = 0;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    neighbours += matches[i].neighbours;
    matched += matches[i].nearest != merge::PointGrid::Match::kNone;
    different += !is_same(matches[i], reference[i]);
  }
  row["neighbours"] = neighbours, row["matched"] = matched, row["different"] = different;
}

/// Per number of threads the peer's faster variant once more, under the peer's own name.
void add_fastest_peer(const Request& request, std::vector<Message>& rows) {
  for (const int threads : request.threads) {
    const Message* best = nullptr;
    for (const Message& row : rows)
      if (row["threads"] == threads &&
          row["impl"].get<std::string>().starts_with(kNanoflann + "/") && row["ms"].is_number() &&
          (!best || row["ms"] < best->at("ms")))
        best = &row;
    if (!best) continue;
    Message row = *best;
    row["variant"] = row["impl"], row["impl"] = kNanoflann;
    rows.push_back(std::move(row));
  }
}

void describe_matches(const BorderPoints& border, const std::vector<Outcome>& outcomes,
                      std::vector<Message>& rows, Message& about) {
  about = {{"points", border.points.size()}, {"radius_m", border.radius_m}};
  Matches reference;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (outcomes[i].result.is_null()) continue;
    const auto matches = array_from<merge::PointGrid::Match>(outcomes[i].result);
    if (reference.empty()) reference = matches;
    add_found(matches, reference, rows[i]);
  }
}

// ------------------------------------------------------------ strips

Status describe_strips(const Strips& strips, const std::vector<Outcome>& outcomes,
                       std::vector<Message>& rows, Message& about) {
  std::size_t before = 0;
  for (const Mesh& part : strips.parts) before += part.triangles.size();
  about = {{"parts", strips.parts.size()}, {"triangles", before}};
  const auto evaluated = apart([&] {  // topology takes threads
    Message out = Message::array();
    for (const Outcome& outcome : outcomes)
      out.push_back(outcome.result.is_null() ? Message::object()
                                             : surface_figures(mesh_from(outcome.result)));
    return out;
  });
  if (!evaluated) return evaluated.error();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    rows[i].update(evaluated->at(i));
    if (rows[i].contains("triangles"))
      rows[i]["added"] =
          rows[i]["triangles"].get<std::int64_t>() - static_cast<std::int64_t>(before);
  }
  return {};
}

Status measure_case(const std::string& name, const Request& request, cli::ProgressBar& bar,
                    Report& report) {
  bar.show(name + ": loading", 0, 1);
  const auto input = load_zipper_case(name);
  if (!input) return input.error();
  const auto contenders = contenders_of(*input, request);
  const auto outcomes = race(contenders, {.runs = request.runs},
                             [&](std::size_t done, std::size_t of) { bar.show(name, done, of); });
  std::vector<Message> rows;
  for (std::size_t i = 0; i < contenders.size(); ++i)
    rows.push_back(result_row(contenders[i], name, outcomes[i]));
  Message& about = report.input[name];
  if (input->strips.parts.empty()) {
    describe_matches(input->border, outcomes, rows, about);
    add_fastest_peer(request, rows);
  } else if (const Status told = describe_strips(input->strips, outcomes, rows, about); !told) {
    return told.error();
  }
  std::ranges::move(rows, std::back_inserter(report.results));
  return {};
}

Result<Report> run_zipper(const Request& request, cli::ProgressBar& bar) {
  if (!request.input.empty())
    return Error{Error::Cause::unsupported, "zipper has cases of its own only: no --input"};
  const auto names = wanted_cases(zipper_cases(), request, "zipper has");
  if (!names) return names.error();
  Report report{.stage = "zipper",
                .columns = {{"found", "neighbours", 0},
                            {"matched", "matched", 0},
                            {"differ", "different", 0},
                            {"added", "added", 0},
                            {"nonman.", "nonmanifold_edges", 0}}};
  if (!has_nanoflann()) report.absent.push_back(kNanoflann);
  if (!has_open3d()) report.absent.push_back("open3d");
  for (const std::string& name : *names)
    if (const Status measured = measure_case(name, request, bar, report); !measured)
      return measured.error();
  return report;
}

}  // namespace

Stage zipper_stage() {
  return {"zipper", "borders matched and joined; peers: nanoflann, Open3D", zipper_cases,
          run_zipper};
}

}  // namespace mr::bench
