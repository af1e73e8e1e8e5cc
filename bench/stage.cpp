#include "stage.h"

#include <algorithm>

namespace mr::bench {
namespace {

/// The cases that go by a name: the one that is called so, else those of which one half is.
std::vector<CaseInfo> called(const std::vector<CaseInfo>& known, const std::string& name) {
  std::vector<CaseInfo> whole, half;
  for (const CaseInfo& c : known) {
    if (c.name == name) whole.push_back(c);
    if (c.name.starts_with(name + "/") || c.name.ends_with("/" + name)) half.push_back(c);
  }
  return whole.empty() ? half : whole;
}

}  // namespace

Result<std::vector<std::string>> wanted_cases(const std::vector<CaseInfo>& known,
                                              const Request& request, const std::string& whose) {
  std::vector<std::string> out;
  if (request.cases.empty())
    for (const CaseInfo& c : known)
      if (c.by_default && c.missing.empty()) out.push_back(c.name);
  for (const std::string& name : request.cases) {
    const auto found = called(known, name);
    if (found.empty())
      return Error{Error::Cause::not_found,
                   whose + " no case '" + name + "'; mr-bench --list names them"};
    for (const CaseInfo& c : found) {
      if (!c.missing.empty())
        return Error{Error::Cause::not_found, "case " + c.name + ": " + c.missing};
      if (std::ranges::find(out, c.name) == out.end()) out.push_back(c.name);
    }
  }
  return out;
}

}  // namespace mr::bench
