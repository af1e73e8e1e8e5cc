#include "mr/eval/ssim.h"

namespace mr::eval {}  // namespace mr::eval
