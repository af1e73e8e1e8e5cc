#include "mr/node/planner.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "mr/core/parallel.h"
#include "mr/fusion/voxel_block.h"
#include "mr/node/chunk_publisher.h"

namespace mr::node {
namespace {

constexpr int kPoints = 128;            // that stand for a sensor's surface
constexpr std::size_t kMostPoses = 16;  // of a sensor that moves
constexpr double kTriangleM2 = 0.0012;  // of sensors that were not looked at: 10,000 on 12 m²

/// What a sensor can see, from the poses that it takes.
class Eye {
 public:
  Eye(const SensorConfig& sensor, const Sight& sight)
      : camera_(undistorted(sensor.depth_camera)),
        depth_(&sight.depth),
        near_m_(sensor.depth_near_m),
        far_m_(sensor.depth_far_m) {
    const auto& all = sensor.T_world_depth;
    const std::size_t count = std::min(all.size(), kMostPoses);
    for (std::size_t i = 0; i < count; ++i) T_world_depth_.push_back(all[i * all.size() / count]);
    const auto end = T_world_depth_.end();
    if (sight.T_world_depth) seen_from_ = {sight.T_world_depth->inverse()};
    if (seen_from_.empty())
      std::transform(T_world_depth_.begin(), end, std::back_inserter(seen_from_),
                     [](const Pose& T) { return T.inverse(); });
    for (const Vec2d pixel : border()) {
      const Vec3d ray = unproject(camera_, pixel);
      rays_.add(is_flat() ? ray : Vec3d{});
      farthest_m_ = std::max(farthest_m_, far_m_ * length(ray));
    }
  }

  /// Whether a point lies in the frustum and, where there is a picture, on a surface in it.
  bool sees(Vec3d point) const {
    return std::any_of(seen_from_.begin(), seen_from_.end(), [&](const Pose& T_depth_world) {
      const Vec3d p = T_depth_world * point;
      if (dot(p, p) > farthest_m_ * farthest_m_) return false;
      const double depth = is_flat() ? p.z : length(p);
      if (depth < near_m_ || depth > far_m_) return false;
      const auto pixel = project(camera_, p);
      if (!pixel) return false;
      const double u = std::round(pixel->x), v = std::round(pixel->y);
      return u >= 0 && v >= 0 && u < camera_.width && v < camera_.height &&
             (depth_->empty() || has_surface(static_cast<int>(u), static_cast<int>(v), depth));
    });
  }

  /// Points spread evenly over the frustum's volume, always the same.
  std::vector<Vec3d> points() const {
    std::vector<Vec3d> out;
    const auto part = [](int i, double step) { return std::fmod(0.5 + i * step, 1.0); };
    for (int i = 0; i < kPoints; ++i) {  // Roberts' R3 sequence
      const Vec2d pixel{part(i, 0.8191725134) * camera_.width - 0.5,
                        part(i, 0.6710436067) * camera_.height - 0.5};
      const double near3 = near_m_ * near_m_ * near_m_, far3 = far_m_ * far_m_ * far_m_;
      const double depth = std::cbrt(near3 + part(i, 0.5497004779) * (far3 - near3));
      out.push_back(T_world_depth_[i % T_world_depth_.size()] *
                    (unproject(camera_, pixel) * depth));
    }
    return out;
  }

  /// All that it can see lies in here.
  Box3d reach() const {
    Box3d out;
    for (const Pose& T : T_world_depth_) {
      out.add(T.translation);
      const Vec3d far{far_m_, far_m_, far_m_};
      if (!is_flat()) out.add(T.translation - far), out.add(T.translation + far);
      if (is_flat())
        for (const Vec2d pixel : border()) out.add(T * (unproject(camera_, pixel) * far_m_));
    }
    return out;
  }

  /// Whether it can see something of a box; may be true of one that is just beside its frustum.
  bool may_see(const Box3d& box) const {
    return std::any_of(T_world_depth_.begin(), T_world_depth_.end(), [&](const Pose& T) {
      const Vec3d nearest = max(box.low, min(box.high, T.translation));
      if (length(nearest - T.translation) > farthest_m_) return false;
      return !is_flat() || !is_beside(box, T.inverse());
    });
  }

 private:
  bool is_flat() const { return camera_.model == CameraModel::pinhole; }

  std::array<Vec2d, 8> border() const {
    const double left = -0.5, right = camera_.width - 0.5, top = -0.5, low = camera_.height - 0.5;
    const double x = (left + right) / 2, y = (top + low) / 2;
    return {{{left, top},
             {x, top},
             {right, top},
             {left, y},
             {right, y},
             {left, low},
             {x, low},
             {right, low}}};
  }

  bool has_surface(int u, int v, double depth_m) const {
    constexpr double kApart = 0.1;  // metres; more is another surface
    for (int y = std::max(v - 1, 0); y <= std::min(v + 1, depth_->height - 1); ++y)
      for (int x = std::max(u - 1, 0); x <= std::min(u + 1, depth_->width - 1); ++x)
        if (*depth_->at(x, y) > 0 && std::abs(*depth_->at(x, y) - depth_m) <= kApart) return true;
    return false;
  }

  /// Whether all of a box lies beyond one of the six sides of a pinhole's frustum.
  bool is_beside(const Box3d& box, const Pose& T_depth_world) const {
    std::array<bool, 6> all;
    all.fill(true);
    for (int corner = 0; corner < 8; ++corner) {
      const Vec3d p = T_depth_world * Vec3d{corner & 1 ? box.high.x : box.low.x,
                                            corner & 2 ? box.high.y : box.low.y,
                                            corner & 4 ? box.high.z : box.low.z};
      const std::array<bool, 6> beyond = {p.z<near_m_, p.z> far_m_,
                                          p.x<rays_.low.x * p.z, p.x> rays_.high.x * p.z,
                                          p.y<rays_.low.y * p.z, p.y> rays_.high.y * p.z};
      for (std::size_t side = 0; side < 6; ++side) all[side] = all[side] && beyond[side];
    }
    return std::any_of(all.begin(), all.end(), [](bool outside) { return outside; });
  }

  Camera camera_;
  const ImageDepth* depth_;
  double near_m_, far_m_, farthest_m_ = 0;
  Box3d rays_;  // of a pinhole's border, at 1 m
  std::vector<Pose> T_world_depth_;
  std::vector<Pose> seen_from_;  // T_depth_world
};

/// A set of sensors, one bit each.
using Group = std::vector<std::uint64_t>;

bool has(const Group& group, std::size_t sensor) { return group[sensor / 64] >> (sensor % 64) & 1; }
void put(Group& group, std::size_t sensor) {
  group[sensor / 64] |= std::uint64_t{1} << (sensor % 64);
}

/// A part of a sensor's surface.
struct Point {
  Vec3d at;
  std::uint32_t sensor = 0;
  double triangles = 0;
  Group seen;  // by these sensors, its own included
};

/// The scene as the planner knows it.
struct Site {
  const Scene* scene = nullptr;
  const MergeCosts* costs = nullptr;
  std::vector<Eye> eyes;          // [sensors]
  std::vector<double> triangles;  // [sensors]
  std::vector<Point> points;      // by sensor

  std::size_t sensors() const { return eyes.size(); }
  Group none() const { return Group((sensors() + 63) / 64, 0); }
};

void add_points(Site& site, std::uint32_t sensor, const Sight& sight) {
  std::vector<Vec3d> at;
  if (sight.surface.empty() && sight.depth.empty())
    at = site.eyes[sensor].points();
  else
    for (int i = 0; i < kPoints && !sight.surface.empty(); ++i)
      at.push_back(vec_cast<double>(sight.surface[i * sight.surface.size() / kPoints]));
  if (site.scene->volume)
    std::erase_if(at, [&](Vec3d p) { return !site.scene->volume->contains(p); });
  site.triangles.push_back(at.empty() ? 0 : sight.triangles);
  for (const Vec3d p : at)
    site.points.push_back({p, sensor, sight.triangles / static_cast<double>(at.size()), {}});
}

Site make_site(const Scene& scene, std::span<const Sight> sights, const MergeCosts& costs) {
  Site site;
  site.scene = &scene, site.costs = &costs;
  for (std::size_t i = 0; i < scene.sensors.size(); ++i)
    site.eyes.emplace_back(scene.sensors[i], sights[i]);
  for (std::uint32_t i = 0; i < scene.sensors.size(); ++i) add_points(site, i, sights[i]);
  parallel_for(site.points.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      Point& point = site.points[k];
      point.seen = site.none();
      for (std::size_t i = 0; i < site.sensors(); ++i)
        if (i == point.sensor || site.eyes[i].sees(point.at)) put(point.seen, i);
    }
  });
  return site;
}

int common(const Group& a, const Group& b) {
  int out = 0;
  for (std::size_t w = 0; w < a.size(); ++w) out += std::popcount(a[w] & b[w]);
  return out;
}

/// A box of cubes of the chunk grid: [low, high).
struct Cubes {
  Vec3i low, high;

  std::int64_t count() const {
    const Vec3i size = high - low;
    return std::int64_t{size.x} * size.y * size.z;
  }
  Box3d box(double chunk_m, int margin = 0) const {
    const Vec3i more{margin, margin, margin};
    return {vec_cast<double>(low - more) * chunk_m, vec_cast<double>(high + more) * chunk_m};
  }
};

bool holds(const Cubes& cubes, Vec3i cube, int margin) {
  for (int axis = 0; axis < 3; ++axis)
    if (cube[axis] < cubes.low[axis] - margin || cube[axis] >= cubes.high[axis] + margin)
      return false;
  return true;
}

/// What a merger has to do, in triangles.
struct Load {
  double in = 0, shared = 0, out = 0;
};

/// Of a merger whose inputs have merged these sensors each. Where several sensors see a spot, one
/// of them stays. With `region`: of a merger that owns it.
Load load_of(const Site& site, std::span<const Group> inputs, const Cubes* region = nullptr) {
  Group all = site.none();
  std::vector<std::size_t> input_of(site.sensors());
  for (std::size_t k = 0; k < inputs.size(); ++k)
    for (std::size_t i = 0; i < site.sensors(); ++i)
      if (has(inputs[k], i)) put(all, i), input_of[i] = k;
  Load out;
  for (const Point& point : site.points) {
    if (!has(all, point.sensor)) continue;
    const Vec3i cube = cube_of(point.at, site.scene->fusion.chunk_m);
    if (region && !holds(*region, cube, 1)) continue;
    const int among = common(point.seen, all);
    const int inside = common(point.seen, inputs[input_of[point.sensor]]);
    out.in += point.triangles / inside;
    if (among > inside) out.shared += point.triangles / inside;
    if (!region || holds(*region, cube, 0)) out.out += point.triangles / among;
  }
  return out;
}

/// Puts in what a merger's load means. `group`: the sensors below it.
void set_load(PlannedMerger& merger, const Load& load, const Group& group, const Site& site) {
  constexpr double kBytesPerPixel = 12;  // a picture, the one before it, and the decoder's
  const MergeCosts& costs = *site.costs;
  merger.triangles_in = load.in, merger.triangles_out = load.out;
  merger.triangles_shared = load.shared;
  merger.latency_ms = 1e-6 * (load.in * (costs.decode_ns + costs.merge_ns) +
                              load.shared * costs.overlap_ns + load.out * costs.code_ns);
  double pixels = 0;
  for (std::size_t i = 0; i < site.sensors(); ++i)
    if (const auto& camera = site.scene->sensors[i].color_camera; camera && has(group, i))
      pixels += static_cast<double>(camera->width) * camera->height;
  merger.memory_mb = 1e-6 * (load.in * costs.memory_bytes + pixels * kBytesPerPixel);
}

/// Time for a node's bytes over a link that the scene names.
double link_ms(const Site& site, const std::string& from, double triangles, double base_ms) {
  double out = base_ms;
  for (const LinkConfig& link : site.scene->links)
    if (link.from == from && link.limit_mbps > 0)
      out = std::max(out,
                     base_ms + triangles * site.costs->coded_bytes * 8 / (link.limit_mbps * 1000));
  return out;
}

/// Adds up the layers: each is as slow as its slowest merger and link.
void add_up(Plan& plan, const Site& site, const PlanConfig& config) {
  std::map<std::string, double> sent;  // triangles
  for (std::size_t i = 0; i < site.sensors(); ++i)
    sent[site.scene->sensors[i].id] = site.triangles[i];
  std::map<int, std::pair<double, double>> layers;  // slowest merger and link
  for (const PlannedMerger& merger : plan.mergers) {
    auto& [slowest, link] = layers[merger.layer];
    slowest = std::max(slowest, merger.latency_ms);
    for (const std::string& input : merger.config.inputs)
      link = std::max(link, link_ms(site, input, sent[input], config.link_ms));
    sent[merger.config.id] = merger.triangles_out;
  }
  plan.layers = static_cast<int>(layers.size());
  plan.latency_ms = plan.links_ms = 0;
  for (const auto& [layer, ms] : layers)
    plan.latency_ms += ms.first + ms.second, plan.links_ms += ms.second;
}

/// Groups of sensors with what they have to do and share.
struct Clusters {
  std::vector<Group> groups;
  std::vector<double> cost;                 // triangles
  std::vector<Vec3d> middle;                // of what they see
  std::vector<std::vector<double>> shared;  // [groups][groups] triangles that both see
};

Clusters one_each(const Site& site) {
  const std::size_t n = site.sensors();
  Clusters out;
  out.groups.assign(n, site.none());
  out.middle.assign(n, {});
  out.shared.assign(n, std::vector<double>(n, 0));
  for (std::size_t i = 0; i < n; ++i) {
    put(out.groups[i], i);
    out.cost.push_back(std::max(site.triangles[i], 1.0));
  }
  for (const Point& point : site.points) {
    out.middle[point.sensor] += point.at * (point.triangles / site.triangles[point.sensor]);
    for (std::size_t j = 0; j < n; ++j) {
      if (j == point.sensor || !has(point.seen, j)) continue;
      out.shared[point.sensor][j] += point.triangles;
      out.shared[j][point.sensor] += point.triangles;
    }
  }
  return out;
}

/// Joins group `b` to group `a` < b.
void join(Clusters& c, std::size_t a, std::size_t b) {
  for (std::size_t w = 0; w < c.groups[a].size(); ++w) c.groups[a][w] |= c.groups[b][w];
  const double sum = c.cost[a] + c.cost[b];
  c.middle[a] = c.middle[a] * (c.cost[a] / sum) + c.middle[b] * (c.cost[b] / sum);
  c.cost[a] = sum;
  for (std::size_t k = 0; k < c.groups.size(); ++k)
    if (k != a) c.shared[k][a] = c.shared[a][k] += c.shared[b][k];
  const auto at = static_cast<std::ptrdiff_t>(b);
  for (auto& row : c.shared) row.erase(row.begin() + at);
  c.shared.erase(c.shared.begin() + at);
  c.groups.erase(c.groups.begin() + at);
  c.cost.erase(c.cost.begin() + at);
  c.middle.erase(c.middle.begin() + at);
}

/// Joins the two groups that share most of what they see (those that are nearest, where none
/// shares any) and have not more than `most` to do together; false where there are none.
bool join_best(Clusters& c, double most) {
  std::optional<std::pair<std::size_t, std::size_t>> best;
  std::pair<double, double> best_key;
  for (std::size_t a = 0; a < c.groups.size(); ++a)
    for (std::size_t b = a + 1; b < c.groups.size(); ++b) {
      if (c.cost[a] + c.cost[b] > most) continue;
      const std::pair key(c.shared[a][b] / (c.cost[a] * c.cost[b]),
                          -length(c.middle[a] - c.middle[b]));
      if (!best || key > best_key) best = {a, b}, best_key = key;
    }
  if (best) join(c, best->first, best->second);
  return best.has_value();
}

/// Joins until `wanted` groups are left that have at most `slack` times their share to do, if
/// that can be.
Clusters joined(Clusters c, std::size_t wanted, double slack) {
  double total = 0;
  for (const double cost : c.cost) total += cost;
  double most = slack * total / static_cast<double>(wanted);
  while (c.groups.size() > wanted)
    if (!join_best(c, most)) most *= 1.1;
  return c;
}

/// Ids for new mergers that no sensor and no root has.
class Ids {
 public:
  explicit Ids(const Scene& scene) : root(scene.mergers.back().id) {
    taken_.insert(root);
    for (const SensorConfig& sensor : scene.sensors) taken_.insert(sensor.id);
  }
  std::string next(const std::string& kind, int number) {
    std::string id = kind + "-" + std::to_string(number);
    while (!taken_.insert(id).second) id += "x";
    return id;
  }
  const std::string root;

 private:
  std::set<std::string> taken_;
};

std::vector<std::string> sensor_ids(const Site& site, const Group& group) {
  std::vector<std::string> out;
  for (std::size_t i = 0; i < site.sensors(); ++i)
    if (has(group, i)) out.push_back(site.scene->sensors[i].id);
  return out;
}

double first_deadline_ms(const Scene& scene) {
  double out = scene.mergers.front().deadline_ms;
  for (const MergerConfig& merger : scene.mergers) out = std::min(out, merger.deadline_ms);
  return out;
}

/// A merger waits as long as its inputs do, and for the slowest of them.
double deadline_above_ms(const std::vector<const PlannedMerger*>& inputs) {
  double deadline = 0, slowest = 0, fastest = 1e9;
  for (const PlannedMerger* input : inputs) {
    deadline = std::max(deadline, input->config.deadline_ms);
    slowest = std::max(slowest, input->latency_ms), fastest = std::min(fastest, input->latency_ms);
  }
  return deadline + 10 * std::ceil((slowest - fastest) / 10);
}

/// Builds a tree of groups, layer by layer.
class TreeBuilder {
 public:
  explicit TreeBuilder(const Site& site) : site_(&site), ids_(*site.scene) {}

  /// The first layer.
  void add_sensor_groups(std::vector<Group> groups) {
    std::sort(groups.begin(), groups.end(), first_sensor_first);
    for (const Group& group : groups) {
      std::vector<Group> inputs;
      for (std::size_t i = 0; i < site_->sensors(); ++i)
        if (has(group, i)) put(inputs.emplace_back(site_->none()), i);
      PlannedMerger merger;
      merger.config.id = ids_.next("merger", ++count_);
      merger.config.inputs = sensor_ids(*site_, group);
      merger.config.deadline_ms = first_deadline_ms(*site_->scene);
      set_load(merger, load_of(*site_, inputs), group, *site_);
      below_.emplace_back(group, plan_.mergers.size());
      plan_.mergers.push_back(std::move(merger));
    }
  }

  /// Mergers above those of the layer before, which are in one of these groups each.
  void add_layer(std::vector<Group> groups) {
    std::sort(groups.begin(), groups.end(), first_sensor_first);
    std::vector<std::pair<Group, std::size_t>> above;
    for (const Group& group : groups) {
      std::vector<Group> inputs;
      std::vector<const PlannedMerger*> nodes;
      PlannedMerger merger;
      for (const auto& [sensors, place] : below_)
        if (common(sensors, group) > 0) {
          inputs.push_back(sensors), nodes.push_back(&plan_.mergers[place]);
          merger.config.inputs.push_back(nodes.back()->config.id);
        }
      merger.layer = nodes.front()->layer + 1;
      merger.config.id = groups.size() == 1 ? ids_.root : ids_.next("upper", ++upper_);
      merger.config.deadline_ms = deadline_above_ms(nodes);
      set_load(merger, load_of(*site_, inputs), group, *site_);
      above.emplace_back(group, plan_.mergers.size());
      plan_.mergers.push_back(std::move(merger));
    }
    below_ = std::move(above);
  }

  Plan take() { return std::move(plan_); }

 private:
  static bool first_sensor_first(const Group& a, const Group& b) {
    for (std::size_t w = 0; w < a.size(); ++w) {
      const int x = std::countr_zero(a[w]), y = std::countr_zero(b[w]);
      if (x != y || x < 64) return x < y;
    }
    return false;
  }

  const Site* site_;
  Ids ids_;
  int count_ = 0, upper_ = 0;
  std::vector<std::pair<Group, std::size_t>> below_;  // the layer before, places in the plan
  Plan plan_;
};

/// A tree of sensor groups: `uppers` of the mergers make a layer of their own.
Plan tree_of_groups(const Site& site, const Clusters& leaves, std::size_t uppers, double slack) {
  TreeBuilder builder(site);
  builder.add_sensor_groups(leaves.groups);
  if (uppers > 0) builder.add_layer(joined(leaves, uppers, slack).groups);
  Group all = site.none();
  for (std::size_t i = 0; i < site.sensors(); ++i) put(all, i);
  builder.add_layer({all});
  return builder.take();
}

/// The best of several trees of sensor groups. Simpler ones come first: another must be clearly
/// faster.
Plan best_groups(const Site& site, const PlanConfig& config) {
  constexpr double kClearly = 0.95;
  const Clusters single = one_each(site);
  std::optional<Plan> best;
  const std::size_t n = static_cast<std::size_t>(config.mergers);
  for (const std::size_t uppers : {std::size_t{0}, (n + 7) / 8, (n + 3) / 4}) {
    if (uppers > 0 && (uppers < 2 || n - uppers < 2 * uppers)) continue;
    for (const double slack : {1.15, 1.5, 2.5, 1e9}) {
      Plan plan = tree_of_groups(site, joined(single, n - uppers, slack), uppers, slack);
      add_up(plan, site, config);
      if (!best || plan.latency_ms < kClearly * best->latency_ms) best = std::move(plan);
    }
  }
  return *std::move(best);
}

/// All that any sensor can see, in cubes.
Cubes space_of(const Site& site) {
  Box3d reach;
  for (const Eye& eye : site.eyes) reach.add(eye.reach().low), reach.add(eye.reach().high);
  if (const auto& volume = site.scene->volume)
    reach = {max(reach.low, volume->low), min(reach.high, volume->high)};
  const double chunk_m = site.scene->fusion.chunk_m;
  const Vec3i high = cube_of(reach.high, chunk_m);
  return {cube_of(reach.low, chunk_m), high + Vec3i{1, 1, 1}};
}

/// Where to cut a box so that its parts, `first` and `second` of them, have about the same to do;
/// nothing when there are too few cubes.
std::optional<std::int32_t> best_cut(const Site& site, const Cubes& box, int axis, int first,
                                     int second) {
  std::map<std::int32_t, double> at;
  double total = 0;
  for (const Point& point : site.points)
    if (const Vec3i cube = cube_of(point.at, site.scene->fusion.chunk_m); holds(box, cube, 0))
      at[cube[axis]] += point.triangles, total += point.triangles;
  if (at.empty()) return std::nullopt;
  std::optional<std::int32_t> best;
  double best_off = 0, below = 0;
  for (std::int32_t cut = at.begin()->first + 1; cut <= at.rbegin()->first; ++cut) {
    if (const auto before = at.find(cut - 1); before != at.end()) below += before->second;
    Cubes low = box, high = box;
    low.high[axis] = high.low[axis] = cut;
    if (low.count() < first || high.count() < second) continue;
    const double off = std::abs(below / total - static_cast<double>(first) / (first + second));
    if (!best || off < best_off) best = cut, best_off = off;
  }
  return best;
}

/// Cuts a box into `parts` regions, across its longest side where there is surface; false when it
/// has too few cubes.
bool cut_space(const Site& site, const Cubes& box, int parts, std::vector<Cubes>& out) {
  if (parts == 1) {
    out.push_back(box);
    return true;
  }
  Box3d surface;
  for (const Point& point : site.points)
    if (holds(box, cube_of(point.at, site.scene->fusion.chunk_m), 0)) surface.add(point.at);
  if (surface.empty()) return false;
  std::array<int, 3> axes{0, 1, 2};
  const Vec3d size = surface.high - surface.low;
  std::stable_sort(axes.begin(), axes.end(), [&](int a, int b) { return size[a] > size[b]; });
  const int first = parts / 2, second = parts - first;
  for (const int axis : axes) {
    const auto cut = best_cut(site, box, axis, first, second);
    if (!cut) continue;
    Cubes low = box, high = box;
    low.high[axis] = high.low[axis] = *cut;
    const std::size_t before = out.size();
    if (cut_space(site, low, first, out) && cut_space(site, high, second, out)) return true;
    out.resize(before);
  }
  return false;
}

/// The sensors that may see something of a region or of the cubes around it.
std::vector<Group> groups_of(const Site& site, const std::vector<Cubes>& regions) {
  const double chunk_m = site.scene->fusion.chunk_m;
  std::vector<Group> out(regions.size(), site.none());
  for (std::size_t i = 0; i < site.sensors(); ++i) {
    bool any = false;
    for (std::size_t r = 0; r < regions.size(); ++r)
      if (site.eyes[i].may_see(regions[r].box(chunk_m, 1))) put(out[r], i), any = true;
    if (!any) put(out[0], i);  // it sees nothing: all the same to which it belongs
  }
  return out;
}

/// A tree of mergers with regions; nothing when the space has too few cubes.
std::optional<Plan> tree_of_regions(const Site& site, const PlanConfig& config) {
  std::vector<Cubes> regions;
  if (!cut_space(site, space_of(site), config.mergers, regions)) return std::nullopt;
  const std::vector<Group> groups = groups_of(site, regions);
  Plan plan;
  plan.split = Split::space;
  Ids ids(*site.scene);
  Load sum;
  Group all = site.none();
  std::vector<std::string> children;
  for (std::size_t r = 0; r < regions.size(); ++r) {
    std::vector<Group> inputs;
    for (std::size_t i = 0; i < site.sensors(); ++i)
      if (has(groups[r], i)) put(inputs.emplace_back(site.none()), i), put(all, i);
    if (inputs.empty()) return std::nullopt;
    PlannedMerger merger;
    merger.config.id = ids.next("region", static_cast<int>(r) + 1);
    merger.config.inputs = sensor_ids(site, groups[r]);
    merger.config.deadline_ms = first_deadline_ms(*site.scene);
    merger.config.region = regions[r].box(site.scene->fusion.chunk_m);
    const Load load = load_of(site, inputs, &regions[r]);
    set_load(merger, load, groups[r], site);
    sum.in += load.out, sum.out += load.out;
    children.push_back(merger.config.id);
    plan.mergers.push_back(std::move(merger));
  }
  PlannedMerger root;
  root.layer = 2;
  root.config.id = ids.root, root.config.inputs = children;
  std::vector<const PlannedMerger*> below;
  for (const PlannedMerger& merger : plan.mergers) below.push_back(&merger);
  root.config.deadline_ms = deadline_above_ms(below);
  set_load(root, sum, all, site);
  plan.mergers.push_back(std::move(root));
  add_up(plan, site, config);
  return plan;
}

/// One merger for all.
Plan tree_of_one(const Site& site, const PlanConfig& config) {
  TreeBuilder builder(site);
  Group all = site.none();
  for (std::size_t i = 0; i < site.sensors(); ++i) put(all, i);
  builder.add_sensor_groups({all});
  Plan plan = builder.take();
  plan.mergers.front().config.id = site.scene->mergers.back().id;
  add_up(plan, site, config);
  return plan;
}

/// Share of what the root gets that several of its inputs saw.
double shared_at_root(const Plan& plan) {
  const PlannedMerger& root = plan.mergers.back();
  return root.triangles_in > 0 ? root.triangles_shared / root.triangles_in : 0;
}

Result<Plan> choose(const Site& site, const PlanConfig& config) {
  constexpr double kCrowded = 0.5;     // of the root's triangles
  constexpr double kDearAtMost = 1.1;  // times the latency: for a root that has nothing to decide
  if (config.mergers == 1) {
    Plan plan = tree_of_one(site, config);
    plan.why = "one merger for all sensors";
    return plan;
  }
  std::optional<Plan> groups, regions;
  if (config.split != Split::space) groups = best_groups(site, config);
  const double shared = groups ? shared_at_root(*groups) : 1;
  if (config.split == Split::space || (!config.split && shared > kCrowded))
    regions = tree_of_regions(site, config);
  if (!groups && !regions)
    return Error{Error::Cause::invalid,
                 fmt::format("the space cannot be split into {} regions: its cubes of "
                             "fusion.chunk_m = {} m are too few",
                             config.mergers, site.scene->fusion.chunk_m)};
  const auto say = [&](Plan& plan, const std::string& why) {
    plan.why = why;
    return std::move(plan);
  };
  if (!groups) return say(*regions, "by region of space, as asked for");
  const std::string seen = fmt::format(
      "{:.0f} % of what the root would get from groups of sensors "
      "is seen by several of them",
      100 * shared);
  if (!regions)
    return say(*groups, config.split        ? "by group of sensors, as asked for"
                        : shared > kCrowded ? seen + ", but the space has too few cubes to be split"
                                            : "by group of sensors: " + seen);
  const std::string both = fmt::format("{:.0f} ms against {:.0f} ms for groups",
                                       regions->latency_ms, groups->latency_ms);
  if (regions->latency_ms <= kDearAtMost * groups->latency_ms)
    return say(*regions, "by region of space: the sensors crowd one place (" + seen + "), " + both);
  return say(*groups, "by group of sensors, though they crowd one place (" + seen +
                          "): regions would need " + both);
}

OneGrid one_grid_of(const Site& site, std::span<const Sight> sights, const Load& all) {
  OneGrid out;
  double area_m2 = 0;
  bool known = true;
  for (std::size_t i = 0; i < sights.size(); ++i) {
    area_m2 += sights[i].area_m2 > 0 ? sights[i].area_m2 : site.triangles[i] * kTriangleM2;
    out.reconstruct_ms += sights[i].reconstruct_ms;
    known = known && sights[i].reconstruct_ms > 0;
  }
  if (!known) out.reconstruct_ms = 0;
  if (all.in > 0) area_m2 *= all.out / all.in;  // what several see counts once
  const double voxel_m = site.scene->voxel_m, side_m = voxel_m * fusion::VoxelBlock::kSide;
  // A plane in any direction crosses 1.5 cubes per side², and its band those beside it.
  const double per_m2 = (1.5 + 2 * site.scene->fusion.truncation_m / side_m) / (side_m * side_m);
  out.blocks = area_m2 * per_m2;
  out.memory_mb =
      1e-6 * out.blocks * (sizeof(fusion::VoxelBlock) + sizeof(fusion::VoxelBlock::Weights));
  constexpr double kDenseBytes = 8;  // distance, weight, colour
  const Vec3d size = vec_cast<double>(space_of(site).high - space_of(site).low) *
                     (site.scene->fusion.chunk_m / voxel_m);
  out.dense_memory_mb = 1e-6 * size.x * size.y * size.z * kDenseBytes;
  return out;
}

Status check(const Scene& scene, std::span<const Sight> sights, const PlanConfig& config) {
  const auto refuse = [](const std::string& why) { return Error{Error::Cause::invalid, why}; };
  constexpr int kMost = 255;  // of scene files, less the root
  if (scene.sensors.empty() || scene.mergers.empty() || sights.size() != scene.sensors.size())
    return refuse("scene '" + scene.id + "' has no sensors to plan for");
  if (config.mergers < 1) return refuse("a tree needs at least 1 merger");
  if (static_cast<std::size_t>(config.mergers) > scene.sensors.size())
    return refuse(fmt::format("{} mergers are more than the scene's {} sensors", config.mergers,
                              scene.sensors.size()));
  if (config.mergers > kMost)
    return refuse(fmt::format("{} mergers are too many: at most {}", config.mergers, kMost));
  return {};
}

/// As it stands in YAML; words that mean something else there are quoted.
std::string in_yaml(const std::string& id) {
  std::string word;
  for (const char c : id) word += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  const std::set<std::string> special{"null", "true", "false", "yes", "no", "on", "off", "y", "n"};
  const bool plain = !id.empty() && std::isalpha(static_cast<unsigned char>(id.front()));
  return plain && !special.contains(word) ? id : "\"" + id + "\"";
}

}  // namespace

Result<Plan> make_plan(const Scene& scene, std::span<const Sight> sights, const MergeCosts& costs,
                       const PlanConfig& config) {
  if (const Status good = check(scene, sights, config); !good) return good.error();
  const Site site = make_site(scene, sights, costs);
  auto plan = choose(site, config);
  if (!plan) return plan.error();
  const Plan one = tree_of_one(site, config);
  plan->central = one.mergers.front();
  plan->central_latency_ms = one.latency_ms;
  plan->one_grid =
      one_grid_of(site, sights, {plan->central.triangles_in, 0, plan->central.triangles_out});
  return plan;
}

std::string mergers_block(const Plan& plan) {
  constexpr std::size_t kWidth = 100;
  std::string out = "mergers:\n";
  for (const PlannedMerger& merger : plan.mergers) {
    std::string line = "  - {id: " + in_yaml(merger.config.id) + ", inputs: [";
    for (std::size_t i = 0; i < merger.config.inputs.size(); ++i) {
      const std::string input =
          in_yaml(merger.config.inputs[i]) + (i + 1 < merger.config.inputs.size() ? "," : "]");
      if (line.size() + input.size() > kWidth) out += line + "\n", line = "     ";
      line += (i > 0 ? " " : "") + input;
    }
    out += line + fmt::format(", deadline_ms: {:.9g}", merger.config.deadline_ms);
    if (merger.config.budget_ms > 0)
      out += fmt::format(", budget_ms: {:.9g}", merger.config.budget_ms);
    if (const auto& r = merger.config.region)
      out += fmt::format(",\n     region: [[{:.9g}, {:.9g}, {:.9g}], [{:.9g}, {:.9g}, {:.9g}]]",
                         r->low.x, r->low.y, r->low.z, r->high.x, r->high.y, r->high.z);
    out += "}\n";
  }
  return out;
}

std::string with_mergers(std::string_view scene_text, const std::string& block) {
  std::string before, after, held;  // held: comments and blank lines, of what comes next
  enum { before_it, in_it, behind_it } place = before_it;
  for (std::size_t begin = 0; begin < scene_text.size();) {
    const std::size_t end = std::min(scene_text.find('\n', begin), scene_text.size() - 1) + 1;
    std::string line(scene_text.substr(begin, end - begin));
    if (line.back() != '\n') line += '\n';
    begin = end;
    const bool starts = line.starts_with("mergers:");
    const bool continues = line[0] == ' ' || line[0] == '\t' || line[0] == '-' || line[0] == ']';
    const bool silent = line[0] == '#' || line.find_first_not_of(" \t\r\n") == std::string::npos;
    if (place == before_it && starts)
      place = in_it;
    else if (place == in_it && silent)
      held += line;
    else if (place == in_it && continues)
      held.clear();
    else if (place == before_it)
      before += line;
    else
      place = behind_it, after += std::exchange(held, "") + line;
  }
  return before + block + held + after;
}

}  // namespace mr::node
