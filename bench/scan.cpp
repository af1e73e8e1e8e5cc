#include <algorithm>
#include <cmath>
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

struct ScanVoxel {
  const char* name;
  const char* what;
  double voxel_m;
};

/// The voxel of examples/lidar-dome.yaml, and that of `fuse`'s room.
constexpr ScanVoxel kVoxels[] = {
    {"scan", "2048x128 LiDAR scan of an 8x5x3 m room, 3 cm voxels", 0.03},
    {"scan-1cm", "the same with the 1 cm voxels of fuse's room", 0.01}};

std::vector<CaseInfo> scan_cases() {
  std::vector<CaseInfo> out;
  for (const ScanVoxel& voxel : kVoxels) out.push_back({voxel.name, voxel.what, true, ""});
  return out;
}

/// `fuse`'s room_bench; where it is not found, the synthetic sensor of `fuse`.
Result<FuseCase> load_room() {
  for (const CaseInfo& known : fuse_cases())
    if (known.name == "room_bench" && known.missing.empty()) return load_fuse_case(known.name);
  return load_fuse_case("rig");
}

/// Fields about one surface. Takes threads: for a child.
Message evaluate(const FuseCase& scan, const Message& result, bool is_scan) {
  if (result.is_null()) return Message::object();
  const Mesh mesh = mesh_from(result);
  Message fields = surface_figures(mesh);
  if (!is_scan || mesh.empty()) return fields;
  Arena arena(0);
  arena.run([&] { fields["to_truth_rms_mm"] = rounded(distance(mesh, scan.truth).rms_mm, 4); });
  return fields;
}

Message describe(const FuseCase& c) {
  return {{"width", c.depth.width},
          {"height", c.depth.height},
          {"valid_pixels", std::ranges::count_if(c.depth.data, [](float m) { return m > 0; })},
          {"voxel_m", c.voxel_m},
          {"truncation_m", c.truncation_m}};
}

Status measure_scan(const FuseCase& scan, const FuseCase& room, const Request& request,
                    cli::ProgressBar& bar, Report& report) {
  std::vector<Contender> contenders;
  for (const int threads : request.threads)
    for (Contender& one : scan_contenders(scan, room, threads))
      contenders.push_back(std::move(one));
  const std::vector<Outcome> outcomes =
      race(contenders, {.runs = request.runs},
           [&](std::size_t done, std::size_t of) { bar.show(scan.name, done, of); });
  for (std::size_t i = 0; i < contenders.size(); ++i) {
    Message row = result_row(contenders[i], scan.name, outcomes[i]);
    const auto fields =
        apart([&] { return evaluate(scan, outcomes[i].result, contenders[i].impl == kOurs); });
    if (!fields) return fields.error();
    row.update(*fields);
    report.results.push_back(std::move(row));
  }
  report.input[scan.name] = describe(scan);
  return {};
}

/// "fuse-room/CASE/tN": time of the room / time of the scan. The target is a third.
Message ratios(const std::vector<Message>& rows) {
  Message out = Message::object();
  for (const Message& scan : rows)
    for (const Message& room : rows) {
      if (scan["impl"] != kOurs || room["impl"] != kFuseRoom) continue;
      if (scan["case"] != room["case"] || scan["threads"] != room["threads"]) continue;
      if (!scan["ms"].is_number() || !room["ms"].is_number()) continue;
      out[kFuseRoom + "/" + scan["case"].get<std::string>() + "/t" +
          std::to_string(scan["threads"].get<int>())] =
          rounded(room["ms"].get<double>() / scan["ms"].get<double>(), 3);
    }
  return out;
}

Result<Report> run_scan(const Request& request, cli::ProgressBar& bar) {
  if (!request.input.empty())
    return Error{Error::Cause::unsupported, "scan takes no --input: its scan and room are fixed"};
  const auto names = wanted_cases(scan_cases(), request, "scan has");
  if (!names) return names.error();
  bar.show("loading", 0, 1);
  const auto room = load_room();
  if (!room) return room.error();
  Report report{.stage = "scan", .columns = {{"m2", "area_m2"}, {"truth mm", "to_truth_rms_mm"}}};
  report.input["room"] = describe(*room);
  report.input["room"]["case"] = room->name;
  for (const ScanVoxel& voxel : kVoxels) {
    if (std::ranges::find(*names, voxel.name) == names->end()) continue;
    const auto scan = load_scan_case(voxel.name, voxel.voxel_m);
    if (!scan) return scan.error();
    if (const Status measured = measure_scan(*scan, *room, request, bar, report); !measured)
      return measured.error();
  }
  report.ratio = ratios(report.results);
  return report;
}

}  // namespace

Stage scan_stage() {
  return {"scan", "a LiDAR scan to an indexed mesh, beside fuse's room in the same run", scan_cases,
          run_scan};
}

}  // namespace mr::bench
