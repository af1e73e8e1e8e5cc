#include "mr/eval/viewpoints.h"

namespace mr::eval {}  // namespace mr::eval
