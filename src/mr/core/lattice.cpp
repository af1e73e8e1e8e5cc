#include "mr/core/lattice.h"

namespace mr {

std::vector<std::string> Lattice::problems() const {
  std::vector<std::string> out = out_of_range({{"step_exp", step_exp, kStepExp},
                                               {"origin", origin.x, kOrigin_m},
                                               {"origin", origin.y, kOrigin_m},
                                               {"origin", origin.z, kOrigin_m}});
  if (!out.empty()) return out;
  for (const double x : {origin.x, origin.y, origin.z})
    if (x / step_m() != std::floor(x / step_m()))
      return {"origin must be multiples of the lattice's step, 2^" + std::to_string(step_exp) +
              " m"};
  return out;
}

}  // namespace mr
