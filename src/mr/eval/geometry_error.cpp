#include "mr/eval/geometry_error.h"

namespace mr::eval {}  // namespace mr::eval
