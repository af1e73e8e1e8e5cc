#pragma once

#include <compare>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "mr/baseline/baseline.h"
#include "mr/core/result.h"
#include "mr/eval/moments.h"
#include "mr/eval/reference.h"
#include "mr/eval/store.h"
#include "mr/scene/scene.h"

namespace mr::eval {

/// The geometry parameters that a sweep varies; a system ignores those that it does not have.
struct GeometrySetting {
  double voxel_m = 0.01;
  double ratio = 0.1;  ///< simplify.ratio
  int step_exp = -10;  ///< lattice.step_exp
  int depth_qp = 16;   ///< coding.depth_qp

  friend auto operator<=>(const GeometrySetting&, const GeometrySetting&) = default;
};

/// The texture parameters that a sweep varies.
struct TextureSetting {
  double scale = 1;  ///< coding.texture_scale
  int qp = 28;       ///< coding.texture_qp

  friend auto operator<=>(const TextureSetting&, const TextureSetting&) = default;
};

/// The settings that a scene file asks for.
GeometrySetting geometry_setting(const Scene& scene);
TextureSetting texture_setting(const Scene& scene);
std::string to_string(const GeometrySetting& setting);
std::string to_string(const TextureSetting& setting);

/// The bytes of one half of a stream (geometry or texture) at one moment.
struct Cost {
  std::vector<double> bytes;  ///< of each capture in the burst, or in the second that ends with it
  /// All captures are predicted, none is sent in full (docs/evaluation.md, Rate).
  bool steady = false;
  double refresh_bytes = 0;  ///< stateful systems: all retained data; not part of `bytes`

  void add_to(Rate& rate) const { steady ? rate.add_steady(bytes) : rate.add_burst(bytes); }
};

/// One half of a stream at one moment: its cost, and the last capture as a client decodes it.
template <typename Decoded>
struct CodedHalf {
  Cost cost;
  Decoded decoded;
};
using CodedGeometry = CodedHalf<baseline::Geometry>;
using CodedTexture = CodedHalf<baseline::Texture>;

/// A scene's pipeline split into geometry and texture, so that a sweep codes each half once and
/// combines them freely. Coded halves are cached. A half without state is coded for the last
/// capture of a burst only; a stateful one processes all captures from the warm-up on.
class System {
 public:
  virtual ~System() = default;

  /// The name for people, e.g. "Holoportation".
  virtual std::string name() const = 0;

  Result<CodedGeometry> geometry(const GeometrySetting& setting, std::size_t moment);
  Result<CodedTexture> texture(const TextureSetting& setting, std::size_t moment);

  /// Only what it costs.
  Result<Cost> texture_cost(const TextureSetting& setting, std::size_t moment);

  /// The cache for scores of this system.
  Store scores(const std::vector<render::Viewpoint>& views, ReferenceKind reference) const;

 protected:
  using Bytes = baseline::Bytes;
  /// `folder`: the cache for coded halves; empty: none.
  explicit System(std::filesystem::path folder) : folder_(std::move(folder)), store_(folder_) {}

 private:
  virtual Result<std::vector<Bytes>> encode(const GeometrySetting& setting, std::size_t moment) = 0;
  virtual Result<std::vector<Bytes>> encode(const TextureSetting& setting, std::size_t moment) = 0;
  virtual Result<baseline::Geometry> decode(const GeometrySetting& setting,
                                            const std::vector<Bytes>& coded) = 0;
  virtual Result<baseline::Texture> decode(const TextureSetting& setting, std::size_t moment,
                                           const std::vector<Bytes>& coded) = 0;
  /// The size of each.
  virtual Cost geometry_cost(const std::vector<Bytes>& coded) const;
  virtual Cost texture_cost(const std::vector<Bytes>& coded) const;
  template <typename Setting>
  Result<std::vector<Bytes>> coded(const Setting& setting, std::size_t moment);

  std::filesystem::path folder_;
  Store store_;
};

struct SystemConfig {
  Moments moments;
  std::filesystem::path rig_cache, eval_cache;
  /// meshreduce only: the texture, which is coded independently of the geometry, contains the
  /// pixels that the surface uses with any of these settings.
  std::vector<GeometrySetting> mask_for;
};

/// The System of the scene's pipeline. The scene must be prepared; it is copied.
Result<std::unique_ptr<System>> make_system(const Scene& scene, const SystemConfig& config);

}  // namespace mr::eval
