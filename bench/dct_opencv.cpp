#include <opencv2/core.hpp>

#include "dct_contenders.h"

namespace mr::bench {
namespace {

class OpenCv final : public Work {
 public:
  explicit OpenCv(const LumaPlane& plane)
      : copy_(plane), plane_(plane.height, plane.width, CV_32F, copy_.data.data()) {
    cv::setNumThreads(1);
  }

  void clear() override {}
  void run(StageClock&) override {
    double sum = 0;
    const int rows = plane_.rows / kDctBlock, columns = plane_.cols / kDctBlock;
    for (int y = 0; y < rows; ++y)
      for (int x = 0; x < columns; ++x) {
        cv::dct(plane_(cv::Rect(x * kDctBlock, y * kDctBlock, kDctBlock, kDctBlock)), dct_);
        sum += weights_.energy(dct_.ptr<float>());
      }
    energy_ = sum / (rows * columns);
  }
  Message result() override { return {{"energy", energy_}}; }

 private:
  LumaPlane copy_;
  cv::Mat plane_,
      dct_ = cv::Mat(kDctBlock, kDctBlock, CV_32F);  // braces would make a list of three numbers
  DctWeights weights_{1, 1};
  double energy_ = 0;
};

}  // namespace

Contender dct_opencv(const LumaPlane& plane) {
  return {"opencv", 1, Message::object(), [&plane] { return std::make_unique<OpenCv>(plane); }};
}

}  // namespace mr::bench
