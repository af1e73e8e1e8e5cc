#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "mr/cli/progress.h"
#include "report.h"

namespace mr::bench {

/// The command line's options for a stage.
struct Request {
  std::vector<int> threads{1, 2};
  std::vector<std::string> cases;  ///< empty: the default ones
  std::filesystem::path input;     ///< a scene file; empty: the stage's own cases
  int runs = 11;
};

struct CaseInfo {
  std::string name, what;
  bool by_default = true;  ///< false: only by name
  std::string missing;     ///< reason why it cannot run here; empty: it can
};

/// The benchmark of one stage of the pipeline against its peers; one .cpp file each.
struct Stage {
  std::string name, what;
  std::vector<CaseInfo> (*cases)();
  Result<Report> (*run)(const Request& request, cli::ProgressBar& bar);
  std::string (*plot)(const Report& report) = nullptr;  ///< an SVG; null: there is no figure
};

Stage atlas_stage();
Stage dct_stage();
Stage fuse_stage();
Stage layers_stage();
Stage merge_stage();
Stage mkv_stage();
Stage overlap_stage();
Stage scan_stage();
Stage zipper_stage();
Stage simplify_stage();

/// The names of the requested cases, else of the default cases that can run. "kitchen/50%" is also
/// selected by "kitchen" and, if no case has exactly that name, by "50%". `whose`: for the error,
/// such as "fuse has".
Result<std::vector<std::string>> wanted_cases(const std::vector<CaseInfo>& known,
                                              const Request& request, const std::string& whose);

}  // namespace mr::bench
