#include <stdexcept>

#include "mr/core/parallel.h"
#include "mr/core/simd.h"
#include "mr/simplify/simplify.h"
#include "simplify_contenders.h"
#include "surfaces.h"

namespace mr::bench {
namespace {

/// As a sensor node does it: the simplifier keeps its memory from frame to frame.
class SimplifyOurs final : public Work {
 public:
  SimplifyOurs(const SimplifyCase& input, int threads) : input_(input), arena_(threads) {}

  void clear() override { small_ = {}; }

  void run(StageClock&) override {
    arena_.run([&] {
      auto small = simplifier_.run(*input_.mesh, {.triangles = input_.triangles});
      if (!small) throw std::runtime_error(small.error().message);
      small_ = *std::move(small);
    });
  }

  Message result() override {
    Message out = to_message(small_.mesh);
    out["error_mm"] = small_.error_m * 1000;
    return out;
  }

 private:
  const SimplifyCase& input_;
  Arena arena_;
  simplify::Simplifier simplifier_;
  simplify::Simplified small_;
};

}  // namespace

Contender simplify_ours(const SimplifyCase& input, int threads) {
  apply_simd_override();
  return {"ours", threads, Message::object(),
          [&input, threads] { return std::make_unique<SimplifyOurs>(input, threads); }};
}

}  // namespace mr::bench
