#pragma once

#include <cstddef>
#include <filesystem>
#include <initializer_list>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace mr::sensor {

/// Files of one folder, by the number in their names.
using NumberedFiles = std::map<int, std::filesystem::path>;

/// The files whose names are `before`, digits (at most nine) and one of `after`, such as "frame-",
/// 000017, ".color.png". At most 100,000; empty where the folder cannot be read.
NumberedFiles numbered_files(const std::filesystem::path& folder, std::string_view before,
                             std::initializer_list<std::string_view> after);

/// For each number of `items` the file of `files` with that number. Where there is none: a name as
/// of the others, which is no file; `missing` counts them.
std::vector<std::filesystem::path> files_of_items(const NumberedFiles& items,
                                                  const NumberedFiles& files, std::size_t& missing);

/// As scene files have them: {pattern: "…%06d.png", first: 0, last: 99} where the numbers in the
/// names follow one another, else a list of names in brackets. At least one file.
std::string files_text(const std::vector<std::filesystem::path>& files);

}  // namespace mr::sensor
