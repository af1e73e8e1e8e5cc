#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "mr/eval/floor_map.h"
#include "mr/eval/viewpoints.h"

// The floor plan with skeleton, sensors and views.
namespace mr::eval {
namespace {

constexpr const char* kUnknownFill = "#e3e6ea";
constexpr const char* kFreeFill = "#ffffff";
constexpr const char* kObstacleFill = "#4a5562";
constexpr const char* kSkeletonFill = "#7fb5e6";
constexpr const char* kSensorFill = "#e08a00";
constexpr const char* kLowColor = "#b3005e";
constexpr const char* kHighColor = "#00695c";

/// A map of metres to pixels, y upwards.
class Canvas {
 public:
  Canvas(Vec2d low, Vec2d high) : low_(low), high_(high) {
    scale_ = std::clamp(880 / std::max(high.x - low.x, 0.1), 20.0, 240.0);
    scale_ = std::min(scale_, 900 / std::max(high.y - low.y, 0.1));
  }
  double scale() const { return scale_; }
  double x(double metres) const { return kMargin + (metres - low_.x) * scale_; }
  double y(double metres) const { return kMargin + (high_.y - metres) * scale_; }
  double width() const { return std::max(2 * kMargin + (high_.x - low_.x) * scale_, kLeastWidth); }
  double bottom() const { return 2 * kMargin + (high_.y - low_.y) * scale_; }

  static constexpr double kMargin = 16, kLeastWidth = 640;

 private:
  Vec2d low_, high_;
  double scale_ = 1;
};

/// A camera from above.
struct CameraFromAbove {
  Vec2d at, ahead;  ///< `ahead` at most one long
  double height_m = 0;
};

CameraFromAbove from_above(const Pose& T_floor_world, const Pose& T_world_camera) {
  const Pose T = T_floor_world * T_world_camera;
  return {
      {T.translation.x, T.translation.y}, {T.rotation(0, 2), T.rotation(1, 2)}, T.translation.z};
}

/// Runs of one kind of cell along the rows.
template <typename Is>
void draw_cells(std::string& svg, const FloorMap& map, const Canvas& canvas, const char* fill,
                const Is& is) {
  svg += fmt::format("<path fill=\"{}\" shape-rendering=\"crispEdges\" d=\"", fill);
  for (int y = 0; y < map.height; ++y)
    for (int x = 0; x < map.width;) {
      const auto at = [&](int column) {
        return is(static_cast<std::size_t>(y) * map.width + column);
      };
      int end = x;
      while (end < map.width && at(end)) ++end;
      if (end > x)
        svg += fmt::format("M{:.2f} {:.2f}h{:.2f}v{:.2f}h{:.2f}z", canvas.x(x * map.cell_m),
                           canvas.y((y + 1) * map.cell_m), (end - x) * map.cell_m * canvas.scale(),
                           map.cell_m * canvas.scale(), (x - end) * map.cell_m * canvas.scale());
      x = std::max(end, x + 1);
    }
  svg += "\"/>\n";
}

void draw_sensor(std::string& svg, double x, double y, Vec2d ahead) {
  const double len = std::hypot(ahead.x, ahead.y);
  const Vec2d a = len > 1e-6 ? ahead * (1 / len) : Vec2d{0, 1};
  const auto corner = [&](double forward, double side) {
    return fmt::format("{:.1f},{:.1f}", x + forward * a.x + side * a.y,
                       y - forward * a.y + side * a.x);
  };
  svg += fmt::format("<polygon points=\"{} {} {}\" fill=\"{}\" stroke=\"#5c3900\"/>\n",
                     corner(-7, 0), corner(11, 5), corner(11, -5), kSensorFill);
}

constexpr double kArrow_px = 26;

void draw_arrow(std::string& svg, double x, double y, Vec2d ahead, const char* color) {
  const double tip_x = x + kArrow_px * ahead.x, tip_y = y - kArrow_px * ahead.y;
  const auto barb = [&](double side) {
    return fmt::format("L{:.1f} {:.1f}", tip_x - 7 * ahead.x + side * 4 * ahead.y,
                       tip_y + 7 * ahead.y + side * 4 * ahead.x);
  };
  svg += fmt::format(
      "<circle cx=\"{0:.1f}\" cy=\"{1:.1f}\" r=\"2.6\" fill=\"{2}\"/>"
      "<path d=\"M{0:.1f} {1:.1f}L{3:.1f} {4:.1f}\" stroke=\"{2}\" stroke-width=\"1.8\"/>"
      "<path d=\"M{3:.1f} {4:.1f}{5}{6}z\" fill=\"{2}\"/>\n",
      x, y, color, tip_x, tip_y, barb(1), barb(-1));
}

constexpr double kLetter_px = 11;

std::string text(double x, double y, const std::string& what, const char* attributes) {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" {}>{}</text>\n", x, y, attributes, what);
}

/// The views as numbered arrows; a number moves on along its arrow until none is in its way.
void draw_views(std::string& svg, const std::vector<CameraFromAbove>& views, double high_m,
                const Canvas& canvas) {
  std::vector<Vec2d> taken;
  std::string numbers;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const CameraFromAbove& view = views[i];
    const double x = canvas.x(view.at.x), y = canvas.y(view.at.y);
    const char* const color = view.height_m > high_m ? kHighColor : kLowColor;
    draw_arrow(svg, x, y, view.ahead, color);
    Vec2d at;
    for (double away = kArrow_px + 9; away < kArrow_px + 80; away += 4) {
      at = {x + away * view.ahead.x, y - away * view.ahead.y};
      const bool clear = std::none_of(taken.begin(), taken.end(), [&](Vec2d other) {
        return std::abs(other.x - at.x) < 1.3 * kLetter_px && std::abs(other.y - at.y) < kLetter_px;
      });
      if (clear) break;
    }
    taken.push_back(at);
    numbers += text(at.x, at.y + 0.36 * kLetter_px, std::to_string(i),
                    fmt::format("text-anchor=\"middle\" font-size=\"{}\" font-weight=\"bold\" "
                                "fill=\"{}\" stroke=\"#ffffff\" stroke-width=\"2.5\" "
                                "paint-order=\"stroke\"",
                                kLetter_px, color)
                        .c_str());
  }
  svg += numbers;
}

/// A bar of a round length.
void draw_scale(std::string& svg, const Canvas& canvas, double y) {
  double length_m = 0.1;
  for (const double step : {0.2, 0.5, 1.0, 2.0, 5.0, 10.0})
    if (step * canvas.scale() <= 200) length_m = step;
  const double x = Canvas::kMargin, end = x + length_m * canvas.scale();
  svg += fmt::format(
      "<path d=\"M{0:.1f} {2:.1f}v6H{1:.1f}v-6\" fill=\"none\" stroke=\"#222\" "
      "stroke-width=\"1.5\"/>\n",
      x, end, y - 6);
  svg += text(end + 6, y + 2, fmt::format("{:g} m", length_m), "fill=\"#222\"");
}

struct LegendEntry {
  std::string mark, words;
};

std::vector<LegendEntry> legend_of(const ViewPlan& plan) {
  const auto square = [](const char* fill) {
    return fmt::format("<rect width=\"12\" height=\"12\" fill=\"{}\" stroke=\"#888\"/>", fill);
  };
  std::vector<LegendEntry> out;
  if (!plan.floor.cells.empty())
    out = {{square(kFreeFill), "free"},
           {square(kObstacleFill), "obstacle"},
           {square(kUnknownFill), "unknown"},
           {square(kSkeletonFill), "skeleton"}};
  std::string sensor, low, high;
  draw_sensor(sensor, 4, 6, {1, 0});
  draw_arrow(low, -4, 6, {0.7, 0}, kLowColor);
  draw_arrow(high, -4, 6, {0.7, 0}, kHighColor);
  out.insert(out.end(), {{sensor, "sensor"}, {low, "lower view"}, {high, "higher view"}});
  return out;
}

void draw_legend(std::string& svg, const ViewPlan& plan, double y) {
  double x = Canvas::kMargin;
  for (const LegendEntry& entry : legend_of(plan)) {
    svg += fmt::format("<g transform=\"translate({:.1f} {:.1f})\">{}</g>\n", x, y, entry.mark);
    svg += text(x + 19, y + 10, entry.words, "fill=\"#222\"");
    x += 34 + 6.8 * static_cast<double>(entry.words.size());
  }
}

/// The floor's frame, or one under the views where the plan has no floor: no view is rolled, so
/// what is up in them is, on average, up.
Pose floor_frame(const ViewPlan& plan) {
  if (!plan.floor.cells.empty() || plan.views.empty()) return plan.floor.T_world_floor;
  Vec3d up, middle;
  for (const render::Viewpoint& view : plan.views) {
    up += -view.T_world_camera.rotation.column(1);
    middle += view.T_world_camera.translation / static_cast<double>(plan.views.size());
  }
  up = length(up) > 1e-6 ? normalized(up) : Vec3d{0, 0, 1};
  const Vec3d x = any_horizontal(up), y = cross(up, x);
  return {{{x.x, y.x, up.x, x.y, y.y, up.y, x.z, y.z, up.z}}, middle};
}

/// Around the floor, the sensors and the views.
Canvas canvas_for(const FloorMap& floor, const std::vector<CameraFromAbove>& sensors,
                  const std::vector<CameraFromAbove>& views) {
  constexpr double kAround_m = 0.3;
  Vec2d low, high{floor.width * floor.cell_m, floor.height * floor.cell_m};
  if (floor.cells.empty() && !views.empty()) low = high = views.front().at;
  for (const auto* const some : {&sensors, &views})
    for (const CameraFromAbove& s : *some) {
      low = {std::min(low.x, s.at.x - kAround_m), std::min(low.y, s.at.y - kAround_m)};
      high = {std::max(high.x, s.at.x + kAround_m), std::max(high.y, s.at.y + kAround_m)};
    }
  return {low, high};
}

/// Halfway between the lowest and the highest view; views all at one height are low.
double middle_height_m(const std::vector<CameraFromAbove>& views) {
  const auto [low, high] =
      std::minmax_element(views.begin(), views.end(),
                          [](const auto& a, const auto& b) { return a.height_m < b.height_m; });
  return low == views.end() ? 0 : 0.5 * (low->height_m + high->height_m);
}

}  // namespace

std::string draw_plan_svg(const ViewPlan& plan, std::span<const Pose> sensors) {
  const Pose T_floor_world = floor_frame(plan).inverse();
  std::vector<CameraFromAbove> seen_sensors, seen_views;
  for (const Pose& sensor : sensors) seen_sensors.push_back(from_above(T_floor_world, sensor));
  for (const auto& view : plan.views)
    seen_views.push_back(from_above(T_floor_world, view.T_world_camera));
  const FloorMap& map = plan.floor;
  const Canvas canvas = canvas_for(map, seen_sensors, seen_views);
  const double height = canvas.bottom() + 56;
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:.0f} {1:.0f}\" "
      "width=\"{0:.0f}\" height=\"{1:.0f}\" font-family=\"sans-serif\" font-size=\"12\">\n"
      "<rect width=\"100%\" height=\"100%\" fill=\"#f7f8fa\"/>\n",
      canvas.width(), height);
  if (!map.cells.empty()) {
    const auto is = [&](FloorMap::Cell kind) {
      return [&map, kind](std::size_t cell) { return map.cells[cell] == kind; };
    };
    draw_cells(svg, map, canvas, kUnknownFill, is(FloorMap::unknown));
    draw_cells(svg, map, canvas, kFreeFill, is(FloorMap::free));
    draw_cells(svg, map, canvas, kObstacleFill, is(FloorMap::obstacle));
    draw_cells(svg, map, canvas, kSkeletonFill,
               [&](std::size_t cell) { return map.skeleton[cell] != 0; });
  }
  for (const CameraFromAbove& sensor : seen_sensors)
    draw_sensor(svg, canvas.x(sensor.at.x), canvas.y(sensor.at.y), sensor.ahead);
  draw_views(svg, seen_views, middle_height_m(seen_views), canvas);
  draw_scale(svg, canvas, canvas.bottom() + 8);
  draw_legend(svg, plan, canvas.bottom() + 28);
  return svg + "</svg>\n";
}

}  // namespace mr::eval
