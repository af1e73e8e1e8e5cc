#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "mr/core/mesh.h"

namespace mr::merge {

/// The best rival at a vertex.
struct Loss {
  static constexpr std::uint32_t kNobody = 0xFFFFFFFFu;
  std::uint32_t part = kNobody, triangle = 0;
};

/// What a part owns of itself.
struct Owned {
  std::vector<float>
      margin;              ///< [V] how much better it measured than the best rival; over 0: its own
  std::vector<Loss> loss;  ///< [V] the best rival
  std::vector<std::uint8_t> given_up;         ///< [T of the part], empty: nothing was
  std::vector<std::uint8_t> given_up_vertex;  ///< [V], empty: nothing was

  bool is_given_up(std::uint32_t triangle) const {
    return !given_up.empty() && given_up[triangle] != 0;
  }
  bool is_vertex_given_up(std::size_t vertex) const {
    return !given_up_vertex.empty() && given_up_vertex[vertex] != 0;
  }
};

/// Gives up the connected patches that a part owns of less than `least_m2`, where rivals have
/// surface under most of them. Returns whether there were any.
/// `keeps`: whether a rival has surface that it does not give up.
/// `whole`: [T] which of the part's `triangles` a triangle of the mesh is of; empty: the same.
bool give_up_patches(const Mesh& mesh, const std::vector<std::uint32_t>& whole,
                     std::size_t triangles, double least_m2,
                     const std::function<bool(const Loss&)>& keeps, Owned& owned);

}  // namespace mr::merge
