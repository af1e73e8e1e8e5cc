#include <open3d/geometry/KDTreeFlann.h>

#include <cmath>
#include <memory>

#include "mr/core/parallel.h"
#include "zipper_contenders.h"

namespace mr::bench {
namespace {

using Match = merge::PointGrid::Match;
constexpr std::size_t kOpen3dGrain = 256;

class ZipperOpen3d final : public Work {
 public:
  ZipperOpen3d(const BorderPoints& input, int threads) : input_(input), arena_(threads) {
    points_.resize(3, static_cast<Eigen::Index>(input.points.size()));
    for (Eigen::Index i = 0; i < points_.cols(); ++i) {
      const Vec3f p = input.points[i];
      points_.col(i) = Eigen::Vector3d(p.x, p.y, p.z);
    }
  }

  void clear() override { matches_ = {}; }
  void run(StageClock& clock) override {
    arena_.run([&] {
      const open3d::geometry::KDTreeFlann tree(points_);
      clock.lap("build");
      matches_.resize(input_.points.size());
      parallel_for(matches_.size(), kOpen3dGrain,
                   [&](std::size_t begin, std::size_t end) { search(tree, begin, end); });
      clock.lap("search");
    });
  }
  Message result() override { return to_message(matches_); }

 private:
  void search(const open3d::geometry::KDTreeFlann& tree, std::size_t begin, std::size_t end) {
    std::vector<int> found;
    std::vector<double> square;
    for (std::size_t i = begin; i < end; ++i) {
      const Eigen::Vector3d middle = points_.col(static_cast<Eigen::Index>(i));
      tree.SearchRadius(middle, input_.radius_m, found, square);
      Match match{static_cast<std::uint32_t>(found.size()) - 1, Match::kNone, 0};
      for (std::size_t k = 0; k < found.size() && match.nearest == Match::kNone; ++k)
        if (input_.part[found[k]] != input_.part[i])  // they come nearest first
          match.nearest = static_cast<std::uint32_t>(found[k]),
          match.distance_m = static_cast<float>(std::sqrt(square[k]));
      matches_[i] = match;
    }
  }

  const BorderPoints& input_;
  Arena arena_;
  Eigen::MatrixXd points_;
  Matches matches_;
};

}  // namespace

std::vector<Contender> match_open3d(const BorderPoints& input, int threads) {
  return {{"open3d", threads, Message::object(),
           [&input, threads] { return std::make_unique<ZipperOpen3d>(input, threads); }}};
}

}  // namespace mr::bench
