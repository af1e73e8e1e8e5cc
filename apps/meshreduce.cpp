#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>

#include "commands.h"

int main(int argc, char** argv) {
  CLI::App app{
      "MeshReduce: live 3D capture with many depth sensors, as one streamed textured mesh.",
      "meshreduce"};
  app.require_subcommand(1);
  app.failure_message(CLI::FailureMessage::simple);
  app.footer("meshreduce COMMAND --help shows a command's options and examples.");
  int exit_code = 0;
  mr::apps::add_demo(app, exit_code);
  mr::apps::add_run(app, exit_code);
  mr::apps::add_node(app, exit_code);
  mr::apps::add_export(app, exit_code);
  mr::apps::add_info(app, exit_code);
  mr::apps::add_plan(app, exit_code);
  mr::apps::add_synth(app, exit_code);
  mr::apps::add_eval(app, exit_code);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& wrong) {
    return app.exit(wrong);
  } catch (const std::exception& unexpected) {
    std::fprintf(stderr, "meshreduce: %s\n", unexpected.what());
    return 1;
  }
  return exit_code;
}
