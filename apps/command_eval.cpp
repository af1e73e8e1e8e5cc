#include "commands.h"

namespace mr::apps {

void add_eval(CLI::App& app, int& exit_code) {
  CLI::App* eval = app.add_subcommand(
      "eval",
      "Measure: quality, geometry, rate against distortion, baselines (docs/evaluation.md)");
  eval->require_subcommand(1);
  eval->footer("meshreduce eval COMMAND --help shows a command's options and examples.");
  add_eval_ssim(*eval, exit_code);
  add_eval_geometry(*eval, exit_code);
  add_eval_scene(*eval, exit_code);
  add_eval_follow(*eval, exit_code);
  add_eval_still(*eval, exit_code);
  add_eval_photos(*eval, exit_code);
  add_eval_views(*eval, exit_code);
  add_eval_compare(*eval, exit_code);
  add_eval_match(*eval, exit_code);
  add_eval_rd(*eval, exit_code);
  add_eval_rate(*eval, exit_code);
  add_eval_features(*eval, exit_code);
}

}  // namespace mr::apps
