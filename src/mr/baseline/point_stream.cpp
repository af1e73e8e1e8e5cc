#include "mr/baseline/baseline.h"

namespace mr::baseline {}  // namespace mr::baseline
