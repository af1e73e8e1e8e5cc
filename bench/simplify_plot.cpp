#include "simplify_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <vector>

namespace mr::bench {
namespace {

constexpr double kWidth_px = 400, kHeight_px = 330, kLeft_px = 62, kTop_px = 40, kStep_px = 480;
// Okabe and Ito's, as in eval's figures; dashed on one thread where there is a choice.
constexpr std::array<const char*, 7> kColors{"#0072B2", "#D55E00", "#E69F00", "#CC79A7",
                                             "#009E73", "#56B4E9", "#000000"};

struct Point {
  double ms, mm;
  double percent;  ///< of the input's triangles, as it came out
};

/// One contender's results, by share.
struct Curve {
  std::string name, color;
  bool dashed = false;
  std::vector<Point> points;
};

/// "kitchen" of "kitchen/50%", "" of "50%".
std::string input_of(const Message& row) {
  const std::string name = row["case"];
  return name.substr(0, name.rfind('/') == std::string::npos ? 0 : name.rfind('/'));
}

/// Where the data lie on a logarithmic axis, from one 1, 2 or 5 of a decade to another.
struct LogAxis {
  std::vector<double> ticks;

  explicit LogAxis(double low, double high) {
    for (int decade = -6; decade <= 9; ++decade)
      for (const double step : {1.0, 2.0, 5.0}) ticks.push_back(step * std::pow(10, decade));
    const auto end = std::ranges::lower_bound(ticks, high * 0.9999);
    ticks.erase(end == ticks.end() ? end : std::next(end), ticks.end());
    const auto above = std::ranges::upper_bound(ticks, low * 1.0001);
    if (above != ticks.begin()) ticks.erase(ticks.begin(), std::prev(above));
  }
  double place(double value) const {  ///< 0..1
    return std::log(value / ticks.front()) / std::log(ticks.back() / ticks.front());
  }
};

std::vector<Curve> curves_of(const Report& report, const char* field) {
  std::vector<Curve> out;
  std::vector<std::string> impls;
  for (const Message& row : report.results) {
    if (input_of(row) != input_of(report.results.front())) continue;
    const std::string impl = row["impl"];
    const bool choice = std::ranges::any_of(report.results, [&](const Message& other) {
      return other["impl"] == impl && other["threads"] != row["threads"];
    });
    const std::string name =
        choice ? fmt::format("{}, t{}", impl, row["threads"].get<int>()) : impl;
    auto color = std::ranges::find(impls, impl) - impls.begin();
    if (color == std::ssize(impls)) impls.push_back(impl);
    auto at = std::ranges::find(out, name, &Curve::name);
    if (at == out.end())
      at = out.insert(at,
                      {name, kColors[color % kColors.size()], choice && row["threads"] == 1, {}});
    const double triangles = report.input.at(row["case"].get<std::string>()).at("triangles");
    if (row["ms"].is_number() && row.value(field, 0.0) > 0)
      at->points.push_back({row["ms"], row[field], 100 * row.value("triangles", 0.0) / triangles});
  }
  return out;
}

void draw_text(std::string& out, double x, double y, const std::string& text,
               const char* more = "text-anchor=\"middle\"") {
  out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" {}>{}</text>\n", x, y, more, text);
}

void draw_line(std::string& out, double x1, double y1, double x2, double y2, const Curve& curve) {
  out += fmt::format(
      "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\" {}/>\n", x1, y1,
      x2, y2, curve.color, curve.dashed ? "stroke-dasharray=\"5 3\"" : "");
}

struct Panel {
  double left;
  LogAxis x, y;

  double x_px(double value) const { return left + kWidth_px * x.place(value); }
  double y_px(double value) const { return kTop_px + kHeight_px * (1 - y.place(value)); }
};

void draw_axes(std::string& out, const Panel& panel, const std::string& title) {
  const Curve grid{"", "#dddddd", false, {}};
  const double bottom = kTop_px + kHeight_px;
  for (const double tick : panel.x.ticks) {
    draw_line(out, panel.x_px(tick), kTop_px, panel.x_px(tick), bottom, grid);
    draw_text(out, panel.x_px(tick), bottom + 18, fmt::format("{}", tick));
  }
  for (const double tick : panel.y.ticks) {
    draw_line(out, panel.left, panel.y_px(tick), panel.left + kWidth_px, panel.y_px(tick), grid);
    draw_text(out, panel.left - 7, panel.y_px(tick) + 4.5, fmt::format("{:.4g}", tick),
              "text-anchor=\"end\"");
  }
  draw_text(out, panel.left + kWidth_px / 2, kTop_px - 14, title,
            "text-anchor=\"middle\" font-weight=\"bold\"");
}

void draw_curve(std::string& out, const Panel& panel, const Curve& curve) {
  for (std::size_t i = 0; i < curve.points.size(); ++i) {
    const Point& p = curve.points[i];
    const double x = panel.x_px(p.ms), y = panel.y_px(p.mm);
    if (i > 0)
      draw_line(out, panel.x_px(curve.points[i - 1].ms), panel.y_px(curve.points[i - 1].mm), x, y,
                curve);
    out += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3\" fill=\"{}\"/>\n", x, y,
                       curve.color);
    if (!curve.dashed)
      draw_text(out, x + 5, y + 12, fmt::format("{:.0f}%", p.percent),
                "font-size=\"9\" fill=\"#888888\"");
  }
}

void draw_panel(std::string& out, const std::vector<Curve>& curves, double left,
                const std::string& title) {
  std::vector<double> ms, mm;
  for (const Curve& curve : curves)
    for (const Point& p : curve.points) ms.push_back(p.ms), mm.push_back(p.mm);
  if (ms.empty()) return;
  const auto [fast, slow] = std::ranges::minmax(ms);
  const auto [near, far] = std::ranges::minmax(mm);
  const Panel panel{left, LogAxis(fast, slow), LogAxis(near, far)};
  draw_axes(out, panel, title);
  for (const Curve& curve : curves) draw_curve(out, panel, curve);
}

void draw_legend(std::string& out, const std::vector<Curve>& curves, double left) {
  double y = kTop_px;
  for (const Curve& curve : curves) {
    draw_line(out, left, y, left + 26, y, curve);
    draw_text(out, left + 34, y + 4.5, curve.name, "");
    y += 20;
  }
}

}  // namespace

std::string plot_simplify(const Report& report) {
  std::string out = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" "
      "height=\"{1}\" font-family=\"Helvetica, Arial, sans-serif\" font-size=\"13\" "
      "fill=\"#222222\" stroke-width=\"1.6\">\n<rect width=\"{0}\" height=\"{1}\" "
      "fill=\"#ffffff\"/>\n",
      kLeft_px + 2 * kStep_px + 180, kTop_px + kHeight_px + 56);
  if (!report.results.empty()) {
    const Message& input = report.input.at(report.results.front()["case"].get<std::string>());
    const auto rms = curves_of(report, "rms_mm");
    draw_panel(out, rms, kLeft_px, "RMS error, mm");
    draw_panel(out, curves_of(report, "max_mm"), kLeft_px + kStep_px, "Worst error, mm");
    draw_text(out, kLeft_px + (kStep_px + kWidth_px) / 2, kTop_px + kHeight_px + 42,
              fmt::format("ms, at the share that was left of the {} triangles of {}; errors: the "
                          "larger of both ways",
                          input["triangles"].get<std::size_t>(), input["mesh"].get<std::string>()));
    draw_legend(out, rms, kLeft_px + 2 * kStep_px - 50);
  }
  return out + "</svg>\n";
}

}  // namespace mr::bench
