#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "mr/core/decoded_scene.h"
#include "mr/core/result.h"
#include "mr/eval/moments.h"
#include "mr/eval/multi_view_ssim.h"
#include "mr/eval/reference.h"
#include "mr/eval/system.h"
#include "mr/eval/viewpoints.h"
#include "mr/scene/scene.h"

namespace mr::eval {

/// What is asked of a measurement.
struct QualityConfig {
  std::optional<ReferenceKind> reference;  ///< none: the scene's best
  int moments = 3, burst = 4;              ///< see Moments
  std::filesystem::path rig_cache, eval_cache;
  std::function<void(const std::string& step, std::size_t done, std::size_t of)> progress{};
  std::function<void(const std::string& message)> notice{};  ///< one line
};

/// `eval ssim` (DESIGN section 7).
struct QualityReport {
  std::string scene, pipeline;
  ReferenceKind reference = ReferenceKind::truth;
  int views = 0, frames = 0;  ///< frames: moments at which pictures were compared
  double fps = 30;
  double mesh_mbps = 0, texture_mbps = 0;
  double refresh_mbps = 0;      ///< see DecodedStream
  std::uint64_t triangles = 0;  ///< of the last frame; points where it has none
  MultiViewScore score;

  double mbps() const { return mesh_mbps + texture_mbps; }
};

/// A prepared scene, and from where, when and with what pictures of it are compared; serves any
/// pipeline of it.
class Trial {
 public:
  /// Uses NAME.views.json beside the scene file where it was made for this scene, else plans the
  /// viewpoints. empty: no viewpoint, no colour, no surface.
  static Result<Trial> prepare(const Scene& scene, const QualityConfig& config);

  const Scene& scene() const { return scene_; }
  const ViewPlan& plan() const { return plan_; }
  const Moments& moments() const { return moments_; }
  ReferenceKind reference() const { return reference_; }
  std::vector<std::size_t> all_moments() const;

  /// The reference from the first `views` viewpoints, so many captures after those that are shown
  /// at some moments: [moments][views].
  Result<std::vector<std::vector<RenderedView>>> pictures(const std::vector<std::size_t>& moments,
                                                          std::size_t views, int captures_later,
                                                          const QualityConfig& config) const;

  /// What a stream of every `divider`-th capture is compared with: on average it is
  /// (divider - 1) / 2 captures old.
  /// `with_seen`: scores have an ssim_seen where the reference is a truth.
  Result<MultiViewSsim> metric(const std::vector<std::size_t>& moments, std::size_t views,
                               int divider, const QualityConfig& config,
                               bool with_seen = false) const;

 private:
  Scene scene_;
  ViewPlan plan_;
  Moments moments_;
  ReferenceKind reference_ = ReferenceKind::truth;
};

/// Every how many captures a scene's pipeline sends one.
int frame_divider(const Scene& scene);

/// One stream as a client decodes it, moment by moment.
struct DecodedStream {
  std::vector<DecodedScene> shown;  ///< [moments]
  double mesh_mbps = 0, texture_mbps = 0;
  /// Of a pipeline with memory: what sending all chunks and plates once a second would cost; that
  /// is in no other rate. Others send everything all the time: 0.
  double refresh_mbps = 0;
};

/// Runs a scene's pipeline, whichever it names, through every moment: one with memory from the
/// warm-up on, with its rate that of the second that ends with each moment.
Result<DecodedStream> run_pipeline(const Scene& scene, const Moments& moments,
                                   const QualityConfig& config);

/// The same from a system's halves: quicker, as only what carries state is coded for the captures
/// before the last of a burst, and kept for next time. Without memory every capture is coded for
/// itself.
Result<DecodedStream> run_pipeline_halves(System& system, const Scene& scene,
                                          const Moments& moments, const QualityConfig& config);

/// Draws the stream from every viewpoint and compares. `pictures`, where given, takes the
/// first moment's, [views].
Result<QualityReport> measure_quality(const Trial& trial, const MultiViewSsim& metric,
                                      const Scene& scene, const DecodedStream& stream,
                                      const QualityConfig& config,
                                      std::vector<ImageRgb>* pictures = nullptr);

/// Where a scene's viewpoints are stored, and what they were made for.
std::filesystem::path viewpoints_file(const Scene& scene);
std::string viewpoints_key(const Scene& scene);

/// Plans the viewpoints of a prepared scene from a coarse fusion of its first capture.
Result<ViewPlan> plan_scene(const Scene& scene, const std::filesystem::path& rig_cache);

/// The figures as JSON (DESIGN section 7), and as lines for people.
std::string to_json(const QualityReport& report);
std::string to_text(const QualityReport& report);

}  // namespace mr::eval
