#include <algorithm>
#include <functional>
#include <map>
#include <set>

#include "mr/core/scene_parts.h"

namespace mr::scene_file {
namespace {

constexpr std::size_t kMaxMergers = 256;
constexpr std::size_t kMaxInputs = 1024;
constexpr std::size_t kMaxLinks = 4096;

void read_inputs(Report& report, const YamlNode& node, MergerEntry& merger) {
  if (node.kind != YamlNode::Kind::list || node.items.empty() || node.items.size() > kMaxInputs) {
    report.problem(node.line, "inputs must be a list of 1 to " + std::to_string(kMaxInputs) +
                                  " ids of sensors or mergers");
    return;
  }
  for (const YamlNode& item : node.items) {
    const auto id = read_text(report, item, "inputs");
    if (!id) continue;
    merger.config.inputs.push_back(*id);
    merger.input_lines.push_back(item.line);
  }
}

/// Who is an input of whom. A node that two mergers want belongs to the first.
struct Tree {
  std::map<std::string, std::size_t> merger_of;  ///< id → index of the merger that is called so
  std::map<std::string, std::size_t> parent_of;  ///< id → index of the merger that it feeds
};

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
      const int line = mergers[m].input_lines[i];
      if (!known.contains(input)) {
        if (leaves_known)
          report.problem(line, "merger " + in_quotes(mergers[m].config.id) + " has the input " +
                                   in_quotes(input) + ", which is no sensor and no merger" +
                                   did_you_mean(input, ids));
        continue;
      }
      const auto [parent, is_new] = tree.parent_of.emplace(input, m);
      if (!is_new)
        report.problem(line, in_quotes(input) + " is already an input of merger " +
                                 in_quotes(mergers[parent->second].config.id) +
                                 "; a node has one parent");
    }
  return tree;
}

void check_cycles(Report& report, const std::vector<MergerEntry>& mergers, const Tree& tree) {
  std::set<std::string> done;
  for (const MergerEntry& start : mergers) {
    std::vector<std::string> path;
    std::string at = start.config.id;
    while (!done.contains(at)) {
      done.insert(at);
      path.push_back(at);
      const auto parent = tree.parent_of.find(at);
      if (parent == tree.parent_of.end()) break;
      at = mergers[parent->second].config.id;
      const auto seen = std::find(path.begin(), path.end(), at);
      if (seen == path.end()) continue;
      std::string circle;
      for (auto node = seen; node != path.end(); ++node) circle += in_quotes(*node) + " -> ";
      report.problem(mergers[tree.merger_of.at(at)].line,
                     "mergers form a cycle: " + circle + in_quotes(at));
    }
  }
}

void check_roots(Report& report, const std::vector<NodeName>& leaves,
                 const std::vector<MergerEntry>& mergers, const Tree& tree) {
  std::vector<const MergerEntry*> roots;
  for (const MergerEntry& merger : mergers)
    if (!merger.config.id.empty() && !tree.parent_of.contains(merger.config.id))
      roots.push_back(&merger);
  for (std::size_t i = 0; i + 1 < roots.size(); ++i)
    report.problem(roots[i]->line, "more than one root: merger " + in_quotes(roots[i]->config.id) +
                                       " is an input of no merger, and neither is " +
                                       in_quotes(roots.back()->config.id));
  const bool inputs_known =
      std::none_of(mergers.begin(), mergers.end(),
                   [](const MergerEntry& merger) { return merger.config.inputs.empty(); });
  for (const NodeName& leaf : leaves)
    if (inputs_known && !tree.parent_of.contains(leaf.id))
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

void check_ids(Report& report, const std::vector<NodeName>& leaves,
               const std::vector<MergerEntry>& mergers) {
  std::map<std::string, int> first;
  const auto check = [&](const std::string& id, int line) {
    const auto [known, is_new] = first.emplace(id, line);
    if (is_new) return;
    const std::string where =
        known->second > 0 ? " (first in line " + std::to_string(known->second) + ")" : "";
    report.problem(line, "id " + in_quotes(id) + " is used twice" + where);
  };
  for (const NodeName& leaf : leaves) check(leaf.id, leaf.line);
  for (const MergerEntry& merger : mergers)
    if (!merger.config.id.empty()) check(merger.config.id, merger.line);
}

std::vector<MergerEntry> read_mergers(Report& report, const YamlNode& node) {
  std::vector<MergerEntry> mergers;
  if (node.kind != YamlNode::Kind::list || node.items.empty() || node.items.size() > kMaxMergers) {
    report.problem(node.line,
                   "mergers must be a list of 1 to " + std::to_string(kMaxMergers) + " mergers");
    return mergers;
  }
  for (const YamlNode& item : node.items) {
    MapReader map(report, item, "merger");
    MergerEntry merger;
    merger.line = item.line;
    if (const YamlNode* id = map.need("id")) {
      merger.config.id = read_id(report, *id, "id").value_or("");
      merger.line = id->line;
    }
    if (const YamlNode* inputs = map.need("inputs")) read_inputs(report, *inputs, merger);
    map.number("deadline_ms", merger.config.deadline_ms, {0, 60'000, true});
    mergers.push_back(std::move(merger));
  }
  return mergers;
}

std::vector<LinkConfig> read_links(Report& report, const YamlNode& node,
                                   const std::vector<NodeName>& names) {
  std::vector<LinkConfig> links;
  if (node.kind != YamlNode::Kind::list || node.items.size() > kMaxLinks) {
    report.problem(node.line,
                   "links must be a list of at most " + std::to_string(kMaxLinks) + " links");
    return links;
  }
  std::vector<std::string> ids;
  for (const NodeName& name : names) ids.push_back(name.id);
  for (const YamlNode& item : node.items) {
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
    map.number("limit_mbps", link.limit_mbps, {0, 1e6, true});
    links.push_back(std::move(link));
  }
  return links;
}

std::vector<MergerConfig> ordered_tree(Report& report, const std::vector<NodeName>& leaves,
                                       const std::vector<MergerEntry>& mergers, bool leaves_known) {
  if (mergers.empty()) return {};
  check_ids(report, leaves, mergers);
  const Tree tree = link_tree(report, leaves, mergers, leaves_known);
  check_cycles(report, mergers, tree);
  check_roots(report, leaves, mergers, tree);
  return children_first(mergers, tree);
}

}  // namespace mr::scene_file
