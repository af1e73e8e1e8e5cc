#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "mr/core/colored_mesh.h"
#include "mr/core/lattice.h"
#include "mr/core/pose.h"
#include "mr/core/result.h"

namespace mr::model {

/// A model of what never moves: sent once, drawn with depth (paper, Fig. 11).
struct BackgroundConfig {
  std::filesystem::path model;  ///< .glb
  Pose T_world_model;

  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const;
  friend bool operator==(const BackgroundConfig&, const BackgroundConfig&) = default;
};

/// Called with one line of text for the person who runs the node.
using Notice = std::function<void(const std::string&)>;

/// A background as a mesh in the world (paper, Fig. 11: a room that was captured before is drawn
/// around the live people), with colours per vertex, neither welded nor on the lattice.
///
/// Reads what read_glb() of gltf_model.h reads. glTF is right-handed with y up, metres;
/// T_world_model maps that to the world. What export_scene() writes is turned so that the scene's
/// `up` is +Y: with up [0, 1, 0] the identity puts it back in place, with up [0, 0, 1] the rotation
/// [1 0 0; 0 0 -1; 0 1 0] does, as for any model whose up is glTF's.
///
/// As colours belong to vertices, edges are cut until they are at most `max_edge_m` on the lattice,
/// and each vertex gets the mean of the texture around it. A model with more than 2 million
/// triangles after that is cut more coarsely, with a notice. The same on any number of threads.
///
/// Errors, one line that names the file: those of reading it; invalid where it reaches beyond the
/// lattice.
Result<ColoredMesh> load_background(const BackgroundConfig& config, const Lattice& lattice,
                                    double max_edge_m, const Notice& notice = {});

/// The same from a file's bytes; its errors do not name the file.
Result<ColoredMesh> read_background(std::span<const std::byte> glb, const Pose& T_world_model,
                                    const Lattice& lattice, double max_edge_m,
                                    const Notice& notice = {});

}  // namespace mr::model
