#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "mr/atlas/atlas_config.h"
#include "mr/core/decoded_scene.h"
#include "mr/core/image.h"
#include "mr/core/lattice.h"
#include "mr/core/mesh.h"
#include "mr/core/packet.h"
#include "mr/core/view.h"

namespace mr::atlas {

class ColorSampler;
class LabelHistory;
class Occluders;

struct LabelConfig {
  AtlasConfig::Views views = AtlasConfig::Views::coherent;
  double geometry_error_m = 0.01;  ///< decimation + lattice + calibration error
  Precision precision{};     ///< of the noisiest sensor, so that noise does not count as occluder
  double min_edge_m = 0.02;  ///< triangles across an occlusion edge are split down to this edge
  const Occluders* occluders = nullptr;  ///< other surface that may occlude this one
  std::optional<Lattice> lattice{};  ///< of the mesh: vertices that splitting adds are put on it
  /// Masks of the pixels of a view's camera picture that may be used for texture, such as the valid
  /// blocks of a clean plate; all pixels if it has no mask.
  std::map<ViewId, TileMask> valid{};
  /// Alpha planes of the views' pictures, by stream: a view that shows something else where a
  /// triangle lies (alpha is 0) textures it only where no other does.
  AlphaByStream alpha{};
  const ColorSampler* colors = nullptr;   ///< coherent: seams go where pictures agree; may be null
  const LabelHistory* history = nullptr;  ///< coherent: views that are kept; null: none
  float keep = 0.15f;                     ///< how much worse a kept view may be (quality_cost)
  double least_region_m2 = 0.005;         ///< coherent: smaller regions take a neighbour's view
};

/// View selection: chooses the view that textures each triangle (paper 3.3). A view is usable if
/// all corners lie beyond its near plane and inside image_rect minus the gutter, the triangle faces
/// it, at least 90 % of the triangle is visible in its depth buffer (a panorama: of its cube
/// faces), with a margin around occluders, and all its pixels are valid. A triangle across an
/// occlusion edge, the border of valid pixels or a panorama's seam is split; a
/// triangle too small to split gets the view in which most of it is visible, or none, and never a
/// view without valid pixels.
/// best_angle chooses the most frontal view. coherent solves a labelling problem (label_problem.h):
/// each triangle costs its area times quality_cost() of its view, seams cost their length times the
/// difference of colours; no region, that is, connected triangles of one view, is smaller than
/// `least_region_m2` unless its neighbours' views do not show all of it. Returns the mesh with
/// runs.
Mesh label_triangles(const Mesh& mesh, std::span<const View> views, const LabelConfig& config);

/// A surface while its triangles are split and labelled.
struct Labelling {
  static constexpr int kNone = -1;

  Mesh mesh;                          ///< without runs
  std::vector<int> label;             ///< [T] index of a view; kNone: none
  std::vector<std::uint8_t> is_due;   ///< [T] whether it is to be labelled
  std::vector<std::uint32_t> origin;  ///< [T] index of the original triangle
  /// For each vertex added by cutting, the ends of the edge that it lies on. These vertices are the
  /// last of the mesh.
  std::vector<std::array<std::uint32_t, 2>> cut_edges;

  /// A surface of which every triangle is due.
  static Labelling of(Mesh surface);
  /// The mesh with its labels as runs, without triangles with two corners in one place.
  Mesh labelled(std::span<const View> views) const;
};

/// Labels the due triangles as label_triangles() does. All others keep their labels and are only
/// split along with a shared edge, but for regions that end up beside due triangles and are smaller
/// than `least_region_m2` (coherent): they are labelled again, too. `is_due` has no meaning after.
/// `config.occluders` must contain the surface that is not due.
void label_due(Labelling& surface, std::span<const View> views, const LabelConfig& config);

/// Margin in pixels for a geometry error at a depth: error · f / z + 2, with f in pixels per
/// radian.
double margin_px(const View& view, double geometry_error_m, double depth_m);

}  // namespace mr::atlas
