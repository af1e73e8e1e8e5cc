#pragma once

#include <string>
#include <utility>
#include <vector>

namespace mr::eval {

/// A figure as SVG: axes with round ticks, a grid, a legend; readable on white and on dark pages.
struct Series {
  std::string name;
  std::vector<std::pair<double, double>> points;  ///< in drawing order
  bool line = true, markers = true;
};

struct Plot {
  std::string title, x_label, y_label;
  std::vector<Series> series;
  bool log_x = false;
  int width = 720, height = 440;
};

std::string draw_svg(const Plot& plot);

}  // namespace mr::eval
