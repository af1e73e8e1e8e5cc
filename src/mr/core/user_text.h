#pragma once

#include <string>
#include <string_view>
#include <vector>

/// Formatting of user input in messages: words of a scene file or a command line.
namespace mr {

/// The text in single quotes, shortened and without control characters.
std::string in_quotes(std::string_view text);

/// A text of somebody else on one line: without control characters, which could be lines of their
/// own or commands to a terminal.
std::string one_line(std::string_view text);

/// " (did you mean 'word'?)" with the most similar of `known`; empty when none is.
std::string did_you_mean(std::string_view word, const std::vector<std::string>& known);

}  // namespace mr
