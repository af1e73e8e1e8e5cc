#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>

#include "mr/cli/command_line.h"
#include "mr/core/file.h"
#include "mr/core/user_text.h"
#include "stage.h"

namespace mr::bench {
namespace {

struct Options {
  std::string stage;
  Request request;
  std::filesystem::path plot;
  bool json = false, list = false;
};

std::vector<Stage> stages() {
  return {fuse_stage(),   simplify_stage(), overlap_stage(), merge_stage(), zipper_stage(),
          layers_stage(), atlas_stage(),    scan_stage(),    mkv_stage(),   dct_stage()};
}

int fail(const std::string& message) {
  fmt::print(stderr, "mr-bench: {}\n", message);
  return cli::kFailed;
}

/// The command line is wrong.
int misused(const std::string& message) {
  fail(message);
  return cli::kMisused;
}

std::string no_stage(const std::string& word) {
  if (word.empty()) return "name a stage; mr-bench --list names them";
  std::vector<std::string> names;
  for (const Stage& stage : stages()) names.push_back(stage.name);
  return "no stage " + in_quotes(word) + did_you_mean(word, names) + "; mr-bench --list names them";
}

Message list_as_json() {
  Message out = Message::object();
  for (const Stage& stage : stages())
    for (const CaseInfo& c : stage.cases())
      out[stage.name].push_back({{"case", c.name},
                                 {"what", c.what},
                                 {"default", c.by_default},
                                 {"available", c.missing.empty()}});
  return out;
}

std::string list_as_text() {
  std::string out;
  for (const Stage& stage : stages()) {
    out += fmt::format("{}: {}\n", stage.name, stage.what);
    for (const CaseInfo& c : stage.cases())
      out +=
          fmt::format("  {:<16} {}{}{}\n", c.name, c.what, c.by_default ? "" : "; only by --case",
                      c.missing.empty() ? "" : "; " + c.missing);
  }
  return out;
}

int measure(const Options& options) {
  const auto known = stages();
  const auto stage = std::find_if(known.begin(), known.end(),
                                  [&](const Stage& s) { return s.name == options.stage; });
  if (stage == known.end()) return misused(no_stage(options.stage));
  if (!options.plot.empty() && !stage->plot) return misused(stage->name + " draws no figure");
  cli::ProgressBar bar;
  const auto report = stage->run(options.request, bar);
  bar.hide();
  if (!report) return fail(report.error().message);
  if (!options.plot.empty())
    if (const Status drawn = write_file(options.plot, stage->plot(*report)); !drawn)
      return fail(drawn.error().message);
  if (options.json)
    fmt::print("{}\n", as_json(*report).dump(-1, ' ', false, Message::error_handler_t::replace));
  else
    fmt::print("{}", as_text(*report));
  return 0;
}

int run(const Options& options) {
  if (!options.list) return measure(options);
  fmt::print("{}", options.json ? list_as_json().dump() + "\n" : list_as_text());
  return 0;
}

void add_options(CLI::App& app, Options& options) {
  app.add_option("STAGE", options.stage, "What to measure; --list names them");
  app.add_option("--threads", options.request.threads, "Thread counts, such as 1,2")
      ->delimiter(',')
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  app.add_option("--case", options.request.cases, "Only this case; may be given several times")
      ->take_all();
  app.add_option("--input", options.request.input,
                 "A scene file in place of the stage's own cases");
  app.add_option("--runs", options.request.runs, "Timed runs of each; 3 where one takes over 2 s")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  app.add_option("--plot", options.plot, "Also draws the results as SVG, for stages with a figure");
  app.add_flag("--json", options.json, "One JSON object on the last line");
  app.add_flag("--list", options.list, "Name the stages and their cases");
  app.footer(
      "Each contender runs in a process of its own, all in turns; times are medians.\n"
      "Examples:\n"
      "  mr-bench fuse\n"
      "  mr-bench fuse --case room_bench --threads 1 --json\n"
      "  mr-bench fuse --input examples/red-kitchen.yaml\n"
      "  mr-bench simplify --case 50% --case 10% --json\n"
      "  mr-bench layers --case two_people --json");
}

}  // namespace
}  // namespace mr::bench

int main(int argc, char** argv) {
  CLI::App app{"Measures the stages of MeshReduce beside the best other implementations.",
               "mr-bench"};
  mr::bench::Options options;
  int exit_code = 0;
  mr::bench::add_options(app, options);
  app.callback([&] { exit_code = mr::bench::run(options); });
  const mr::cli::ExitCode parsed = mr::cli::parse_and_run(app, argc, argv);
  return parsed == mr::cli::kDone ? exit_code : parsed;
}
