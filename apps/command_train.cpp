#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <set>

#include "commands.h"
#include "mr/core/file.h"
#include "mr/rate/models.h"
#include "output.h"
#include "rate_sweeps.h"

namespace mr::apps {
namespace {

struct TrainOptions : SweepOptions {
  std::filesystem::path out = "src/mr/rate/models.json";
  std::vector<std::filesystem::path> resweep;
};

int run_train(const TrainOptions& options) {
  if (const Status ok = check({{}, options.out, {}}); !ok) return fail(ok.error().message);
  if (!options.resweep.empty())
    if (const auto swept = measure_sweeps(options.resweep, options); !swept)
      return fail(swept.error().message);
  const auto sweeps = read_all_sweeps(options.folder);
  if (!sweeps) return fail(sweeps.error().message);
  std::set<std::string> scenes;
  for (const rate::Sweep& sweep : *sweeps) scenes.insert(sweep.scene);
  const std::string text = rate::to_json(rate::Models::train(*sweeps));
  if (const Status written = write_file(options.out, text); !written)
    return fail(written.error().message);
  fmt::print("{}: trained on {} sweeps of {} scenes\n", options.out.string(), sweeps->size(),
             scenes.size());
  return 0;
}

}  // namespace

void add_train(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<TrainOptions>();
  CLI::App* command =
      app.add_subcommand("train", "Train the models of rate control (docs/rate-control.md)");
  add_sweep_options(*command, *options);
  command->add_option("--sweeps", options->folder, "Folder of the sweeps of 'eval rd'")
      ->capture_default_str();
  command->add_option("--out", options->out, "Model file")->capture_default_str();
  command
      ->add_option("--resweep", options->resweep,
                   "Scene files: measure their sweeps again first, from the rigs' seeds")
      ->expected(1, -1);
  options->again = true;
  command->footer(
      "Example, from stored sweeps, and from the seeds of the rigs:\n"
      "  meshreduce train\n"
      "  meshreduce train --resweep examples/eval/*.yaml");
  command->callback([options, &exit_code] { exit_code = run_train(*options); });
}

}  // namespace mr::apps
