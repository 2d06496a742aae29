// Numbers, PMFs and names from any text: refused with std::invalid_argument, or read; a PMF is the one that its spec
// is parsed to.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <string_view>

#include <debias/pmf/any.hpp>

#include "cli/requests.hpp"
#include "core/text.hpp"

namespace {

using namespace debias;

template <class Read>
void refused_or(const Read& read) {
  try {
    read();
  } catch (const std::invalid_argument& e) {
    if (*e.what() == '\0') std::abort();
  }
}

void read_pmf(std::string_view text) {
  const AnyPmf pmf = AnyPmf::parse(text);
  const AnyPmf again = AnyPmf::parse(pmf.spec());
  for (const std::int64_t j : {0, 1, 2, 10, 100}) {
    if (pmf.mass(j) != again.mass(j) || pmf.tail(j) != again.tail(j)) std::abort();
    if (!(pmf.mass(j) >= 0 && pmf.mass(j) <= 1 && pmf.tail(j) >= 0 && pmf.tail(j) <= 1)) std::abort();
  }
  for (const double u : {0.9, 0.5, 1e-3}) {
    try {
      if (pmf.sample(u) < 0) std::abort();
    } catch (const std::length_error&) {
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  refused_or([&] {
    if (const double x = parse_double(text, "x"); !std::isfinite(x) || parse_double(to_text(x), "x") != x) std::abort();
  });
  refused_or([&] {
    if (const std::uint64_t n = parse_count(text, "n", 3, 1'000'000); n < 3 || n > 1'000'000) std::abort();
  });
  for (const char* field : {"confidence", "seconds", "seed", "shard", "estimator", "base_level"}) {
    refused_or([&] {
      cli::Words words = cli::usual_words("run");
      words.values["problem"] = "A01";
      words.values[field] = text;
      cli::read_request("run", words);
    });
  }
  refused_or([&] { catalog::find(text.substr(0, 100)); });
  refused_or([&] { read_pmf(text); });
  return 0;
}
