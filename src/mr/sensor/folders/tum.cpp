#include "mr/sensor/folders/tum.h"

#include <fmt/format.h>

#include <algorithm>
#include <tuple>
#include <utility>

#include "mr/core/user_text.h"
#include "mr/sensor/folders/text_lines.h"
#include "mr/sensor/folders/timed_items.h"
#include "mr/yaml/files.h"

namespace mr::sensor {
namespace {

constexpr std::size_t kMostPictures = 100'000;

/// The files of a sensor that are not there are noted in the scene's report.
void look_at_pictures(yaml::Report& report, int line, const std::string& key,
                      const std::vector<std::filesystem::path>& files) {
  yaml::FileList list;
  list.paths = files;
  list.lines.assign(files.size(), line);
  for (std::size_t i = 0; i < files.size(); ++i) {
    std::error_code failed;
    if (!std::filesystem::is_regular_file(files[i], failed))
      list.unusable[i] = {Error::Cause::not_found, "no such file: " + in_quotes(files[i].string())};
  }
  if (!files.empty() && list.unusable.size() == files.size())
    return report.problem(
        line, fmt::format("{}: none of the {} listed files exists; first: {}", key, files.size(),
                          list.unusable.begin()->second.message));
  yaml::report_unusable(report, list, key);
}

/// Where a list is missing, that is a problem.
bool has_lists(yaml::Report& report, const yaml::Node& node, const std::filesystem::path& folder) {
  for (const char* name : {"depth.txt", "rgb.txt"}) {
    std::error_code failed;
    if (std::filesystem::is_regular_file(folder / name, failed)) continue;
    report.missing_files(node.line,
                         "folder: no such file: " + in_quotes((folder / name).string()) +
                             "; a TUM folder lists its pictures in rgb.txt and depth.txt",
                         folder / name, 1, node.text + "/" + name);
    return false;
  }
  return true;
}

std::optional<TumSource> read_folder(yaml::MapReader& map, double max_apart_ms,
                                     const std::string& key) {
  const yaml::Node* node = map.need("folder");
  if (!node) return std::nullopt;
  const auto text = yaml::read_text(map.report, *node, "folder");
  if (!text) return std::nullopt;
  if (text->empty()) map.report.problem(node->line, "folder must name a file, not ''");
  const auto folder = map.report.resolve(*text);
  if (text->empty() || !has_lists(map.report, *node, folder)) return std::nullopt;
  auto source = read_tum_folder(folder, max_apart_ms);
  if (source && !map.report.spend_files(2 * source->pictures.depth.size()))
    source = Error{Error::Cause::too_large, "too many files: at most 1000000 a scene"};
  if (!source) {
    map.report.problem(node->line, "folder: " + source.error().message);
    return std::nullopt;
  }
  look_at_pictures(map.report, node->line, key + ".depth", source->pictures.depth);
  look_at_pictures(map.report, node->line, key + ".color", source->pictures.color);
  if (source->without_color > 0)
    map.report.notice(
        node->line,
        fmt::format("{}: {} of the {} depth pictures are left out: no colour within {:g} ms", key,
                    source->without_color, source->without_color + source->pictures.depth.size(),
                    max_apart_ms));
  return *std::move(source);
}

}  // namespace

Result<std::vector<TimedFile>> parse_file_list(std::string_view text, const std::string& name) {
  std::vector<TimedFile> out;
  TextLines lines(text);
  while (lines.next()) {
    const auto refuse = [&](Error::Cause cause, const std::string& why) {
      return Error{cause, name + ": line " + std::to_string(lines.number()) + " " + why};
    };
    if (out.size() == kMostPictures)
      return refuse(Error::Cause::too_large, "is one too many: at most 100000 pictures");
    const auto at = time_of_seconds(lines.words()[0]);
    if (lines.words().size() < 2 || !at)
      return refuse(Error::Cause::invalid,
                    "must hold a time in seconds and a file, not " + in_quotes(lines.words()[0]));
    out.push_back({*at, std::string(lines.words()[1])});
  }
  std::ranges::stable_sort(out, {}, &TimedFile::at);
  const auto same_time = [](const TimedFile& a, const TimedFile& b) { return a.at == b.at; };
  out.erase(std::unique(out.begin(), out.end(), same_time), out.end());
  if (out.empty()) return Error{Error::Cause::empty, name + ": lists no pictures"};
  return out;
}

std::vector<std::optional<std::size_t>> associate(std::span<const TimedFile> depth,
                                                  std::span<const TimedFile> color, Duration most) {
  constexpr std::size_t kCandidates = 16;  // on each side; more are no clock of a camera
  std::vector<std::tuple<Duration, std::size_t, std::size_t>> pairs;
  for (std::size_t d = 0; d < depth.size(); ++d) {
    const auto from = std::ranges::lower_bound(color, depth[d].at, {}, &TimedFile::at);
    const auto middle = static_cast<std::size_t>(from - color.begin());
    const std::size_t end = std::min(middle + kCandidates, color.size());
    for (std::size_t c = middle - std::min(middle, kCandidates); c < end; ++c) {
      const Duration apart = std::chrono::abs(color[c].at - depth[d].at);
      if (apart <= most) pairs.emplace_back(apart, d, c);
    }
  }
  std::ranges::sort(pairs);
  std::vector<std::optional<std::size_t>> out(depth.size());
  std::vector<bool> used(color.size());
  for (const auto& [apart, d, c] : pairs)
    if (!out[d] && !used[c]) out[d] = c, used[c] = true;
  return out;
}

Result<TumSource> read_tum_folder(const std::filesystem::path& folder, double max_apart_ms) {
  std::vector<TimedFile> lists[2];
  for (const int i : {0, 1}) {
    const auto file = folder / (i == 0 ? "depth.txt" : "rgb.txt");
    const auto text = read_text_file(file);
    if (!text) return text.error();
    auto list = parse_file_list(*text, file.string());
    if (!list) return list.error();
    lists[i] = *std::move(list);
  }
  const auto& [depth, color] = lists;
  const auto partner = associate(depth, color, Duration(std::llround(max_apart_ms * 1e6)));
  TumSource out;
  out.pictures.depth_unit_m = TumSource::kDepthUnit_m;
  for (std::size_t i = 0; i < depth.size(); ++i) {
    if (!partner[i]) {
      ++out.without_color;
      continue;
    }
    out.pictures.depth.push_back((folder / depth[i].name).lexically_normal());
    out.pictures.color.push_back((folder / color[*partner[i]].name).lexically_normal());
    out.pictures.times.push_back(depth[i].at);
  }
  if (out.pictures.depth.empty())
    return Error{Error::Cause::invalid,
                 fmt::format("{}: no picture of rgb.txt is within {:g} ms of one of depth.txt",
                             folder.string(), max_apart_ms)};
  return out;
}

SourceKeys read_tum(yaml::MapReader& map, const std::string& key) {
  double max_apart_ms = TumSource::kMaxApart_ms;
  map.number("max_apart_ms", max_apart_ms, TumSource::kApart_ms);
  const auto read = read_folder(map, max_apart_ms, key);
  TumSource source = read.value_or(TumSource{});
  source.pictures.depth_unit_m = TumSource::kDepthUnit_m;
  map.number("depth_unit_m", source.pictures.depth_unit_m, RgbdImagesSource::kDepthUnit_m);
  read_invalid_counts(map, source.pictures.invalid);
  map.flag("loop", source.pictures.loop);
  SourceKeys keys{std::move(source), true};
  if (!read) keys.cameras = SourceCameras{};  // none is asked for beside the problem
  return keys;
}

std::unique_ptr<FrameSource> open_tum(const SensorConfig& sensor, SensorId id,
                                      const Timeline& timeline) {
  const auto* source = sensor.source.get_if<TumSource>();
  MR_ASSERT(source != nullptr);
  return std::make_unique<RecordedFrames>(std::make_unique<TimedItems>(sensor, source->pictures),
                                          sensor, id, timeline);
}

}  // namespace mr::sensor
