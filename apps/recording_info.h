#pragma once

#include <filesystem>
#include <string>

#include "mr/sensor/recording_formats.h"

/// `info` of recordings and data sets, which are no scene files.
namespace mr::apps {

/// Whether a path is to be described as a recording: a folder, or a file of a format that is known.
bool is_recording(const std::filesystem::path& path);

/// Prints what a recording holds, as text or JSON; returns the exit code.
int describe_recording(const std::filesystem::path& path, bool json);

/// "TUM RGB-D folder, ScanNet export, …": what can be described, or imported.
std::string known_formats(bool importable_only);

/// In one line, that a path is of no format, or that recordings lie in it.
std::string unknown_format(const std::filesystem::path& path, bool importable_only);

/// A path without symbolic links and "..", if it is there.
std::filesystem::path whole_path(const std::filesystem::path& path);

}  // namespace mr::apps
