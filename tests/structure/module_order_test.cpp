#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <vector>

/// Keeps the order of docs/architecture.md: core < yaml < kit < stages < scene < node < planner <
/// gateway < runtime < baseline < eval < cli < apps.
namespace {

/// A file's text by its path from the repository's root.
using Files = std::map<std::string, std::string>;

const std::set<std::string> kStages = {"sensor",   "synth",  "still", "calib", "fusion",
                                       "simplify", "model",  "codec", "merge", "atlas",
                                       "rate",     "render", "net"};

/// Layer of a module, from the ground up; -1 when the design does not know it.
int layer(const std::string& module) {
  if (kStages.contains(module)) return 3;
  const std::vector<std::string> order = {"core", "yaml",    "kit",     "",        "scene",
                                          "node", "planner", "gateway", "runtime", "baseline",
                                          "eval", "cli",     "apps"};
  const auto at = std::find(order.begin(), order.end(), module);
  return module.empty() || at == order.end() ? -1 : static_cast<int>(at - order.begin());
}

/// "src/mr/merge/overlap.cpp" → "merge"; "apps/meshreduce.cpp" → "apps"; else empty.
std::string module_of(const std::string& path) {
  if (path.starts_with("apps/")) return "apps";
  const std::string root = "src/mr/";
  const std::size_t end = path.find('/', root.size());
  if (!path.starts_with(root) || end == std::string::npos) return {};
  return path.substr(root.size(), end - root.size());
}

bool may_include(const std::string& from, const std::string& to) {
  return from == to || layer(to) < layer(from);
}

/// `#include "mr/merge/overlap/overlap.h"` → "merge"; empty for any other line.
std::string included_module(std::string line) {
  std::erase_if(line, [](char c) { return c == ' ' || c == '\t'; });
  for (const std::string start : {"#include\"mr/", "#include<mr/"})
    if (line.starts_with(start)) {
      const std::size_t end = line.find('/', start.size());
      return end == std::string::npos ? "" : line.substr(start.size(), end - start.size());
    }
  return {};
}

std::vector<std::string> order_problems(const Files& files) {
  std::vector<std::string> problems;
  for (const auto& [path, text] : files) {
    const std::string from = module_of(path);
    if (layer(from) < 0) {
      problems.push_back(path + ": its folder is no module of docs/architecture.md");
      continue;
    }
    std::istringstream lines(text);
    std::string line;
    for (int n = 1; std::getline(lines, line); ++n) {
      const std::string to = included_module(line);
      if (to.empty()) continue;
      const std::string where = path + ":" + std::to_string(n) + ": ";
      if (layer(to) < 0)
        problems.push_back(where + to + " is no module of docs/architecture.md");
      else if (!may_include(from, to))
        problems.push_back(where + from + " must not include " + to);
    }
  }
  return problems;
}

Files source_files(const std::filesystem::path& root) {
  Files files;
  for (const char* folder : {"src/mr", "apps"}) {
    if (!std::filesystem::exists(root / folder)) continue;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root / folder)) {
      const std::string extension = entry.path().extension().string();
      if (!entry.is_regular_file() || (extension != ".h" && extension != ".cpp")) continue;
      std::ostringstream text;
      text << std::ifstream(entry.path(), std::ios::binary).rdbuf();
      files[std::filesystem::relative(entry.path(), root).generic_string()] = text.str();
    }
  }
  return files;
}

TEST(ModuleOrder, TheTreeKeepsIt) {
  const Files files = source_files(MR_SOURCE_DIR);
  ASSERT_GT(files.size(), 20u) << "the sources were not found";
  for (const std::string& problem : order_problems(files)) ADD_FAILURE() << problem;
}

std::size_t problems_of(const std::string& path, const std::string& text) {
  return order_problems({{path, text}}).size();
}

TEST(ModuleOrder, SeededBadIncludesAreFound) {
  EXPECT_EQ(problems_of("src/mr/merge/a.cpp", "#include \"mr/codec/b.h\"\n"), 1u) << "a neighbour";
  EXPECT_EQ(problems_of("src/mr/core/a.h", "#include \"mr/kit/b.h\"\n"), 1u) << "upwards";
  EXPECT_EQ(problems_of("src/mr/kit/a.h", "  # include <mr/fusion/b.h>\n"), 1u) << "other spelling";
  EXPECT_EQ(problems_of("src/mr/node/a.h", "#include \"mr/eval/b.h\"\n"), 1u);
  EXPECT_EQ(problems_of("src/mr/node/a.h", "#include \"mr/planner/b.h\"\n"), 1u);
  EXPECT_EQ(problems_of("src/mr/atlas/a.h", "#include \"mr/node/b.h\"\n"), 1u);
  EXPECT_EQ(problems_of("apps/a.cpp", "#include \"mr/magic/b.h\"\n"), 1u) << "an unknown module";
  EXPECT_EQ(problems_of("src/mr/magic/a.cpp", ""), 1u);
  EXPECT_EQ(order_problems({{"src/mr/merge/a.cpp", "// one\n#include \"mr/atlas/b.h\"\n"}}),
            std::vector<std::string>{"src/mr/merge/a.cpp:2: merge must not include atlas"});
}

TEST(ModuleOrder, DownwardsIsAllowed) {
  EXPECT_EQ(
      problems_of("src/mr/merge/a.cpp",
                  "#include \"mr/merge/a.h\"\n#include \"mr/kit/b.h\"\n#include \"mr/core/c.h\"\n"
                  "#include <vector>\n#include <embree3/rtcore.h>\n"),
      0u);
  EXPECT_EQ(
      problems_of("src/mr/node/a.cpp", "#include \"mr/codec/b.h\"\n#include \"mr/net/c.h\"\n"), 0u);
  EXPECT_EQ(problems_of("apps/a.cpp", "#include \"mr/node/b.h\"\n#include \"mr/eval/c.h\"\n"), 0u);
}

}  // namespace
