#include "simplify_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <vector>

#include "svg_plot.h"

namespace mr::bench {
namespace {

constexpr PlotLayout kSimplifyLayout{400, 330, 62, 40, 480};
// Okabe and Ito's, as in eval's figures; dashed on one thread where there is a choice.
constexpr std::array<const char*, 7> kColors{"#0072B2", "#D55E00", "#E69F00", "#CC79A7",
                                             "#009E73", "#56B4E9", "#000000"};

struct SimplifyPoint {
  double ms, mm;
  double percent;  ///< of the input's triangles, as it came out
};

/// One contender's results, by share.
struct Curve {
  std::string name, color;
  bool dashed = false;
  std::vector<SimplifyPoint> points;
};

/// "kitchen" of "kitchen/50%", "" of "50%".
std::string input_of(const Message& row) {
  const std::string name = row["case"];
  return name.substr(0, name.rfind('/') == std::string::npos ? 0 : name.rfind('/'));
}

/// Where the data lie on a logarithmic axis, from one 1, 2 or 5 of a decade to another.
LogAxis axis_around(double low, double high) {
  std::vector<double> ticks;
  for (int decade = -6; decade <= 9; ++decade)
    for (const double step : {1.0, 2.0, 5.0}) ticks.push_back(step * std::pow(10, decade));
  const auto end = std::ranges::lower_bound(ticks, high * 0.9999);
  ticks.erase(end == ticks.end() ? end : std::next(end), ticks.end());
  const auto above = std::ranges::upper_bound(ticks, low * 1.0001);
  if (above != ticks.begin()) ticks.erase(ticks.begin(), std::prev(above));
  return {std::move(ticks)};
}

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

void draw_curve(std::string& out, const PlotPanel& panel, const Curve& curve) {
  for (std::size_t i = 0; i < curve.points.size(); ++i) {
    const SimplifyPoint& p = curve.points[i];
    const double x = panel.x_px(p.ms), y = panel.y_px(p.mm);
    if (i > 0)
      draw_line(out, panel.x_px(curve.points[i - 1].ms), panel.y_px(curve.points[i - 1].mm), x, y,
                curve.color, curve.dashed);
    out += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3\" fill=\"{}\"/>\n", x, y,
                       curve.color);
    if (!curve.dashed)
      draw_text(out, x + 5, y + 12, fmt::format("{:.0f}%", p.percent),
                "font-size=\"9\" fill=\"#888888\"");
  }
}

void draw_simplify_panel(std::string& out, const std::vector<Curve>& curves, double left,
                         const std::string& title) {
  std::vector<double> ms, mm;
  for (const Curve& curve : curves)
    for (const SimplifyPoint& p : curve.points) ms.push_back(p.ms), mm.push_back(p.mm);
  if (ms.empty()) return;
  const auto [fast, slow] = std::ranges::minmax(ms);
  const auto [near, far] = std::ranges::minmax(mm);
  const PlotPanel panel{kSimplifyLayout, left, axis_around(fast, slow), axis_around(near, far)};
  draw_axes(out, panel, title);
  for (const Curve& curve : curves) draw_curve(out, panel, curve);
}

void draw_simplify_legend(std::string& out, const std::vector<Curve>& curves, double left) {
  double y = kSimplifyLayout.top;
  for (const Curve& curve : curves) {
    draw_line(out, left, y, left + 26, y, curve.color, curve.dashed);
    draw_text(out, left + 34, y + 4.5, curve.name, "");
    y += 20;
  }
}

}  // namespace

std::string plot_simplify(const Report& report) {
  std::string out = open_svg(kSimplifyLayout, 180);
  if (!report.results.empty()) {
    const Message& input = report.input.at(report.results.front()["case"].get<std::string>());
    const auto rms = curves_of(report, "rms_mm");
    draw_simplify_panel(out, rms, kSimplifyLayout.left, "RMS error, mm");
    draw_simplify_panel(out, curves_of(report, "max_mm"),
                        kSimplifyLayout.left + kSimplifyLayout.step, "Worst error, mm");
    draw_text(out, kSimplifyLayout.left + (kSimplifyLayout.step + kSimplifyLayout.width) / 2,
              kSimplifyLayout.top + kSimplifyLayout.height + 42,
              fmt::format("ms, at the share that was left of the {} triangles of {}; errors: the "
                          "larger of both ways",
                          input["triangles"].get<std::size_t>(), input["mesh"].get<std::string>()));
    draw_simplify_legend(out, rms, kSimplifyLayout.left + 2 * kSimplifyLayout.step - 50);
  }
  return out + "</svg>\n";
}

}  // namespace mr::bench
