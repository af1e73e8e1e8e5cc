#include <memory>

#include "bytes.h"
#include "mr/core/parallel.h"
#include "mr/merge/seam/point_grid.h"
#include "mr/merge/seam/zipper.h"
#include "surfaces.h"
#include "zipper_contenders.h"

namespace mr::bench {
namespace {

class Grid final : public Work {
 public:
  Grid(const BorderPoints& input, int threads) : input_(input), arena_(threads) {}

  void clear() override { matches_ = {}; }
  void run(StageClock& clock) override {
    arena_.run([&] {
      const merge::PointGrid grid(input_.points, input_.radius_m);
      clock.lap("build");
      matches_ = grid.match(input_.part, input_.radius_m);
      clock.lap("search");
    });
  }
  Message result() override { return to_message(matches_); }

 private:
  const BorderPoints& input_;
  Arena arena_;
  Matches matches_;
};

class Zip final : public Work {
 public:
  Zip(const Strips& input, int threads) : input_(input), arena_(threads) {}

  void clear() override { joined_ = {}; }
  void run(StageClock&) override {
    arena_.run([&] { joined_ = merge::zip(input_.parts, merge::zipper_config(input_.voxel_m)); });
  }
  Message result() override { return to_message(joined_); }

 private:
  const Strips& input_;
  Arena arena_;
  Mesh joined_;
};

}  // namespace

Message to_message(const Matches& matches) { return binary(matches); }

Contender match_ours(const BorderPoints& input, int threads) {
  return {"ours", threads, Message::object(),
          [&input, threads] { return std::make_unique<Grid>(input, threads); }};
}

Contender zip_ours(const Strips& input, int threads) {
  return {"ours", threads, Message::object(),
          [&input, threads] { return std::make_unique<Zip>(input, threads); }};
}

}  // namespace mr::bench
