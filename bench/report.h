#pragma once

#include <string>
#include <vector>

#include "child.h"

namespace mr::bench {

/// What `mr-bench STAGE` found (DESIGN section 7).
struct Report {
  std::string stage;
  Message input = Message::object();  ///< per case: what was measured on
  std::vector<Message> results;       ///< as result_row() begins them
  std::vector<std::string> absent;    ///< peers that are not installed
};

/// With `ratio` ("PEER/CASE/tN": the peer's ms / ours), likewise `cpu_ratio` (of time on all cores,
/// which other programs disturb less) and `memory_ratio`, and the machine.
Message as_json(const Report& report);

/// A table for people.
std::string as_text(const Report& report);

}  // namespace mr::bench
