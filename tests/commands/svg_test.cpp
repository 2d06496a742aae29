#include "commands/svg.hpp"

#include <cmath>
#include <limits>
#include <string>

#include "catch_shim.hpp"

using namespace debias::commands::svg;

namespace {

// What no reader of SVG takes for a number. Of tags and their attributes alone: names may say what they like.
bool has_bad_number(const std::string& picture) {
  for (const char* word : {"=\"nan", "=\"-nan", "=\"inf", "=\"-inf", ",nan", ",-nan", ",inf", " nan", " inf"}) {
    if (picture.find(word) != std::string::npos) return true;
  }
  return false;
}

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

constexpr double infinity = std::numeric_limits<double>::infinity();

}  // namespace

TEST_CASE("a picture holds no number that an axis cannot show, and its curve has a gap there", "[commands][exact]") {
  const Curve curve{"a", colour::blue, {{1, 1}, {2, 2}, {3, nothing}, {4, infinity}, {5, 0}, {6, -1}, {7, 8}, {8, 9}}};
  const std::string picture = draw({{"t", {"x"}, {"y", 10}, {curve}, {}, {{"l", colour::red, nothing}}, {}}});
  CHECK_FALSE(has_bad_number(picture));
  CHECK(has_bad_number("<line x1=\"nan\"/>"));  // the check itself
  std::size_t lines = 0;
  for (std::size_t at = picture.find("<polyline"); at != std::string::npos; at = picture.find("<polyline", at + 1))
    ++lines;
  CHECK(lines == 2);
  for (const Panel& panel :
       {Panel{"none", {"x"}, {"y"}, {}, {}, {}, {}},
        Panel{"one", {"x", 2}, {"y", 2}, {{"", colour::red, {{3, 3}}}}, {}, {}, {}},
        Panel{"huge", {"x"}, {"y"}, {{"", colour::red, {{0, -1e300}, {1, 1e300}}}}, {}, {}, {}},
        Panel{"one far away", {"x"}, {"y"}, {{"", colour::red, {{1e17, 1e17}}}}, {}, {}, {}},
        Panel{"rounding", {"x"}, {"y"}, {{"", colour::red, {{1, 1e17}, {2, 1e17 + 16}}}}, {}, {}, {}},
        Panel{"bars", {"x"}, {"y", 10}, {{"", colour::red, {{1, 1, 5}, {2, 1, infinity}}}}, {}, {}, {}}}) {
    CHECK_FALSE(has_bad_number(draw({panel})));
  }
}

TEST_CASE("names are text, whatever they hold, and stand in the legend once", "[commands][exact]") {
  const Panel panel{"a < b & c > d",
                    {"x"},
                    {"y"},
                    {{"E D^2 < 1", colour::blue, {{0, 1}, {1, 2}}}},
                    {{"same", colour::sky, 0, 0.2}, {"same", colour::sky, 0.2, 0.4}},
                    {},
                    {}};
  const std::string picture = draw({panel});
  CHECK(has(picture, "a &lt; b &amp; c &gt; d"));
  CHECK(has(picture, "E D^2 &lt; 1"));
  CHECK(picture.find(">same<") == picture.rfind(">same<"));
}
