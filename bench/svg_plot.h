#pragma once

#include <string>
#include <vector>

/// What the plots of mr-bench share: panels with logarithmic axes, drawn as SVG.
namespace mr::bench {

/// Where panels lie on the sheet, in its pixels.
struct PlotLayout {
  double width, height;  ///< of a panel
  double left, top;      ///< of the first
  double step;           ///< from one to the next
};

/// A logarithmic axis from one tick to another.
struct LogAxis {
  std::vector<double> ticks;

  double place(double value) const;  ///< 0..1
};

struct PlotPanel {
  const PlotLayout& layout;
  double left;
  LogAxis x, y;

  double x_px(double value) const { return left + layout.width * x.place(value); }
  double y_px(double value) const { return layout.top + layout.height * (1 - y.place(value)); }
};

void draw_text(std::string& out, double x, double y, const std::string& text,
               const char* more = "text-anchor=\"middle\"");
void draw_line(std::string& out, double x1, double y1, double x2, double y2,
               const std::string& color, bool dashed = false);
/// Grid, ticks and title.
void draw_axes(std::string& out, const PlotPanel& panel, const std::string& title);

/// A white sheet of two panels, `right` pixels beside the second; ends with "</svg>\n".
std::string open_svg(const PlotLayout& layout, double right);

}  // namespace mr::bench
