#pragma once

#include <CLI/CLI.hpp>

/// One function per command: adds its options to the app; when it was chosen, its work is done by
/// the callback, which returns the exit code through `exit_code`.
namespace mr::apps {

void add_run(CLI::App& app, int& exit_code);
void add_demo(CLI::App& app, int& exit_code);
void add_node(CLI::App& app, int& exit_code);
void add_export(CLI::App& app, int& exit_code);
void add_info(CLI::App& app, int& exit_code);
void add_import(CLI::App& app, int& exit_code);
void add_devices(CLI::App& app, int& exit_code);
void add_plan(CLI::App& app, int& exit_code);
void add_synth(CLI::App& app, int& exit_code);
void add_train(CLI::App& app, int& exit_code);
void add_eval(CLI::App& app, int& exit_code);

// Of `eval`; the app is that command.
void add_eval_geometry(CLI::App& eval, int& exit_code);
void add_eval_features(CLI::App& eval, int& exit_code);
void add_eval_scene(CLI::App& eval, int& exit_code);
void add_eval_follow(CLI::App& eval, int& exit_code);
void add_eval_still(CLI::App& eval, int& exit_code);
void add_eval_views(CLI::App& eval, int& exit_code);
void add_eval_ssim(CLI::App& eval, int& exit_code);
void add_eval_compare(CLI::App& eval, int& exit_code);
void add_eval_match(CLI::App& eval, int& exit_code);
void add_eval_photos(CLI::App& eval, int& exit_code);
void add_eval_rd(CLI::App& eval, int& exit_code);
void add_eval_rate(CLI::App& eval, int& exit_code);

}  // namespace mr::apps
