#include "mr/eval/plot.h"

namespace mr::eval {}  // namespace mr::eval
