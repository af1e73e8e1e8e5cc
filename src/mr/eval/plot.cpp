#include "mr/eval/plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>

namespace mr::eval {
namespace {

// Okabe and Ito, without the yellow that is lost on white.
constexpr std::array<const char*, 7> kColors{"#0072B2", "#D55E00", "#009E73", "#CC79A7",
                                             "#E69F00", "#56B4E9", "#000000"};
constexpr std::array<const char*, 3> kDashes{"", "7 3", "2 2.5"};
constexpr double kFont_px = 13, kGlyph_px = 7.2;  // mean width of a letter
constexpr double kLegendRow_px = 20, kLegendSwatch_px = 26;
constexpr double kLargestDrawn = 1e100;  // beyond it nothing is drawn

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += static_cast<unsigned char>(c) < ' ' ? ' ' : c;
    }
  return out;
}

/// Letters, not bytes, of UTF-8.
double text_width_px(const std::string& text) {
  return kGlyph_px *
         std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; });
}

// ------------------------------------------------------------------------------------ axes

struct Axis {
  double low = 0, high = 1;   ///< decades where logarithmic
  std::vector<double> ticks;  ///< in the data's unit
  std::vector<std::string> labels;
  bool log = false;

  double place(double value) const {  ///< 0..1
    return ((log ? std::log10(value) : value) - low) / (high - low);
  }
};

bool drawn(std::pair<double, double> p, bool log_x) {
  return std::abs(p.first) < kLargestDrawn && std::abs(p.second) < kLargestDrawn &&
         (!log_x || p.first > 1 / kLargestDrawn);
}

struct Range {
  double low, high;
};

/// What the points span along one coordinate; nothing where there is no point.
template <typename Coordinate>
std::optional<Range> range_of(const Plot& plot, Coordinate coordinate) {
  std::optional<Range> range;
  for (const Series& series : plot.series)
    for (const auto& point : series.points) {
      if (!drawn(point, plot.log_x)) continue;
      const double value = coordinate(point);
      if (!range) range = Range{value, value};
      range->low = std::min(range->low, value);
      range->high = std::max(range->high, value);
    }
  return range;
}

/// 1, 2 or 5 times a power of ten, so that `span` holds about `count` of it.
double round_step(double span, int count) {
  const double rough = span / count;
  const double power = std::pow(10, std::floor(std::log10(rough)));
  for (const double factor : {1.0, 2.0, 5.0})
    if (rough <= factor * power * 1.0001) return factor * power;
  return 10 * power;
}

std::string number(double value, double step) {
  if (std::abs(value) < step / 2) return "0";
  if (step < 1e-4 || std::abs(value) >= 1e7) return fmt::format("{:.4g}", value);
  const int decimals = std::max(0, -static_cast<int>(std::floor(std::log10(step) + 1e-9)));
  return fmt::format("{:.{}f}", value, decimals);
}

Axis linear_axis(std::optional<Range> data, int count) {
  Range range = data.value_or(Range{0, 1});
  const double size = std::max(std::abs(range.low), std::abs(range.high));
  if (range.high - range.low <= 1e-9 * size || size == 0) {  // one value: a little about it
    const double margin = size > 0 ? 0.1 * size : 1;
    range = {range.low - margin, range.high + margin};
  } else if (range.low > 0 && range.low < 0.25 * range.high) {
    range.low = 0;  // close enough to show how far it is from nothing
  }
  const double step = round_step(range.high - range.low, count);
  const double first = std::floor(range.low / step + 1e-6);
  const double last = std::ceil(range.high / step - 1e-6);
  Axis axis{.low = first * step, .high = last * step, .ticks = {}, .labels = {}};
  for (double k = first; k <= last; ++k) {
    axis.ticks.push_back(k * step);
    axis.labels.push_back(number(k * step, step));
  }
  return axis;
}

/// Ticks at 1, 2 and 5 times powers of ten, or at powers of ten only where the range is wide.
Axis log_axis(std::optional<Range> data) {
  const Range range = data.value_or(Range{1, 10});
  const double decades = std::log10(range.high) - std::log10(range.low);
  std::vector<double> steps{1};
  if (decades <= 3) steps = {1, 2, 5};
  const int stride = std::max(1, static_cast<int>(decades / 8));
  std::vector<double> ticks;
  const int first = static_cast<int>(std::floor(std::log10(range.low))) - 1;
  for (int decade = first; decade <= std::log10(range.high) + stride + 1; decade += stride)
    for (const double step : steps) ticks.push_back(step * std::pow(10, decade));
  // From the last tick not above the data to the first not below, and at least two.
  const auto above = std::upper_bound(ticks.begin(), ticks.end(), range.low * (1 + 1e-9));
  auto end = std::lower_bound(ticks.begin(), ticks.end(), range.high * (1 - 1e-9));
  if (end == std::prev(above)) ++end;
  Axis axis{
      .ticks = std::vector<double>(std::prev(above), std::next(end)), .labels = {}, .log = true};
  for (const double tick : axis.ticks) axis.labels.push_back(fmt::format("{:.4g}", tick));
  axis.low = std::log10(axis.ticks.front());
  axis.high = std::log10(axis.ticks.back());
  return axis;
}

// ------------------------------------------------------------------------------------ drawing

/// Where the data of a panel go, in pixels.
struct Area {
  double left, top, width, height;
  Axis x, y;

  double x_px(double value) const { return left + width * x.place(value); }
  double y_px(double value) const { return top + height * (1 - y.place(value)); }
};

using Out = std::back_insert_iterator<std::string>;

void draw_text(Out out, double x, double y, const char* anchor, const std::string& text,
               const char* more = "") {
  fmt::format_to(out, "<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\"{}>{}</text>\n", x, y,
                 anchor, more, escaped(text));
}

void draw_line(Out out, double x1, double y1, double x2, double y2, const char* color) {
  fmt::format_to(out,
                 "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\"/>\n",
                 x1, y1, x2, y2, color);
}

void draw_axes(Out out, const Area& area, const Plot& plot) {
  constexpr const char* kGrid = "#dddddd";
  constexpr const char* kLine = "#444444";
  const double bottom = area.top + area.height, right = area.left + area.width;
  double label_px = 0;
  for (std::size_t i = 0; i < area.x.ticks.size(); ++i) {
    const double x = area.x_px(area.x.ticks[i]);
    draw_line(out, x, area.top, x, bottom, kGrid);
    draw_line(out, x, bottom, x, bottom + 4, kLine);
    draw_text(out, x, bottom + 18, "middle", area.x.labels[i]);
  }
  for (std::size_t i = 0; i < area.y.ticks.size(); ++i) {
    const double y = area.y_px(area.y.ticks[i]);
    draw_line(out, area.left, y, right, y, kGrid);
    draw_line(out, area.left - 4, y, area.left, y, kLine);
    draw_text(out, area.left - 7, y + 4.5, "end", area.y.labels[i]);
    label_px = std::max(label_px, text_width_px(area.y.labels[i]));
  }
  draw_line(out, area.left, bottom, right, bottom, kLine);
  draw_line(out, area.left, area.top, area.left, bottom, kLine);
  const double middle = area.left + area.width / 2;
  draw_text(out, middle, bottom + 38, "middle", plot.x_label);
  draw_text(out, middle, area.top - 12, "middle", plot.title, " font-weight=\"bold\"");
  const double x = area.left - label_px - 18, y = area.top + area.height / 2;
  draw_text(out, x, y, "middle", plot.y_label,
            fmt::format(" transform=\"rotate(-90 {:.1f} {:.1f})\"", x, y).c_str());
}

/// One of four shapes; the legend's and the data's look the same.
void draw_marker(Out out, std::size_t shape, double x, double y, double r, const char* color) {
  const auto polygon = [&](std::initializer_list<std::pair<double, double>> corners) {
    fmt::format_to(out, "<polygon fill=\"{}\" points=\"", color);
    for (const auto& [dx, dy] : corners)
      fmt::format_to(out, "{:.1f},{:.1f} ", x + dx * r, y + dy * r);
    fmt::format_to(out, "\"/>\n");
  };
  switch (shape % 4) {
    case 0:
      fmt::format_to(out, "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\" fill=\"{}\"/>\n", x, y,
                     r, color);
      break;
    case 1:
      return polygon({{-0.9, -0.9}, {0.9, -0.9}, {0.9, 0.9}, {-0.9, 0.9}});
    case 2:
      return polygon({{0, -1.2}, {1.1, 0.8}, {-1.1, 0.8}});
    default:
      return polygon({{0, -1.3}, {1.3, 0}, {0, 1.3}, {-1.3, 0}});
  }
}

struct Style {
  const char* color;
  std::string dash;
  std::size_t shape;
};

Style style_of(const Series& series, std::size_t index) {
  std::string dash = series.dashed ? "5 4" : kDashes[index / kColors.size() % kDashes.size()];
  return {kColors[index % kColors.size()], std::move(dash), index};
}

std::string stroke(const Style& style) {
  std::string out = fmt::format(
      "fill=\"none\" stroke=\"{}\" stroke-width=\"1.8\" "
      "stroke-linejoin=\"round\"",
      style.color);
  if (!style.dash.empty()) out += fmt::format(" stroke-dasharray=\"{}\"", style.dash);
  return out;
}

using Run = std::vector<std::pair<double, double>>;

void draw_run(Out out, const Run& run, const Series& series, const Style& style) {
  if (series.line && run.size() > 1) {
    fmt::format_to(out, "<polyline {} points=\"", stroke(style));
    for (const auto& [x, y] : run) fmt::format_to(out, "{:.1f},{:.1f} ", x, y);
    fmt::format_to(out, "\"/>\n");
  }
  // A line of one point would not be seen.
  if (series.markers || run.size() == 1)
    for (const auto& [x, y] : run)
      draw_marker(out, style.shape, x, y, series.marker_radius_px, style.color);
}

void draw_series(Out out, const Area& area, const Series& series, std::size_t index) {
  const Style style = style_of(series, index);
  fmt::format_to(out, "<g opacity=\"{:.2f}\">\n", std::clamp(series.opacity, 0.0, 1.0));
  Run run;
  for (const auto& point : series.points) {
    if (drawn(point, area.x.log)) {
      run.emplace_back(area.x_px(point.first), area.y_px(point.second));
    } else {
      draw_run(out, run, series, style);
      run.clear();
    }
  }
  draw_run(out, run, series, style);
  fmt::format_to(out, "</g>\n");
}

bool has_legend(const Plot& plot) {
  return std::any_of(plot.series.begin(), plot.series.end(),
                     [](const Series& series) { return !series.name.empty(); });
}

double legend_width_px(const Plot& plot) {
  if (!has_legend(plot)) return 0;
  double widest = 0;
  for (const Series& series : plot.series) widest = std::max(widest, text_width_px(series.name));
  return kLegendSwatch_px + 8 + widest + 10;
}

void draw_legend(Out out, const Plot& plot, double left, double top) {
  double y = top - kLegendRow_px / 2;
  for (std::size_t i = 0; i < plot.series.size(); ++i) {
    const Series& series = plot.series[i];
    if (series.name.empty()) continue;
    const Style style = style_of(series, i);
    y += kLegendRow_px;
    if (series.line)
      fmt::format_to(out, "<polyline {} points=\"{:.1f},{:.1f} {:.1f},{:.1f}\"/>\n", stroke(style),
                     left, y, left + kLegendSwatch_px, y);
    if (series.markers || !series.line)
      draw_marker(out, style.shape, left + kLegendSwatch_px / 2, y,
                  std::max(series.marker_radius_px, 3.0), style.color);
    draw_text(out, left + kLegendSwatch_px + 8, y + 4.5, "start", series.name);
  }
}

void draw_panel(Out out, const Plot& plot, double left, double top, double width, double height) {
  Area area{};
  area.top = top + 32;
  area.height = std::max(height - 32 - 52, 40.0);
  area.y = linear_axis(range_of(plot, [](auto p) { return p.second; }),
                       std::max(2, static_cast<int>(area.height / 40)));
  double label_px = 0;
  for (const std::string& label : area.y.labels)
    label_px = std::max(label_px, text_width_px(label));
  area.left = left + label_px + 36;
  area.width = std::max(width - label_px - 36 - 18, 40.0);
  const auto x_range = range_of(plot, [](auto p) { return p.first; });
  area.x = plot.log_x ? log_axis(x_range)
                      : linear_axis(x_range, std::max(2, static_cast<int>(area.width / 70)));
  draw_axes(out, area, plot);
  for (std::size_t i = 0; i < plot.series.size(); ++i) draw_series(out, area, plot.series[i], i);
}

}  // namespace

std::string draw_svg(const std::vector<Plot>& panels, int columns) {
  const Plot first = panels.empty() ? Plot{} : panels.front();
  columns = std::max(columns, 1);
  const int rows = (static_cast<int>(panels.size()) + columns - 1) / columns;
  const int width = columns * first.width;
  const double legend_rows_px = 32 + kLegendRow_px * static_cast<double>(first.series.size()) + 12;
  const int height =
      std::max(rows * first.height, has_legend(first) ? static_cast<int>(legend_rows_px) : 1);
  const double legend_px = legend_width_px(first);
  const double panel_px = (width - legend_px) / columns;
  std::string svg;
  const Out out(svg);
  fmt::format_to(out,
                 "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" "
                 "viewBox=\"0 0 {0} {1}\" font-family=\"Helvetica, Arial, sans-serif\" "
                 "font-size=\"{2}\" fill=\"#222222\">\n"
                 "<rect width=\"{0}\" height=\"{1}\" fill=\"#ffffff\"/>\n",
                 width, height, kFont_px);
  for (std::size_t i = 0; i < panels.size(); ++i)
    draw_panel(out, panels[i], panel_px * static_cast<double>(i % columns),
               static_cast<double>(i / columns) * first.height, panel_px, first.height);
  if (legend_px > 0) draw_legend(out, first, width - legend_px, 32);
  svg += "</svg>\n";
  return svg;
}

std::string draw_svg(const Plot& plot) { return draw_svg(std::vector<Plot>{plot}, 1); }

}  // namespace mr::eval
