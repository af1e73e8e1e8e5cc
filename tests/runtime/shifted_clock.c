// Preloaded into a program, this sets its clock of the day off by MR_CLOCK_SHIFT_MS: another
// machine, whose clock nobody synchronised.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <time.h>

int clock_gettime(clockid_t clock, struct timespec* out) {
  static int (*real)(clockid_t, struct timespec*);
  if (!real) real = (int (*)(clockid_t, struct timespec*))dlsym(RTLD_NEXT, "clock_gettime");
  const int result = real(clock, out);
  const char* shift = getenv("MR_CLOCK_SHIFT_MS");
  if (result != 0 || clock != CLOCK_REALTIME || !shift) return result;
  const long long ns = out->tv_sec * 1000000000LL + out->tv_nsec + atoll(shift) * 1000000LL;
  out->tv_sec = ns / 1000000000LL;
  out->tv_nsec = ns % 1000000000LL;
  return result;
}
