#include "mr/eval/plot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <regex>
#include <sstream>

namespace mr::eval {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::vector<std::string> all(const std::string& svg, const std::string& pattern) {
  const std::regex expression(pattern);
  std::vector<std::string> found;
  for (std::sregex_iterator at(svg.begin(), svg.end(), expression), end; at != end; ++at)
    found.push_back((*at)[at->size() > 1 ? 1 : 0]);
  return found;
}

/// Elements nest and close, attributes are quoted, text holds no bare < or &.
std::string why_not_xml(const std::string& svg) {
  std::vector<std::string> open;
  const std::regex tag(R"(<(/?)([a-z]+)((?: [A-Za-z0-9-]+="[^"<&]*")*)(/?)>)");
  const std::regex text(R"(([^<>&"]|&(amp|lt|gt|quot);)*)");
  std::size_t at = 0;
  for (std::sregex_iterator it(svg.begin(), svg.end(), tag), end; it != end; ++it) {
    const std::string between = svg.substr(at, it->position() - at);
    if (!std::regex_match(between, text)) return "text: " + between;
    at = it->position() + it->length();
    const std::string name = (*it)[2];
    if ((*it)[1].length() > 0) {
      if (open.empty() || open.back() != name) return "closes " + name;
      open.pop_back();
    } else if ((*it)[4].length() == 0) {
      open.push_back(name);
    }
  }
  if (!open.empty()) return "left open: " + open.back();
  return svg.substr(at) == "\n" ? "" : "after the end: " + svg.substr(at);
}

/// Everything that must hold of any figure.
void expect_sound(const std::string& svg) {
  EXPECT_EQ(why_not_xml(svg), "");
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  EXPECT_THAT(svg, Not(HasSubstr("inf")));
  EXPECT_THAT(svg, HasSubstr("fill=\"#ffffff\"/>")) << "the ground";
}

/// Labels of the x axis (centred) or the y axis (at its left), in order.
std::vector<double> ticks(const std::string& svg, const std::string& anchor) {
  std::vector<double> values;
  for (const std::string& label :
       all(svg, "text-anchor=\"" + anchor + "\">(-?[0-9.]+(?:e[-+0-9]+)?)<"))
    values.push_back(std::stod(label));
  return values;
}

Plot plot_of(std::vector<std::pair<double, double>> points, bool log_x = false) {
  Plot plot{
      .title = "Title", .x_label = "x (m)", .y_label = "y (ms)", .series = {}, .log_x = log_x};
  plot.series.push_back({.name = "a", .points = std::move(points)});
  return plot;
}

TEST(Plot, HasItsTextsAndOneLine) {
  const std::string svg = draw_svg(plot_of({{0, 1}, {1, 3}, {2, 2}}));
  expect_sound(svg);
  for (const char* text : {">Title<", ">x (m)<", ">y (ms)<", ">a<"})
    EXPECT_THAT(svg, HasSubstr(text));
  EXPECT_EQ(all(svg, "<polyline").size(), 2u) << "the line and its sample in the legend";
  EXPECT_EQ(all(svg, "<circle").size(), 4u);
}

TEST(Plot, PointsLieWhereTheirTicksLie) {
  const std::string svg = draw_svg(plot_of({{0, 10}, {4, 30}}));
  const auto points = all(svg, "<circle cx=\"([0-9.]+)\" ");
  const auto label =
      all(svg, "<text x=\"([0-9.]+)\" y=\"[0-9.]+\" text-anchor=\"middle\">4(?:\\.0)?<");
  ASSERT_EQ(label.size(), 1u);
  EXPECT_EQ(points[1], label[0]);
}

TEST(Plot, TicksAreRoundAndCoverTheData) {
  struct Case {
    double low, high;
  };
  for (const auto& [low, high] :
       {Case{0.612, 0.947}, {0, 100}, {-3.7, 12.2}, {13, 199}, {1e-6, 9e-6}, {12345, 98765}}) {
    const std::string svg = draw_svg(plot_of({{low, low}, {high, high}}));
    expect_sound(svg);
    for (const char* anchor : {"middle", "end"}) {
      const std::vector<double> values = ticks(svg, anchor);
      ASSERT_GE(values.size(), 3u) << low << ' ' << high;
      EXPECT_LE(values.size(), 16u);
      EXPECT_LE(values.front(), low);
      EXPECT_GE(values.back(), high);
      const double step = values[1] - values[0];
      const double digit = step / std::pow(10, std::floor(std::log10(step) + 1e-9));
      EXPECT_TRUE(std::abs(digit - 1) < 1e-6 || std::abs(digit - 2) < 1e-6 ||
                  std::abs(digit - 5) < 1e-6)
          << step;
      for (std::size_t i = 1; i < values.size(); ++i)
        EXPECT_NEAR(values[i] - values[i - 1], step, 1e-6 * step);
    }
  }
}

TEST(Plot, AxesOfDataNearNothingBeginAtNothing) {
  EXPECT_EQ(ticks(draw_svg(plot_of({{0, 5}, {1, 100}})), "end").front(), 0);
  EXPECT_GT(ticks(draw_svg(plot_of({{0, 60}, {1, 100}})), "end").front(), 0);
}

TEST(Plot, LogarithmicTicksAreOneTwoFive) {
  const std::string svg = draw_svg(plot_of({{3, 1}, {30, 2}, {150, 3}}, true));
  expect_sound(svg);
  EXPECT_THAT(ticks(svg, "middle"), ElementsAre(2, 5, 10, 20, 50, 100, 200));
  // Equal factors are equal distances.
  const auto x = all(svg, "<text x=\"([0-9.]+)\" y=\"[0-9.]+\" text-anchor=\"middle\">[1-9]");
  ASSERT_EQ(x.size(), 7u);
  EXPECT_NEAR(std::stod(x[2]) - std::stod(x[0]), std::stod(x[5]) - std::stod(x[3]), 0.21);

  const std::vector<double> wide = ticks(draw_svg(plot_of({{1e-3, 1}, {2e6, 2}}, true)), "middle");
  EXPECT_THAT(wide, ElementsAre(1e-3, 1e-2, 0.1, 1, 10, 100, 1e3, 1e4, 1e5, 1e6, 1e7));
  const std::vector<double> vast =
      ticks(draw_svg(plot_of({{1e-50, 1}, {1e50, 2}}, true)), "middle");
  EXPECT_LE(vast.size(), 12u);
  EXPECT_LE(vast.front(), 1e-50);
  EXPECT_GE(vast.back(), 1e50);
}

TEST(Plot, SkipsWhatIsNotANumberAndBreaksTheLine) {
  const std::string svg =
      draw_svg(plot_of({{0, 1}, {1, 2}, {2, kNan}, {3, 2}, {4, 1}, {5, kInfinity}, {kNan, 3}}));
  expect_sound(svg);
  EXPECT_EQ(all(svg, "<polyline").size(), 3u) << "two pieces and the legend's sample";
  EXPECT_EQ(all(svg, "<circle").size(), 5u);
  const std::string log = draw_svg(plot_of({{0, 1}, {-1, 2}, {10, 3}, {20, 4}}, true));
  expect_sound(log);
  EXPECT_EQ(all(log, "<circle").size(), 3u) << "a logarithm needs more than 0";
}

TEST(Plot, DrawsNothingOnePointAndEqualValues) {
  for (const bool log_x : {false, true}) {
    expect_sound(draw_svg(plot_of({}, log_x)));
    expect_sound(draw_svg(plot_of({{kNan, kNan}}, log_x)));
    for (const double value : {7.0, -7.0, 0.0, 1e-30, 1e90, 1e300}) {
      const std::string one = draw_svg(plot_of({{5, value}}, log_x));
      expect_sound(one);
      EXPECT_EQ(all(one, "<circle").size(), value < 1e100 ? 2u : 1u) << value;
      expect_sound(draw_svg(plot_of({{5, value}, {5, value}}, log_x)));
    }
  }
  expect_sound(draw_svg(Plot{}));
  expect_sound(draw_svg(std::vector<Plot>{}, 2));
}

TEST(Plot, APointWithoutNeighboursIsSeenAlsoWithoutMarkers) {
  Plot plot = plot_of({{0, 1}, {1, 2}, {2, kNan}, {3, 2}});
  plot.series[0].markers = false;
  const std::string svg = draw_svg(plot);
  EXPECT_EQ(all(svg, "<circle").size(), 1u);
}

TEST(Plot, PutsEveryPointInsideTheFigure) {
  const std::string svg = draw_svg(plot_of({{-5, -20}, {0.001, 1000}, {12, 3.3}}));
  for (const std::string& x : all(svg, "cx=\"(-?[0-9.]+)\"")) {
    EXPECT_GE(std::stod(x), 0);
    EXPECT_LE(std::stod(x), 720);
  }
  for (const std::string& y : all(svg, "cy=\"(-?[0-9.]+)\"")) {
    EXPECT_GE(std::stod(y), 0);
    EXPECT_LE(std::stod(y), 440);
  }
}

TEST(Plot, EscapesTexts) {
  Plot plot = plot_of({{0, 1}, {1, 2}});
  plot.title = "a < b & \"c\" > d\n";
  plot.series[0].name = "</svg>";
  const std::string svg = draw_svg(plot);
  expect_sound(svg);
  EXPECT_THAT(svg, HasSubstr("a &lt; b &amp; &quot;c&quot; &gt; d <"));
  EXPECT_THAT(svg, HasSubstr("&lt;/svg&gt;"));
}

TEST(Plot, TellsManySeriesApart) {
  Plot plot;
  for (int i = 0; i < 14; ++i)
    plot.series.push_back({.name = "s" + std::to_string(i), .points = {{0, i}, {1, i + 1}}});
  plot.series.push_back({.name = "limit", .points = {{0, 3}, {1, 3}}, .dashed = true});
  const std::string svg = draw_svg(plot);
  expect_sound(svg);
  auto styles = all(svg, "<polyline fill=\"none\" (stroke=[^/]*) points=");
  std::sort(styles.begin(), styles.end());
  styles.erase(std::unique(styles.begin(), styles.end()), styles.end());
  EXPECT_EQ(styles.size(), 15u);
}

TEST(Plot, UnnamedSeriesAreNotInTheLegend) {
  Plot plot = plot_of({{0, 1}, {1, 2}});
  const std::size_t named = all(draw_svg(plot), "<polyline").size();
  plot.series.push_back({.name = "", .points = {{0, 1}, {1, 0}}});
  EXPECT_EQ(all(draw_svg(plot), "<polyline").size(), named + 1);
}

TEST(Plot, CloudsAreSmallAndPale) {
  Plot plot = plot_of({{0, 1}, {1, 2}, {2, 3}});
  plot.series[0].line = false;
  plot.series[0].marker_radius_px = 1.5;
  plot.series[0].opacity = 0.3;
  const std::string svg = draw_svg(plot);
  EXPECT_TRUE(all(svg, "<polyline").empty());
  EXPECT_EQ(all(svg, "r=\"1.5\"").size(), 3u);
  EXPECT_THAT(svg, HasSubstr("opacity=\"0.30\""));
}

TEST(Plot, PanelsShareOneLegend) {
  const Plot plot = plot_of({{0, 1}, {1, 2}});
  const std::string svg = draw_svg({plot, plot, plot, plot}, 2);
  expect_sound(svg);
  EXPECT_EQ(all(svg, ">Title<").size(), 4u);
  EXPECT_EQ(all(svg, ">a<").size(), 1u);
  EXPECT_THAT(svg, HasSubstr("width=\"1440\" height=\"880\""));
  EXPECT_EQ(draw_svg({plot}, 1), draw_svg(plot));
}

}  // namespace
}  // namespace mr::eval
