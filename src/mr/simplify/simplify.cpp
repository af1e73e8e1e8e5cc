#include "mr/simplify/simplify.h"

#include <cmath>

#include "mr/core/assert.h"
#include "mr/simplify/collapser.h"

namespace mr::simplify {

struct Simplifier::Impl {};

Simplifier::Simplifier() : impl_(std::make_unique<Impl>()) {}
Simplifier::~Simplifier() = default;
Simplifier::Simplifier(Simplifier&&) noexcept = default;
Simplifier& Simplifier::operator=(Simplifier&&) noexcept = default;

Result<Simplified> Simplifier::run(const Mesh& mesh, const SimplifyOptions& options) {
  if (options.triangles >= mesh.triangles.size()) return Simplified{mesh, {}, 0};
  Collapser collapser(mesh);
  collapser.reduce_to(options.triangles);
  collapser.relax();
  return Simplified{collapser.mesh(), {}, collapser.error_m()};
}

Result<std::vector<Simplified>> Simplifier::run(const Mesh& mesh,
                                                std::span<const std::size_t> triangles,
                                                const SimplifyOptions& options) {
  std::vector<Simplified> out;
  for (const std::size_t n : triangles) {
    SimplifyOptions one = options;
    one.triangles = n;
    auto level = run(mesh, one);
    if (!level) return level.error();
    out.push_back(*std::move(level));
  }
  return out;
}

Result<Simplified> simplify(const Mesh& mesh, const SimplifyOptions& options) {
  return Simplifier().run(mesh, options);
}

std::size_t triangles_at(const Mesh& mesh, double ratio) {
  MR_ASSERT(ratio > 0 && ratio <= 1);
  return static_cast<std::size_t>(std::ceil(static_cast<double>(mesh.triangles.size()) * ratio));
}

}  // namespace mr::simplify
