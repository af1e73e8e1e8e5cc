#include "mr/core/simd.h"

// Highway includes this file once per target.
#define HWY_TARGET_INCLUDE "core/simd_test.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace mr::test::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// The target that ran, as a bit; `sum` becomes 0 + 1 + … + 31 from its vectors.
std::int64_t run_kernel(float& sum) {
  const hn::ScalableTag<float> tag;
  auto sums = hn::Zero(tag);
  for (int i = 0; i < 32; i += static_cast<int>(Lanes(tag)))
    sums = hn::Add(sums, hn::Iota(tag, static_cast<float>(i)));
  sum = hn::GetLane(hn::SumOfLanes(tag, sums));
  return HWY_TARGET;
}

}  // namespace mr::test::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <map>

namespace mr::test {
namespace {

HWY_EXPORT(run_kernel);

/// The target that dispatched code runs, in the words of MR_SIMD; `sum` as above.
std::string dispatched(float& sum) {
  const std::map<std::string, std::string> words = {
      {"AVX3_DL", "avx512"}, {"AVX3", "avx512"}, {"AVX2", "avx2"},     {"SSE4", "sse4"},
      {"SSSE3", "ssse3"},    {"NEON", "neon"},   {"SCALAR", "scalar"}, {"EMU128", "scalar"}};
  return words.at(hwy::TargetName(HWY_DYNAMIC_DISPATCH(run_kernel)(sum)));
}

/// Sets MR_SIMD, prints the target in use and exits; to be run in a process of its own.
[[noreturn]] void say_target(const char* wanted) {
  setenv("MR_SIMD", wanted, 1);
  apply_simd_override();
  float sum = 0;
  const std::string ran = dispatched(sum);
  std::fprintf(stderr, "[%s ran %s]", simd_target().c_str(), ran.c_str());
  std::exit(0);
}

// Googletest runs death tests first, before this process reads its own MR_SIMD.
TEST(SimdDeathTest, EnvironmentNamesTheTarget) {
  for (const std::string& name : simd_targets())
    EXPECT_EXIT(say_target(name.c_str()), testing::ExitedWithCode(0),
                "^.?" + name + " ran " + name);
  EXPECT_EXIT(say_target("baseline"), testing::ExitedWithCode(0), "^.?scalar ran scalar");
}

TEST(SimdDeathTest, WhatIsNotThereIsSaidAndTheBestStays) {
  const std::string best = simd_targets().front();
  for (const std::string name : {"mmx", "AVX2 ", "avx2,sse4"})
    EXPECT_EXIT(say_target(name.c_str()), testing::ExitedWithCode(0),
                "^MR_SIMD=" + name + ": not on this machine, which has " + best + ".*; using " +
                    best + "\n.?" + best + " ran " + best);
  EXPECT_EXIT(say_target(""), testing::ExitedWithCode(0), "^.?" + best + " ran " + best);
}

TEST(Simd, BestFirstAndScalarLast) {
  const std::vector<std::string> known = {"avx512", "avx2", "sse4", "ssse3", "neon", "scalar"};
  const std::vector<std::string> names = simd_targets();
  std::size_t last = 0;
  for (const std::string& name : names) {
    const auto at = std::find(known.begin() + static_cast<std::ptrdiff_t>(last), known.end(), name);
    ASSERT_NE(at, known.end()) << name;
    last = static_cast<std::size_t>(at - known.begin()) + 1;
  }
  EXPECT_EQ(names.back(), "scalar");
#if HWY_ARCH_ARM_A64
  EXPECT_EQ(names.front(), "neon");
#endif
}

TEST(Simd, DispatchedCodeUsesTheTargetThatIsSet) {
  const std::string before = simd_target();
  for (const std::string& name : simd_targets()) {
    ASSERT_TRUE(set_simd_target(name));
    EXPECT_EQ(simd_target(), name);
    float sum = 0;
    EXPECT_EQ(dispatched(sum), name);
    EXPECT_EQ(sum, 496.f);
  }
  EXPECT_FALSE(set_simd_target("mmx"));
  EXPECT_EQ(simd_target(), "scalar");
  EXPECT_TRUE(set_simd_target(""));
  EXPECT_EQ(simd_target(), before);
  float sum = 0;
  EXPECT_EQ(dispatched(sum), before);
}

}  // namespace
}  // namespace mr::test

#endif  // HWY_ONCE
