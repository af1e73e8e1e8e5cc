#include <tbb/global_control.h>

/// TBB starts no more workers than the machine has cores; tests that compare 1 with 8 threads want
/// eight.
static const tbb::global_control eight_threads(tbb::global_control::max_allowed_parallelism, 8);
