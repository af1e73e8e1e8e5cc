#include "mr/core/user_text.h"

#include <gtest/gtest.h>

namespace mr {
namespace {

TEST(Words, TheMostSimilarIsSuggested) {
  const std::vector<std::string> commands{"demo", "run", "export", "eval"};
  EXPECT_EQ(did_you_mean("dem", commands), " (did you mean 'demo'?)");
  EXPECT_EQ(did_you_mean("runn", commands), " (did you mean 'run'?)");
  EXPECT_EQ(did_you_mean("exprot", commands), " (did you mean 'export'?)");
}

TEST(Words, NothingIsSuggestedForWhatIsLikeNone) {
  EXPECT_EQ(did_you_mean("calibrate", {"demo", "run"}), "");
  EXPECT_EQ(did_you_mean("demo", {}), "");
  EXPECT_EQ(did_you_mean(std::string(100, 'x'), {std::string(100, 'x')}), "");
}

TEST(Words, QuotesAreShortAndOnOneLine) {
  EXPECT_EQ(in_quotes("a b"), "'a b'");
  EXPECT_EQ(in_quotes("a\nb\x1b"), "'a?b?'");
  EXPECT_EQ(in_quotes(std::string(200, 'x')), "'" + std::string(160, 'x') + "...'");
}

}  // namespace
}  // namespace mr
