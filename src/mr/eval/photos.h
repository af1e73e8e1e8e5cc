#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "mr/core/image.h"
#include "mr/core/result.h"
#include "mr/eval/photo_files.h"
#include "mr/runtime/lockstep_scene.h"
#include "mr/scene/scene.h"

/// Decoded streams compared with photographs that no sensor of the scene delivered
/// (docs/evaluation.md, Photographs).
namespace mr::eval {

struct PhotoConfig {
  PhotoSelection photographs;
  std::string camera;                ///< id of the sensor that took them; empty: the first sensor
  int captures = 1;                  ///< of the stream; it is compared after the last
  std::vector<std::string> systems;  ///< of photo_systems(); not empty
  std::filesystem::path pictures;    ///< folder for photographs beside renders; empty: none
  std::filesystem::path rig_cache;
};

/// One system beside one photograph.
struct PhotoScore {
  double ssim = 0, psnr_db = 0;  ///< luma BT.709, over the pixels that all systems cover
  double gain = 1;               ///< exposure: photograph / render, in linear light
};

/// One system beside all photographs. Means are over the photographs of which all systems cover
/// something.
struct PhotoSystem {
  std::string name;
  double ssim = 0, psnr_db = 0;
  double covered = 0;                             ///< its own share of all photographs' pixels
  std::vector<std::optional<PhotoScore>> scores;  ///< [photographs] nothing: none covered by all
};

struct PhotoReport {
  std::string scene;
  int captures = 0;
  std::vector<PhotoFile> photographs;
  std::vector<PhotoSystem> systems;  ///< as in the config
};

/// The names that PhotoConfig::systems may hold.
std::vector<std::string> photo_systems();

/// Runs each system on the scene and compares what a client draws with the photographs: from the
/// sensor's colour camera, moved by each photograph's pose, without back faces, after one gain per
/// picture. The scene must be prepared. Errors are one line: those of find_photographs() and
/// check_not_delivered(); empty: a system shows nothing, or no pixel is covered by all of them;
/// invalid: no such sensor, or it has no colour.
Result<PhotoReport> compare_with_photographs(const Scene& scene, const PhotoConfig& config,
                                             const runtime::RunListener& listener);

/// The gain of a rendered picture's linear light, one number for all channels, that brings it
/// closest to a photograph: it minimises the sum of the absolute differences of linear luma over
/// the covered pixels that clip in neither picture (no channel of 254 or more), so that few pixels
/// that show something else do not matter. 1 where no such pixel is brighter than black. The three
/// have one size.
double exposure_gain(const ImageRgb& rendered, const ImageRgb& photograph,
                     const ImageMask& covered);

/// The picture with its linear light multiplied by `gain`; clips.
ImageRgb exposed(const ImageRgb& picture, double gain);

std::string to_json(const PhotoReport& report);
std::string to_text(const PhotoReport& report);

}  // namespace mr::eval
