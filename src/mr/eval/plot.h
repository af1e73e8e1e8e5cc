#pragma once

#include <string>
#include <utility>
#include <vector>

namespace mr::eval {

/// One series of a line or scatter plot. The plot is SVG with round ticks, a grid and a legend at
/// the right, on a white background for light and dark pages. Colours suit colour-blind readers
/// (Okabe and Ito palette); from the eighth series on they repeat with another dash and marker.
struct Series {
  std::string name;                               ///< empty: not in the legend
  std::vector<std::pair<double, double>> points;  ///< in drawing order
  bool line = true, markers = true;
  bool dashed = false;          ///< as a limit or a hull is drawn
  double marker_radius_px = 3;  ///< 1.5 suits clouds of hundreds
  double opacity = 1;           ///< of line and markers
};

/// Points that are not finite (on a logarithmic axis: not above 0) are left out and break the line.
struct Plot {
  std::string title, x_label, y_label;
  std::vector<Series> series;
  bool log_x = false;
  int width = 720, height = 440;
};

std::string draw_svg(const Plot& plot);

/// Several plots in one figure, row by row, each as large as the first, with one legend: they hold
/// the same series.
std::string draw_svg(const std::vector<Plot>& panels, int columns);

}  // namespace mr::eval
