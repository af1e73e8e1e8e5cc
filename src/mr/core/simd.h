#pragma once

#include <string>
#include <string_view>
#include <vector>

/// Which instruction set run-time dispatched code uses. Names, best first: avx512, avx2, sse4,
/// ssse3 on x86, neon on ARM, and scalar (or baseline) on both. Dispatched code gives the same
/// bytes with each.
namespace mr {

/// Applies the environment variable MR_SIMD: dispatched code then uses nothing newer than the
/// target it names. If this machine lacks that target or the name is unknown, a line on stderr
/// lists the available ones, and the best is used. Modules with dispatched kernels call this before
/// their first kernel; the variable is read once per process. Thread-safe.
void apply_simd_override();

/// The target that dispatched code uses.
std::string simd_target();

/// The targets that this machine supports, best first, regardless of MR_SIMD; the last is "scalar".
std::vector<std::string> simd_targets();

/// For tests: dispatched code then uses nothing newer than this one of simd_targets(). Empty:
/// restores the target of MR_SIMD, or the best one. Returns false, without effect, for any other
/// name. Must not be called while a dispatched kernel runs.
bool set_simd_target(std::string_view target);

}  // namespace mr
