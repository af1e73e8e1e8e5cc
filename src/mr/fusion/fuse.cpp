#include "mr/fusion/fuse.h"

namespace mr::fusion {

std::vector<Rect> patches(int width, int height, const FusionConfig& fusion) {
  if (fusion.decomposition != Decomposition::patches) return {{0, 0, width, height}};
  const auto column = [&](int i) { return width * i / fusion.patches_x; };
  const auto row = [&](int i) { return height * i / fusion.patches_y; };
  std::vector<Rect> out;
  for (int y = 0; y < fusion.patches_y; ++y)
    for (int x = 0; x < fusion.patches_x; ++x)
      out.push_back({column(x), row(y), column(x + 1) - column(x), row(y + 1) - row(y)});
  return out;
}

Surface& FrameFuser::fuse(const DepthFrame& frame, IntegrateReport* report) {
  const IntegrateReport done = volume_.integrate(frame);
  if (report) *report = done;
  marching_cubes_.run(volume_, surface_);
  return surface_;
}

}  // namespace mr::fusion
