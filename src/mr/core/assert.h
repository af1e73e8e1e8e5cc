#pragma once

#include <cstdio>
#include <cstdlib>

/// Our own mistakes: stops the program with the place. On in every build that defines
/// MR_ENABLE_ASSERTS (dev, asan, tsan, fuzz); elsewhere the condition is not evaluated.
#ifdef MR_ENABLE_ASSERTS
#define MR_ASSERT(condition)                                                                 \
  do {                                                                                       \
    if (!(condition)) {                                                                      \
      std::fprintf(stderr, "%s:%d: assertion failed: %s\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                                          \
    }                                                                                        \
  } while (false)
#else
#define MR_ASSERT(condition) static_cast<void>(sizeof(!(condition)))
#endif
