#pragma once

namespace mr::rate {

/// Keeps nodes within a time per capture by fewer triangles: raises the least error limit of
/// decimation while a node takes longer, takes back a raise that did not help, and lowers it again
/// where there is time. Counts captures; no clock.
class TimeBudget {
 public:
  static constexpr double kMost_ms = 100;

  /// No error is raised above `most_voxels`, for however little time there is.
  explicit TimeBudget(double most_voxels) : most_voxels_(most_voxels) {}

  /// The slowest node took so long for its newest capture, which had that error limit.
  void note(double ms, double error_voxels);
  /// In voxels; 0: there is time for any.
  double least_error_voxels() const { return least_voxels_; }

 private:
  void decide(double mean_ms, double error_voxels);

  double most_voxels_;
  double sum_ms_ = 0;
  int captures_ = 0;  ///< in the sum
  double least_voxels_ = 0;
  // The last raise, until it is known whether it helped:
  bool is_tried_ = false;
  double voxels_before_ = 0, ms_before_ = 0;
  int wait_ = 0;  ///< decisions until the next raise may be tried
};

}  // namespace mr::rate
