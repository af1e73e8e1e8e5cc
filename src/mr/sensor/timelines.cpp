#include "mr/sensor/timelines.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>

namespace mr::sensor {
namespace {

constexpr Duration kApart = std::chrono::seconds(10);

/// A sensor with the clock of its recording.
struct Clocked {
  std::size_t sensor;
  SourceClock clock;

  /// A recording that was never closed may go on for long.
  TimePoint last() const { return clock.last.value_or(clock.first + std::chrono::hours(24)); }
};

/// One session of recordings on one clock, by their first captures.
void lay(std::span<const Clocked> session, std::vector<Timeline>& out) {
  const TimePoint start = session.front().clock.first;
  const bool is_known =
      std::ranges::all_of(session, [](const Clocked& c) { return c.clock.last.has_value(); });
  const TimePoint last = std::ranges::max_element(session, {}, &Clocked::last)->last();
  for (const Clocked& c : session) {
    Timeline& timeline = out[c.sensor];
    timeline.start = start;
    timeline.length = is_known ? last - start + timeline.period() : Duration{};
  }
}

/// Recordings that loop start again together, after the longest of them: else those that began
/// together would play apart from the second round on.
void share_length(std::span<const SensorConfig> sensors, std::vector<Timeline>& out) {
  const auto loops = [&](std::size_t i) {
    return sensors[i].source.content().loops && out[i].length > Duration{};
  };
  Duration longest{};
  for (std::size_t i = 0; i < out.size(); ++i)
    if (loops(i)) longest = std::max(longest, out[i].length);
  for (std::size_t i = 0; i < out.size(); ++i)
    if (loops(i)) out[i].length = longest;
}

}  // namespace

std::vector<Timeline> timelines(std::span<const SensorConfig> sensors, double fps) {
  std::vector<Timeline> out(sensors.size(), Timeline{.fps = fps});
  std::map<std::string, std::vector<Clocked>> domains;
  for (std::size_t i = 0; i < sensors.size(); ++i)
    if (auto clock = sensors[i].source.clock())
      domains[clock->domain].push_back({i, *std::move(clock)});
  for (auto& [name, members] : domains) {
    std::ranges::stable_sort(members, {}, [](const Clocked& c) { return c.clock.first; });
    std::size_t first = 0;
    TimePoint end = members.front().last();
    for (std::size_t i = 1; i <= members.size(); ++i) {
      if (i < members.size() && members[i].clock.first <= end + kApart) {
        end = std::max(end, members[i].last());
        continue;
      }
      lay(std::span(members).subspan(first, i - first), out);
      if (i < members.size()) first = i, end = members[i].last();
    }
  }
  share_length(sensors, out);
  return out;
}

std::vector<std::string> timeline_notes(std::span<const SensorConfig> sensors) {
  constexpr Duration kMostApart = std::chrono::seconds(1);
  std::map<std::string, std::pair<std::size_t, TimePoint>> earliest;
  for (std::size_t i = 0; i < sensors.size(); ++i)
    if (const auto clock = sensors[i].source.clock()) {
      const auto [found, is_new] = earliest.try_emplace(clock->domain, i, clock->first);
      if (!is_new && clock->first < found->second.second) found->second = {i, clock->first};
    }
  std::vector<std::string> out;
  for (std::size_t i = 0; i < sensors.size(); ++i) {
    const auto clock = sensors[i].source.clock();
    if (!clock) continue;
    const auto& [first, at] = earliest.at(clock->domain);
    if (clock->first - at <= kMostApart) continue;
    const double seconds = std::chrono::duration<double>(clock->first - at).count();
    out.push_back("the recording of sensor '" + sensors[i].id + "' begins " +
                  std::to_string(std::lround(seconds)) + " s after that of '" + sensors[first].id +
                  "' by their common clock; if they were started together (a master before its "
                  "subordinates), set clock_offset_ms");
  }
  return out;
}

}  // namespace mr::sensor
