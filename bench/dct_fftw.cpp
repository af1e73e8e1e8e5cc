#include <fftw3.h>

#include <algorithm>
#include <cmath>

#include "dct_contenders.h"

namespace mr::bench {
namespace {

class Fftw final : public Work {
 public:
  explicit Fftw(const LumaPlane& plane)
      : plane_(plane),
        columns_(plane.width / kDctBlock),
        dct_(fftwf_alloc_real(columns_ * kDctBlock * kDctBlock)) {
    const int size[] = {kDctBlock, kDctBlock}, rows[] = {kDctBlock, plane.width};
    const fftwf_r2r_kind kinds[] = {FFTW_REDFT10, FFTW_REDFT10};
    plan_ =
        fftwf_plan_many_r2r(2, size, columns_, plane_.data.data(), rows, 1, kDctBlock, dct_, size,
                            1, kDctBlock * kDctBlock, kinds, FFTW_MEASURE | FFTW_PRESERVE_INPUT);
    plane_ = plane;  // planning overwrites it
  }
  ~Fftw() override {
    fftwf_destroy_plan(plan_);
    fftwf_free(dct_);
  }
  Fftw(const Fftw&) = delete;
  Fftw& operator=(const Fftw&) = delete;

  void clear() override {}
  void run(StageClock&) override {
    double sum = 0;
    const int rows = plane_.height / kDctBlock;
    for (int row = 0; row < rows; ++row) {
      fftwf_execute_r2r(plan_, plane_.row(row * kDctBlock), dct_);
      for (int i = 0; i < columns_; ++i) sum += weights_.energy(dct_ + i * kDctBlock * kDctBlock);
    }
    energy_ = sum / (rows * columns_);
  }
  Message result() override { return {{"energy", energy_}}; }

 private:
  LumaPlane plane_;
  int columns_;
  float* dct_;  ///< [columns] blocks
  fftwf_plan plan_;
  // FFTW's is 2 Σ pixel cos(…) in each direction.
  DctWeights weights_{std::sqrt(1.0 / kDctBlock) / 2, std::sqrt(2.0 / kDctBlock) / 2};
  double energy_ = 0;
};

}  // namespace

bool has_fftw() { return true; }

std::vector<Contender> dct_fftw(const LumaPlane& plane) {
  return {{"fftw", 1, Message::object(), [&plane] { return std::make_unique<Fftw>(plane); }}};
}

}  // namespace mr::bench
