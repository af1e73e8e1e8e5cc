#include "mr/sensor/k4a/k4a_config.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "mr/core/assert.h"

namespace mr::sensor {
namespace {

struct DepthModeWord {
  const char* word;
  K4aSource::DepthMode mode;
  const char* kinect_name;
  int most_fps;
};
constexpr DepthModeWord kDepthWords[] = {
    {"nfov", K4aSource::DepthMode::nfov, "NFOV_UNBINNED", 30},
    {"nfov_binned", K4aSource::DepthMode::nfov_binned, "NFOV_2X2BINNED", 30},
    {"wfov", K4aSource::DepthMode::wfov, "WFOV_UNBINNED", 15},
    {"wfov_binned", K4aSource::DepthMode::wfov_binned, "WFOV_2X2BINNED", 30},
};
struct ColorWord {
  const char* word;
  K4aSource::Color color;
  int most_fps;
};
constexpr ColorWord kColorWords[] = {
    {"off", K4aSource::Color::off, 30},     {"720p", K4aSource::Color::p720, 30},
    {"1080p", K4aSource::Color::p1080, 30}, {"1440p", K4aSource::Color::p1440, 30},
    {"1536p", K4aSource::Color::p1536, 30}, {"2160p", K4aSource::Color::p2160, 30},
    {"3072p", K4aSource::Color::p3072, 15},
};

const DepthModeWord& depth_word(K4aSource::DepthMode mode) {
  return *std::ranges::find(kDepthWords, mode, &DepthModeWord::mode);
}
const ColorWord& color_word(K4aSource::Color color) {
  return *std::ranges::find(kColorWords, color, &ColorWord::color);
}

/// What does not fit the frame rate.
std::vector<std::string> k4a_rate_problems(const K4aSource& source) {
  std::vector<std::string> out;
  if (source.fps != 5 && source.fps != 15 && source.fps != 30)
    return {fmt::format("fps must be 5, 15 or 30, not {}", source.fps)};
  const int period_us = 1'000'000 / source.fps;
  const DepthModeWord& depth = depth_word(source.depth_mode);
  const ColorWord& color = color_word(source.color);
  if (source.fps > depth.most_fps)
    out.push_back(fmt::format("depth_mode {} has at most {} fps", depth.word, depth.most_fps));
  if (source.fps > color.most_fps)
    out.push_back(fmt::format("color {} has at most {} fps", color.word, color.most_fps));
  if (source.subordinate_delay_us < 0 || source.subordinate_delay_us > period_us)
    out.push_back(
        fmt::format("subordinate_delay_us must be between 0 and {}, a frame's time", period_us));
  if (std::abs(source.depth_delay_us) > period_us)
    out.push_back(
        fmt::format("depth_delay_us must be between -{0} and {0}, a frame's time", period_us));
  if (source.exposure_us.value_or(0) > period_us)
    out.push_back(fmt::format("exposure_us must be at most {}, a frame's time at {} fps", period_us,
                              source.fps));
  return out;
}

/// What depends on other keys.
std::vector<std::string> k4a_key_problems(const K4aSource& source) {
  std::vector<std::string> out;
  const bool has_color = source.color != K4aSource::Color::off;
  if (source.sync == K4aSource::Sync::master && !has_color)
    out.push_back("sync master needs color: the colour camera gives the pulse");
  if (source.sync != K4aSource::Sync::subordinate && source.subordinate_delay_us != 0)
    out.push_back("subordinate_delay_us needs sync: subordinate");
  if (source.depth_delay_us != 0 && !has_color)
    out.push_back("depth_delay_us needs color: depth is delayed after it");
  if (source.gain && !source.exposure_us)
    out.push_back("gain needs exposure_us: automatic exposure sets the gain, too");
  if (source.white_balance_k && *source.white_balance_k % 10 != 0)
    out.push_back("white_balance_k must be a multiple of 10");
  if (source.powerline_hz && *source.powerline_hz != 50 && *source.powerline_hz != 60)
    out.push_back("powerline_hz must be 50 or 60");
  if (!has_color &&
      (source.exposure_us || source.gain || source.white_balance_k || source.powerline_hz))
    out.push_back("exposure_us, gain, white_balance_k and powerline_hz need color");
  return out;
}

bool optional_integer(yaml::MapReader& map, const char* key, std::optional<int>& out, Range range) {
  int value = 0;
  if (!map.has(key) || !map.integer(key, value, range)) return false;
  out = value;
  return true;
}

/// The key that a problem begins with, for its line.
std::string first_word(const std::string& problem) { return problem.substr(0, problem.find(' ')); }

void read_k4a_device(yaml::MapReader& map, K4aSource& out) {
  const bool has_serial = map.has("serial"), has_number = map.has("device");
  if (has_serial == has_number)
    map.report.problem(map.line(), has_serial
                                       ? "source names both serial and device; one is enough"
                                       : "source needs serial: \"...\", or device: 0 where there "
                                         "is only one (meshreduce devices lists them)");
  map.integer("device", out.device, K4aSource::kDevice);
  if (map.text("serial", out.serial) && (out.serial.empty() || out.serial.size() > 64))
    map.report.problem(map.line("serial"), "serial must have 1 to 64 characters");
}

}  // namespace

std::vector<std::string> K4aSource::problems() const {
  std::vector<std::string> out =
      out_of_range({{"device", device, kDevice},
                    {"depth_unit_m", depth_unit_m, kDepthUnit_m},
                    {"exposure_us", exposure_us.value_or(500), kExposure_us},
                    {"gain", gain.value_or(0), kGain},
                    {"white_balance_k", white_balance_k.value_or(2500), kWhiteBalance_k}});
  append(out, k4a_rate_problems(*this));
  append(out, k4a_key_problems(*this));
  return out;
}

std::string K4aSource::name() const {
  return serial.empty() ? "device number " + std::to_string(device) : "device " + serial;
}

const KinectMode& K4aSource::depth() const {
  const KinectMode* mode = find_depth_mode(depth_word(depth_mode).kinect_name);
  MR_ASSERT(mode != nullptr);
  return *mode;
}

const KinectMode* K4aSource::color_mode() const { return find_color_mode(word_of(color)); }

std::string_view word_of(K4aSource::DepthMode mode) { return depth_word(mode).word; }
std::string_view word_of(K4aSource::Color color) { return color_word(color).word; }

std::optional<K4aSource::DepthMode> k4a_depth_mode(std::string_view word) {
  const auto found = std::ranges::find(kDepthWords, word, &DepthModeWord::word);
  return found == std::end(kDepthWords) ? std::nullopt : std::optional(found->mode);
}

std::optional<K4aSource::Color> k4a_color(std::string_view word) {
  const auto found = std::ranges::find(kColorWords, word, &ColorWord::word);
  return found == std::end(kColorWords) ? std::nullopt : std::optional(found->color);
}

SourceKeys read_k4a(yaml::MapReader& map, const std::string&) {
  using Depth = K4aSource::DepthMode;
  using Color = K4aSource::Color;
  using Sync = K4aSource::Sync;
  K4aSource out;
  read_k4a_device(map, out);
  map.choice<Depth>("depth_mode", out.depth_mode,
                    {{"nfov", Depth::nfov},
                     {"nfov_binned", Depth::nfov_binned},
                     {"wfov", Depth::wfov},
                     {"wfov_binned", Depth::wfov_binned}});
  map.choice<Color>("color", out.color,
                    {{"off", Color::off},
                     {"720p", Color::p720},
                     {"1080p", Color::p1080},
                     {"1440p", Color::p1440},
                     {"1536p", Color::p1536},
                     {"2160p", Color::p2160},
                     {"3072p", Color::p3072}});
  map.integer("fps", out.fps, {5, 30});
  map.choice<Sync>("sync", out.sync,
                   {{"standalone", Sync::standalone},
                    {"master", Sync::master},
                    {"subordinate", Sync::subordinate}});
  map.integer("subordinate_delay_us", out.subordinate_delay_us, K4aSource::kDelay_us);
  map.integer("depth_delay_us", out.depth_delay_us, K4aSource::kDelay_us);
  optional_integer(map, "exposure_us", out.exposure_us, K4aSource::kExposure_us);
  optional_integer(map, "gain", out.gain, K4aSource::kGain);
  optional_integer(map, "white_balance_k", out.white_balance_k, K4aSource::kWhiteBalance_k);
  optional_integer(map, "powerline_hz", out.powerline_hz, {50, 60});
  map.number("depth_unit_m", out.depth_unit_m, K4aSource::kDepthUnit_m);
  for (const std::string& problem : out.problems())
    map.report.problem(map.line(first_word(problem)), problem);
  const bool has_color = out.color != Color::off;
  return {std::move(out), has_color};
}

}  // namespace mr::sensor
