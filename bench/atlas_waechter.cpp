#include <optional>

#include "atlas_contenders.h"
#include "mr/baseline/waechter.h"
#include "mr/core/parallel.h"

namespace mr::bench {
namespace {

class Waechter final : public Work {
 public:
  Waechter(const AtlasCase& input, int threads) : input_(input), arena_(threads) {
    for (const ImageRgb& picture : input_.pictures) pictures_.push_back(&picture);
    arena_.run([&] {
      if (input_.still.empty()) return;
      const Mesh* const meshes[] = {&input_.still};
      still_.emplace(meshes);
    });
  }

  void clear() override { label_.clear(); }
  void run(StageClock& clock) override {
    arena_.run([&] {
      const Mesh* const meshes[] = {&input_.surface};
      const kit::RayScene surface(meshes);
      std::vector<const kit::RayScene*> hiding{&surface};
      if (still_) hiding.push_back(&*still_);
      const std::vector<float> sums =
          baseline::gradient_sums({&input_.surface, input_.views, pictures_, hiding});
      clock.lap("data");
      label_ = baseline::cut_views(input_.surface, input_.views.size(), sums);
      clock.lap("cut");
    });
  }
  Message result() override { return label_message(input_.surface, label_); }

 private:
  const AtlasCase& input_;
  Arena arena_;
  std::vector<const ImageRgb*> pictures_;
  std::optional<kit::RayScene> still_;
  std::vector<int> label_;
};

}  // namespace

Contender atlas_waechter(const AtlasCase& input, int threads) {
  return {"waechter", threads, Message::object(),
          [&input, threads] { return std::make_unique<Waechter>(input, threads); }};
}

}  // namespace mr::bench
