#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "mr/atlas/atlas_config.h"
#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/packet.h"
#include "mr/core/view.h"

namespace mr::atlas {

class Occluders;

struct LabelConfig {
  AtlasConfig::Views views = AtlasConfig::Views::coherent;
  double coherent_angle_deg =
      30;  ///< a neighbour's view is taken when it is at most this much worse than the best
  double geometry_error_m = 0.01;  ///< decimation + lattice + calibration error
  Precision precision{};           ///< of the noisiest sensor: bumps of its noise are not occluders
  double min_edge_m = 0.02;        ///< triangles across an occlusion edge are cut down to this
  const Occluders* occluders = nullptr;  ///< other surface that may hide this one; may be null
  /// Of which pixels of its camera picture a view is good for, such as a plate's valid blocks; all
  /// where it has no mask.
  std::map<ViewId, TileMask> valid{};
};

/// Chooses which view textures each triangle (paper 3.3; DESIGN section 4, "Texturing by
/// projection"). A view may be used where all corners lie beyond its near plane and inside
/// image_rect minus the gutter, the triangle faces it, and at least 90 % of the triangle is visible
/// in a rasterisation of this mesh from it (of a panorama: from its six sides), with a margin
/// around occluders, and every pixel of it is valid. A triangle across an occlusion edge, the
/// border of what is valid, or the seam of a panorama, is cut; what cannot be cut further goes to
/// the view that sees most of it, or to none, never to one without valid pixels. best_angle takes
/// the view that looks most directly; coherent prefers the neighbours' view where angles allow.
/// Returns the mesh with runs; vertices that cutting added may lie off the lattice.
Mesh label_triangles(const Mesh& mesh, std::span<const View> views, const LabelConfig& config);

/// A surface that is cut and labelled triangle by triangle.
struct Labelling {
  static constexpr int kNone = -1;

  Mesh mesh;                          ///< without runs
  std::vector<int> label;             ///< [T] place of a view; kNone: none
  std::vector<std::uint8_t> is_due;   ///< [T] to be labelled
  std::vector<std::uint32_t> origin;  ///< [T] triangle of the surface that it was cut from
  /// The ends of the edge that each vertex added by cutting lies on; those are the last vertices.
  std::vector<std::array<std::uint32_t, 2>> cut_edges;

  /// All of a surface, to be labelled.
  static Labelling of(Mesh surface);
  /// The labels as runs.
  Mesh labelled(std::span<const View> views) const;
};

/// Labels what is due, as label_triangles() does; all else keeps its label, and is only cut where
/// an edge of what is due is. `config.occluders`: must hold what is not due.
void label_due(Labelling& surface, std::span<const View> views, const LabelConfig& config);

/// The margin in pixels that geometry error asks for at a depth: error · f / z + 2,
/// f: pixels per radian.
double margin_px(const View& view, double geometry_error_m, double depth_m);

}  // namespace mr::atlas
