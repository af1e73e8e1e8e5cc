#include <cmath>
#include <functional>
#include <memory>
#include <nanoflann.hpp>

#include "mr/core/parallel.h"
#include "zipper_contenders.h"

namespace mr::bench {
namespace {

using Match = merge::PointGrid::Match;
constexpr std::size_t kNanoflannGrain = 256;

/// The points as it wants to see them.
struct Cloud {
  const std::vector<Vec3f>& points;

  std::size_t kdtree_get_point_count() const { return points.size(); }
  float kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return points[i][static_cast<int>(axis)];
  }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Cloud>, Cloud,
                                                 3, std::uint32_t>;

/// What a match is made from: one found point after another.
struct MatchCollector {
  const std::vector<std::uint32_t>& part;
  std::uint32_t point;
  std::uint32_t found = 0, nearest = Match::kNone;
  float least = 0;

  void add(std::uint32_t other, float square) {
    ++found;
    if (part[other] == part[point]) return;
    if (nearest == Match::kNone || square < least || (square == least && other < nearest))
      least = square, nearest = other;
  }
  Match result() const { return {found - 1, nearest, std::sqrt(least)}; }  // it found itself
};

/// Takes the found points as they come.
struct Visitor {
  MatchCollector& into;
  float limit;

  void init() {}
  std::size_t size() const { return into.found; }
  bool full() const { return true; }
  float worstDist() const { return limit; }
  bool addPoint(float square, std::uint32_t other) {
    if (square < limit) into.add(other, square);
    return true;
  }
};

class Nanoflann final : public Work {
 public:
  Nanoflann(const BorderPoints& input, int threads, bool lists)
      : input_(input), arena_(threads), lists_(lists) {}

  void clear() override { matches_ = {}; }
  void run(StageClock& clock) override {
    arena_.run([&] {
      const Cloud cloud{input_.points};
      const Tree tree(3, cloud);
      clock.lap("build");
      matches_.resize(input_.points.size());
      parallel_for(matches_.size(), kNanoflannGrain, [&](std::size_t begin, std::size_t end) {
        lists_ ? list_some(tree, begin, end) : visit_some(tree, begin, end);
      });
      clock.lap("search");
    });
  }
  Message result() override { return to_message(matches_); }

 private:
  void list_some(const Tree& tree, std::size_t begin, std::size_t end) {
    nanoflann::SearchParams unsorted;
    unsorted.sorted = false;
    std::vector<std::pair<std::uint32_t, float>> found;
    for (std::size_t i = begin; i < end; ++i) {
      tree.radiusSearch(&input_.points[i].x, input_.radius_m * input_.radius_m, found, unsorted);
      MatchCollector collector{input_.part, static_cast<std::uint32_t>(i)};
      for (const auto& [other, square] : found) collector.add(other, square);
      matches_[i] = collector.result();
    }
  }

  void visit_some(const Tree& tree, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      MatchCollector collector{input_.part, static_cast<std::uint32_t>(i)};
      Visitor visitor{collector, input_.radius_m * input_.radius_m};
      tree.radiusSearchCustomCallback(&input_.points[i].x, visitor);
      matches_[i] = collector.result();
    }
  }

  const BorderPoints& input_;
  Arena arena_;
  bool lists_;
  Matches matches_;
};

}  // namespace

bool has_nanoflann() { return true; }

std::vector<Contender> match_nanoflann(const BorderPoints& input, int threads) {
  const auto make = [&](bool lists) {
    return [&input, threads, lists] { return std::make_unique<Nanoflann>(input, threads, lists); };
  };
  return {{"nanoflann/list", threads, Message::object(), make(true)},
          {"nanoflann/visit", threads, Message::object(), make(false)}};
}

}  // namespace mr::bench
