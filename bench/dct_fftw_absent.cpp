#include "dct_contenders.h"

namespace mr::bench {

bool has_fftw() { return false; }

std::vector<Contender> dct_fftw(const LumaPlane&) { return {}; }

}  // namespace mr::bench
