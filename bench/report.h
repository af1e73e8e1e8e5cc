#pragma once

#include <string>
#include <vector>

#include "child.h"

namespace mr::bench {

/// The contender that is our own code.
inline const std::string kOurs = "ours";

/// A number of the rows that as_text() shows.
struct Column {
  std::string title, field;
  int digits = 3;
};

/// Rounds to a number of decimal places, for readable output.
double rounded(double value, int digits);

/// The results of `mr-bench STAGE`. Programs outside the repository read them: the JSON keys are
/// stable.
struct Report {
  std::string stage;
  Message input = Message::object();  ///< per case: what was measured on
  std::vector<Message> results{};     ///< as result_row() begins them
  std::vector<std::string> absent{};  ///< peers that are not installed
  std::vector<Column> columns{};      ///< additional columns of the printed table
  /// Replaces the ratio of `ms` in stages that compare more than time.
  Message ratio{};
};

/// With `ratio` ("PEER/CASE/tN": the peer's ms / ours on N threads; a peer that ran on one thread
/// only is set against ours on any number), likewise `cpu_ratio` (of time on all cores,
/// which other programs disturb less) and `memory_ratio`, and the machine.
Message as_json(const Report& report);

/// A table for people.
std::string as_text(const Report& report);

}  // namespace mr::bench
