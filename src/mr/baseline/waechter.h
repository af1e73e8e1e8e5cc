#pragma once

#include <functional>
#include <span>
#include <vector>

#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/vec.h"
#include "mr/core/view.h"
#include "mr/kit/raycast.h"

/// Texturing by Waechter, Moehrle and Goesele (ECCV 2014, "Let There Be Color!"), written anew
/// after the paper: view selection (3), global and local seam levelling (4). Their rejection of
/// pictures that show somebody walking through is left out: the pictures are of one moment. Local
/// levelling runs over all that one picture textures, where theirs runs over each patch.
namespace mr::baseline {

/// A surface and the pinhole views that may texture it.
struct Photographed {
  const Mesh* surface = nullptr;
  std::span<const View> views;
  std::span<const ImageRgb* const> pictures;     ///< [views] of the cameras
  std::span<const kit::RayScene* const> hiding;  ///< what hides points, the surface too
};

/// The data term: the magnitude of the brightness gradient summed over a triangle's pixels; 0: the
/// view does not see all its corners. [T * views]. Parallel.
std::vector<float> gradient_sums(const Photographed& in);

/// A Potts model solved by alpha expansion: a triangle costs 1 - sum / the sums' 99.5th percentile,
/// an edge between two views 1. [T] index of the view; -1: none sees it. One thread.
std::vector<int> cut_views(const Mesh& surface, std::size_t views, std::span<const float> sums);

/// What a view shows at a point, 0..255.
using ColorOfView = std::function<Vec3d(int view, Vec3d p_world)>;

/// Global seam levelling (after Lempitsky and Ivanov 2007): what is to be added to the colours of
/// the corners, least squares of what is left of the differences across seams and, tenfold, of the
/// changes along edges within a view. What is connected is not darkened or brightened as a whole.
/// [3T]; 0 where there is no view. Corners of one vertex and one view have one value. One thread.
std::vector<Vec3d> level_seams(const Mesh& surface, std::span<const int> label,
                               const ColorOfView& color);

/// The pictures with level_seams() added where they texture the surface, then levelled locally:
/// within 20 pixels of a seam the rest of the difference fades out, harmonically (Perez et al.
/// 2003), so both sides of a seam have the mean of their colours. [views]
std::vector<ImageRgb> levelled_pictures(const Photographed& in, std::span<const int> label);

}  // namespace mr::baseline
