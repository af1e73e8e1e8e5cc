#include "merge_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <vector>

#include "svg_plot.h"

namespace mr::bench {
namespace {

constexpr PlotLayout kMergeLayout{380, 320, 62, 40, 470};
constexpr double kPaperSensors = 400, kPaper_s = 1.2, kPaper_gb = 43.2;  // on 16 cores

/// One way to merge one kind of place. Dashed: in a tree. Okabe and Ito's colours.
struct Series {
  const char *name, *prefix, *impl, *color;
  bool dashed;
};
constexpr std::array<Series, 4> kSeries{
    {{"rooms of 20, flat", "rooms/", "flat", "#0072B2", false},
     {"rooms of 20, tree", "rooms/", "hierarchical", "#0072B2", true},
     {"one room, flat", "one_room/", "flat", "#D55E00", false},
     {"one room, tree", "one_room/", "hierarchical", "#D55E00", true}}};

struct MergePoint {
  double sensors, value;
};

/// Whole decades around the values.
LogAxis decades(const std::vector<double>& values) {
  const auto [low, high] = std::ranges::minmax(values);
  LogAxis out;
  for (double tick = std::pow(10, std::floor(std::log10(low) + 1e-9));; tick *= 10) {
    out.ticks.push_back(tick);
    if (tick >= high && out.ticks.size() > 1) return out;
  }
}

/// `field` of a series' rows, by the number of sensors.
std::vector<MergePoint> points_of(const Report& report, const Series& series, const char* field,
                                  double unit) {
  std::vector<MergePoint> out;
  for (const Message& row : report.results) {
    const std::string name = row["case"];
    if (name.starts_with(series.prefix) && row["impl"] == series.impl && row.contains(field) &&
        row[field].is_number() && row[field] > 0)
      out.push_back({report.input.at(name).at("sensors"), row[field].get<double>() / unit});
  }
  std::ranges::sort(out, {}, &MergePoint::sensors);
  return out;
}

void draw_series(std::string& out, const PlotPanel& panel, const Series& series,
                 const std::vector<MergePoint>& points) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double x = panel.x_px(points[i].sensors), y = panel.y_px(points[i].value);
    if (i > 0)
      draw_line(out, panel.x_px(points[i - 1].sensors), panel.y_px(points[i - 1].value), x, y,
                series.color, series.dashed);
    out += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3\" fill=\"{}\"/>\n", x, y,
                       series.color);
    draw_text(out, x - 6, y - 6, fmt::format("{:.2g}", points[i].value),
              "text-anchor=\"end\" font-size=\"9\" fill=\"#888888\"");
  }
}

void draw_merge_panel(std::string& out, const Report& report, double left, const std::string& title,
                      const char* field, double unit, double paper) {
  std::vector<double> values{paper};
  for (const Series& series : kSeries)
    for (const MergePoint& point : points_of(report, series, field, unit))
      values.push_back(point.value);
  const PlotPanel panel{kMergeLayout, left, {{1, 5, 20, 100, 400}}, decades(values)};
  draw_axes(out, panel, title);
  for (const Series& series : kSeries)
    draw_series(out, panel, series, points_of(report, series, field, unit));
  const double x = panel.x_px(kPaperSensors), y = panel.y_px(paper);
  out += fmt::format("<path d=\"M{:.1f} {:.1f}l-5 5l5 5l5 -5z\" fill=\"#000000\"/>\n", x, y - 5);
  draw_text(out, x - 9, y + 4, fmt::format("paper: {:.4g}", paper),
            "text-anchor=\"end\" font-size=\"11\"");
}

void draw_merge_legend(std::string& out, double left) {
  double y = kMergeLayout.top + 6;
  for (const Series& series : kSeries) {
    draw_line(out, left, y, left + 26, y, series.color, series.dashed);
    draw_text(out, left + 34, y + 4.5, series.name, "");
    y += 20;
  }
}

}  // namespace

std::string plot_merge(const Report& report) {
  std::string out = open_svg(kMergeLayout, 110);
  draw_merge_panel(out, report, kMergeLayout.left, "Time to merge, s", "ms", 1e3, kPaper_s);
  draw_merge_panel(out, report, kMergeLayout.left + kMergeLayout.step, "Peak memory with input, GB",
                   "total_mb", 1e3, kPaper_gb);
  draw_text(out, kMergeLayout.left + (kMergeLayout.step + kMergeLayout.width) / 2,
            kMergeLayout.top + kMergeLayout.height + 42,
            "sensors, 10,000 triangles each; tree: the slowest merger below the root and the root; "
            "the largest merger");
  draw_merge_legend(out, kMergeLayout.left + 2 * kMergeLayout.step - 50);
  return out + "</svg>\n";
}

}  // namespace mr::bench
