#pragma once

#include <optional>
#include <string>
#include <vector>

#include "mr/core/frame.h"
#include "mr/core/result.h"
#include "mr/net/digest.h"

namespace mr::gateway {

/// Who may watch: anybody who knows one of these. Only their digests are kept.
class Tokens {
 public:
  static constexpr std::size_t kShortest = 16, kLongest = 256;  ///< characters

  enum class Verdict { right, wrong, expired };
  struct Answer {
    Verdict verdict = Verdict::wrong;
    std::optional<TimePoint> until;  ///< of a token that ends
  };

  /// One token a line or between commas, each perhaps with "until=2027-01-31" (to the end of that
  /// day, UTC); from '#' to the end of a line is a remark. invalid: one line that names the entry's
  /// number and never shows what stands in it.
  static Result<Tokens> parse(const std::string& text);

  /// Takes the same time for every token of one length.
  Answer check(const std::string& token, TimePoint now) const;

 private:
  struct Token {
    net::Sha256 digest;
    std::optional<TimePoint> until;
  };
  static Result<Token> parse_one(const std::string& entry, const std::string& where);
  std::vector<Token> tokens_;
};

}  // namespace mr::gateway
