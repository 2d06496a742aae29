#pragma once

// A picture of curves as SVG: panels with axes, linear or logarithmic, and a legend below each, where no curve can run through it.
//
// A number that an axis cannot show (NaN, infinity, one that is not positive on a logarithmic axis) is left out, and its curve
// has a gap there. Colours are those of Okabe and Ito, which colour-blind readers tell apart; dashes and open markers say the
// same in print. src/python/debias/plot.py draws the same pictures by matplotlib.

#include <limits>
#include <string>
#include <string_view>
#include <vector>

namespace debias::commands::svg {

namespace colour {
inline constexpr std::string_view blue = "#0072B2", orange = "#E69F00", green = "#009E73", purple = "#CC79A7",
                                  sky = "#56B4E9", red = "#D55E00", black = "#000000", grey = "#999999";
}  // namespace colour

inline constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

struct Point {
  double x = 0;
  double y = 0;
  double error = nothing;  ///< half the height of its bar
  bool open = false;       ///< drawn white inside: not to be trusted, or not used
};

struct Curve {
  std::string name;  ///< in the legend; empty for none
  std::string_view colour;
  std::vector<Point> points;
  bool line = true;
  bool markers = true;
  bool dashed = false;
  bool right = false;  ///< by the axis on the right
};

/// Between two places of the x axis, from top to bottom.
struct Region {
  std::string name;
  std::string_view colour;
  double low = 0;
  double high = 0;
};

/// From left to right at one height, which the axis makes room for.
struct Level {
  std::string name;
  std::string_view colour;
  double y = 0;
};

struct Axis {
  std::string label;
  int base = 0;          ///< of the logarithm, 10 or 2; 0: linear
  double low = nothing;  ///< where it is to end; by itself around what is drawn
  double high = nothing;
  bool whole = false;  ///< ticks at whole numbers only
};

struct Panel {
  std::string title;
  Axis x;
  Axis y;
  std::vector<Curve> curves;
  std::vector<Region> regions;
  std::vector<Level> levels;
  Axis right;  ///< drawn where a curve asks for it
};

/// One row of panels after the other.
std::string draw(const std::vector<Panel>& panels, std::size_t columns = 1);

}  // namespace debias::commands::svg
