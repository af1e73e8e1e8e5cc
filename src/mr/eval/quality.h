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

/// Options of a quality measurement.
struct QualityConfig {
  std::optional<ReferenceKind> reference;  ///< none: the best that the scene has
  int moments = 3, burst = 4;              ///< see Moments
  std::filesystem::path rig_cache, eval_cache;
  std::function<void(const std::string& step, std::size_t done, std::size_t of)> progress{};
  std::function<void(const std::string& message)> notice{};  ///< one line
};

/// The figures that `eval ssim` prints (docs/evaluation.md, Pictures).
struct QualityReport {
  std::string scene, pipeline;
  ReferenceKind reference = ReferenceKind::truth;
  int views = 0, frames = 0;  ///< frames: moments that were compared
  double fps = 30;
  double mesh_mbps = 0, texture_mbps = 0;
  double refresh_mbps = 0;      ///< see DecodedStream
  std::uint64_t triangles = 0;  ///< of the last frame; points where it has none
  MultiViewScore score;

  double mbps() const { return mesh_mbps + texture_mbps; }
};

/// The set-up of an evaluation: a prepared scene with the viewpoints, moments and reference of the
/// comparison. It serves all pipelines of the scene.
class Trial {
 public:
  /// Reads the viewpoints from NAME.views.json beside the scene file if they were planned for this
  /// scene, else plans them. empty: there is no viewpoint, no colour or no surface.
  static Result<Trial> prepare(const Scene& scene, const QualityConfig& config);

  const Scene& scene() const { return scene_; }
  const ViewPlan& plan() const { return plan_; }
  const Moments& moments() const { return moments_; }
  ReferenceKind reference() const { return reference_; }
  std::vector<std::size_t> all_moments() const;

  /// Renders the reference from the first `views` viewpoints, `captures_later` captures after each
  /// of the given moments: [moments][views].
  Result<std::vector<std::vector<RenderedView>>> pictures(const std::vector<std::size_t>& moments,
                                                          std::size_t views, int captures_later,
                                                          const QualityConfig& config) const;

  /// The metric for a stream that sends every `divider`-th capture, so that what it shows is 0 to
  /// divider - 1 captures old. `with_seen`: scores have ssim_seen if the reference is ground truth.
  Result<MultiViewSsim> metric(const std::vector<std::size_t>& moments, std::size_t views,
                               int divider, const QualityConfig& config,
                               bool with_seen = false) const;

 private:
  Scene scene_;
  ViewPlan plan_;
  Moments moments_;
  ReferenceKind reference_ = ReferenceKind::truth;
};

/// A scene's pipeline sends one of so many captures.
int frame_divider(const Scene& scene);

/// A stream as a client decodes it at each moment, and its bitrates.
struct DecodedStream {
  std::vector<DecodedScene> shown;  ///< [moments]
  double mesh_mbps = 0, texture_mbps = 0;
  /// Stateful pipelines: what sending all chunks and clean plates once a second would cost, which
  /// is not part of the other rates. 0 for stateless ones, which always send everything.
  double refresh_mbps = 0;
};

/// Runs the scene's pipeline over all moments. A stateful one runs from the warm-up on, and its
/// bitrate is that of the second that ends with each moment.
Result<DecodedStream> run_pipeline(const Scene& scene, const Moments& moments,
                                   const QualityConfig& config);

/// The same from the two halves of a System (geometry, texture). Faster: of a burst's earlier
/// captures only what carries state is coded, and results are cached. Without state every capture
/// is coded on its own.
Result<DecodedStream> run_pipeline_halves(System& system, const Scene& scene,
                                          const Moments& moments, const QualityConfig& config);

/// Renders a decoded stream from every viewpoint and compares it with the reference. `pictures`, if
/// given, receives those of the first moment, [views].
Result<QualityReport> measure_quality(const Trial& trial, const MultiViewSsim& metric,
                                      const Scene& scene, const DecodedStream& stream,
                                      const QualityConfig& config,
                                      std::vector<ImageRgb>* pictures = nullptr);

/// The file of a scene's viewpoints, and the key of the scene for which they were planned.
std::filesystem::path viewpoints_file(const Scene& scene);
std::string viewpoints_key(const Scene& scene);

/// Plans the viewpoints of a prepared scene from a coarse fusion of its first capture.
Result<ViewPlan> plan_scene(const Scene& scene, const std::filesystem::path& rig_cache);

/// The viewpoints that are stored beside a prepared scene; planned where there are none, or those
/// of another scene (`notice` gets a line then; may be empty).
Result<ViewPlan> scene_viewpoints(const Scene& scene, const std::filesystem::path& rig_cache,
                                  const std::function<void(const std::string&)>& notice);

/// The figures as JSON with stable keys, and as lines for people.
std::string to_json(const QualityReport& report);
std::string to_text(const QualityReport& report);

}  // namespace mr::eval
