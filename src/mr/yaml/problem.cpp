#include "mr/yaml/problem.h"

#include "mr/core/user_text.h"

namespace mr::yaml {

std::string to_string(const Problem& problem) {
  if (problem.option) return "--set " + in_quotes(*problem.option) + ": " + problem.message;
  if (problem.line <= 0) return problem.file.string() + ": " + problem.message;
  return problem.file.string() + ":" + std::to_string(problem.line) + ": " + problem.message;
}

}  // namespace mr::yaml
