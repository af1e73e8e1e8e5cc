#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <span>
#include <string>

/// Command-line handling shared by `meshreduce` and `mr-bench`.
namespace mr::cli {

/// docs/command-line.md. A process that a signal ends has 128 + its number, as in any shell.
enum ExitCode : int {
  kDone = 0,
  kFailed = 1,         ///< the work, or a file that it needs
  kMisused = 2,        ///< the command line; nothing was started
  kInterrupted = 130,  ///< Ctrl-C while a rig is rendered
};

/// One line on the first command or --option among the arguments that the program does not have,
/// with the one that may have been meant; nothing where all are known.
std::optional<std::string> unknown_word(const CLI::App& app, std::span<const std::string> args);

/// Parses and runs the chosen command's callback. Prints a problem of the command line in one
/// line on stderr, and the help if a command is missing. kDone, kFailed for an exception
/// of the work, or kMisused; the callback reports its own exit code elsewhere.
ExitCode parse_and_run(CLI::App& app, int argc, const char* const* argv);

}  // namespace mr::cli
