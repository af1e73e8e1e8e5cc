#include "mr/cli/command_line.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <vector>

#include "mr/core/user_text.h"

namespace mr::cli {
namespace {

std::vector<std::string> commands_of(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(command->get_name());
  return names;
}

const CLI::App* command_named(const CLI::App& app, const std::string& name) {
  const auto found = app.get_subcommands([&](const CLI::App* c) { return c->get_name() == name; });
  return found.empty() ? nullptr : found.front();
}

std::string no_command(const CLI::App& app, const std::string& called, const std::string& word) {
  const std::string ending = std::filesystem::path(word).extension().string();
  if (!app.get_parent() && (ending == ".yaml" || ending == ".yml"))
    return fmt::format("{} is no command; to run a scene: {} run {}", in_quotes(word), called,
                       word);
  return fmt::format("no command {}{}; {} --help lists them", in_quotes(word),
                     did_you_mean(word, commands_of(app)), called);
}

std::string no_option(const CLI::App& app, const std::string& called, const std::string& word) {
  std::vector<std::string> known;
  for (const CLI::Option* option : app.get_options())
    for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
  return fmt::format("{}no option {}{}; {} --help lists them",
                     app.get_parent() ? app.get_name() + " has " : "", in_quotes(word),
                     did_you_mean(word, known), called);
}

/// The command that the arguments name, as it is called: "meshreduce eval ssim".
struct Called {
  const CLI::App* command;
  std::string name;
};

Called called_by(const CLI::App& app, std::span<const std::string> args) {
  Called out{&app, app.get_name()};
  for (const std::string& arg : args)
    if (const CLI::App* next = command_named(*out.command, arg)) out = {next, out.name + " " + arg};
  return out;
}

ExitCode misused(const CLI::App& app, const std::string& message) {
  fmt::print(stderr, "{}: {}\n", app.get_name(), message);
  return kMisused;
}

ExitCode print_parse_error(const CLI::App& app, const CLI::ParseError& wrong,
                           std::span<const std::string> args) {
  const Called called = called_by(app, args);
  if (called.command->get_require_subcommand_min() > 0) {
    const CLI::App* parent = called.command->get_parent();
    fmt::print(stderr, "{}", called.command->help(parent ? parent->get_name() : ""));
    return kMisused;
  }
  return misused(app, fmt::format("{}; {} --help shows what it takes", wrong.what(), called.name));
}

}  // namespace

std::optional<std::string> unknown_word(const CLI::App& app, std::span<const std::string> args) {
  Called called{&app, app.get_name()};
  for (const std::string& arg : args) {
    if (arg == "--") break;
    if (arg.starts_with("--")) {
      const std::string name = arg.substr(0, arg.find('='));
      if (!called.command->get_option_no_throw(name))
        return no_option(*called.command, called.name, name);
    } else if (arg.size() > 1 && arg[0] == '-' &&
               std::isalpha(static_cast<unsigned char>(arg[1]))) {
      if (!called.command->get_option_no_throw(arg.substr(0, 2)))
        return no_option(*called.command, called.name, arg);
    } else if (!arg.starts_with("-") && called.command->get_require_subcommand_min() > 0) {
      const CLI::App* next = command_named(*called.command, arg);
      if (!next) return no_command(*called.command, called.name, arg);
      called = {next, called.name + " " + arg};
    }
  }
  return std::nullopt;
}

ExitCode parse_and_run(CLI::App& app, int argc, const char* const* argv) {
  const std::vector<std::string> args(argv + std::min(argc, 1), argv + argc);
  if (const auto unknown = unknown_word(app, args)) return misused(app, *unknown);
  try {
    app.parse(argc, argv);
    return kDone;
  } catch (const CLI::ParseError& wrong) {
    if (wrong.get_exit_code() != 0) return print_parse_error(app, wrong, args);
    app.exit(wrong);  // --help, --version
    return kDone;
  } catch (const std::exception& unexpected) {
    fmt::print(stderr, "{}: {}\n", app.get_name(), unexpected.what());
    return kFailed;
  }
}

}  // namespace mr::cli
