#pragma once

#include <functional>
#include <map>
#include <vector>

#include "mr/core/decoded_scene.h"
#include "mr/core/mesh.h"
#include "mr/kit/part.h"
#include "mr/node/chunk_grid.h"

/// Scenes by layer, as a merger takes them: one scene per input, without pictures.
namespace mr::node {

/// Views and sources of a tick with their poses corrected (merge.refine).
struct CorrectedPoses {
  std::vector<View> views;
  std::vector<SourceInfo> sources;
};

/// The tiles of views' pictures that may give colour: all that are not blind
/// (SourceInfo::blind_color). Views of which nothing is said have none.
std::map<ViewId, TileMask> seeing_tiles(const std::vector<View>& views,
                                        const std::vector<SourceInfo>& sources);

/// A scene with the chunks of one layer.
DecodedScene layer_of(const DecodedScene& scene, Layer layer);
std::vector<DecodedScene> layer_of(const std::vector<DecodedScene>& scenes, Layer layer);

/// One surface of all chunks of a scene in these cubes; borders between chunks are welded.
kit::Part part_of(const DecodedScene& scene, const std::function<bool(Vec3i cube)>& wanted);
/// The same of all cubes, for each scene. Parallel.
std::vector<kit::Part> parts_of(const std::vector<DecodedScene>& scenes);

/// The errors that the scenes' chunks have.
CubeErrors errors_of(const std::vector<DecodedScene>& scenes);

/// Whether two sets of scenes have the same geometry, measured from the same poses and seen by the
/// same views. Chunks are compared by address: one that was kept is the very same object.
bool same_geometry(const std::vector<DecodedScene>& a, const std::vector<DecodedScene>& b);
/// Whether two sources are one sensor in the same place.
bool same_place(const SourceInfo& a, const SourceInfo& b);

}  // namespace mr::node
