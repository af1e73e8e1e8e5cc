#include "bytes.h"
#include "mr/core/parallel.h"
#include "mr/merge/overlap/occlusion_rule.h"
#include "overlap_contenders.h"

namespace mr::bench {
namespace {

class OverlapOurs final : public Work {
 public:
  OverlapOurs(const MergeCase& input, int threads) : input_(input), arena_(threads) {}

  void clear() override { gone_ = {}; }
  void run(StageClock&) override {
    const auto config = paper_config(input_, merge::MergeConfig::Overlap::raster);
    arena_.run([&] { gone_ = merge::farther_triangles(input_.parts, config); });
  }
  Message result() override {
    std::vector<std::uint8_t> all;
    for (const auto& part : gone_) all.insert(all.end(), part.begin(), part.end());
    return binary(all);
  }

 private:
  const MergeCase& input_;
  Arena arena_;
  std::vector<std::vector<std::uint8_t>> gone_;
};

}  // namespace

Contender overlap_ours(const MergeCase& input, int threads) {
  return {"ours", threads, Message::object(),
          [&input, threads] { return std::make_unique<OverlapOurs>(input, threads); }};
}

}  // namespace mr::bench
