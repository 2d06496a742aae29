// Samples that a result has already are not drawn again, and a checkpoint of any bytes is read or refused.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
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

#include <debias/core/estimate.hpp>

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
