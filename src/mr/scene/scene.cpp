#include "mr/scene/scene.h"

#include <algorithm>
#include <cmath>

#include "mr/core/file.h"
#include "mr/rate/models.h"
#include "mr/scene/parts.h"
#include "mr/yaml/edit.h"

namespace mr {
namespace {

using scene_file::MapReader;
using scene_file::MergerEntry;
using scene_file::NodeName;
using scene_file::Report;

constexpr std::uintmax_t kMaxBytes = 16 * 1024 * 1024;

void read_up(MapReader& top, Vec3d& up) {
  double v[3];
  if (!top.numbers("up", {-1e6, 1e6}, v)) return;
  const Vec3d direction{v[0], v[1], v[2]};
  if (length(direction) < 1e-9)
    top.report.problem(top.line("up"), "up must be a direction, not 0 0 0");
  else
    up = normalized(direction);
}

/// A point cloud may be coarser than what browsers decode.
void read_step(MapReader& map, bool of_points, Lattice& lattice) {
  const bool read = map.integer("step_exp", lattice.step_exp, {-1000, 1000});
  const bool coarse = lattice.step_exp == -7 || lattice.step_exp == -8;
  if (read && (lattice.step_exp > (of_points ? -7 : -9) || lattice.step_exp < -11)) {
    map.report.problem(map.line("step_exp"),
                       std::string("step_exp must be one of ") + (of_points ? "-7, -8, " : "") +
                           "-9, -10, -11; not " + std::to_string(lattice.step_exp) +
                           (coarse ? ", which is for pipeline points" : ""));
    lattice.step_exp = Lattice{}.step_exp;
  }
}

/// After rate control's keys, which `step_exp: auto` goes by.
void read_lattice(MapReader& top, Scene& scene) {
  const yaml::Node* node = top.find("lattice");
  if (!node) return;
  MapReader map(top.report, *node, "lattice");
  Lattice& lattice = scene.lattice;
  const yaml::Node* step = map.find("step_exp");
  const bool is_auto = step && step->kind == yaml::Node::Kind::scalar && step->text == "auto";
  if (is_auto)
    lattice.step_exp = -rate::lattice_of_epoch(scene.rate, scene.still.layers, scene.voxel_m);
  else
    read_step(map, scene.pipeline == "points", lattice);
  double v[3];
  if (!map.numbers("origin", Lattice::kOrigin_m, v)) return;
  lattice.origin = {v[0], v[1], v[2]};
  Lattice coarsest = lattice;  // that it may be
  if (is_auto) coarsest.step_exp = static_cast<int>(Lattice::kMeshStepExp.high);
  for (const std::string& problem : coarsest.problems())
    map.report.problem(map.line("origin"), problem);
}

void read_volume(MapReader& top, Scene& scene) {
  const yaml::Node* node = top.find("volume");
  if (!node) return;
  MapReader map(top.report, *node, "volume");
  if (node->kind == yaml::Node::Kind::map && !map.has("box") && !map.has("remove_floor"))
    map.report.problem(map.line(), "volume lacks the key 'box' or 'remove_floor'");
  scene.volume = scene_file::read_box(map, "box");
  if (const yaml::Node* floor = map.find("remove_floor")) {
    MapReader plane(map.report, *floor, "remove_floor");
    scene.floor.emplace();
    plane.number("height_m", scene.floor->height_m, FloorConfig::kHeight_m);
    plane.number("margin_m", scene.floor->margin_m, FloorConfig::kMargin_m);
  }
}

void read_general(MapReader& top, Scene& scene) {
  if (const yaml::Node* id = top.need("scene"))
    scene.id = yaml::read_id(top.report, *id, "scene").value_or("");
  read_up(top, scene.up);
  top.number("fps", scene.fps, Scene::kFps);
  top.integer("threads", scene.threads, Scene::kThreads);
  top.number("voxel_m", scene.voxel_m, Scene::kVoxel_m);
  top.choice<std::string>("pipeline", scene.pipeline,
                          {{"meshreduce", "meshreduce"},
                           {"holoportation", "holoportation"},
                           {"holoportation++", "holoportation++"},
                           {"points", "points"},
                           {"rgbd", "rgbd"}});
  if (const yaml::Node* node = top.find("video")) {
    MapReader video(top.report, *node, "video");
    video.integer("threads", scene.video.threads, VideoConfig::kThreads);
    video.integer("slices", scene.video.slices, VideoConfig::kSlices);
  }
  read_volume(top, scene);
}

void read_fusion(MapReader& top, const Scene& scene, FusionConfig& fusion) {
  fusion.truncation_m = FusionConfig::kTruncation_voxels * scene.voxel_m;
  const yaml::Node* node = top.find("fusion");
  if (!node) return;
  MapReader map(top.report, *node, "fusion");
  map.choice<Decomposition>("decomposition", fusion.decomposition,
                            {{"none", Decomposition::none},
                             {"chunks", Decomposition::chunks},
                             {"patches", Decomposition::patches}});
  if (fusion.decomposition == Decomposition::none)
    map.not_acted_on("decomposition", "fusion.decomposition none (same as chunks)");
  const auto voxels = [&](const char* key, double& out, int least, Range range) {
    constexpr double kRounding = 1e-9;
    double value = 0;
    if (!map.number(key, value, range)) return;
    if (value < least * scene.voxel_m - kRounding)
      map.report.problem(map.line(key), std::string(key) + " must be at least " +
                                            std::to_string(least) + " voxels of voxel_m");
    else
      out = value;
  };
  voxels("chunk_m", fusion.chunk_m, FusionConfig::kLeastChunkVoxels, FusionConfig::kChunk_m);
  map.flag("mixed_pixels", fusion.clean.mixed_pixels);
  map.integer("speckle_px", fusion.clean.speckle_px, CleanConfig::kSpeckle_px);
  map.integer("fill_px", fusion.clean.fill_px, CleanConfig::kFill_px);
  map.flag("smooth_depth", fusion.clean.smooth_depth);
  voxels("truncation_m", fusion.truncation_m, FusionConfig::kLeastTruncationVoxels,
         FusionConfig::kTruncation_m);
  if (map.size("patches", FusionConfig::kPatches, fusion.patches_x, fusion.patches_y) &&
      fusion.decomposition != Decomposition::patches)
    map.not_acted_on("patches", "fusion.patches where decomposition is not patches");
}

void read_simplify(MapReader& parent, SimplifyConfig& simplify) {
  const yaml::Node* node = parent.find("simplify");
  if (!node) return;
  MapReader map(parent.report, *node, "simplify");
  map.number("ratio", simplify.ratio, SimplifyConfig::kRatio);
  map.number("error_m", simplify.error_m, SimplifyConfig::kError_m);
}

void read_merge(MapReader& top, MergeConfig& merge) {
  const yaml::Node* node = top.find("merge");
  if (!node) return;
  using Owner = MergeConfig::Owner;
  using Overlap = MergeConfig::Overlap;
  MapReader map(top.report, *node, "merge");
  map.choice<Owner>("owner", merge.owner, {{"paper", Owner::paper}, {"coherent", Owner::coherent}});
  map.choice<Overlap>("overlap", merge.overlap,
                      {{"rays", Overlap::rays}, {"raster", Overlap::raster}});
  if (map.has("overlap") && merge.owner != Owner::paper)
    map.not_acted_on("overlap", "merge.overlap where owner is not paper");
  map.flag("refine", merge.refine);
  map.flag("color_gain", merge.color_gain);
  map.number("calibration_error_m", merge.calibration_error_m, MergeConfig::kCalibrationError_m);
  map.number("island_area_m2", merge.island_area_m2, MergeConfig::kIslandArea_m2);
  map.number("gap_m", merge.gap_m, MergeConfig::kGap_m);
  map.number("agree_m", merge.agree_m, MergeConfig::kAgree_m);
  map.number("fill_m", merge.fill_m, MergeConfig::kFill_m);
  map.number("leave_out_mm", merge.leave_out_mm, MergeConfig::kLeaveOut_mm);
  read_simplify(map, merge.simplify);
}

void read_atlas(MapReader& top, AtlasConfig& atlas) {
  const yaml::Node* node = top.find("atlas");
  if (!node) return;
  using Views = AtlasConfig::Views;
  MapReader map(top.report, *node, "atlas");
  map.choice<Views>("views", atlas.views,
                    {{"coherent", Views::coherent},
                     {"best_angle", Views::best_angle},
                     {"packed", Views::packed},
                     {"separate", Views::separate}});
  map.flag("mask", atlas.mask);
  map.flag("burn_sequence", atlas.burn_sequence);
  map.size("size", AtlasConfig::kSize, atlas.width, atlas.height);
  if (atlas.views == Views::packed) map.not_acted_on("views", "atlas.views packed");
  if (atlas.views == Views::separate) map.not_acted_on("views", "atlas.views separate");
}

void read_rate_and_coding(MapReader& top, Scene& scene) {
  using Model = RateConfig::Model;
  if (const yaml::Node* node = top.find("reuse")) {
    MapReader reuse(top.report, *node, "reuse");
    reuse.flag("chunks", scene.reuse_chunks);
  }
  if (const yaml::Node* node = top.find("still")) {
    MapReader still(top.report, *node, "still");
    still.flag("layers", scene.still.layers);
    still.number("after_s", scene.still.after_s, StillConfig::kAfter_s);
  }
  if (const yaml::Node* node = top.find("rate")) {
    MapReader rate(top.report, *node, "rate");
    rate.choice<Model>("model", scene.rate.model,
                       {{"fixed", Model::fixed},
                        {"lookup", Model::lookup},
                        {"classifier", Model::classifier},
                        {"ours", Model::ours}});
    rate.number("target_mbps", scene.rate.target_mbps, RateConfig::kTarget_mbps);
    rate.integer("rungs", scene.rate.rungs, RateConfig::kRungs);
    rate.number("moving_weight", scene.rate.moving_weight, RateConfig::kMovingWeight);
    if (std::string file; rate.text("model_file", file)) {
      if (file.empty())
        rate.report.problem(rate.line("model_file"), "model_file must name a file, not ''");
      else
        scene.rate.model_file = rate.report.resolve(file);
    }
  }
  if (const yaml::Node* node = top.find("coding")) {
    MapReader coding(top.report, *node, "coding");
    coding.number("texture_scale", scene.coding.texture_scale, CodingConfig::kTextureScale);
    coding.integer("texture_qp", scene.coding.texture_qp, CodingConfig::kQp);
    coding.integer("sensor_texture_qp", scene.coding.sensor_texture_qp, CodingConfig::kQp);
    coding.integer("depth_qp", scene.coding.depth_qp, CodingConfig::kQp);
    coding.integer("frame_divider", scene.coding.frame_divider, CodingConfig::kFrameDivider);
    if (scene.pipeline == "meshreduce" && scene.coding.frame_divider != 1)
      coding.not_acted_on("frame_divider", "coding.frame_divider of pipeline meshreduce");
  }
}

void read_truth(MapReader& top, std::optional<TruthConfig>& truth) {
  const yaml::Node* node = top.find("truth");
  if (!node) return;
  MapReader map(top.report, *node, "truth");
  truth.emplace();
  if (map.need("mesh")) map.text("mesh", truth->mesh);
  if (const yaml::Node* rig = map.find("rig")) truth->rig = scene_file::read_rig(top.report, *rig);
}

/// Sensors or a rig; the names that mergers may use for them.
std::vector<NodeName> read_leaves(MapReader& top, Scene& scene) {
  Report& report = top.report;
  std::vector<NodeName> names;
  const yaml::Node* sensors = top.find("sensors");
  const yaml::Node* rig = top.find("rig");
  if (sensors) scene.sensors = scene_file::read_sensors(report, *sensors, names);
  if (rig) scene.rig = scene_file::read_rig(report, *rig);
  if (rig && sensors) report.problem(top.line("rig"), "a scene has sensors or a rig, not both");
  if (!rig && !sensors) report.problem(1, "the scene lacks the key 'sensors' (or 'rig')");
  if (rig && !sensors)
    for (const std::string& id : scene.rig->sensor_ids()) names.push_back({id, top.line("rig")});
  return names;
}

void read_tree(MapReader& top, const std::vector<NodeName>& leaves, Scene& scene) {
  std::vector<MergerEntry> mergers;
  if (const yaml::Node* node = top.find("mergers")) {
    mergers = scene_file::read_mergers(top.report, *node);
  } else {
    MergerEntry root;
    root.config.id = "root";
    for (const NodeName& leaf : leaves) {
      // A doubled id is reported as such; naming it twice here would only repeat that.
      if (std::find(root.config.inputs.begin(), root.config.inputs.end(), leaf.id) !=
          root.config.inputs.end())
        continue;
      if (leaf.id == root.config.id)
        top.report.problem(leaf.line, "id 'root' is the merger's where 'mergers' is left out");
      else
        root.config.inputs.push_back(leaf.id);
    }
    scene.mergers = {root.config};
    scene_file::check_ids(top.report, leaves, {});
  }
  const bool leaves_known =
      scene.rig || (!scene.sensors.empty() && leaves.size() == scene.sensors.size());
  if (!mergers.empty())
    scene.mergers =
        scene_file::ordered_tree(top.report, leaves, mergers, scene.fusion.chunk_m, leaves_known);
  if (const yaml::Node* node = top.find("links")) {
    std::vector<NodeName> names = leaves;
    for (const MergerConfig& merger : scene.mergers) names.push_back({merger.id, 0});
    scene.links = scene_file::read_links(top.report, *node, names);
    if (!scene.links.empty() && scene.rate.model == RateConfig::Model::fixed)
      top.not_acted_on("links", "links (but for `meshreduce plan`) where rate.model is fixed");
  }
}

/// What a sensor sees must lie on the lattice, or every frame would be lost.
void check_positions(Report& report, const std::vector<NodeName>& leaves, const Scene& scene) {
  const double half = scene.lattice.step_m() * Lattice::kCells / 2;
  for (std::size_t i = 0; i < std::min(leaves.size(), scene.sensors.size()); ++i)
    for (const Pose& pose : scene.sensors[i].T_world_depth) {
      const Vec3d off = pose.translation - scene.lattice.origin;
      const double reach = std::max({std::abs(off.x), std::abs(off.y), std::abs(off.z)}) +
                           scene.sensors[i].depth_far_m;
      if (reach < half) continue;
      report.problem(leaves[i].line,
                     "sensor '" + leaves[i].id + "' sees places outside the lattice's cube of " +
                         std::to_string(static_cast<int>(2 * half)) + " m; poses are in metres");
      break;
    }
}

void read_scene(Report& report, const yaml::Node& root, Scene& scene) {
  if (root.kind != yaml::Node::Kind::map) {
    report.problem(root.line, "this is no scene file: its top level must be a mapping of keys");
    return;
  }
  MapReader top(report, root, "the scene");
  read_general(top, scene);
  read_rate_and_coding(top, scene);
  read_lattice(top, scene);
  const std::vector<NodeName> leaves = read_leaves(top, scene);
  if (leaves.size() == scene.sensors.size()) check_positions(report, leaves, scene);
  read_fusion(top, scene, scene.fusion);
  read_tree(top, leaves, scene);
  read_simplify(top, scene.simplify);
  read_merge(top, scene.merge);
  read_atlas(top, scene.atlas);
  read_truth(top, scene.truth);
  scene_file::read_background(top, scene.background);
  scene_file::read_network(top, scene);
}

}  // namespace

SceneResult parse_scene(const std::string& text, const std::filesystem::path& file,
                        const std::vector<std::string>& set) {
  SceneResult result;
  result.scene.file = file, result.scene.set = set;
  Report report(file, set);
  try {
    yaml::Tree tree = yaml::parse_yaml(text);
    for (std::size_t i = 0; i < set.size() && tree.problem.empty(); ++i) {
      const int line = report.line_of_option(i);
      const std::string problem = yaml::set_value(tree.root, set[i], line);
      if (!problem.empty()) report.problem(line, problem);
    }
    if (tree.problem.empty())
      read_scene(report, tree.root, result.scene);
    else
      report.problem(tree.line, tree.problem);
  } catch (const std::exception& e) {
    report.problem(0, std::string("cannot read the scene: ") + e.what());
  }
  result.problems = report.take_problems();
  result.notices = report.take_notices();
  // What else is wrong may follow from a wrong option.
  const auto in_file = [](const SceneProblem& problem) { return !problem.option; };
  if (!std::all_of(result.problems.begin(), result.problems.end(), in_file))
    std::erase_if(result.problems, in_file);
  return result;
}

SceneResult load_scene(const std::filesystem::path& file, const std::vector<std::string>& set) {
  std::error_code failed;
  const auto status = std::filesystem::status(file, failed);
  const bool is_pipe = std::filesystem::exists(status) && std::filesystem::is_other(status);
  const auto bytes = is_pipe ? Error{Error::Cause::io, file.string() + " is not a regular file"}
                             : read_file(file, kMaxBytes);
  if (bytes)
    return parse_scene({reinterpret_cast<const char*>(bytes->data()), bytes->size()}, file, set);
  SceneResult result;
  result.scene.file = file;
  result.problems = {{file, 0, bytes.error().message}};
  return result;
}

}  // namespace mr
