#include "mr/merge/overlap/ownership_map.h"

#include <algorithm>
#include <numeric>

#include "mr/core/parallel.h"
#include "mr/kit/raster.h"

namespace mr::merge {
namespace {

constexpr double kCell_voxels = 16;   // of the quality grid
constexpr float kFirstWins = 1.001f;  // of two about equally good measurements
constexpr float kClear = 0.8f;        // of another's quality: worse than that beside it, too
constexpr float kLeastMargin = 1e-12f;
constexpr double kFocal_voxels = 2.5;  // pixels per radian · voxel_m: 1.2 voxels a pixel at 3 m
constexpr double kLeastFocal_px = 250;
constexpr float kLeastOwn = 1;          // at its own border, of the others' weight
constexpr double kFeather_voxels = 14;  // from a border, where a part counts less
constexpr double kAside_voxels = 1.6;   // how far from a part's border the part counts as there

/// The pinhole cameras of a source (one, or the faces of a cube) at the low resolution that
/// ownership needs.
std::vector<RayGrid> places_of(const SourceInfo& source, double voxel_m) {
  const double focal_px = std::max(kFocal_voxels / voxel_m, kLeastFocal_px);
  const Camera& camera = source.depth_camera;
  if (camera.model == CameraModel::pinhole)
    return {{kit::scaled(camera, std::min(1.0, focal_px / camera.fx)), source.T_world_depth}};
  std::vector<RayGrid> out;
  for (const kit::CubeFace& face : kit::cube_faces(focal_px, 0))
    out.push_back({face.camera, source.T_world_depth * Pose{face.R_camera_face, {}}});
  return out;
}

std::vector<Measured> all_measured(std::span<const kit::Part> parts, const OverlapConfig& config) {
  std::vector<Measured> out(parts.size());
  parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) out[i] = measured(parts[i], config);
  });
  return out;
}

std::vector<std::uint32_t> first_owners(std::span<const kit::Part> parts) {
  std::vector<std::uint32_t> out{0};
  for (const kit::Part& part : parts)
    out.push_back(out.back() + static_cast<std::uint32_t>(part.sources.size()));
  return out;
}

}  // namespace

OwnershipMap::OwnershipMap(std::span<const kit::Part> parts, const OverlapConfig& config,
                           QualityMemory* memory)
    : parts_(parts),
      voxel_m_(config.voxel_m),
      measured_(all_measured(parts, config)),
      first_owner_(first_owners(parts)),
      grid_(parts, measured_, kCell_voxels * config.voxel_m, memory, !config.is_piece),
      surface_(first_owner_.back()),
      kept_{std::vector<Cut>(parts.size()), std::vector<Views>(first_owner_.back())},
      kept_also_(kept_) {
  std::size_t most = 0;
  for (const kit::Part& part : parts) most = std::max(most, part.mesh.triangles.size());
  same_.resize(most);
  std::iota(same_.begin(), same_.end(), 0u);
  parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) draw(i, {parts_[i].mesh, same_}, surface_);
  });
}

/// What a source measured of a part's region.
OwnershipMap::Views OwnershipMap::views_of(std::size_t part, std::uint32_t source,
                                           const Region& region) const {
  const SourceInfo& from = parts_[part].sources[source];
  const bool pinhole = from.depth_camera.model == CameraModel::pinhole;
  Views out;
  for (const RayGrid& place : places_of(from, voxel_m_))
    out.emplace_back(parts_[part], measured_[part], region, source, place.camera,
                     place.T_world_camera, pinhole ? place.camera.width / 4 : 1,
                     kFeather_voxels * voxel_m_);
  return out;
}

void OwnershipMap::draw(std::size_t part, const Region& region, std::vector<Views>& views) {
  for (std::uint32_t s = 0; s < parts_[part].sources.size(); ++s)
    views[first_owner_[part] + s] = views_of(part, s, region);
}

void OwnershipMap::keep(std::size_t part, Cut region, Drawn& in) {
  in.regions[part] = std::move(region);
  const Cut& kept = in.regions[part];
  if (!kept.mesh.empty()) draw(part, {kept.mesh, kept.parent}, in.views);
}
void OwnershipMap::keep(std::size_t part, Cut region) { keep(part, std::move(region), kept_); }
void OwnershipMap::keep_also(std::size_t part, Cut region) {
  keep(part, std::move(region), kept_also_);
}

bool OwnershipMap::has_surface(std::uint32_t owner, const SurfacePoint& point,
                               std::uint32_t of) const {
  return std::ranges::any_of(surface_[owner], [&](const PartView& view) {
    return view.has(point, measured_[of].slack_m);
  });
}

bool OwnershipMap::keeps(const Drawn& in, std::uint32_t owner, const SurfacePoint& point,
                         std::uint32_t of) const {
  const auto aside_m = static_cast<float>(kAside_voxels * voxel_m_);
  return std::ranges::any_of(in.views[owner], [&](const PartView& view) {
    return view.reaches(point, measured_[of].slack_m, aside_m);
  });
}

OwnershipMargin OwnershipMap::Query::margin_at(const SurfacePoint& point) {
  const auto candidates = reader_.at(point.position, point.normal);
  float mine = 0, below = 0;  // the best of those that measured it worse
  for (const auto& [owner, number, quality] : candidates)
    if (owner.part == part_ && owner.source == point.source) mine = quality;
  better_.clear();
  for (QualityGrid::Candidate its : candidates) {
    if (its.owner.part == part_) continue;
    its.quality *= its.owner.part < part_ ? kFirstWins : 1 / kFirstWins;
    if (its.quality < mine || (its.quality == mine && part_ < its.owner.part))
      below = std::max(below, its.quality);
    else
      better_.push_back(its);
  }
  std::ranges::make_heap(better_, {}, by_quality);
  for (; !better_.empty(); better_.pop_back()) {
    std::ranges::pop_heap(better_, {}, by_quality);
    const auto& [owner, number, quality] = better_.back();
    if (owners_.has_surface(number, point, part_))
      return {std::min(mine - quality, -kLeastMargin), {number, mine < kClear * quality}};
  }
  return {std::max(mine - below, kLeastMargin), {}};
}

Vec3f OwnershipMap::Query::mean_at(const SurfacePoint& point) {
  float along_m = 0, others = 0;
  for (const QualityGrid::Candidate& c : reader_.at(point.position, point.normal)) {
    if (c.owner.part == part_) continue;
    PartView::Meeting best;
    for (const PartView& view : owners_.surface_[c.number])
      if (const auto m = view.meeting(point, owners_.measured_[part_].slack_m);
          m.weight > best.weight)
        best = m;
    along_m += best.weight * best.along_m, others += best.weight;
  }
  if (others == 0) return point.position;
  float own = 0;
  for (const PartView& view : owners_.surface_[owners_.first_owner_[part_] + point.source])
    own = std::max(own, view.own_weight(point));
  if (own == 0) own = kLeastOwn * others;  // at its own border
  return point.position + point.normal * (along_m / (own + others));
}

bool OwnershipMap::Query::is_kept_by(std::uint32_t owner, const SurfacePoint& point) const {
  return owners_.keeps(owners_.kept_, owner, point, part_) ||
         owners_.keeps(owners_.kept_also_, owner, point, part_);
}

bool OwnershipMap::Query::is_kept(const SurfacePoint& point, const Loss& loss) {
  if (loss.owner != Loss::kNoOwner && is_kept_by(loss.owner, point)) return true;
  const auto candidates = reader_.at(point.position, point.normal);
  return std::ranges::any_of(candidates, [&](const QualityGrid::Candidate& c) {
    return c.owner.part != part_ && c.number != loss.owner && is_kept_by(c.number, point);
  });
}

bool OwnershipMap::Query::is_kept_also(const SurfacePoint& point) const {
  for (std::uint32_t owner = 0; owner < owners_.first_owner_[part_]; ++owner)
    if (owners_.keeps(owners_.kept_also_, owner, point, part_)) return true;
  return false;
}

}  // namespace mr::merge
