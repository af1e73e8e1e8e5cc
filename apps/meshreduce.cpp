#include <CLI/CLI.hpp>

#include "commands.h"
#include "mr/cli/command_line.h"
#include "mr/kit/freed_memory.h"
#include "version.h"

int main(int argc, char** argv) {
  mr::kit::keep_freed_memory();
  CLI::App app{
      "MeshReduce: live 3D capture with many depth sensors, as one streamed textured mesh.",
      "meshreduce"};
  app.require_subcommand(1);
  app.set_version_flag("--version", mr::apps::version_text, "Print the version");
  app.footer(
      "meshreduce COMMAND --help shows a command's options and examples.\n"
      "Exit code: 0 done, 1 it failed, 2 wrong command line, 130 interrupted "
      "(docs/command-line.md).");
  int exit_code = 0;
  mr::apps::add_demo(app, exit_code);
  mr::apps::add_run(app, exit_code);
  mr::apps::add_node(app, exit_code);
  mr::apps::add_export(app, exit_code);
  mr::apps::add_info(app, exit_code);
  mr::apps::add_import(app, exit_code);
  mr::apps::add_devices(app, exit_code);
  mr::apps::add_plan(app, exit_code);
  mr::apps::add_synth(app, exit_code);
  mr::apps::add_train(app, exit_code);
  mr::apps::add_eval(app, exit_code);
  const mr::cli::ExitCode parsed = mr::cli::parse_and_run(app, argc, argv);
  return parsed == mr::cli::kDone ? exit_code : parsed;
}
