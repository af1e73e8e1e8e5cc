#pragma once

#include <algorithm>
#include <boost/graph/adjacency_list.hpp>
#include <boost/graph/boykov_kolmogorov_max_flow.hpp>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

/// Graph cuts: maximum flow by Boykov and Kolmogorov (2004, Boost.Graph), alpha
/// expansion by Boykov, Veksler and Zabih (2001). Plain and slow.
namespace mr::kit {

/// A directed graph with capacities between a source and a sink.
class MaxFlow {
 public:
  explicit MaxFlow(std::size_t nodes) : graph_(nodes + 2), nodes_(nodes) {}

  void add_edge(std::size_t from, std::size_t to, std::int64_t capacity) {
    const Edge there = boost::add_edge(from, to, {capacity, 0, {}}, graph_).first,
               back = boost::add_edge(to, from, {0, 0, there}, graph_).first;
    graph_[there].reverse = back;
  }
  /// What a node costs on the source's side and on the sink's.
  void add_node_cost(std::size_t node, std::int64_t on_source, std::int64_t on_sink) {
    if (on_sink > on_source) add_edge(source(), node, on_sink - on_source);
    if (on_source > on_sink) add_edge(node, sink(), on_source - on_sink);
  }

  /// [nodes] whether a node is on the sink's side of a minimum cut.
  std::vector<bool> cut() {
    boost::boykov_kolmogorov_max_flow(
        graph_, boost::get(&Arc::capacity, graph_), boost::get(&Arc::residual, graph_),
        boost::get(&Arc::reverse, graph_), boost::get(&Node::predecessor, graph_),
        boost::get(&Node::color, graph_), boost::get(&Node::distance, graph_),
        boost::get(boost::vertex_index, graph_), source(), sink());
    std::vector<bool> out(nodes_);
    for (std::size_t v = 0; v < nodes_; ++v) out[v] = graph_[v].color != boost::black_color;
    return out;
  }

 private:
  using Edge =
      boost::adjacency_list_traits<boost::vecS, boost::vecS, boost::directedS>::edge_descriptor;
  struct Arc {
    std::int64_t capacity = 0, residual = 0;
    Edge reverse;
  };
  struct Node {
    boost::default_color_type color = boost::white_color;
    Edge predecessor;
    long distance = 0;
  };

  std::size_t source() const { return nodes_; }
  std::size_t sink() const { return nodes_ + 1; }

  boost::adjacency_list<boost::vecS, boost::vecS, boost::directedS, Node, Arc> graph_;
  std::size_t nodes_;
};

/// Two nodes of a labelling problem that want the same label.
struct CutEdge {
  std::uint32_t a, b;
};

/// Minimizes sum of cost[node * labels + label] + sum over edges of pair(edge, label a, label b) by
/// alpha expansion until no label changes, at most `most_rounds`. An infinite cost: not allowed.
/// Nodes without an allowed label have a negative one and take no part. `pair` is a metric in the
/// labels; `label`: an allowed start.
template <typename Pair>
void expand_labels(std::span<const float> cost, int labels, std::span<const CutEdge> edges,
                   const Pair& pair, std::vector<int>& label, int most_rounds = 10) {
  const auto scaled = [](double v) { return static_cast<std::int64_t>(std::llround(v * 1e9)); };
  const auto at = [&](std::size_t node, int l) {
    return cost[node * static_cast<std::size_t>(labels) + static_cast<std::size_t>(l)];
  };
  bool any = true;
  for (int round = 0; round < most_rounds && any; ++round) {
    any = false;
    for (int alpha = 0; alpha < labels; ++alpha) {
      const auto moves = [&](std::size_t n) {
        return label[n] >= 0 && label[n] != alpha && std::isfinite(at(n, alpha));
      };
      std::vector<std::int64_t> keep(label.size()), take(label.size());
      MaxFlow flow(label.size());
      for (std::size_t n = 0; n < label.size(); ++n)
        if (moves(n)) keep[n] = scaled(at(n, label[n])), take[n] = scaled(at(n, alpha));
      for (std::size_t e = 0; e < edges.size(); ++e) {
        const auto [p, q] = edges[e];
        if (label[p] < 0 || label[q] < 0) continue;
        if (moves(p) && moves(q)) {
          const std::int64_t stay = scaled(pair(e, label[p], label[q])),
                             q_takes = scaled(pair(e, label[p], alpha)),
                             p_takes = scaled(pair(e, alpha, label[q]));
          take[p] += p_takes - stay, take[q] -= p_takes;
          flow.add_edge(p, q, std::max<std::int64_t>(q_takes + p_takes - stay, 0));
        } else if (moves(p)) {
          keep[p] += scaled(pair(e, label[p], label[q])),
              take[p] += scaled(pair(e, alpha, label[q]));
        } else if (moves(q)) {
          keep[q] += scaled(pair(e, label[p], label[q])),
              take[q] += scaled(pair(e, label[p], alpha));
        }
      }
      for (std::size_t n = 0; n < label.size(); ++n)
        if (moves(n)) flow.add_node_cost(n, keep[n], take[n]);
      const std::vector<bool> takes = flow.cut();
      for (std::size_t n = 0; n < label.size(); ++n)
        if (moves(n) && takes[n]) label[n] = alpha, any = true;
    }
  }
}

}  // namespace mr::kit
