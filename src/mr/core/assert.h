#pragma once

#include <cstdio>
#include <cstdlib>

/// Assertion against programming errors: prints file and line and aborts. Enabled in builds that
/// define MR_ENABLE_ASSERTS (dev, asan, tsan, fuzz); in others the condition is not evaluated.
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
