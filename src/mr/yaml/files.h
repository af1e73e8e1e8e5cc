#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "mr/core/result.h"
#include "mr/core/secret_source.h"
#include "mr/yaml/map_reader.h"

/// Files and secrets that a scene file names.
namespace mr::yaml {

/// Files named by a list, by one string, or by {pattern, first, last}; at least one of them exists
/// where no problem was reported.
struct FileList {
  std::vector<std::filesystem::path> paths;
  std::vector<int> lines;  ///< [paths] line of each
  bool is_pattern = false;
  std::map<std::size_t, Error> unusable;  ///< index of an unusable path → its error
};

/// A printf pattern with one number, taken apart: the user's text never reaches printf.
struct NumberedPattern {
  std::string before, after;
  std::size_t digits = 0;  ///< at least so many, with leading zeros

  std::string name(int number) const;  ///< `number`: not negative
};
inline constexpr const char* kPatternRule =
    "one %d or one of %01d to %09d and no other %";  ///< what a pattern must hold

/// Nothing where the text breaks kPatternRule.
std::optional<NumberedPattern> parse_pattern(const std::string& text);

/// Reads a list, one name or a pattern.
std::optional<FileList> read_files(Report& report, const Node& node, const std::string& name);
/// Reads one name.
std::optional<FileList> read_one_file(Report& report, const Node& node, const std::string& name);
/// The same from a mapping that holds pattern, first and last.
std::optional<FileList> read_pattern(MapReader& map, const std::string& name);

/// Reports the unusable files of a list of which the rest can be used; `key`: in the scene, such as
/// "sensors.cam-0.source.depth".
void report_unusable(Report& report, const FileList& list, const std::string& key);

/// Reads the location of a secret: {env: NAME} or {file: PATH}. Its existence is not checked, as
/// each node of a scene has only its own secrets. False: the key is missing or wrong.
bool read_secret_source(MapReader& map, const std::string& key, SecretSource& out);

}  // namespace mr::yaml
