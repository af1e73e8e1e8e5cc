#include "svg_plot.h"

#include <fmt/format.h>

#include <cmath>

namespace mr::bench {

double LogAxis::place(double value) const {
  return std::log(value / ticks.front()) / std::log(ticks.back() / ticks.front());
}

void draw_text(std::string& out, double x, double y, const std::string& text, const char* more) {
  out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" {}>{}</text>\n", x, y, more, text);
}

void draw_line(std::string& out, double x1, double y1, double x2, double y2,
               const std::string& color, bool dashed) {
  out += fmt::format(
      "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\" {}/>\n", x1, y1,
      x2, y2, color, dashed ? "stroke-dasharray=\"5 3\"" : "");
}

void draw_axes(std::string& out, const PlotPanel& panel, const std::string& title) {
  const std::string kGrid = "#dddddd";
  const double top = panel.layout.top, bottom = top + panel.layout.height;
  const double right = panel.left + panel.layout.width;
  for (const double tick : panel.x.ticks) {
    draw_line(out, panel.x_px(tick), top, panel.x_px(tick), bottom, kGrid);
    draw_text(out, panel.x_px(tick), bottom + 18, fmt::format("{}", tick));
  }
  for (const double tick : panel.y.ticks) {
    draw_line(out, panel.left, panel.y_px(tick), right, panel.y_px(tick), kGrid);
    draw_text(out, panel.left - 7, panel.y_px(tick) + 4.5, fmt::format("{:.4g}", tick),
              "text-anchor=\"end\"");
  }
  draw_text(out, (panel.left + right) / 2, top - 14, title,
            "text-anchor=\"middle\" font-weight=\"bold\"");
}

std::string open_svg(const PlotLayout& layout, double right) {
  return fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" "
      "height=\"{1}\" font-family=\"Helvetica, Arial, sans-serif\" font-size=\"13\" "
      "fill=\"#222222\" stroke-width=\"1.6\">\n<rect width=\"{0}\" height=\"{1}\" "
      "fill=\"#ffffff\"/>\n",
      layout.left + 2 * layout.step + right, layout.top + layout.height + 56);
}

}  // namespace mr::bench
