#pragma once

#include <optional>
#include <string>
#include <vector>

#include "mr/core/frame.h"
#include "mr/core/result.h"
#include "mr/net/digest.h"

namespace mr::gateway {

/// The access tokens of a scene: a viewer that shows one of them is admitted. Only their digests
/// are kept.
class Tokens {
 public:
  static constexpr std::size_t kShortest = 16, kLongest = 256;  ///< characters

  enum class Verdict { right, wrong, expired };
  struct Answer {
    Verdict verdict = Verdict::wrong;
    std::optional<TimePoint> until;  ///< when the token expires; none: never
  };

  /// Tokens are separated by line ends or commas; each may be followed by "until=2027-01-31" (valid
  /// to the end of that day, UTC); '#' starts a comment. Error invalid: its message names the
  /// number of the bad entry and never shows the entry itself, which may be a secret.
  static Result<Tokens> parse(const std::string& text);

  /// Constant-time comparison: the duration depends on the length of `token` only.
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
