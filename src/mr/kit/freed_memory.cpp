#include "mr/kit/freed_memory.h"

#include <cstdlib>
#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace mr::kit {

void keep_freed_memory() {
#ifdef __GLIBC__
  static_cast<void>(::mallopt(M_MMAP_THRESHOLD, 32 << 20));
  static_cast<void>(::mallopt(M_TRIM_THRESHOLD, 64 << 20));
#endif
}

}  // namespace mr::kit
