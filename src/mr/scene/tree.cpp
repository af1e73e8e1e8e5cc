#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "mr/scene/parts.h"

namespace mr::scene_file {
namespace {

constexpr std::size_t kMaxMergers = 256;
constexpr std::size_t kMaxInputs = 1024;
constexpr std::size_t kMaxLinks = 4096;

void read_inputs(Report& report, const yaml::Node& node, MergerEntry& merger) {
  if (node.kind != yaml::Node::Kind::list || node.items.empty() || node.items.size() > kMaxInputs) {
    report.problem(node.line, "inputs must be a list of 1 to " + std::to_string(kMaxInputs) +
                                  " ids of sensors or mergers");
    return;
  }
  for (const yaml::Node& item : node.items) {
    const auto id = yaml::read_text(report, item, "inputs");
    if (!id) continue;
    merger.config.inputs.push_back(*id);
    merger.input_lines.push_back(item.line);
  }
}

/// Who is an input of whom. A node that two mergers want belongs to the first, unless they share
/// the space between them.
struct Tree {
  std::map<std::string, std::size_t> merger_of;  ///< id → index of the merger that is called so
  std::map<std::string, std::vector<std::size_t>> parents_of;  ///< id → the mergers that it feeds
};

/// Whether merger `m` may take an input that another merger takes, too.
bool may_share(const std::vector<MergerEntry>& mergers, std::size_t m, std::size_t other) {
  return m != other && mergers[m].region_line > 0 && mergers[other].region_line > 0;
}

void add_parent(Report& report, const std::vector<MergerEntry>& mergers, std::size_t m,
                std::size_t input, Tree& tree) {
  const std::string& id = mergers[m].config.inputs[input];
  std::vector<std::size_t>& parents = tree.parents_of[id];
  const auto taken = std::find_if(parents.begin(), parents.end(),
                                  [&](std::size_t other) { return !may_share(mergers, m, other); });
  if (taken == parents.end()) return parents.push_back(m);
  report.problem(mergers[m].input_lines[input],
                 in_quotes(id) + " is already an input of merger " +
                     in_quotes(mergers[*taken].config.id) +
                     (*taken == m ? "" : "; a node has one parent, or several that have a region"));
}

Tree link_tree(Report& report, const std::vector<NodeName>& leaves,
               const std::vector<MergerEntry>& mergers, bool leaves_known) {
  Tree tree;
  std::vector<std::string> ids;
  for (const NodeName& leaf : leaves) ids.push_back(leaf.id);
  for (std::size_t m = 0; m < mergers.size(); ++m) {
    tree.merger_of.emplace(mergers[m].config.id, m);
    ids.push_back(mergers[m].config.id);
  }
  const std::set<std::string> known(ids.begin(), ids.end());
  for (std::size_t m = 0; m < mergers.size(); ++m)
    for (std::size_t i = 0; i < mergers[m].config.inputs.size(); ++i) {
      const std::string& input = mergers[m].config.inputs[i];
      if (known.contains(input)) {
        add_parent(report, mergers, m, i, tree);
        continue;
      }
      if (leaves_known)
        report.problem(mergers[m].input_lines[i], "merger " + in_quotes(mergers[m].config.id) +
                                                      " has the input " + in_quotes(input) +
                                                      ", which is no sensor and no merger" +
                                                      did_you_mean(input, ids));
    }
  return tree;
}

/// Walks from every node towards the root, each node once.
void check_cycles(Report& report, const std::vector<MergerEntry>& mergers, const Tree& tree) {
  std::set<std::string> done;
  std::vector<std::string> path;
  const std::function<void(const std::string&)> visit = [&](const std::string& at) {
    const auto seen = std::find(path.begin(), path.end(), at);
    if (seen != path.end()) {
      std::string circle;
      for (auto node = seen; node != path.end(); ++node) circle += in_quotes(*node) + " -> ";
      report.problem(mergers[tree.merger_of.at(at)].line,
                     "mergers form a cycle: " + circle + in_quotes(at));
    }
    if (!done.insert(at).second) return;
    path.push_back(at);
    if (const auto parents = tree.parents_of.find(at); parents != tree.parents_of.end())
      for (const std::size_t m : parents->second) visit(mergers[m].config.id);
    path.pop_back();
  };
  for (const MergerEntry& start : mergers) visit(start.config.id);
}

std::string as_text(const Box3d& box) {
  const auto corner = [](Vec3d p) {
    char text[100];
    std::snprintf(text, sizeof text, "[%.9g, %.9g, %.9g]", p.x, p.y, p.z);
    return std::string(text);
  };
  return "[" + corner(box.low) + ", " + corner(box.high) + "]";
}

/// The box on the chunk grid that is nearest to a region, at least one cube large.
Box3d on_grid(const Box3d& region, double chunk_m) {
  Box3d out;
  for (int axis = 0; axis < 3; ++axis) {
    const double low = std::round(region.low[axis] / chunk_m);
    const double high = std::max(std::round(region.high[axis] / chunk_m), low + 1);
    out.low[axis] = low * chunk_m, out.high[axis] = high * chunk_m;
  }
  return out;
}

/// Chunks are whole: no cube may belong to two regions, or to half of one.
void check_grid(Report& report, const std::vector<MergerEntry>& mergers, double chunk_m) {
  constexpr double kRounding = 1e-6;  // of a cube
  for (const MergerEntry& merger : mergers) {
    if (!merger.config.region) continue;
    const Box3d &given = *merger.config.region, nearest = on_grid(given, chunk_m);
    const double off = std::max(length(given.low - nearest.low), length(given.high - nearest.high));
    if (off <= kRounding * chunk_m) continue;
    char edge[32];
    std::snprintf(edge, sizeof edge, "%.9g", chunk_m);
    report.problem(merger.region_line, "region must lie on the chunk grid, multiples of " +
                                           std::string(edge) +
                                           " m (fusion.chunk_m); nearest: " + as_text(nearest));
  }
}

bool overlap(const Box3d& a, const Box3d& b, double tolerance_m) {
  const Vec3d size = min(a.high, b.high) - max(a.low, b.low);
  return size.x > tolerance_m && size.y > tolerance_m && size.z > tolerance_m;
}

/// What two mergers get from one input must not be merged twice.
void check_shares(Report& report, const std::vector<MergerEntry>& mergers, const Tree& tree,
                  double chunk_m) {
  std::set<std::pair<std::size_t, std::size_t>> reported;
  for (const auto& [input, parents] : tree.parents_of)
    for (std::size_t j = 1; j < parents.size(); ++j)
      for (std::size_t i = 0; i < j; ++i) {
        const MergerEntry &a = mergers[parents[i]], &b = mergers[parents[j]];
        if (!a.config.region || !b.config.region) continue;
        if (!overlap(*a.config.region, *b.config.region, chunk_m / 2)) continue;
        if (!reported.emplace(parents[i], parents[j]).second) continue;
        report.problem(b.region_line, "the regions of mergers " + in_quotes(a.config.id) + " and " +
                                          in_quotes(b.config.id) +
                                          " overlap, and both have the input " + in_quotes(input));
      }
}

void check_roots(Report& report, const std::vector<NodeName>& leaves,
                 const std::vector<MergerEntry>& mergers, const Tree& tree) {
  std::vector<const MergerEntry*> roots;
  for (const MergerEntry& merger : mergers)
    if (!merger.config.id.empty() && !tree.parents_of.contains(merger.config.id))
      roots.push_back(&merger);
  for (std::size_t i = 0; i + 1 < roots.size(); ++i)
    report.problem(roots[i]->line, "more than one root: merger " + in_quotes(roots[i]->config.id) +
                                       " is an input of no merger, and neither is " +
                                       in_quotes(roots.back()->config.id));
  const bool inputs_known =
      std::none_of(mergers.begin(), mergers.end(),
                   [](const MergerEntry& merger) { return merger.config.inputs.empty(); });
  for (const NodeName& leaf : leaves)
    if (inputs_known && !tree.parents_of.contains(leaf.id))
      report.problem(leaf.line, "sensor " + in_quotes(leaf.id) +
                                    " reaches no root: it is an input of no merger");
}

std::vector<MergerConfig> children_first(const std::vector<MergerEntry>& mergers,
                                         const Tree& tree) {
  std::vector<MergerConfig> out;
  std::vector<bool> visited(mergers.size(), false);
  const std::function<void(std::size_t)> visit = [&](std::size_t m) {
    if (visited[m]) return;
    visited[m] = true;
    for (const std::string& input : mergers[m].config.inputs)
      if (const auto child = tree.merger_of.find(input); child != tree.merger_of.end())
        visit(child->second);
    out.push_back(mergers[m].config);
  };
  for (std::size_t m = 0; m < mergers.size(); ++m) visit(m);
  return out;
}

}  // namespace

std::optional<Box3d> read_box(MapReader& map, const std::string& key) {
  const yaml::Node* box = map.find(key);
  if (!box) return std::nullopt;
  if (box->kind != yaml::Node::Kind::list || box->items.size() != 2) {
    map.report.problem(map.line(key),
                       key + " must be [[x, y, z], [x, y, z]]: the low and the high corner");
    return std::nullopt;
  }
  double low[3], high[3];
  const bool good = yaml::read_numbers(map.report, box->items[0], key, kCorner_m, low) &
                    yaml::read_numbers(map.report, box->items[1], key, kCorner_m, high);
  if (!good) return std::nullopt;
  if (low[0] >= high[0] || low[1] >= high[1] || low[2] >= high[2]) {
    map.report.problem(map.line(key),
                       key + " is empty: its first corner must be below its second on every axis");
    return std::nullopt;
  }
  return Box3d{{low[0], low[1], low[2]}, {high[0], high[1], high[2]}};
}

void check_ids(Report& report, const std::vector<NodeName>& leaves,
               const std::vector<MergerEntry>& mergers) {
  std::map<std::string, int> first;
  const auto check = [&](const std::string& id, int line) {
    const auto [known, is_new] = first.emplace(id, line);
    if (!is_new)
      report.problem(line,
                     "id " + in_quotes(id) + " is used twice" + yaml::first_in(known->second));
  };
  for (const NodeName& leaf : leaves) check(leaf.id, leaf.line);
  for (const MergerEntry& merger : mergers)
    if (!merger.config.id.empty()) check(merger.config.id, merger.line);
}

std::vector<MergerEntry> read_mergers(Report& report, const yaml::Node& node) {
  std::vector<MergerEntry> mergers;
  if (node.kind != yaml::Node::Kind::list || node.items.empty() ||
      node.items.size() > kMaxMergers) {
    report.problem(node.line,
                   "mergers must be a list of 1 to " + std::to_string(kMaxMergers) + " mergers");
    return mergers;
  }
  for (const yaml::Node& item : node.items) {
    MapReader map(report, item, "merger");
    MergerEntry merger;
    merger.line = item.line;
    if (const yaml::Node* id = map.need("id")) {
      merger.config.id = yaml::read_id(report, *id, "id").value_or("");
      merger.line = id->line;
    }
    if (const yaml::Node* inputs = map.need("inputs")) read_inputs(report, *inputs, merger);
    map.number("deadline_ms", merger.config.deadline_ms, MergerConfig::kDeadline_ms);
    map.number("budget_ms", merger.config.budget_ms, MergerConfig::kBudget_ms);
    merger.config.region = read_box(map, "region");
    if (map.has("region")) merger.region_line = map.line("region");
    mergers.push_back(std::move(merger));
  }
  return mergers;
}

std::vector<LinkConfig> read_links(Report& report, const yaml::Node& node,
                                   const std::vector<NodeName>& names) {
  std::vector<LinkConfig> links;
  if (node.kind != yaml::Node::Kind::list || node.items.size() > kMaxLinks) {
    report.problem(node.line,
                   "links must be a list of at most " + std::to_string(kMaxLinks) + " links");
    return links;
  }
  std::vector<std::string> ids;
  for (const NodeName& name : names) ids.push_back(name.id);
  for (const yaml::Node& item : node.items) {
    if (report.full()) break;
    MapReader map(report, item, "link");
    LinkConfig link;
    const auto end = [&](const char* key, std::string& out) {
      if (!map.need(key) || !map.text(key, out)) return;
      if (std::find(ids.begin(), ids.end(), out) == ids.end())
        report.problem(map.line(key), std::string(key) + ": " + in_quotes(out) +
                                          " is no sensor and no merger" + did_you_mean(out, ids));
    };
    end("from", link.from);
    end("to", link.to);
    map.number("limit_mbps", link.limit_mbps, LinkConfig::kLimit_mbps);
    links.push_back(std::move(link));
  }
  return links;
}

std::vector<MergerConfig> ordered_tree(Report& report, const std::vector<NodeName>& leaves,
                                       const std::vector<MergerEntry>& mergers, double chunk_m,
                                       bool leaves_known) {
  if (mergers.empty()) return {};
  check_ids(report, leaves, mergers);
  const Tree tree = link_tree(report, leaves, mergers, leaves_known);
  check_grid(report, mergers, chunk_m);
  check_shares(report, mergers, tree, chunk_m);
  check_cycles(report, mergers, tree);
  check_roots(report, leaves, mergers, tree);
  return children_first(mergers, tree);
}

}  // namespace mr::scene_file
