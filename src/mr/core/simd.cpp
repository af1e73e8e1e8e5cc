#include "mr/core/simd.h"

#include <hwy/targets.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <optional>

namespace mr {
namespace {

/// Highway's targets are bits; a lower bit is a better target.
using Target = std::int64_t;

std::string word(Target target) {
  switch (target) {
#if HWY_ARCH_X86
    case HWY_AVX3_DL:
    case HWY_AVX3:
      return "avx512";
    case HWY_AVX2:
      return "avx2";
    case HWY_SSE4:
      return "sse4";
    case HWY_SSSE3:
      return "ssse3";
#elif HWY_ARCH_ARM
    case HWY_NEON:
      return "neon";
#endif
    default:
      return "scalar";
  }
}

/// The targets as detected, before limit_to() removes some.
const std::vector<Target>& available() {
  static const std::vector<Target> targets = hwy::SupportedAndGeneratedTargets();
  return targets;
}

std::optional<Target> find(std::string_view name) {
  if (name == "baseline") name = "scalar";
  for (const Target target : available())
    if (word(target) == name) return target;
  return {};
}

/// Limits dispatch to `best` and older targets. hwy::DisableTargets is not used: in Highway 1.0.3
/// its effect is lost when the supported targets are queried again.
void limit_to(Target best) {
  Target targets = 0;
  for (const Target target : available())
    if (target >= best) targets |= target;
  hwy::SetSupportedTargetsForTest(targets);
  hwy::GetChosenTarget().Update(targets);
}

void warn(const char* wanted) {
  std::string names;
  for (const std::string& name : simd_targets()) names += " " + name;
  std::fprintf(stderr, "MR_SIMD=%s: not on this machine, which has%s; using %s\n", wanted,
               names.c_str(), word(available().front()).c_str());
}

/// The target that MR_SIMD names, else the best.
Target asked_for() {
  static const Target target = [] {
    const char* wanted = std::getenv("MR_SIMD");
    if (wanted == nullptr || *wanted == '\0') return available().front();
    const std::optional<Target> found = find(wanted);
    if (!found) warn(wanted);
    return found.value_or(available().front());
  }();
  return target;
}

}  // namespace

void apply_simd_override() {
  static std::once_flag once;
  std::call_once(once, [] { limit_to(asked_for()); });
}

std::string simd_target() {
  apply_simd_override();
  return word(hwy::SupportedAndGeneratedTargets().front());
}

std::vector<std::string> simd_targets() {
  std::vector<std::string> names;
  for (const Target target : available())
    if (names.empty() || names.back() != word(target)) names.push_back(word(target));
  return names;
}

bool set_simd_target(std::string_view target) {
  apply_simd_override();
  const std::optional<Target> found = target.empty() ? asked_for() : find(target);
  if (found) limit_to(*found);
  return found.has_value();
}

}  // namespace mr
