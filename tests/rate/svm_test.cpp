#include "mr/rate/svm.h"
#include "rate/made_sweeps.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>

namespace mr::rate {
namespace {

struct Problem {
  std::vector<std::vector<double>> samples;
  std::vector<int> classes;
};

/// Points of a square, of the classes that `of` gives them; none near a border between classes.
Problem problem(unsigned seed, int count, const std::function<int(double, double)>& of) {
  std::mt19937 random(seed);
  const auto uniform = [&] { return 4 * static_cast<double>(random() >> 8) * 0x1p-24 - 2; };
  Problem out;
  while (out.samples.size() < static_cast<std::size_t>(count)) {
    const double x = uniform(), y = uniform(), near = 0.15;
    bool inside = true;
    for (const auto& [dx, dy] : {std::pair{near, 0.0}, {-near, 0.0}, {0.0, near}, {0.0, -near}})
      inside = inside && of(x + dx, y + dy) == of(x, y);
    if (!inside) continue;
    out.samples.push_back({x, y});
    out.classes.push_back(of(x, y));
  }
  return out;
}

int ring(double x, double y) { return std::hypot(x, y) > 1 ? 1 : 0; }
int thirds(double x, double y) { return y > 0.3 * x ? 2 : (x > 0 ? 7 : 0); }

double share_right(const Svm& svm, const Problem& p) {
  int right = 0;
  for (std::size_t i = 0; i < p.samples.size(); ++i)
    right += svm.predict(p.samples[i]) == p.classes[i];
  return right / static_cast<double>(p.samples.size());
}

Svm trained(const std::function<int(double, double)>& of) {
  const Problem p = problem(1, 150, of);
  return Svm::train(p.samples, p.classes);
}

TEST(Svm, SeparatesTwoClassesThatNoLineSeparates) {
  const Svm svm = trained(ring);
  EXPECT_EQ(share_right(svm, problem(1, 150, ring)), 1);
  EXPECT_GE(share_right(svm, problem(2, 500, ring)), 0.98) << "of samples it was not trained on";
}

TEST(Svm, SeparatesThreeClassesOfAnyNumber) {
  const Svm svm = trained(thirds);
  EXPECT_EQ(share_right(svm, problem(1, 150, thirds)), 1);
  EXPECT_GE(share_right(svm, problem(2, 500, thirds)), 0.98);
}

TEST(Svm, OfOneClassPredictsIt) {
  const Svm svm = Svm::train({{1, 2}, {3, 4}}, {5, 5});
  EXPECT_EQ(svm.predict({-100, 7}), 5);
  const auto again = Svm::from(svm.parts());
  ASSERT_TRUE(again);
  EXPECT_EQ(again->predict({0, 0}), 5);
}

TEST(Svm, TrainingIsDeterministic) {
  const Svm::Parts a = trained(thirds).parts(), b = trained(thirds).parts();
  EXPECT_EQ(a.coefficients, b.coefficients);
  EXPECT_EQ(a.vectors, b.vectors);
  EXPECT_EQ(a.rho, b.rho);
}

TEST(Svm, ItsPartsPredictTheSame) {
  for (const auto& of : {ring, thirds}) {
    const Svm svm = trained(of);
    const auto again = Svm::from(svm.parts());
    ASSERT_TRUE(again);
    for (double x = -3; x <= 3; x += 0.1)
      for (double y = -3; y <= 3; y += 0.1)
        ASSERT_EQ(again->predict({x, y}), svm.predict({x, y})) << x << ' ' << y;
  }
}

TEST(Svm, CopiesOutliveTheOriginal) {
  Svm copy;
  {
    const Svm svm = trained(ring);
    copy = svm;
  }
  EXPECT_EQ(copy.predict({0, 0}), 0);
  EXPECT_EQ(copy.predict({1.8, 0}), 1);
}

/// A decision function worked out by hand: of class 3 where exp(-x²) - exp(-(x - 2)²) > rho.
TEST(Svm, PredictsByTheFormula) {
  Svm::Parts parts{1, {3, 8}, {1, 1}, {0.2}, {{1, -1}}, {{0}, {2}}};
  const auto svm = Svm::from(parts);
  ASSERT_TRUE(svm);
  for (double x = -1; x <= 3; x += 0.01) {
    const double value = std::exp(-x * x) - std::exp(-(x - 2) * (x - 2)) - 0.2;
    EXPECT_EQ(svm->predict({x}), value > 0 ? 3 : 8) << x;
  }
}

using Break = std::function<void(Svm::Parts&)>;

void expect_refused(const Break& damage) {
  Svm::Parts parts = trained(thirds).parts();
  damage(parts);
  const auto svm = Svm::from(std::move(parts));
  ASSERT_FALSE(svm);
  EXPECT_EQ(svm.error().cause, Error::Cause::corrupt);
}

TEST(Svm, RefusesListsOfAnotherLength) {
  const Break breaks[] = {[](auto& p) { p.labels.pop_back(); },
                          [](auto& p) { p.labels.push_back(9); },
                          [](auto& p) { p.labels.clear(); },
                          [](auto& p) { p.counts.pop_back(); },
                          [](auto& p) { p.counts.push_back(0); },
                          [](auto& p) { p.rho.pop_back(); },
                          [](auto& p) { p.rho.push_back(0); },
                          [](auto& p) { p.coefficients.pop_back(); },
                          [](auto& p) { p.coefficients.push_back(p.coefficients[0]); },
                          [](auto& p) { p.coefficients[1].pop_back(); },
                          [](auto& p) { p.coefficients[0].push_back(0); },
                          [](auto& p) { p.vectors.pop_back(); },
                          [](auto& p) { p.vectors.clear(); },
                          [](auto& p) { p.vectors[2].pop_back(); },
                          [](auto& p) { p.vectors[2].push_back(0); }};
  for (std::size_t i = 0; i < std::size(breaks); ++i) {
    SCOPED_TRACE(i);
    expect_refused(breaks[i]);
  }
  EXPECT_FALSE(Svm::from({}));
}

TEST(Svm, RefusesCountsThatAreNotThoseOfItsVectors) {
  expect_refused([](auto& p) { ++p.counts[0]; });
  expect_refused([](auto& p) { --p.counts[1]; });
  expect_refused([](auto& p) { p.counts[0] += p.counts[1] + 1, p.counts[1] = -1; });
  expect_refused([](auto& p) { p.counts[0] = std::numeric_limits<int>::max(); });
}

TEST(Svm, RefusesNumbersThatAreNone) {
  for (const double bad : {kNan, kInfinite, -kInfinite}) {
    expect_refused([=](auto& p) { p.gamma = bad; });
    expect_refused([=](auto& p) { p.rho[1] = bad; });
    expect_refused([=](auto& p) { p.coefficients[1].back() = bad; });
    expect_refused([=](auto& p) { p.vectors.back()[0] = bad; });
  }
  for (const double bad : {0.0, -1.0}) expect_refused([=](auto& p) { p.gamma = bad; });
}

TEST(Svm, RefusesTooManyClasses) {
  Svm::Parts parts;
  parts.labels.assign(300, 1), parts.counts.assign(300, 0);
  parts.rho.assign(300 * 299 / 2, 0);
  parts.coefficients.resize(299);
  EXPECT_FALSE(Svm::from(parts));
}

}  // namespace
}  // namespace mr::rate
