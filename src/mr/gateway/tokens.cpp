#include "mr/gateway/tokens.h"

#include <chrono>
#include <cstdio>
#include <sstream>

namespace mr::gateway {
namespace {

/// The end of a day such as "2027-01-31", UTC; nothing: not a valid date.
std::optional<TimePoint> end_of_day(const std::string& text) {
  int year = 0, month = 0, day = 0, used = 0;
  const int read = std::sscanf(text.c_str(), "%4d-%2d-%2d%n", &year, &month, &day, &used);
  if (read != 3 || static_cast<std::size_t>(used) != text.size()) return std::nullopt;
  const std::chrono::year_month_day date{std::chrono::year(year),
                                         std::chrono::month(static_cast<unsigned>(month)),
                                         std::chrono::day(static_cast<unsigned>(day))};
  if (!date.ok() || year < 1970 || year > 2200) return std::nullopt;
  return TimePoint(std::chrono::sys_days(date)) + std::chrono::hours(24);
}

bool is_token(const std::string& word) {
  return word.size() >= Tokens::kShortest && word.size() <= Tokens::kLongest &&
         word.find_first_not_of(
             "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789"
             "-._~+/=") == std::string::npos;
}

}  // namespace

Result<Tokens::Token> Tokens::parse_one(const std::string& entry, const std::string& where) {
  constexpr std::string_view kUntil = "until=";
  const auto refuse = [&](const std::string& why) {
    return Error{Error::Cause::invalid, where + " " + why};
  };
  std::istringstream words(entry);
  std::string word, until, more;
  words >> word >> until >> more;
  if (!is_token(word))
    return refuse(
        "is no token: 16 to 256 letters, digits or -._~+/=, as `openssl rand -hex 16` gives");
  Token token{net::sha256(word), {}};
  if (!until.empty()) {
    if (until.starts_with(kUntil)) token.until = end_of_day(until.substr(kUntil.size()));
    if (!token.until || !more.empty())
      return refuse("may have until=YYYY-MM-DD behind the token, and nothing else");
  }
  return token;
}

Result<Tokens> Tokens::parse(const std::string& text) {
  Tokens out;
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    std::istringstream entries(line.substr(0, line.find('#')));
    for (std::string entry; std::getline(entries, entry, ',');) {
      if (entry.find_first_not_of(" \t\r") == std::string::npos) continue;
      auto token = parse_one(entry, "tokens: an entry of line " + std::to_string(number));
      if (!token) return token.error();
      out.tokens_.push_back(*std::move(token));
    }
  }
  if (out.tokens_.empty()) return Error{Error::Cause::invalid, "tokens: there is none"};
  return out;
}

Tokens::Answer Tokens::check(const std::string& token, TimePoint now) const {
  const net::Sha256 digest = net::sha256(token);
  const Token* found = nullptr;
  for (const Token& known : tokens_)  // all of them, whichever it is
    if (net::is_equal_in_constant_time(known.digest, digest)) found = &known;
  if (found == nullptr) return {};
  const bool is_over = found->until && now >= *found->until;
  return {is_over ? Verdict::expired : Verdict::right, found->until};
}

}  // namespace mr::gateway
