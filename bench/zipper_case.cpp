#include "zipper_case.h"

#include <fmt/format.h>

#include <random>

#include "merge_case.h"
#include "merge_contenders.h"
#include "mr/core/parallel.h"
#include "mr/kit/topology.h"
#include "mr/merge/overlap/overlap.h"
#include "surfaces.h"

namespace mr::bench {
namespace {

const std::string kStrips = "strips/";

struct Size {
  const char* name;
  std::size_t points;
  std::size_t triangles;  ///< of a part; 0: all
};
/// A border of 10,000 vertices is one of decimated parts; 100,000 are there without.
constexpr Size kSizes[]{{"10k", 10'000, kTrianglesOfABench}, {"100k", 100'000, 0}};

/// Every so many of the parts' border vertices; where there are too few, copies of them up to a
/// centimetre away.
BorderPoints some_of(const BorderPoints& all, const Size& size) {
  BorderPoints out;
  out.name = size.name;
  std::mt19937 random(1);
  const std::size_t have = all.points.size();
  for (std::size_t i = 0; i < size.points; ++i) {
    const std::size_t from = have >= size.points ? i * have / size.points : i % have;
    const auto jitter = [&] {
      return i < have ? 0.0f : (static_cast<float>(random() % 2001) - 1000) * 1e-5f;
    };
    out.points.push_back(all.points[from] + Vec3f{jitter(), jitter(), jitter()});
    out.part.push_back(all.part[from]);
  }
  return out;
}

BorderPoints borders_of(const std::vector<kit::Part>& parts) {
  BorderPoints out;
  for (std::uint32_t i = 0; i < parts.size(); ++i) {
    const Mesh& mesh = parts[i].mesh;
    const kit::EdgeTable table = kit::edge_table(mesh);
    std::vector<std::uint8_t> on_border(mesh.positions.size());
    for (std::uint32_t h = 0; h < table.uses.size(); ++h)
      if (table.uses[h] == 1)
        on_border[kit::edge_from(mesh, h)] = on_border[kit::edge_to(mesh, h)] = 1;
    for (std::size_t v = 0; v < on_border.size(); ++v)
      if (on_border[v]) out.points.push_back(mesh.positions[v]), out.part.push_back(i);
  }
  return out;
}

/// In a child, because what it calls takes threads.
Result<BorderPoints> load_border(const Size& size) {
  const auto parts = load_room_bench(size.triangles);
  if (!parts) return parts.error();
  BorderPoints all;
  const auto outcome = apart([&]() -> Message {
    const BorderPoints found = borders_of(*parts);
    Mesh points{found.points, {}, {}, {}};
    Message out = to_message(points);
    out["part"] = found.part;
    return out;
  });
  if (!outcome) return outcome.error();
  all.points = mesh_from(*outcome).positions;
  all.part = outcome->at("part").get<std::vector<std::uint32_t>>();
  if (all.points.empty()) return Error{Error::Cause::empty, "the parts have no border"};
  return some_of(all, size);
}

Result<Strips> load_strips(const std::string& name) {
  const auto input = load_merge_case(name.substr(kStrips.size()));
  if (!input) return input.error();
  const auto outcome = apart([&] {
    Message out = Message::array();
    Arena arena(0);
    arena.run([&] {
      const merge::OverlapConfig config = overlap_config(*input);
      for (const Mesh& mesh : merge::remove_overlap(input->parts, config))
        out.push_back(to_message(mesh));
    });
    return out;
  });
  if (!outcome) return outcome.error();
  Strips out{name, {}, input->voxel_m};
  for (const Message& mesh : *outcome) out.parts.push_back(mesh_from(mesh));
  return out;
}

}  // namespace

std::vector<CaseInfo> zipper_cases() {
  std::vector<CaseInfo> out;
  for (const Size& size : kSizes)
    out.push_back({size.name, fmt::format("{} border vertices of room_bench, 2 cm", size.points),
                   true, no_room_bench()});
  for (const CaseInfo& c : merge_cases())
    if (c.name == "room_bench" || c.name == "rooms/20")
      out.push_back(
          {kStrips + c.name, c.what + ", without overlap", c.name == "room_bench", c.missing});
  return out;
}

Result<ZipperCase> load_zipper_case(const std::string& name) {
  ZipperCase out;
  for (const Size& size : kSizes) {
    if (name != size.name) continue;
    auto border = load_border(size);
    if (!border) return border.error();
    out.border = *std::move(border);
    return out;
  }
  auto strips = load_strips(name);
  if (!strips) return strips.error();
  out.strips = *std::move(strips);
  return out;
}

}  // namespace mr::bench
