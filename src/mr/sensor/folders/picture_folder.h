#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/frame.h"
#include "mr/core/result.h"
#include "mr/sensor/recording_formats.h"

/// What the folders of data sets have in common, so that each layout only has to be read.
namespace mr::sensor {

/// A recording of picture files, whichever its layout, with what its folder says of it.
struct PictureFolder {
  std::string format;
  std::filesystem::path folder;
  std::vector<std::filesystem::path> depth, color;  ///< item by item; no colour: empty
  double depth_unit_m = 0.001;
  std::string depth_unit_from;  ///< such as "the layout: metres = value / 5000"
  std::vector<std::uint16_t> invalid{0};
  std::optional<Camera> depth_camera, color_camera;
  Pose T_color_depth;
  std::string cameras_from;  ///< the file or the rule that they are from
  std::vector<Pose> poses;   ///< those that can be used, in any order
  std::size_t lost_poses = 0;
  std::string T_world_depth;                       ///< value of the scene's key; empty: not known
  std::vector<std::filesystem::path> still_poses;  ///< [depth] each item is a view of its own
  std::vector<TimePoint> times;                    ///< [depth], or empty
  std::string source;                              ///< value of the scene's key; empty: of files
  bool is_structured_light = false;                ///< Kinect v1, PrimeSense: their range and noise
  std::vector<std::string> comments;               ///< for the imported scene, beside the notes
  std::vector<std::string> notes;                  ///< what is missing or unusual
};

/// Fields and notes of a folder. Opens its first pictures. Error: none of the first ten depth
/// pictures can be read.
Result<RecordingInfo> describe(const PictureFolder& folder);

/// One moving sensor, or one for each still view. Error: the cameras are not known and no usual
/// ones have pictures of this size.
Result<ImportedScene> imported(const PictureFolder& folder);

struct PictureSize {
  int width = 0, height = 0;  ///< pixels; 0: not known
};
/// The size of the first picture of a list that can be read, among the first ten.
PictureSize picture_size(const std::vector<std::filesystem::path>& files);

/// Adds a note such as "3 of 90 pictures have no colour" if `missing` is not 0.
void note_missing(PictureFolder& folder, std::size_t missing, const std::string& what);

/// The poses of the files that can be read; the others count as lost.
void read_pose_files(PictureFolder& folder, const std::vector<std::filesystem::path>& files);
/// The same from one file of many poses; a note where it cannot be read or has another number of
/// poses than there are pictures.
void read_trajectory(PictureFolder& folder, const std::filesystem::path& file);

/// A name as scene files allow it, made of the last part of a path: letters, digits, - and _.
std::string id_of(const std::filesystem::path& path);

}  // namespace mr::sensor
