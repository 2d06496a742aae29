// Samples that a result has already are not drawn again, and a checkpoint of any bytes is read or refused.

#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <unistd.h>

#include "catch_shim.hpp"

#include <debias/core/checkpoint.hpp>
#include <debias/core/estimate.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/estimators/stratified.hpp>
#include <debias/pmf/geometric.hpp>

#include "core/part_file.hpp"
#include "core/run_state_bytes.hpp"

using namespace debias;

namespace {

double draw(Stream& rng) { return rng.uniform() * rng.normal(); }

std::string temporary(const std::string& name) {
  return (std::filesystem::temp_directory_path() / (name + "." + std::to_string(getpid()))).string();
}

}  // namespace

TEST_CASE("an extended result has the bits of one run, tails and largest samples included", "[core][estimate][exact]") {
  for (const std::int64_t first : {0, 300}) {
    for (const std::int64_t n : {10, 511, 512, 20'000}) {
      const auto part = estimate(draw, {.samples = n, .seed = 5, .first = first});
      const auto more = extend(draw, part, {.samples = 30'000});
      const auto whole = estimate(draw, {.samples = 30'000, .seed = 5, .first = first, .threads = 1});
      CHECK(more.mean == whole.mean);
      CHECK(more.moments.m4 == whole.moments.m4);
      CHECK(more.upper_tail == whole.upper_tail);
      CHECK(more.lower_tail == whole.lower_tail);
      CHECK(more.largest == whole.largest);
      CHECK_THROWS_AS(extend(draw, more, {.samples = n}), std::invalid_argument);
    }
  }
  const auto rough = estimate(draw, {.seed = 5, .goal = {.error = 0.01}});
  const auto fine = extend(draw, rough, {.goal = {.error = 0.005}});
  CHECK(fine.mean == estimate(draw, {.seed = 5, .goal = {.error = 0.005}}).mean);
  CHECK(extend(draw, fine, {.goal = {.error = 0.01}}).samples == fine.samples);
}

TEST_CASE("a checkpoint reads back, and is refused or shortened where any byte is wrong or missing",
          "[core][checkpoint][exact]") {
  const std::string path = temporary("checkpoint_test");
  const auto run = estimate(draw, {.samples = 700, .seed = 5});
  PartWriter writer(path, "a text", {{"run", encode(run.state)}});
  std::ifstream file(path, std::ios::binary);
  const std::vector<char> chars{std::istreambuf_iterator<char>(file), {}};
  std::filesystem::remove(path);
  const auto parse = [](const std::vector<char>& c) { return parse_parts(std::as_bytes(std::span(c))); };
  const PartFile read = parse(chars);
  CHECK(read.text == "a text");
  REQUIRE(read.parts.size() == 1);
  const RunState state = decode(read.parts.at("run"));
  CHECK(state.total().moments.m4 == run.moments.m4);
  CHECK(state.extremes.upper_tail() == run.upper_tail);
  CHECK(state.extremes.largest() == run.largest);
  int accepted = 0;
  for (std::size_t i = 0; i < chars.size(); i += i < 200 ? 1 : 97) {
    std::vector<char> broken = chars;
    broken[i] = static_cast<char>(broken[i] ^ 0x10);
    for (const auto& bytes :
         {broken, std::vector<char>(chars.begin(), chars.begin() + static_cast<std::ptrdiff_t>(i))}) {
      try {
        if (!parse(bytes).parts.empty()) ++accepted;
      } catch (const std::invalid_argument&) {
      }
    }
  }
  CHECK(accepted == 0);
}

TEST_CASE("a checkpoint that is cut at any byte has the parts of the whole records before it",
          "[core][checkpoint][exact]") {
  const std::string path = temporary("checkpoint_cut");
  const Bytes one = encode(estimate(draw, {.samples = 60, .seed = 5}).state);
  const Bytes two = encode(estimate(draw, {.samples = 80, .seed = 5}).state);
  PartWriter writer(path, "a text");
  Parts parts;
  std::map<std::uintmax_t, Parts> after = {{std::filesystem::file_size(path), parts}};  // by size of the file
  for (const auto& [name, contents] : {std::pair("run", one), {"other", one}, {"run", two}}) {
    writer.save({{name, contents}});
    parts[name] = contents;
    after[std::filesystem::file_size(path)] = parts;
  }
  int wrong = 0;
  for (std::uintmax_t size = after.rbegin()->first + 1; size-- > 0;) {
    std::filesystem::resize_file(path, size);
    const auto next = after.upper_bound(size);
    try {
      const PartFile cut = read_parts(path);
      const auto& [whole, expected] = *std::prev(next);
      wrong += cut.text != "a text" || cut.parts != expected || cut.dropped != size - whole;
    } catch (const std::invalid_argument&) {
      wrong += next != after.begin();
    }
  }
  CHECK(wrong == 0);
  std::filesystem::remove(path);
}

TEST_CASE("a longer run that stops in the chunk it has to draw again leaves what was saved",
          "[core][checkpoint][exact]") {
  for (const auto& [first, samples] : {std::pair<std::int64_t, std::int64_t>{0, 600}, {300, 100}, {300, 900}}) {
    RunState held = estimate(draw, {.samples = samples, .seed = 5, .first = first}).state;
    Plan plan{.samples = 3000, .seed = 5, .first = first, .threads = 1};
    const auto whole = estimate(draw, plan);
    int saves = 0;
    plan.save = [&](const RunState& finished, const Plan&) {
      held = finished;
      ++saves;
    };
    for (const std::int64_t most : {50, 700, 10'000}) {                 // in the cut chunk, behind it, and to the end
      plan.earlier = std::make_shared<RunState>(decode(encode(held)));  // a file, which knows no types
      std::int64_t left = most;
      const auto failing = [&](Stream& rng) { return left-- > 0 ? draw(rng) : throw std::runtime_error("no more"); };
      if (most < 3000) {
        CHECK_THROWS_AS(estimate(failing, plan), SampleError);
        CHECK(saves == (most == 50 ? 0 : 1));
        continue;
      }
      const auto resumed = estimate(draw, plan);
      CHECK(resumed.mean == whole.mean);
      CHECK(resumed.upper_tail == whole.upper_tail);
      CHECK(resumed.lower_tail == whole.lower_tail);
    }
  }
}

TEST_CASE("a checkpoint that is deleted comes back, and the file of another run is left alone",
          "[core][checkpoint][exact]") {
  const std::string path = temporary("checkpoint_lost");
  const Bytes sums = encode(estimate(draw, {.samples = 60, .seed = 5}).state);
  PartWriter writer(path, "one run");
  writer.save({{"run", sums}});
  std::filesystem::remove(path);
  {
    const PartWriter quick(path, "a quick run");  // at once: its file must not be taken for the one that went
    CHECK_THROWS_AS(writer.save({{"other", sums}}), std::system_error);
    CHECK_THROWS_AS(writer.restart("more of one run", {}), std::system_error);
  }
  CHECK(read_parts(path).text == "a quick run");
  std::filesystem::remove(path);
  writer.save({{"other", sums}});
  CHECK(read_parts(path).parts == Parts{{"run", sums}, {"other", sums}});
  PartWriter another(path, "another run");
  CHECK_THROWS_AS(writer.save({{"run", sums}}), std::system_error);
  another.save({{"run", sums}});
  CHECK(read_parts(path).text == "another run");
  std::filesystem::remove(path);
}

// ---- what a C++ user has: save_run and read_run

namespace {

Draw<double> halves(std::int64_t level, Stream& rng) {
  const double u = rng.uniform();
  const double size = std::exp2(-static_cast<double>(level));
  return level == 0 ? base(u) : coupled(1 + size * u, 1 + 2 * size * u);
}

std::string refusal_of(const std::function<void()>& f) {
  try {
    f();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "accepted";
}

/// A path that is empty before and after.
struct TemporaryFile {
  explicit TemporaryFile(const std::string& name) : path(temporary(name)) { std::filesystem::remove(path); }
  ~TemporaryFile() { std::filesystem::remove(path); }
  std::string path;
};

}  // namespace

TEST_CASE("a run that is saved and read again goes on with the bits of one run", "[core][checkpoint][exact]") {
  const TemporaryFile file("save_run");
  const auto plain = single_term(halves, Geometric(0.6));
  const auto check = [&](const auto& e, std::int64_t first) {
    const auto part = estimate(e, {.samples = 7040, .seed = 5, .first = first});
    save_run(file.path, part.state);
    const RunState read = read_run(file.path);
    CHECK(read.seed == std::uint64_t{5});
    CHECK(read.first() == first);
    CHECK(read.last() == first + 7040);
    CHECK(encode(read) == encode(part.state));
    const auto whole = estimate(e, {.samples = 20'480, .seed = 5, .first = first, .threads = 1});
    const auto more = extend(e, read, {.samples = 20'480});
    CHECK(more.mean == whole.mean);
    CHECK(more.standard_error == whole.standard_error);
    CHECK(more.upper_tail == whole.upper_tail);
    CHECK(more.largest == whole.largest);
    CHECK(more.samples == whole.samples);
    CHECK(extend(e, read, {.samples = 7040}).mean == part.mean);  // nothing is drawn
    CHECK_THAT(refusal_of([&] { extend(e, read, {.samples = 64}); }), Catch::Contains("ask for at least those"));
  };
  check(plain, 0);
  check(plain, 1024);
  check(stratified(plain, 64), 0);
  check(stratified(plain, 64), 1024);
  check(named("gas", plain), 0);
  check([](Stream& rng) { return std::complex<double>(rng.normal(), rng.uniform()); }, 0);
}

TEST_CASE("what a plan saves as it runs is what a later process goes on with", "[core][checkpoint][exact]") {
  const TemporaryFile file("save_as_it_runs");
  const auto e = single_term(halves, Geometric(0.6));
  Plan plan{.samples = 100'000, .seed = 9, .threads = 1};
  plan.save = [&](const RunState& state, const Plan&) { save_run(file.path, state); };
  plan.progress = [](std::int64_t done) { return done < 30'000; };
  CHECK_THROWS_AS(estimate(e, plan), Interrupted);
  const RunState read = read_run(file.path);
  CHECK(read.last() >= 30'000);
  CHECK(read.last() < 100'000);
  CHECK(extend(e, read, {.samples = 100'000}).mean == estimate(e, {.samples = 100'000, .seed = 9}).mean);
}

TEST_CASE("saved parts of a run merge to the bits of the whole, in any order", "[core][checkpoint][exact]") {
  const TemporaryFile a("part_a");
  const TemporaryFile b("part_b");
  for (const std::int64_t block : {1, 16}) {
    const auto e = stratified(single_term(halves, Geometric(0.6)), block);
    save_run(a.path, estimate(e, {.samples = 4096, .seed = 5}).state);
    save_run(b.path, estimate(e, {.samples = 6000 / block * block, .seed = 5, .first = 4096}).state);
    RunState both = read_run(b.path);
    both.merge(read_run(a.path));
    const auto whole = estimate(e, {.samples = both.last(), .seed = 5});
    const auto merged = extend(e, both, {.samples = both.last()});
    CHECK(merged.mean == whole.mean);
    CHECK(merged.moments.m4 == whole.moments.m4);
    CHECK(merged.lower_tail == whole.lower_tail);
    CHECK_THAT(refusal_of([&] { both.merge(read_run(a.path)); }), Catch::Contains("a sample may count once only"));
    save_run(b.path, estimate(e, {.samples = 4096, .seed = 6, .first = 1 << 20}).state);
    CHECK_THAT(refusal_of([&] { both.merge(read_run(b.path)); }),
               Catch::Contains("samples of seed 5 and of seed 6") && Catch::Contains("one run has one seed"));
  }
}

TEST_CASE("the run of another estimator or seed is refused with a sentence", "[core][checkpoint][exact]") {
  const TemporaryFile file("other_run");
  const auto e = single_term(halves, Geometric(0.6));
  save_run(file.path, estimate(named("gas", e), {.samples = 1000, .seed = 5}).state);
  const RunState read = read_run(file.path);
  CHECK_THAT(refusal_of([&] { extend(e, read, {.samples = 2000}); }), Catch::Contains("the names 'gas' and no name"));
  CHECK_THAT(refusal_of([&] { extend(named("glass", e), read, {.samples = 2000}); }), Catch::Contains("'glass'"));
  CHECK_THAT(refusal_of([&] { extend(single_term(halves, Geometric(0.7)), read, {.samples = 2000}); }),
             Catch::Contains("two different estimators") && Catch::Contains("r=0.7"));
  CHECK_THAT(refusal_of([&] { extend(stratified(named("gas", e), 8), read, {.samples = 2000}); }),
             Catch::Contains("two different estimators") && Catch::Contains("blocks of 8"));
  const auto held = std::make_shared<RunState>(read);
  CHECK_THAT(refusal_of([&] { estimate(named("gas", e), {.samples = 2000, .seed = 6, .earlier = held}); }),
             Catch::Contains("seed 6 and of seed 5"));
  CHECK(refusal_of([&] { estimate(named("gas", e), {.samples = 2000, .seed = 5, .earlier = held}); }) == "accepted");
}

TEST_CASE("a damaged file of a run, one of another version and one of anything else are refused with a sentence",
          "[core][checkpoint][exact]") {
  const TemporaryFile file("bad_run");
  const RunState state = estimate(draw, {.samples = 700, .seed = 5}).state;
  save_run(file.path, state);
  const auto bytes_of_file = [&] {
    std::ifstream in(file.path, std::ios::binary);
    return std::vector<char>{std::istreambuf_iterator<char>(in), {}};
  };
  const auto write = [&](const std::vector<char>& bytes) {
    std::ofstream out(file.path, std::ios::binary | std::ios::trunc);
    out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  };
  const auto read = [&] { read_run(file.path); };
  const std::vector<char> whole = bytes_of_file();
  int accepted = 0;
  int nameless = 0;
  for (std::size_t i = 0; i < whole.size(); i += i < 200 ? 1 : 97) {
    std::vector<char> broken = whole;
    broken[i] = static_cast<char>(broken[i] ^ 0x10);
    write(broken);
    const std::string flipped = refusal_of(read);
    write({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(i)});
    const std::string cut = refusal_of(read);
    accepted += flipped == "accepted" || cut == "accepted";
    nameless += flipped.find("bad_run") == std::string::npos || cut.find("bad_run") == std::string::npos;
  }
  CHECK(accepted == 0);
  CHECK(nameless == 0);
  write({whole.begin(), whole.end() - 20});
  CHECK_THAT(refusal_of(read), Catch::Contains("its record is damaged, or cut short"));
  write({'h', 'e', 'l', 'l', 'o', ' ', 'w', 'o', 'r', 'l', 'd'});
  CHECK_THAT(refusal_of(read), Catch::Contains("does not begin with DEBIASCP"));
  std::vector<char> old = whole;
  old[8] = 3;  // the format before seeds and blocks
  write(old);
  CHECK_THAT(refusal_of(read), Catch::Contains("its format is version 3, not 4"));

  { const PartWriter other(file.path, "version=0.0.9\n", {{"run", encode(state)}}); }
  CHECK_THAT(refusal_of(read), Catch::Contains("written by debias 0.0.9") && Catch::Contains("may draw other samples"));
  { const PartWriter other(file.path, "anything", {{"run", encode(state)}}); }
  CHECK_THAT(refusal_of(read), Catch::Contains("names no version"));
  save_run(file.path, state);  // in place of the other one
  CHECK(encode(read_run(file.path)) == encode(state));
  std::filesystem::remove(file.path);
  CHECK_THROWS_AS(read(), std::system_error);
  CHECK_THROWS_AS(save_run("/dev/full", state), std::system_error);
  CHECK_THROWS_AS(save_run((std::filesystem::temp_directory_path() / "no-such-folder" / "f").string(), state),
                  std::system_error);
}
