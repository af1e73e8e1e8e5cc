#include "merge_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <vector>

namespace mr::bench {
namespace {

constexpr double kWidth_px = 380, kHeight_px = 320, kLeft_px = 62, kTop_px = 40, kStep_px = 470;
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

struct Point {
  double sensors, value;
};

/// A logarithmic axis from one tick to another.
struct LogAxis {
  std::vector<double> ticks;

  double place(double value) const {  ///< 0..1
    return std::log(value / ticks.front()) / std::log(ticks.back() / ticks.front());
  }
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

struct Panel {
  double left;
  LogAxis x, y;

  double x_px(double value) const { return left + kWidth_px * x.place(value); }
  double y_px(double value) const { return kTop_px + kHeight_px * (1 - y.place(value)); }
};

/// `field` of a series' rows, by the number of sensors.
std::vector<Point> points_of(const Report& report, const Series& series, const char* field,
                             double unit) {
  std::vector<Point> out;
  for (const Message& row : report.results) {
    const std::string name = row["case"];
    if (name.starts_with(series.prefix) && row["impl"] == series.impl && row.contains(field) &&
        row[field].is_number() && row[field] > 0)
      out.push_back({report.input.at(name).at("sensors"), row[field].get<double>() / unit});
  }
  std::ranges::sort(out, {}, &Point::sensors);
  return out;
}

void draw_text(std::string& out, double x, double y, const std::string& text,
               const char* more = "text-anchor=\"middle\"") {
  out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" {}>{}</text>\n", x, y, more, text);
}

void draw_line(std::string& out, double x1, double y1, double x2, double y2, const char* color,
               bool dashed = false) {
  out += fmt::format(
      "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\" {}/>\n", x1, y1,
      x2, y2, color, dashed ? "stroke-dasharray=\"5 3\"" : "");
}

void draw_axes(std::string& out, const Panel& panel, const std::string& title) {
  constexpr const char* kGrid = "#dddddd";
  const double bottom = kTop_px + kHeight_px;
  for (const double tick : panel.x.ticks) {
    draw_line(out, panel.x_px(tick), kTop_px, panel.x_px(tick), bottom, kGrid);
    draw_text(out, panel.x_px(tick), bottom + 18, fmt::format("{:.0f}", tick));
  }
  for (const double tick : panel.y.ticks) {
    draw_line(out, panel.left, panel.y_px(tick), panel.left + kWidth_px, panel.y_px(tick), kGrid);
    draw_text(out, panel.left - 7, panel.y_px(tick) + 4.5, fmt::format("{:.4g}", tick),
              "text-anchor=\"end\"");
  }
  draw_text(out, panel.left + kWidth_px / 2, kTop_px - 14, title,
            "text-anchor=\"middle\" font-weight=\"bold\"");
}

void draw_series(std::string& out, const Panel& panel, const Series& series,
                 const std::vector<Point>& points) {
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

void draw_panel(std::string& out, const Report& report, double left, const std::string& title,
                const char* field, double unit, double paper) {
  std::vector<double> values{paper};
  for (const Series& series : kSeries)
    for (const Point& point : points_of(report, series, field, unit)) values.push_back(point.value);
  const Panel panel{left, {{1, 5, 20, 100, 400}}, decades(values)};
  draw_axes(out, panel, title);
  for (const Series& series : kSeries)
    draw_series(out, panel, series, points_of(report, series, field, unit));
  const double x = panel.x_px(kPaperSensors), y = panel.y_px(paper);
  out += fmt::format("<path d=\"M{:.1f} {:.1f}l-5 5l5 5l5 -5z\" fill=\"#000000\"/>\n", x, y - 5);
  draw_text(out, x - 9, y + 4, fmt::format("paper: {:.4g}", paper),
            "text-anchor=\"end\" font-size=\"11\"");
}

void draw_legend(std::string& out, double left) {
  double y = kTop_px + 6;
  for (const Series& series : kSeries) {
    draw_line(out, left, y, left + 26, y, series.color, series.dashed);
    draw_text(out, left + 34, y + 4.5, series.name, "");
    y += 20;
  }
}

}  // namespace

std::string plot_merge(const Report& report) {
  std::string out = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" "
      "height=\"{1}\" font-family=\"Helvetica, Arial, sans-serif\" font-size=\"13\" "
      "fill=\"#222222\" stroke-width=\"1.6\">\n<rect width=\"{0}\" height=\"{1}\" "
      "fill=\"#ffffff\"/>\n",
      kLeft_px + 2 * kStep_px + 110, kTop_px + kHeight_px + 56);
  draw_panel(out, report, kLeft_px, "Time to merge, s", "ms", 1e3, kPaper_s);
  draw_panel(out, report, kLeft_px + kStep_px, "Peak memory with input, GB", "total_mb", 1e3,
             kPaper_gb);
  draw_text(out, kLeft_px + (kStep_px + kWidth_px) / 2, kTop_px + kHeight_px + 42,
            "sensors, 10,000 triangles each; tree: the slowest merger below the root and the root; "
            "the largest merger");
  draw_legend(out, kLeft_px + 2 * kStep_px - 50);
  return out + "</svg>\n";
}

}  // namespace mr::bench
