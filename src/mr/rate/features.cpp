#include "mr/rate/features.h"

namespace mr::rate {}  // namespace mr::rate
