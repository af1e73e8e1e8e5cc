#pragma once

#include <memory>

#include "mr/baseline/baseline.h"

namespace mr::baseline {

/// The four systems; the scene must be prepared and outlive them.
std::unique_ptr<Baseline> make_holoportation(const Scene& scene);
std::unique_ptr<Baseline> make_holoportation_plus(const Scene& scene);
std::unique_ptr<Baseline> make_points(const Scene& scene);
std::unique_ptr<Baseline> make_rgbd(const Scene& scene);

}  // namespace mr::baseline
