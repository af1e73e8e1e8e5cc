#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "mr/core/result.h"
#include "mr/rate/setting.h"

namespace mr::rate {

/// A named feature of a scene at a moment, as models are fed it.
struct Feature {
  std::string name;
  double value = 0;
  friend bool operator==(const Feature&, const Feature&) = default;
};

/// Rate and distortion of one scene at one moment, measured in the steady state (paper 4.2, Fig.
/// 8a): geometry and texture are coded separately, so their rates add up, and quality is measured
/// for pairs of them.
struct Sweep {
  struct Geometry {
    double error_voxels = 0;
    int bits = 10;
    double bytes = 0;             ///< of a capture: moving chunks and the packet's head
    std::uint64_t triangles = 0;  ///< of the moving surface
    friend bool operator==(const Geometry&, const Geometry&) = default;
  };
  struct Texture {
    double scale = 1;
    int qp = 0;
    double key_bytes = 0;  ///< of a capture with a key frame; both include alpha planes
    double bytes = 0;      ///< of any other capture
    friend bool operator==(const Texture&, const Texture&) = default;
  };
  /// The clean plates, whole, with everything else at its best.
  struct Plates {
    int qp = 0;
    double key_bytes = 0;
    double ssim = 0;
    friend bool operator==(const Plates&, const Plates&) = default;
  };
  /// The still surface, whole, with everything else at its best.
  struct Still {
    double error_voxels = 0;
    double bytes = 0;
    double ssim = 0;
    friend bool operator==(const Still&, const Still&) = default;
  };
  struct Quality {
    std::size_t geometry = 0, texture = 0;  ///< index
    double ssim = 0;                        ///< masked, mean over the viewpoints
    /// Of the pixels that show the moving surface, decimated least; where nothing moves, of all.
    double moving_ssim = 0;
    friend bool operator==(const Quality&, const Quality&) = default;
  };

  std::string scene;
  bool layers = true;  ///< still.layers
  int moment = 0;      ///< capture at which quality was measured
  double fps = 30, voxel_m = 0.01;
  std::vector<Feature> features;
  std::vector<Geometry> geometries;
  std::vector<Texture> textures;
  std::vector<Quality> qualities;
  // Only with layers:
  std::vector<Plates> plates;
  std::vector<Still> stills;

  double geometry_mbps(const Geometry& g) const { return g.bytes * fps * 8e-6; }
  /// One capture a second has a key frame.
  double texture_mbps(const Texture& t) const { return (t.key_bytes + (fps - 1) * t.bytes) * 8e-6; }
  friend bool operator==(const Sweep&, const Sweep&) = default;
};

/// The sweeps of a scene, as stored: their format's version and what they were measured from.
struct SweepFile {
  static constexpr int kVersion = 2;
  std::string scene_hash;  ///< of the scene file, its viewpoints, and the sweep's options
  std::vector<Sweep> sweeps;
};

std::string to_json(const SweepFile& file);
/// Untrusted text. Errors: corrupt; unsupported: of another version; too_large. One line.
Result<SweepFile> sweeps_from_json(std::string_view text);

}  // namespace mr::rate
