#include "mr/calib/depth_correction.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "mr/calib/outliers.h"
#include "mr/calib/overlaps.h"
#include "mr/core/assert.h"
#include "mr/core/parallel.h"

namespace mr::calib {
namespace {

constexpr int kFirstRounds = 4;   // of association and solution, for new parts
constexpr int kMostSteps = 200;   // of conjugate gradients
constexpr double kEnough = 1e-8;  // of the first residual
constexpr double kStiff = 0.5;    // of the membrane, against a node's mean of data
constexpr double kHome = 0.2;     // of the pull towards no correction, likewise
constexpr double kMost = 0.6;     // of agree_m: half the largest disagreement, and a little more
constexpr double kStep_voxels = 0.2;   // a later update moves the surface by this at most
constexpr double kWorth_voxels = 0.1;  // RMS of a move that is made

using Nodes = std::vector<double>;  // [parts · kNodes] the unknowns

/// A distance between two parts' surfaces as a linear function of their nodes.
struct Row {
  std::array<std::uint32_t, 8> node{};
  std::array<double, 8> factor{};
  double apart_m = 0;  // with the corrections that it was measured with
  double weight = 0;

  double times(const Nodes& x) const {
    double sum = 0;
    for (std::size_t i = 0; i < node.size(); ++i) sum += factor[i] * x[node[i]];
    return sum;
  }
};

/// The least-squares problem: rows, and springs between nodes that are neighbours.
struct Problem {
  std::vector<Row> rows;
  std::vector<double> goal;                           // [rows] of times(x)
  std::vector<std::array<std::uint32_t, 2>> springs;  // nodes
  std::vector<double> stiffness, home;                // [springs], [nodes]

  /// The normal equations' left side.
  Nodes apply(const Nodes& x) const {
    Nodes out(x.size());
    for (const Row& row : rows) {
      const double pull = row.weight * row.times(x);
      for (std::size_t i = 0; i < row.node.size(); ++i) out[row.node[i]] += row.factor[i] * pull;
    }
    for (std::size_t s = 0; s < springs.size(); ++s) {
      const auto& [a, b] = springs[s];
      const double pull = stiffness[s] * (x[a] - x[b]);
      out[a] += pull, out[b] -= pull;
    }
    for (std::size_t k = 0; k < x.size(); ++k) out[k] += home[k] * x[k];
    return out;
  }
  Nodes right_side(std::size_t nodes) const {
    Nodes out(nodes);
    for (std::size_t r = 0; r < rows.size(); ++r)
      for (std::size_t i = 0; i < rows[r].node.size(); ++i)
        out[rows[r].node[i]] += rows[r].weight * rows[r].factor[i] * goal[r];
    return out;
  }
};

double product(const Nodes& a, const Nodes& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

/// Conjugate gradients from `x`.
Nodes solve(const Problem& problem, Nodes x) {
  Nodes rest = problem.right_side(x.size());
  const Nodes at_start = problem.apply(x);
  for (std::size_t i = 0; i < x.size(); ++i) rest[i] -= at_start[i];
  Nodes direction = rest;
  double left = product(rest, rest);
  const double enough = kEnough * left;
  for (int step = 0; step < kMostSteps && left > enough && left > 0; ++step) {
    const Nodes turned = problem.apply(direction);
    const double along = left / product(direction, turned);
    for (std::size_t i = 0; i < x.size(); ++i)
      x[i] += along * direction[i], rest[i] -= along * turned[i];
    const double next = product(rest, rest), keep = next / left;
    for (std::size_t i = 0; i < x.size(); ++i) direction[i] = rest[i] + keep * direction[i];
    left = next;
  }
  return x;
}

/// The nodes that move a point of a part, and by how much along the normal.
void add_nodes(const DepthCorrection& correction, std::size_t part, const Correspondence& match,
               double sign, std::size_t first, Row& row) {
  const auto [node, weight] = correction.weights(match.point);
  const double along = sign * dot(match.normal, normalized(match.point - correction.eye()));
  for (std::size_t i = 0; i < node.size(); ++i)
    row.node[first + i] = static_cast<std::uint32_t>(part * DepthCorrection::kNodes + node[i]),
                     row.factor[first + i] = along * weight[i];
}

std::vector<Row> rows_of(const std::vector<PairOverlap>& overlaps,
                         const std::vector<DepthCorrection>& corrections, double agree_m) {
  std::vector<Row> out;
  for (const PairOverlap& o : overlaps)
    for (const Correspondence& match : o.found.matches) {
      if (std::abs(match.apart_m) > agree_m) continue;
      const double off = match.apart_m / (0.5 * agree_m), alike = 1 / (1 + off * off);
      const double noise_m = std::hypot(corrections[o.pair.a].noise_m(match.point),
                                        corrections[o.pair.b].noise_m(match.point));
      Row row;
      row.apart_m = std::copysign(std::max(std::abs(match.apart_m) - noise_m, 0.0), match.apart_m);
      row.weight = match.area_m2 * alike * alike;
      add_nodes(corrections[o.pair.a], o.pair.a, match, 1, 0, row);
      add_nodes(corrections[o.pair.b], o.pair.b, match, -1, 4, row);
      out.push_back(row);
    }
  return out;
}

/// Springs as stiff as the data of their part's nodes on average.
void add_springs(const std::vector<DepthCorrection>& corrections, Problem& problem) {
  const std::size_t parts = corrections.size();
  constexpr std::size_t kNodes = DepthCorrection::kNodes;
  std::vector<double> data(parts);
  for (const Row& row : problem.rows)
    for (std::size_t i = 0; i < row.node.size(); ++i)
      data[row.node[i] / kNodes] += row.weight * row.factor[i] * row.factor[i];
  for (std::size_t p = 0; p < parts; ++p) {
    constexpr double kLeast = 1e-9;
    const double mean = std::max(data[p] / kNodes, kLeast);
    for (std::uint32_t k = 0; k < kNodes; ++k) {
      const auto node = static_cast<std::uint32_t>(p * kNodes) + k;
      const bool is_last = k % DepthCorrection::kColumns == DepthCorrection::kColumns - 1;
      if (!is_last) problem.springs.push_back({node, node + 1});
      if (is_last && corrections[p].goes_around())
        problem.springs.push_back({node, node + 1 - DepthCorrection::kColumns});
      if (k + DepthCorrection::kColumns < kNodes)
        problem.springs.push_back({node, node + DepthCorrection::kColumns});
      problem.stiffness.resize(problem.springs.size(), kStiff * mean);
      problem.home.push_back(kHome * mean);
    }
  }
}

Nodes nodes_of(const std::vector<DepthCorrection>& corrections) {
  Nodes out;
  for (const DepthCorrection& c : corrections)
    out.insert(out.end(), c.offset_m.begin(), c.offset_m.end());
  return out;
}

void set_nodes(const Nodes& x, double most_m, std::vector<DepthCorrection>& corrections) {
  for (std::size_t p = 0; p < corrections.size(); ++p)
    for (std::size_t k = 0; k < DepthCorrection::kNodes; ++k)
      corrections[p].offset_m[k] = std::clamp(x[p * DepthCorrection::kNodes + k], -most_m, most_m);
}

std::vector<PairOverlap> overlaps_of(std::span<const kit::Part> parts,
                                     const std::vector<DepthCorrection>& corrections,
                                     const RegistrationConfig& config) {
  std::vector<kit::Part> moved(parts.begin(), parts.end());
  bend({corrections.begin(), corrections.end()}, moved);
  return pair_overlaps(sampled_surfaces(moved, config.voxel_m), std::vector<Pose>(parts.size()),
                       config);
}

/// Those between parts that fit each other but for at most `agree_m`.
std::vector<PairOverlap> sound(std::vector<PairOverlap> overlaps, std::size_t parts,
                               double agree_m) {
  const auto odd = outliers(residuals_of(overlaps), parts, 1000 * agree_m);
  const auto is_odd = [&](std::uint32_t part) { return std::ranges::find(odd, part) != odd.end(); };
  std::erase_if(overlaps, [&](const PairOverlap& o) {
    return o.residual.shared_m2 < kLeastShared_m2 || !agree(o.residual, 1000 * agree_m) ||
           is_odd(o.pair.a) || is_odd(o.pair.b);
  });
  return overlaps;
}

/// How far a change of the nodes moves the surfaces, where they were compared.
struct Move {
  double rms_m = 0, most_m = 0;
};
Move move_of(const std::vector<Row>& rows, const Nodes& change) {
  Move out;
  double squares = 0;
  for (const Row& row : rows)
    for (const std::size_t first : {0, 4}) {
      double moved = 0;
      for (std::size_t i = first; i < first + 4; ++i) moved += row.factor[i] * change[row.node[i]];
      squares += moved * moved, out.most_m = std::max(out.most_m, std::abs(moved));
    }
  if (!rows.empty()) out.rms_m = std::sqrt(squares / (2 * static_cast<double>(rows.size())));
  return out;
}

}  // namespace

DepthCorrection::DepthCorrection(const kit::Part& part) {
  MR_ASSERT(!part.sources.empty());
  for (const SourceInfo& source : part.sources)
    eye_ += source.T_world_depth.translation / static_cast<double>(part.sources.size());
  const SourceInfo& first = part.sources.front();
  precision_ = first.precision;
  if (part.sources.size() > 1 || first.depth_camera.model != CameraModel::pinhole) return;
  camera_ = first.depth_camera, T_camera_world_ = first.T_world_depth.inverse();
}

DepthCorrection::Weights DepthCorrection::weights(Vec3d point) const {
  double right = 0, down = 0;  // 0..1
  if (!goes_around()) {
    const Vec3d p = T_camera_world_ * point;
    const double z = std::max(p.z, 1e-3);
    right = (camera_.fx * p.x / z + camera_.cx) / camera_.width;
    down = (camera_.fy * p.y / z + camera_.cy) / camera_.height;
  } else {
    const Vec3d d = point - eye_;
    right = std::atan2(d.y, d.x) / (2 * std::numbers::pi) + 0.5;
    down = std::atan2(d.z, std::hypot(d.x, d.y)) / std::numbers::pi + 0.5;
  }
  const double x = goes_around() ? right * kColumns : std::clamp(right, 0.0, 1.0) * (kColumns - 1);
  const double y = std::clamp(down, 0.0, 1.0) * (kRows - 1);
  const std::uint32_t last = goes_around() ? kColumns - 1 : kColumns - 2;
  const auto column = std::min(static_cast<std::uint32_t>(x), last);
  const auto row = std::min(static_cast<std::uint32_t>(y), std::uint32_t{kRows - 2});
  const double s = x - column, t = y - row;
  const std::uint32_t here = row * kColumns + column,
                      beside = row * kColumns + (column + 1) % kColumns;
  return {{here, beside, here + kColumns, beside + kColumns},
          {(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t}};
}

double DepthCorrection::offset_at(Vec3d point) const {
  const auto [node, weight] = weights(point);
  double sum = 0;
  for (std::size_t i = 0; i < node.size(); ++i) sum += weight[i] * offset_m[node[i]];
  return sum;
}

void correct(const DepthCorrection& correction, kit::Part& part) {
  for (Vec3f& p : part.mesh.positions) p = vec_cast<float>(correction.moved(vec_cast<double>(p)));
}

void bend(const Bends& bends, std::span<kit::Part> parts) {
  MR_ASSERT(bends.size() == parts.size());
  parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      if (bends[i]) correct(*bends[i], parts[i]);
  });
}

const DepthCorrection* DepthCorrector::of(std::uint64_t id) const {
  const auto known = known_.find(id);
  return known == known_.end() ? nullptr : &known->second;
}

/// One step of Gauss-Newton, all the way where `at_once`; nothing: not worth it.
std::optional<Nodes> DepthCorrector::step(const std::vector<PairOverlap>& overlaps,
                                          const std::vector<DepthCorrection>& corrections,
                                          bool at_once) const {
  const std::size_t parts = corrections.size();
  const Nodes now = nodes_of(corrections);
  Problem problem;
  problem.rows = rows_of(sound(overlaps, parts, agree_m_), corrections, agree_m_);
  for (const Row& row : problem.rows) problem.goal.push_back(row.times(now) - row.apart_m);
  add_springs(corrections, problem);
  Nodes next = solve(problem, now), change(next.size());
  for (std::size_t k = 0; k < next.size(); ++k) change[k] = next[k] - now[k];
  const Move move = move_of(problem.rows, change);
  if (move.most_m == 0 || (!at_once && move.rms_m < kWorth_voxels * config_.voxel_m))
    return std::nullopt;
  const double most_m = kStep_voxels * config_.voxel_m;
  const double share = at_once || move.most_m <= most_m ? 1 : most_m / move.most_m;
  for (std::size_t k = 0; k < next.size(); ++k) next[k] = now[k] + change[k] * share;
  return next;
}

bool DepthCorrector::update(std::span<const kit::Part> parts, std::span<const std::uint64_t> ids) {
  MR_ASSERT(parts.size() == ids.size());
  residuals_.clear();
  if (agree_m_ <= 0) return false;
  std::vector<DepthCorrection> corrections;
  bool is_new = false;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    corrections.emplace_back(parts[i]);
    if (const DepthCorrection* known = of(ids[i]))
      corrections.back().offset_m = known->offset_m;
    else
      is_new = true;
  }
  bool changed = false;
  std::vector<PairOverlap> overlaps = overlaps_of(parts, corrections, config_);
  for (int round = 0; round < (is_new ? kFirstRounds : 1); ++round) {
    const auto next = step(overlaps, corrections, is_new);
    if (!next) break;
    set_nodes(*next, kMost * agree_m_, corrections);
    overlaps = overlaps_of(parts, corrections, config_);
    changed = true;
  }
  residuals_ = residuals_of(overlaps);
  for (std::size_t i = 0; i < parts.size(); ++i) known_.insert_or_assign(ids[i], corrections[i]);
  return changed;
}

}  // namespace mr::calib
