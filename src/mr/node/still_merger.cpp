#include "mr/node/still_merger.h"

#include <algorithm>
#include <utility>

#include "mr/kit/raycast.h"
#include "mr/node/chunk_grid.h"
#include "mr/node/sensor_node.h"

namespace mr::node {
namespace {

constexpr double kReach_voxels = 48;  // three cells of the quality grid

// In ticks. kPatience: how long a fresh still triangle is withheld while no plate textures it; less
// than the ten captures during which a sensor in lockstep keeps sending it as moving.
// kRelabelEvery: how long still surface without a plate waits until labels are chosen again.
// kLabelAllEvery: the longest interval between labellings of everything.
constexpr std::uint64_t kPatience = 8, kRelabelEvery = 30, kLabelAllEvery = 3000;
// The same if fewer than 1/kManyBlocks of the valid blocks are new.
constexpr std::uint64_t kRelabelLateEvery = 300;
constexpr std::size_t kManyBlocks = 100;
// The root splits each cube of the chunk grid in this many along each axis for the still surface,
// so that a change affects fewer triangles.
constexpr int kStillPerCube = 2;
// Ticks between removals of surface in free space, for a large or a small area.
constexpr std::uint64_t kEmptyEvery = 15, kLittleEvery = 30;
constexpr double kMuchEmptied_m2 = 0.02;
constexpr std::uint64_t kCheckEvery = 90;  // ticks until surface uncovered by a removal is labelled
constexpr double kWorthWithholding_m2 = 0.02;
constexpr double kManyCuts = 1.3;  // times the triangles after the last labelling of everything

/// The precision of the noisiest of several sensors, as seen from 2 m.
Precision noisiest(const std::vector<SourceInfo>& sources) {
  const auto worst = std::max_element(sources.begin(), sources.end(),
                                      [](const SourceInfo& a, const SourceInfo& b) {
                                        return a.precision.sigma_m(2) < b.precision.sigma_m(2);
                                      });
  return worst == sources.end() ? Precision{} : worst->precision;
}

}  // namespace

atlas::LabelConfig label_config(const Scene& scene, const std::vector<SourceInfo>& sources,
                                float error_m) {
  return {.views = scene.atlas.views,
          .geometry_error_m = texturing_error_m(scene, error_m),
          .precision = noisiest(sources),
          .min_edge_m = 2 * scene.voxel_m,
          .lattice = scene.lattice};
}

StillMerger::StillMerger(const Scene& scene, const MergerConfig& merger, bool is_root, Clock clock,
                         Trace& trace)
    : scene_(&scene),
      is_root_(is_root),
      trace_(&trace),
      joiner_(scene, merger, std::move(clock), trace),
      cubes_(scene.fusion.chunk_m, kReach_voxels * scene.voxel_m) {}

/// Whether enough blocks of plates have become valid since the last labelling. After
/// kRelabelLateEvery ticks a single block suffices, or labels that were not sent.
bool StillMerger::is_labelling_worth_it(std::uint64_t age, std::size_t valid_blocks) const {
  if (labels_.are_outdated && age >= kRelabelLateEvery) return true;
  return valid_blocks > labels_.blocks &&
         (age >= kRelabelLateEvery ||
          kManyBlocks * (valid_blocks - labels_.blocks) >= valid_blocks);
}

bool StillMerger::is_due(std::uint64_t sequence, std::size_t valid_blocks,
                         double emptied_m2) const {
  const std::uint64_t age = sequence - labels_.last;
  const std::uint64_t empty_every = emptied_m2 >= kMuchEmptied_m2 ? kEmptyEvery : kLittleEvery;
  return !is_labelled_ || (emptied_m2 > 0 && age >= empty_every) ||
         (withheld_until_ && sequence >= *withheld_until_) ||
         (labels_.is_check_due && sequence >= labels_.checked + kCheckEvery) ||
         (is_root_ && age >= kRelabelEvery && is_labelling_worth_it(age, valid_blocks));
}

Result<StillMerger::Made> StillMerger::update(Task task) {
  using Extent = atlas::LastingLabels::Extent;
  const Extent extent = extent_of(task);
  const bool was_quick = labels_.is_check_due;
  if (task.inputs)
    if (const Status joined = join(*std::move(task.inputs), task.decimation, task.sequence);
        !joined)
      return joined.error();
  const Mesh textured =
      trace_->time("atlas", [&] { return is_root_ ? labelled(task, extent) : joined_.mesh; });
  std::optional<std::uint64_t> withheld_until;
  const bool withhold = is_root_ && !task.views.empty();
  Mesh mesh = withhold ? without_fresh_grey(textured, task.sequence, withheld_until) : textured;
  const bool was_withheld = std::exchange(withheld_until_, withheld_until).has_value();
  shown_.mesh = std::make_shared<const Mesh>(std::move(mesh));
  shown_.error_m = joined_.errors.most_m();
  const bool is_other =
      !is_labelled_ || withheld_until_ || was_withheld ||
      (extent != Extent::new_surface && (was_quick || !labels_.lasting.kept_surface()));
  // Inner mergers pass everything on: they do not know when the root shows still surface.
  if (is_root_ && is_other)
    shown_.cover = std::make_shared<const merge::StillSurfaceMask>(*shown_.mesh, joined_.parts,
                                                                   overlap_config(*scene_));
  if (is_root_) shown_.occluders = labels_.lasting.occluders();
  is_labelled_ = true;
  return Made{shown_, pieces(), !withheld_until_};
}

double StillMerger::piece_m(const Scene& scene, bool is_root) {
  return scene.fusion.chunk_m / (is_root ? kStillPerCube : 1);
}

/// The shown mesh by the cubes that it is sent in.
std::map<Vec3i, SurfacePiece> StillMerger::pieces() const {
  const double edge_m = piece_m(*scene_, is_root_);
  std::map<Vec3i, SurfacePiece> out;
  for (auto& [place, mesh] : split_by_cube(*shown_.mesh, edge_m)) {
    const Vec3d middle = (vec_cast<double>(place) + Vec3d{0.5, 0.5, 0.5}) * edge_m;
    const float error_m = joined_.errors.at(cube_of(middle, scene_->fusion.chunk_m));
    std::vector<std::uint8_t> guessed = joined_.guessed.marks(mesh);
    out[place] = {std::move(mesh), error_m, std::move(guessed)};
  }
  return out;
}

/// Overlap removal, zipper, island removal and decimation around the cubes that changed. Labels are
/// chosen later.
Status StillMerger::join(Inputs inputs, const Decimation& decimation, std::uint64_t sequence) {
  is_labelled_ = false;
  const std::vector<DecodedScene>& scenes = inputs.scenes;
  const std::vector<kit::Part>& parts = inputs.parts;
  if (std::exchange(bends_, inputs.bends) != inputs.bends) cubes_.forget();
  const auto join_some = [&](const std::vector<kit::Part>& some, bool all) {
    return joiner_.join(some, all);
  };
  const auto bend = [&](std::vector<kit::Part>& some) { calib::bend(inputs.bends, some); };
  // A refined pose (merge.refine) changes every cube of an input.
  const bool whole = scene_->merge.refine || scene_->merge.leave_out_mm > 0;
  const Mesh joined = whole ? join_some(parts, true) : cubes_.run(scenes, parts, bend, join_some);
  if (joiner_.take_hurried()) cubes_.forget();  // some seams are still open
  note_fresh(scenes, sequence);
  auto surface = joiner_.decimated(joined, parts, errors_of(scenes), decimation);
  if (!surface) return surface.error();
  if (is_root_) joiner_.close_holes(parts, Layer::still, *surface);
  joined_ = {std::move(surface->mesh), std::move(inputs.parts), std::move(surface->errors),
             std::move(surface->guessed)};
  return {};
}

/// Records which cubes are fresh. A second change does not extend the period, as the surface from
/// before it is not sent as moving for longer.
void StillMerger::note_fresh(const std::vector<DecodedScene>& scenes, std::uint64_t sequence) {
  std::map<Vec3i, std::vector<ChunkKey>> contents;
  for (const DecodedScene& scene : scenes)
    for (const auto& chunk : scene.chunks) contents[chunk->key.id.cube].push_back(chunk->key);
  std::erase_if(fresh_since_, [&](const auto& cube) { return sequence > cube.second + kPatience; });
  for (const auto& [cube, keys] : contents) {
    const auto before = contents_.find(cube);
    const bool changed = before == contents_.end() || before->second != keys;
    if (changed) fresh_since_.try_emplace(cube, sequence);
  }
  contents_ = std::move(contents);
}

/// The tick until which a cube is fresh; nothing: it is not fresh.
std::optional<std::uint64_t> StillMerger::fresh_until(Vec3i cube, std::uint64_t sequence) const {
  const auto since = fresh_since_.find(cube);
  if (since == fresh_since_.end() || sequence >= since->second + kPatience) return std::nullopt;
  return since->second + kPatience;
}

/// Withholds fresh triangles that no plate textures, where nothing was shown before: until a plate
/// textures them, or kPatience has passed, they remain part of the moving surface.
Mesh StillMerger::without_fresh_grey(const Mesh& mesh, std::uint64_t sequence,
                                     std::optional<std::uint64_t>& until) const {
  const Mesh nothing;
  const Mesh& shown = shown_.mesh ? *shown_.mesh : nothing;
  std::vector<std::uint8_t> keep(mesh.triangles.size(), 1);
  std::optional<kit::RayScene> before;
  double withheld_m2 = 0;
  for (const ViewRun& run : mesh.views) {
    if (run.id != kNoView) continue;
    for (std::uint32_t t = run.first; t < run.first + run.count; ++t) {
      const Vec3f p = mesh.centroid(t);
      const auto fresh =
          fresh_until(cube_of(vec_cast<double>(p), scene_->fusion.chunk_m), sequence);
      if (!fresh) continue;
      const Mesh* const meshes[] = {&shown};
      if (!before) before.emplace(meshes);
      if (before->nearest(p, static_cast<float>(2 * scene_->voxel_m))) continue;
      keep[t] = 0, withheld_m2 += 0.5 * length(mesh.area_normal(t));
      until = std::min(until.value_or(*fresh), *fresh);
    }
  }
  if (withheld_m2 < kWorthWithholding_m2) until.reset();
  return until ? select_triangles(mesh, keep) : mesh;
}

/// The extent of the next labelling. Everything is labelled at intervals that grow with the age of
/// the surface, when more blocks are valid. Removed surface is handled soon (new_surface);
/// labelling the surface that it uncovered costs more and is deferred (changes).
atlas::LastingLabels::Extent StillMerger::extent_of(const Task& task) const {
  using Extent = atlas::LastingLabels::Extent;
  const std::uint64_t wait = std::clamp(labels_.all - labels_.first, kPatience, kLabelAllEvery);
  // Triangles split at the silhouette of a temporary occluder stay split.
  const bool many_cuts =
      static_cast<double>(labels_.pieces) > kManyCuts * static_cast<double>(labels_.pieces_at_all);
  if (!labels_.are_any || ((task.valid_blocks > labels_.blocks_at_all || many_cuts) &&
                           task.sequence >= labels_.all + wait))
    return Extent::everything;
  const bool is_old = task.inputs || !is_labelled_ || withheld_until_;
  return is_old || task.sequence >= labels_.checked + kCheckEvery ? Extent::changes
                                                                  : Extent::new_surface;
}

/// The joined surface, without surface in free space, with labels of the plates that texture it.
Mesh StillMerger::labelled(const Task& task, atlas::LastingLabels::Extent extent) {
  using Extent = atlas::LastingLabels::Extent;
  if (!std::exchange(labels_.are_any, true)) labels_.first = task.sequence;
  labels_.last = task.sequence, labels_.blocks = task.valid_blocks;
  atlas::LabelConfig config = label_config(*scene_, task.sources, joined_.errors.most_m());
  config.valid = task.valid, config.colors = &task.colors;
  Mesh out = labels_.lasting.update(task.empty.carved(joined_.mesh), task.views, std::move(config),
                                    extent);
  labels_.pieces = out.triangles.size();
  const bool quick = extent == Extent::new_surface;
  labels_.is_check_due = quick && (labels_.is_check_due || !labels_.lasting.kept_surface());
  if (!quick) labels_.checked = task.sequence;
  if (extent == Extent::everything)
    labels_.all = task.sequence, labels_.blocks_at_all = task.valid_blocks,
    labels_.pieces_at_all = labels_.pieces;
  return out;
}

}  // namespace mr::node
