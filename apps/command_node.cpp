#include <memory>

#include "commands.h"
#include "live.h"
#include "output.h"

namespace mr::apps {

void add_node(CLI::App& app, int& exit_code) {
  struct Options {
    std::filesystem::path scene;
    std::vector<std::string> set;
    LiveRun run;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("node", "Run one node of a scene, joined with the others by NATS or TCP");
  command->add_option("SCENE", options->scene, "Scene file (YAML)")->required();
  add_set_option(*command, options->set);
  command
      ->add_option("NAME", options->run.nodes,
                   "Sensors, mergers or 'gateway' to run in this process")
      ->required();
  command->add_option("--listen", options->run.listen, "Address of the gateway, host:port");
  command->add_option("--page", options->run.page, "Folder of the built viewer");
  command->add_option("--report", options->run.report, "Write figures as JSON at the end");
  command->add_option("--metrics", options->run.metrics,
                      "Serve /metrics (Prometheus) and /healthz at host:port; a gateway has them");
  command->add_option("--seconds", options->run.seconds, "Stop after so long; 0: when interrupted")
      ->check(CLI::Range(0.0, 1e9));
  command->add_option("--threads", options->run.threads, "Threads; 0: as the scene says")
      ->check(CLI::Range(0, 1024));
  command->footer(
      "The scene file needs 'nats: {url: nats://host:4222}', or 'tcp: {NODE: host:port, ...}' "
      "with\n"
      "an address for every sensor and merger.\n"
      "Example, each on its own machine:\n"
      "  meshreduce node room.yaml cam-0\n"
      "  meshreduce node room.yaml root\n"
      "  meshreduce node room.yaml gateway\n"
      "For viewers on other machines the scene needs 'gateway: {listen: \"0.0.0.0:8443\", tls: "
      "auto,\n"
      "tokens: {file: tokens}}', or 'open: true' in place of the last two; see docs/security.md.");
  command->callback([options, &exit_code] {
    const auto scene = load_or_print_problems(options->scene, options->set);
    exit_code = scene ? run_live(*scene, options->run) : 1;
  });
}

}  // namespace mr::apps
