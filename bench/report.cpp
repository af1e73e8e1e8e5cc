#include "report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <thread>

namespace mr::bench {
namespace {

std::string cpu_model() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);)
    if (line.starts_with("model name")) return line.substr(line.find(':') + 2);
  return "unknown";
}

/// A peer whose variants ("open3d/8") are named apart has its own name but once.
bool is_peer(const Message& row) {
  const std::string impl = row["impl"];
  return impl != kOurs && impl.find('/') == std::string::npos;
}

/// Whether a peer's row is what ours on `threads` is set against: the peer's on as many, or on the
/// only number that it ran on, if that is one.
bool faces(const Report& report, const Message& peer, int threads) {
  if (peer["threads"] == threads) return true;
  return peer["threads"] == 1 && std::ranges::none_of(report.results, [&](const Message& row) {
           return row["impl"] == peer["impl"] && row["case"] == peer["case"] && row["threads"] != 1;
         });
}

/// field of the peer / field of ours, for each peer that has both.
Message ratios(const Report& report, const char* field) {
  const auto number = [&](const Message& row) {
    return row.contains(field) && row[field].is_number() ? row[field].get<double>() : 0.0;
  };
  Message out = Message::object();
  for (const Message& peer : report.results)
    for (const Message& ours : report.results) {
      const int threads = ours["threads"];
      if (!is_peer(peer) || ours["impl"] != kOurs || ours["case"] != peer["case"]) continue;
      if (!faces(report, peer, threads) || !(number(peer) > 0 && number(ours) > 0)) continue;
      out[fmt::format("{}/{}/t{}", peer["impl"].get<std::string>(), peer["case"].get<std::string>(),
                      threads)] = std::round(number(peer) / number(ours) * 100) / 100;
    }
  return out;
}

/// A number of a row, or "-".
std::string cell(const Message& row, const char* field, int digits) {
  if (!row.contains(field) || !row[field].is_number()) return "-";
  return fmt::format("{:.{}f}", row[field].get<double>(), digits);
}

std::string stages_text(const Message& row) {
  std::string out;
  if (row.contains("aborted")) out = "aborted: " + row["why"].get<std::string>() + " ";
  if (!row.contains("stages")) return out;
  for (const auto& [stage, ms] : row["stages"].items())
    out += fmt::format("{} {:.1f} ", stage, ms.get<double>());
  return out;
}

/// A line per peer: "faster than PEER: CASE/tN 2.09, ...".
std::string ratio_text(const char* name, const Message& ratios) {
  std::string out, last;
  for (const auto& [key, value] : ratios.items()) {
    const std::string peer = key.substr(0, key.find('/')), rest = key.substr(peer.size() + 1);
    if (peer != last)
      out += fmt::format("{}{} {}: ", out.empty() ? "" : "\n", name, peer);
    else
      out += ", ";
    out += fmt::format("{} {:.2f}", rest, value.get<double>());
    last = peer;
  }
  return out.empty() ? out : out + "\n";
}

}  // namespace

double rounded(double value, int digits) {
  const double scale = std::pow(10.0, digits);
  return std::round(value * scale) / scale;
}

Message as_json(const Report& report) {
  return {{"stage", report.stage},
          {"input", report.input},
          {"results", report.results},
          {"ratio", report.ratio.is_null() ? ratios(report, "ms") : report.ratio},
          {"cpu_ratio", ratios(report, "cpu_ms")},
          {"memory_ratio", ratios(report, "peak_mb")},
          {"absent", report.absent},
          {"machine", {{"cpu", cpu_model()}, {"cores", std::thread::hardware_concurrency()}}}};
}

std::string as_text(const Report& report) {
  std::string out = fmt::format("{:<16} {:>2} {:<22} {:>9} {:>9} {:>8} {:>9}", "case", "t", "impl",
                                "ms", "p95 ms", "MB", "triangles");
  for (const Column& column : report.columns) out += fmt::format(" {:>9}", column.title);
  out += "  stages, ms\n";
  for (const Message& row : report.results) {
    out +=
        fmt::format("{:<16} {:>2} {:<22} {:>9} {:>9} {:>8} {:>9}", row["case"].get<std::string>(),
                    row["threads"].get<int>(), row["impl"].get<std::string>(), cell(row, "ms", 1),
                    cell(row, "p95_ms", 1), cell(row, "peak_mb", 1), cell(row, "triangles", 0));
    for (const Column& column : report.columns)
      out += fmt::format(" {:>9}", cell(row, column.field.c_str(), column.digits));
    out += "  " + stages_text(row) + "\n";
  }
  out += report.ratio.is_null() ? ratio_text("faster than", ratios(report, "ms"))
                                : ratio_text("times ours:", report.ratio);
  out += ratio_text("less memory than", ratios(report, "peak_mb"));
  for (const std::string& peer : report.absent) out += peer + " is not installed\n";
  return out;
}

}  // namespace mr::bench
