#include "svg.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "core/text.hpp"
#include "text.hpp"

namespace debias::commands::svg {
namespace {

constexpr double width = 420, height = 250;  // of what axes enclose, in pixels
constexpr int most_ticks = 12;               // of an axis, also where its numbers differ by rounding only
constexpr double before = 78, after = 62, above = 40, below = 58, row = 19;

std::string number(double x) { return to_text(std::round(100 * x) / 100 + 0.0); }  // + 0.0: no -0

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '&') {
      out += "&amp;";
    } else if (c == '<' || c == '>') {
      out += c == '<' ? "&lt;" : "&gt;";
    } else {
      out += static_cast<unsigned char>(c) < ' ' ? ' ' : c;
    }
  }
  return out;
}

std::string line(double x1, double y1, double x2, double y2, std::string_view colour, std::string_view more = "") {
  return "<line x1=\"" + number(x1) + "\" y1=\"" + number(y1) + "\" x2=\"" + number(x2) + "\" y2=\"" + number(y2) +
         "\" stroke=\"" + std::string(colour) + "\" " + std::string(more) + "/>\n";
}

std::string text(double x, double y, const std::string& shown, std::string_view more = "") {
  return "<text x=\"" + number(x) + "\" y=\"" + number(y) + "\" " + std::string(more) + ">" + shown + "</text>\n";
}

std::string box(double x, double y, double w, double h, std::string_view more) {
  return "<rect x=\"" + number(x) + "\" y=\"" + number(y) + "\" width=\"" + number(w) + "\" height=\"" + number(h) +
         "\" " + std::string(more) + "/>\n";
}

std::string marker(double x, double y, std::string_view colour, bool open) {
  return "<circle cx=\"" + number(x) + "\" cy=\"" + number(y) + "\" r=\"3.5\" stroke=\"" + std::string(colour) +
         "\" fill=\"" + (open ? "white" : std::string(colour)) + "\"/>\n";
}

// Of a whole number.
std::string raised(const std::string& number) {
  static constexpr std::array<std::string_view, 10> digits = {"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
  std::string out;
  for (const char c : number) out += c == '-' ? "⁻" : digits[static_cast<std::size_t>(c - '0')];
  return out;
}

constexpr std::string_view dashes = "stroke-width=\"1.5\" stroke-dasharray=\"6 4\"";
constexpr std::string_view solid = "stroke-width=\"1.5\"";

// Numbers to pixels, linear in the number or in its logarithm.
class Scale {
 public:
  Scale(Axis axis, double from, double to) : axis_(std::move(axis)), from_(from), to_(to) {}

  void cover(double x) {
    if (!shows(x)) return;
    low_ = any_ ? std::min(low_, at(x)) : at(x);
    high_ = any_ ? std::max(high_, at(x)) : at(x);
    any_ = true;
  }
  void close() {
    if (!any_) high_ = low_ + 1;
    const double room =
        std::max(0.05 * (high_ - low_), high_ > low_ ? 1e-9 * std::abs(low_) : std::max(0.5, 1e-3 * std::abs(low_)));
    low_ -= room, high_ += room;
    if (shows(axis_.low)) low_ = at(axis_.low);
    if (shows(axis_.high)) high_ = at(axis_.high);
    if (!(high_ > low_)) high_ = low_ + 1;
  }
  [[nodiscard]] bool shows(double x) const { return std::abs(x) <= 1e300 && (axis_.base == 0 || x > 0); }
  /// Cut where the axis ends.
  [[nodiscard]] double pixel(double x) const {
    const double t = !shows(x) ? (x > 0 ? high_ : low_) : std::clamp(at(x), low_, high_);
    return from_ + (t - low_) / (high_ - low_) * (to_ - from_);
  }
  [[nodiscard]] bool inside(double x) const { return shows(x) && at(x) >= low_ - 1e-9 && at(x) <= high_ + 1e-9; }
  [[nodiscard]] const Axis& axis() const { return axis_; }

  /// Where, and what is written there.
  [[nodiscard]] std::vector<std::pair<double, std::string>> ticks() const {
    std::vector<std::pair<double, std::string>> all;
    const bool log = axis_.base != 0 && high_ - low_ >= (axis_.base == 10 ? 2.2 : 1.5);
    if (axis_.base == 10 && !log) {  // hardly two powers: plain numbers between them
      for (double power = std::floor(low_); power <= high_; ++power) {
        for (const double factor : {1.0, 2.0, 5.0}) {
          const double x = factor * std::pow(10, power);
          if (inside(x)) all.emplace_back(x, rounded(x));
        }
      }
      if (all.size() > 1) return all;
      all.clear();
    }
    const double low = log || axis_.base == 0 ? low_ : std::pow(axis_.base, low_);
    const double high = log || axis_.base == 0 ? high_ : std::pow(axis_.base, high_);
    const double unit = std::pow(10, std::floor(std::log10((high - low) / 5)));
    double step = unit;
    for (const double factor : {2.0, 5.0, 10.0}) step = (high - low) / step > 6 ? factor * unit : step;
    if (log || axis_.whole) step = std::max(1.0, std::round(step));
    const double first = std::ceil(low / step - 1e-9);
    for (int i = 0; i < most_ticks && (first + i) * step <= high + 1e-9 * step; ++i) {
      const double x = std::abs(first + i) < 1e-9 ? 0 : (first + i) * step;  // no -0
      if (log) {
        all.emplace_back(std::pow(axis_.base, x), std::to_string(axis_.base) + raised(rounded(x)));
      } else {
        all.emplace_back(x, rounded(x, 6));
      }
    }
    return all;
  }

 private:
  [[nodiscard]] double at(double x) const { return axis_.base == 0 ? x : std::log(x) / std::log(axis_.base); }

  Axis axis_;
  double from_, to_, low_ = 0, high_ = 0;
  bool any_ = false;
};

std::string curve_on(const Curve& curve, const Scale& x, const Scale& y) {
  std::string lines, path, out;
  const auto finish = [&] {
    if (path.find(' ') != std::string::npos) {
      lines += "<polyline fill=\"none\" stroke=\"" + std::string(curve.colour) + "\" " +
               std::string(curve.dashed ? dashes : solid) + " points=\"" + path + "\"/>\n";
    }
    path.clear();
  };
  for (const Point& p : curve.points) {
    if (!x.shows(p.x) || !y.shows(p.y)) {
      finish();
      continue;
    }
    path += (path.empty() ? "" : " ") + number(x.pixel(p.x)) + "," + number(y.pixel(p.y));
    if (std::isfinite(p.error)) {
      out += line(x.pixel(p.x), y.pixel(p.y - p.error), x.pixel(p.x), y.pixel(p.y + p.error), curve.colour);
    }
    if (curve.markers && y.inside(p.y)) out += marker(x.pixel(p.x), y.pixel(p.y), curve.colour, p.open);
  }
  finish();
  return (curve.line ? lines : std::string()) + out;
}

// Names, each behind what it stands for; the same name once.
struct Legend {
  std::vector<std::pair<std::string, std::string>> rows;  // name, symbol at (0, 0)

  void add(const std::string& name, std::string symbol) {
    const auto same = [&](const auto& r) { return r.first == name; };
    if (!name.empty() && std::none_of(rows.begin(), rows.end(), same)) rows.emplace_back(name, std::move(symbol));
  }
};

std::string region_style(const Region& r) { return "fill=\"" + std::string(r.colour) + "\" fill-opacity=\"0.3\""; }

Legend legend_of(const Panel& panel) {
  Legend legend;
  for (const Region& r : panel.regions) legend.add(r.name, box(0, -8, 24, 10, region_style(r)));
  for (const Curve& c : panel.curves) {
    const bool all_open =
        !c.points.empty() && std::all_of(c.points.begin(), c.points.end(), [](const Point& p) { return p.open; });
    legend.add(c.name, (c.line ? line(0, -4, 24, -4, c.colour, c.dashed ? dashes : solid) : std::string()) +
                           (c.markers ? marker(12, -4, c.colour, all_open) : std::string()));
  }
  for (const Level& l : panel.levels) legend.add(l.name, line(0, -4, 24, -4, l.colour, dashes));
  return legend;
}

std::string panel_at(const Panel& panel, const Legend& legend, double left, double top) {
  Scale x(panel.x, left, left + width);
  Scale y(panel.y, top + height, top);
  Scale right(panel.right, top + height, top);
  bool has_right = false;
  for (const Curve& c : panel.curves) {
    Scale& side = c.right ? right : y;
    has_right = has_right || c.right;
    for (const Point& p : c.points) {
      if (!side.shows(p.y)) continue;
      x.cover(p.x);
      side.cover(p.y);
      if (std::isfinite(p.error)) side.cover(p.y - p.error), side.cover(p.y + p.error);
    }
  }
  for (const Region& r : panel.regions) x.cover(r.low), x.cover(r.high);
  for (const Level& l : panel.levels) y.cover(l.y);
  x.close(), y.close(), right.close();

  std::string out;
  for (const Region& r : panel.regions) {
    out += box(x.pixel(r.low), top, x.pixel(r.high) - x.pixel(r.low), height, region_style(r));
  }
  for (const auto& [at, shown] : x.ticks()) {
    out += line(x.pixel(at), top, x.pixel(at), top + height, "#e0e0e0");
    out += text(x.pixel(at), top + height + 16, shown, "text-anchor=\"middle\"");
  }
  for (const auto& [at, shown] : y.ticks()) {
    out += line(left, y.pixel(at), left + width, y.pixel(at), "#e0e0e0");
    out += text(left - 7, y.pixel(at) + 4, shown, "text-anchor=\"end\"");
  }
  if (has_right) {
    for (const auto& [at, shown] : right.ticks()) out += text(left + width + 7, right.pixel(at) + 4, shown);
  }
  out += box(left, top, width, height, "fill=\"none\" stroke=\"#444444\"");
  for (const Level& l : panel.levels) {
    if (y.inside(l.y)) out += line(left, y.pixel(l.y), left + width, y.pixel(l.y), l.colour, dashes);
  }
  for (const Curve& c : panel.curves) out += curve_on(c, x, c.right ? right : y);
  const auto upright = [&](double at, const std::string& label) {
    const std::string turn =
        "transform=\"rotate(-90 " + number(at) + " " + number(top + height / 2) + ")\" text-anchor=\"middle\"";
    return text(at, top + height / 2, escaped(label), turn);
  };
  out += text(left + width / 2, top - 12, escaped(panel.title), "text-anchor=\"middle\" font-size=\"14\"");
  out += text(left + width / 2, top + height + 36, escaped(panel.x.label), "text-anchor=\"middle\"");
  out += upright(left - 55, panel.y.label);
  if (has_right) out += upright(left + width + 50, panel.right.label);
  double down = top + height + below;
  for (const auto& [name, symbol] : legend.rows) {
    out += "<g transform=\"translate(" + number(left) + " " + number(down) + ")\">" + symbol + "</g>\n";
    out += text(left + 32, down, escaped(name));
    down += row;
  }
  return out;
}

}  // namespace

std::string draw(const std::vector<Panel>& panels, std::size_t columns) {
  std::string body;
  double top = 0;
  for (std::size_t first = 0; first < panels.size(); first += columns) {
    std::size_t rows = 0;
    for (std::size_t i = first; i < std::min(first + columns, panels.size()); ++i) {
      const Legend legend = legend_of(panels[i]);
      rows = std::max(rows, legend.rows.size());
      body +=
          panel_at(panels[i], legend, before + static_cast<double>(i - first) * (before + width + after), top + above);
    }
    top += above + height + below + row * static_cast<double>(rows);
  }
  const double across = static_cast<double>(columns) * (before + width + after);
  return "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" + number(across) + "\" height=\"" + number(top) +
         "\" viewBox=\"0 0 " + number(across) + " " + number(top) +
         "\" font-family=\"DejaVu Sans, Helvetica, sans-serif\" font-size=\"12\">\n" +
         box(0, 0, across, top, "fill=\"white\"") + body + "</svg>\n";
}

}  // namespace debias::commands::svg
