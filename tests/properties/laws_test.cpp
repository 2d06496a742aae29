#include "property.hpp"

#include <bit>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/text.hpp"
#include "laws/pmf_laws.hpp"

#include <debias/core/stream.hpp>

using namespace debias;
using namespace debias::properties;

TEST_CASE("any PMF: masses and tails add up, samples invert the tail and follow the masses", "[property][law]") {
  holds("the laws of a PMF", [] {
    const AnyPmf pmf = any_pmf();
    RC_TAG(pmf.spec().substr(0, 5));
    const laws::Failures failures = laws::pmf_laws(pmf);
    if (!failures.empty()) RC_FAIL(pmf.spec() + ": " + failures.front());
  });
}

TEST_CASE("any PMF is the PMF that its spec is parsed to, bit for bit", "[property][exact]") {
  holds("parse(spec) is the PMF", [] {
    const AnyPmf pmf = any_pmf();
    const AnyPmf again = AnyPmf::parse(pmf.spec());
    RC_ASSERT(again.spec() == pmf.spec());
    for (int i = 0; i < 50; ++i) {
      const std::int64_t j = *rc::gen::inRange<std::int64_t>(0, 5000);
      RC_ASSERT(again.mass(j) == pmf.mass(j));
      RC_ASSERT(again.tail(j) == pmf.tail(j));
      const double u = any_number(1e-9, 1);
      RC_ASSERT(laws::sampled_level(again, u) == laws::sampled_level(pmf, u));
    }
  });
}

TEST_CASE("any double is the number that its text reads back as", "[property][exact]") {
  holds("parse_double(to_text(x)) is x", [] {
    const double x = std::bit_cast<double>(*rc::gen::arbitrary<std::uint64_t>());
    RC_PRE(std::isfinite(x));
    RC_ASSERT(std::bit_cast<std::uint64_t>(parse_double(to_text(x), "x")) == std::bit_cast<std::uint64_t>(x));
  });
  holds("parse_count(n) is n", [] {
    const auto n = *rc::gen::arbitrary<std::uint64_t>();
    RC_ASSERT(parse_count(std::to_string(n), "n", 0, ~std::uint64_t{0}) == n);
  });
  holds("any text is a number or refused with its own name", [] {
    const auto text =
        *rc::gen::container<std::string>(rc::gen::element('0', '1', '9', '.', 'e', '-', '+', '_', ' ', 'x'));
    try {
      RC_ASSERT(std::isfinite(parse_double(text, "argument")));
    } catch (const std::invalid_argument& e) {
      RC_ASSERT(std::string(e.what()).find("argument") != std::string::npos);
    }
    try {
      RC_ASSERT(parse_count(text, "argument", 3, 1000) <= 1000U);
    } catch (const std::invalid_argument& e) {
      RC_ASSERT(std::string(e.what()).find("argument") != std::string::npos);
    }
  });
}

TEST_CASE("fill gives the numbers of single calls however it is cut, and a split looks at no position",
          "[property][exact]") {
  holds("fill", [] {
    const auto seed = *rc::gen::arbitrary<std::uint64_t>();
    const auto index = *rc::gen::arbitrary<std::uint64_t>();
    Stream one(seed, index);
    Stream many(seed, index);
    const Stream child = one.split(7);
    for (int cuts = *rc::gen::inRange(1, 6); cuts > 0; --cuts) {
      std::vector<double> filled(static_cast<std::size_t>(*rc::gen::inRange(0, 20)));
      many.fill(filled);
      for (const double u : filled) {
        RC_ASSERT(u > 0.0);
        RC_ASSERT(u < 1.0);
        RC_ASSERT(one.uniform() == u);
      }
    }
    Stream early(child);
    Stream late = many.split(7);
    RC_ASSERT(early.uniform() == late.uniform());
  });
}
