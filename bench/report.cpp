#include "report.h"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <thread>

namespace mr::bench {
namespace {

const std::string kOurs = "ours";

std::string cpu_model() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);)
    if (line.starts_with("model name")) return line.substr(line.find(':') + 2);
  return "unknown";
}

/// Ours for the same case and threads; null where there is none with that field.
const Message* our_twin(const Report& report, const Message& peer, const char* field) {
  for (const Message& row : report.results)
    if (row["impl"] == kOurs && row["case"] == peer["case"] && row["threads"] == peer["threads"])
      return row.contains(field) && row[field].is_number() && row[field] > 0 ? &row : nullptr;
  return nullptr;
}

/// field of the peer / field of ours, for each peer that has both. A peer's variants ("open3d/8")
/// have none of their own.
Message ratios(const Report& report, const char* field) {
  Message out = Message::object();
  for (const Message& row : report.results) {
    const std::string impl = row["impl"];
    if (impl == kOurs || impl.find('/') != std::string::npos) continue;
    const Message* twin = our_twin(report, row, field);
    if (!twin || !row.contains(field) || !row[field].is_number()) continue;
    const double ratio = row[field].get<double>() / (*twin)[field].get<double>();
    out[fmt::format("{}/{}/t{}", impl, row["case"].get<std::string>(), row["threads"].get<int>())] =
        std::round(ratio * 100) / 100;
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

std::string ratio_text(const char* name, const Message& ratios) {
  std::string out;
  for (const auto& [key, value] : ratios.items())
    out += fmt::format("{} {}: {:.2f}\n", name, key, value.get<double>());
  return out;
}

}  // namespace

Message as_json(const Report& report) {
  return {{"stage", report.stage},
          {"input", report.input},
          {"results", report.results},
          {"ratio", ratios(report, "ms")},
          {"cpu_ratio", ratios(report, "cpu_ms")},
          {"memory_ratio", ratios(report, "peak_mb")},
          {"absent", report.absent},
          {"machine", {{"cpu", cpu_model()}, {"cores", std::thread::hardware_concurrency()}}}};
}

std::string as_text(const Report& report) {
  constexpr const char* kLine =
      "{:<14} {:>2} {:<10} {:>9} {:>9} {:>8} {:>9} {:>9} {:>8} {:>8}  {}\n";
  std::string out = fmt::format(kLine, "case", "t", "impl", "ms", "p95 ms", "MB", "triangles", "m2",
                                "peer mm", "truth mm", "stages, ms");
  for (const Message& row : report.results)
    out += fmt::format(kLine, row["case"].get<std::string>(), row["threads"].get<int>(),
                       row["impl"].get<std::string>(), cell(row, "ms", 1), cell(row, "p95_ms", 1),
                       cell(row, "peak_mb", 1), cell(row, "triangles", 0), cell(row, "area_m2", 3),
                       cell(row, "to_peer_rms_mm", 3), cell(row, "to_truth_rms_mm", 3),
                       stages_text(row));
  out += ratio_text("faster than", ratios(report, "ms"));
  out += ratio_text("less memory than", ratios(report, "peak_mb"));
  for (const std::string& peer : report.absent) out += peer + " is not installed\n";
  return out;
}

}  // namespace mr::bench
