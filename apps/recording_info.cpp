#include "recording_info.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "mr/core/user_text.h"
#include "output.h"

namespace mr::apps {
namespace {

using Json = nlohmann::ordered_json;
using sensor::RecordingInfo;

std::string value_text(const RecordingInfo::Field& field) {
  const std::string unit = field.unit.empty() ? "" : " " + field.unit;
  if (const auto* text = std::get_if<std::string>(&field.value)) return one_line(*text) + unit;
  if (const auto* whole = std::get_if<std::int64_t>(&field.value))
    return fmt::format("{}{}", *whole, unit);
  if (const auto* number = std::get_if<double>(&field.value))
    return fmt::format("{:g}{}", *number, unit);
  const auto& list = std::get<std::vector<double>>(field.value);
  return fmt::format("{:g}{}", fmt::join(list, " "), unit);
}

std::string as_text(const RecordingInfo& info, const std::filesystem::path& path) {
  std::string out = fmt::format("{}: {}\n", path.string(), info.format);
  for (const RecordingInfo::Field& field : info.fields)
    out += fmt::format("  {:<20} {}\n", field.name, value_text(field));
  for (const std::string& note : info.notes) out += fmt::format("  ! {}\n", one_line(note));
  return out;
}

Json as_json(const RecordingInfo& info, const std::filesystem::path& path) {
  Json out{{"format", info.format}, {"file", path.string()}};
  for (const RecordingInfo::Field& field : info.fields)
    out[field.name + (field.unit.empty()  ? ""
                      : field.unit == "%" ? "_percent"
                                          : "_" + field.unit)] =
        std::visit([](const auto& value) { return Json(value); }, field.value);
  out["notes"] = info.notes;
  return out;
}

}  // namespace

std::string known_formats(bool importable_only) {
  std::string out;
  for (const sensor::RecordingFormat& format : sensor::recording_formats())
    if (!importable_only || format.import)
      out += (out.empty() ? "" : ", ") + std::string(format.name);
  return out;
}

std::string unknown_format(const std::filesystem::path& path, bool importable_only) {
  std::vector<std::string> found;
  std::error_code failed;
  for (std::filesystem::directory_iterator at(path, failed), end; !failed && at != end;
       at.increment(failed))
    if (const auto* format = sensor::recognize(at->path()); format && format->import)
      found.push_back(at->path().filename().string());
  if (found.empty())
    return in_quotes(path.string()) +
           " is of no format that is known: " + known_formats(importable_only);
  std::ranges::sort(found);
  const std::string rest =
      found.size() > 1 ? fmt::format(" (and {} more)", found.size() - 1) : std::string();
  return in_quotes(path.string()) + " is a folder of recordings: name one, such as " +
         in_quotes((path / found.front()).string()) + rest;
}

std::filesystem::path whole_path(const std::filesystem::path& path) {
  std::error_code failed;
  const auto whole = std::filesystem::canonical(path, failed);
  return failed ? path : whole;
}

bool is_recording(const std::filesystem::path& path) {
  const auto ending = path.extension();
  if (ending == ".yaml" || ending == ".yml") return false;
  std::error_code failed;
  return std::filesystem::is_directory(path, failed) || sensor::recognize(path);
}

int describe_recording(const std::filesystem::path& path, bool json) {
  const sensor::RecordingFormat* format = sensor::recognize(whole_path(path));
  std::error_code failed;
  if (!format && std::filesystem::is_regular_file(path / "scene.yaml", failed))
    return fail(in_quotes(path.string()) + " is the folder of a scene: meshreduce info " +
                (path / "scene.yaml").string());
  if (!format) return fail(unknown_format(path, false));
  const auto info = format->describe(whole_path(path));
  if (!info) return fail(info.error().message);
  fmt::print("{}",
             json ? as_json(*info, path).dump(2, ' ', false, Json::error_handler_t::replace) + "\n"
                  : as_text(*info, path));
  return 0;
}

}  // namespace mr::apps
