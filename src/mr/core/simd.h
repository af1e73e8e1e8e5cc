#pragma once

#include <string>
#include <string_view>
#include <vector>

/// Which instruction set run-time dispatched code uses. In words, best first: avx512, avx2, sse4,
/// ssse3 on x86, neon on ARM, and scalar (or baseline) on both. Dispatched code gives the same
/// bytes with each.
namespace mr {

/// Applies the environment variable MR_SIMD: dispatched code then uses nothing newer than the
/// target it names. What it names may be unknown or missing on this machine: then a line on stderr
/// says which there are, and the best one is used. Modules with dispatched kernels call it before
/// the first of them; it reads the variable once per process. Thread-safe.
void apply_simd_override();

/// The target that dispatched code uses.
std::string simd_target();

/// The targets that this machine can run, best first, whatever MR_SIMD says; "scalar" is the last.
std::vector<std::string> simd_targets();

/// For tests: from here on dispatched code uses nothing newer than this one of simd_targets().
/// Empty: back to what MR_SIMD asks for, the best if it asks for nothing. False, and nothing
/// changes, for any other word. Not while a dispatched kernel runs.
bool set_simd_target(std::string_view target);

}  // namespace mr
