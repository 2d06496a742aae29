// Commands without a door: requests made here, reports read here.

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <tuple>
#include <vector>

#include "catch_shim.hpp"
#include "commands/advise.hpp"
#include "commands/describe.hpp"
#include "commands/multilevel.hpp"
#include "commands/replay.hpp"
#include "commands/run.hpp"
#include "commands/survey.hpp"
#include "commands/tradeoff.hpp"
#include "commands/validate.hpp"
#include "validation/bits.hpp"

using namespace debias;
using namespace debias::commands;

namespace {

const catalog::Problem& problem() { return catalog::find("A10"); }

template <class F>
std::string refusal(const F& f) {
  try {
    f();
    return "accepted";
  } catch (const BadRequest& e) {
    return e.what();
  }
}

struct Memory final : Store {
  std::map<std::string, Bytes> parts;
  const Bytes* held(const std::string& part) const override {
    const auto at = parts.find(part);
    return at == parts.end() ? nullptr : &at->second;
  }
  bool due() const override { return true; }
  void keep(const std::string& part, Bytes contents) override { parts[part] = std::move(contents); }
};

}  // namespace

TEST_CASE("a request with defaults alone runs a problem as its declared rates ask", "[commands][exact]") {
  const RunReport report = run({.problem = &problem(), .sampling = {.samples = 2000, .seed = 3}});
  const Statistics expected = problem().run({.pmf = catalog::default_pmf(problem())}, {.samples = 2000, .seed = 3});
  CHECK(validation::bits_of(report.statistics) == validation::bits_of(expected));
  CHECK(std::abs(report.z) < 4.5);
}

TEST_CASE("a refusal names fields, and each door spells them", "[commands][exact]") {
  const BadRequest e({Field{"base_level"}, " = '1'; leave ", Field{"pmf"}, " out of base_level"});
  CHECK(std::string(e.what()) == "base_level = '1'; leave pmf out of base_level");
  CHECK(e.spelled([](std::string_view f) { return "<" + std::string(f) + ">"; }) ==
        "<base_level> = '1'; leave <pmf> out of base_level");
}

TEST_CASE("fields that do not go together are refused, whoever asks", "[commands][exact]") {
  const commands::Estimator truncated{catalog::Method::truncated};
  CHECK(refusal([&] {
          run({.problem = &problem(), .shape = {.estimator = truncated, .pmf = AnyPmf(Zeta(2.0))}});
        }).find("truncated draws no level") != std::string::npos);
  CHECK(refusal([&] {
          run({.problem = &problem(), .sampling = {.samples = 10, .goal = {.error = 1}}});
        }).find("a goal fixes the samples") != std::string::npos);
  CHECK(refusal([&] {
          run({.problem = &problem(), .sampling = {.goal = {.error = 1, .seconds = 1}}});
        }).find("more than one") != std::string::npos);
  CHECK(refusal([&] { tradeoff({.problem = &problem(), .shape = {.estimator = truncated}}); }).find("a sweep is for") !=
        std::string::npos);
  CHECK(refusal([&] { advise({.problem = &problem(), .shape = {.block = 4}}); }).find("a recipe chooses it") !=
        std::string::npos);
  const commands::Estimator by_recipe{.recipe = true};
  for (const Shape& shape :
       {Shape{.pmf = AnyPmf(Zeta(2.0))}, Shape{.estimator = by_recipe, .pmf = AnyPmf(Zeta(2.0))}}) {
    CHECK(refusal([&] { advise({.problem = &problem(), .shape = shape}); }) ==
          "pmf = 'zeta:s=2' (a recipe chooses it); leave it out");
  }
  CHECK(refusal([&] { advise({.problem = &problem(), .shape = {.estimator = truncated}}); }).find("a recipe is for") !=
        std::string::npos);
  CHECK(refusal([&] { replay({.problem = &problem(), .shape = {.estimator = by_recipe}}); }).find("has printed") !=
        std::string::npos);
  CHECK(refusal([&] { tradeoff({.problem = &problem(), .shape = {.estimator = by_recipe}}); }).find("a sweep is for") !=
        std::string::npos);
  CHECK(refusal([&] { validate({.samples = 1}); }).find("has no standard error") != std::string::npos);
  CHECK(refusal([&] { multilevel_of({.problem = &problem()}); }).find("takes its draws from error") !=
        std::string::npos);
}

TEST_CASE("a run that is kept half way and extended has the bits of the whole", "[commands][exact]") {
  const RunRequest asked{.problem = &problem(), .sampling = {.samples = 6000, .seed = 5}};
  KeptRun kept;
  run(asked, {}, {}, [&](const RunRequest& now, const RunState& sums) {
    kept = {now, std::make_shared<RunState>(sums)};
  });
  CHECK(kept.request.sampling.samples == 6000);
  const auto [longer, earlier] = extended({.kept = kept, .samples = 10'000});
  const RunReport grown = run(longer, {}, earlier);
  RunRequest whole = asked;
  whole.sampling.samples = 10'000;
  CHECK(validation::bits_of(grown.statistics) == validation::bits_of(run(whole).statistics));
  CHECK(refusal([&] { extended({.kept = kept, .samples = 100}); }).find("none is thrown away") != std::string::npos);
}

// Shard 3 of 2 drew samples outside the run, and 1 of 0 divided by zero, where a door did not look itself.
TEST_CASE("a shard that does not exist is refused, whoever asks", "[commands][exact]") {
  const auto most = std::numeric_limits<std::int64_t>::max();
  for (const Shard shard : {Shard{3, 2}, Shard{0, 2}, Shard{-1, 2}, Shard{1, 0}, Shard{1, -2}, Shard{-1, -1},
                            Shard{1, Shard::most + 1}, Shard{most, most}, Shard{-most - 1, -most - 1}}) {
    const RunRequest asked{.problem = &problem(), .sampling = {.samples = 20'000}, .shard = shard};
    INFO(shard.index << "/" << shard.of);
    CHECK_THAT(refusal([&] { run(asked); }), Catch::StartsWith("shard = '") && Catch::Contains("must be one of 1/n"));
    CHECK_THAT(refusal([&] { settled(asked); }), Catch::Contains("must be one of 1/n"));
  }
  const RunRequest to_a_goal{.problem = &problem(), .sampling = {.goal = {.error = 0.1}}, .shard = Shard{1, 2}};
  CHECK_THAT(refusal([&] { run(to_a_goal); }), Catch::StartsWith("shard (a goal fixes the samples late"));
}

// --samples 20000 --block 1099511627776 drew 10^12 samples: one block.
TEST_CASE("a block of more than the samples is refused, but not one that a PMF or a recipe brings",
          "[commands][exact]") {
  const std::string why = "(samples come in whole blocks, and are only 1000); take a smaller one, or more samples";
  for (const std::int64_t block : {std::int64_t{1} << 40, std::int64_t{1001}}) {
    const RunRequest asked{.problem = &problem(), .shape = {.block = block}, .sampling = {.samples = 1000}};
    const std::string refused = "block = '" + std::to_string(block) + "' " + why;
    CHECK(refusal([&] { run(asked); }) == refused);
    CHECK(refusal([&] { settled(asked); }) == refused);
    CHECK(refusal([&] { tradeoff({.problem = &problem(), .shape = {.block = block}, .samples = 1000}); }) == refused);
  }
  CHECK(run({.problem = &problem(), .shape = {.block = 1000}, .sampling = {.samples = 1000}}).statistics.blocks == 1);

  const commands::Estimator outcome{.method = catalog::Method::single_term_outcome};
  const commands::Estimator by_recipe{.recipe = true};
  const std::string dyadic = "dyadic:10,8,5;theta=1.25";
  for (const Shape& shape : {Shape{.estimator = outcome, .pmf = AnyPmf::parse(dyadic), .points = Points::nets},
                             Shape{.estimator = by_recipe}}) {
    RunRequest asked{.problem = &problem(), .shape = shape, .sampling = {.samples = 1}};
    RunRequest now;
    const RunReport report = run(asked, {}, {}, [&](const RunRequest& kept, const RunState&) { now = kept; });
    CHECK(now.sampling.samples == report.statistics.samples);
    CHECK(run(now).statistics.components.front().mean == report.statistics.components.front().mean);  // not refused
    CHECK(refusal([&] { run(settled(asked)); }) == "accepted");
  }
}

TEST_CASE("what a recipe has chosen is what is kept of it", "[commands][exact]") {
  RunRequest now;
  const RunReport report = run({.problem = &problem(),
                                .shape = {.estimator = commands::Estimator{.recipe = true}},
                                .sampling = {.samples = 20'000}},
                               {}, {}, [&](const RunRequest& kept, const RunState&) { now = kept; });
  REQUIRE(report.advice);
  CHECK(std::get<AnyPmf>(now.shape.pmf).spec() == report.advice->pmf.spec());
  CHECK(now.shape.block == report.advice->block);
  const Statistics again = run(now).statistics;  // without the pilot, whose work counts in the report
  CHECK(again.components.front().mean == report.statistics.components.front().mean);
  CHECK(again.components.front().standard_error == report.statistics.components.front().standard_error);
  CHECK(again.samples == report.statistics.samples);
}

TEST_CASE("shards join to the whole, and only to it", "[commands][exact]") {
  MergeRequest shards;
  shards.same = [](const RunRequest& a, const RunRequest& b) { return a.sampling.seed == b.sampling.seed; };
  RunRequest asked{.problem = &problem(), .sampling = {.samples = 5000}};
  for (const std::int64_t i : {2, 1}) {
    RunRequest part = asked;
    part.shard = Shard{i, 2};
    KeptRun kept;
    run(settled(part), {}, {}, [&](const RunRequest& now, const RunState& sums) {
      kept = {now, std::make_shared<RunState>(sums)};
    });
    shards.shards.emplace_back("part " + std::to_string(i), kept);
  }
  const KeptRun whole = merged(shards);
  CHECK(validation::bits_of(run(whole.request, {}, {whole.sums}).statistics) ==
        validation::bits_of(run(settled(asked)).statistics));
  MergeRequest one = shards;
  one.shards.pop_back();
  CHECK_THROWS_AS(merged(one), BadPart);
  shards.shards[1].second.request.sampling.seed = 2;
  CHECK_THROWS_AS(merged(shards), BadPart);
}

TEST_CASE("samples are members at the doors: run, resume, shards, sweep and replay", "[commands][exact]") {
  const Shape strata{.pmf = AnyPmf(Geometric(0.6)), .block = 64};
  // One thread: of several, the others may draw all ten chunks before the one that tells has its first.
  RunRequest asked{.problem = &problem(), .shape = strata, .sampling = {.samples = 10'000, .seed = 5, .threads = 1}};
  double told = 0;
  double total = 0;
  const RunReport whole = run(asked, [&](std::string_view, double done, double all) {
    told = done;
    total = all;
    return true;
  });
  const Statistics& s = whole.statistics;
  CHECK(s.samples == 10'048);
  CHECK(s.blocks == 157);
  CHECK(s.block == 64);
  CHECK(total == 10'048);
  CHECK(told <= total);
  const std::string json = to_json(whole);
  for (const char* field : {"\"samples\": 10048", "\"blocks\": 157", "\"block\": 64"}) {
    CHECK_THAT(json, Catch::Contains(field));
  }
  std::ostringstream text;
  print(text, whole);
  CHECK_THAT(text.str(), Catch::Contains("10048 in 157 blocks of 64, seed 5"));

  KeptRun kept;
  RunRequest half = asked;
  half.sampling.samples = 4000;
  run(half, {}, {}, [&](const RunRequest& now, const RunState& sums) {
    kept = {now, std::make_shared<RunState>(sums)};
  });
  CHECK(kept.sums->last() == 4032);
  const auto [longer, earlier] = extended({.kept = kept, .samples = 10'000});
  CHECK(validation::bits_of(run(longer, {}, earlier).statistics) == validation::bits_of(s));
  CHECK(extended({.kept = kept, .samples = 4000}).first.sampling.samples == 4000);
  CHECK(refusal([&] { extended({.kept = kept, .samples = 3968}); }).find("holds 4032 samples") != std::string::npos);

  MergeRequest shards;
  shards.same = [](const RunRequest&, const RunRequest&) { return true; };
  for (const std::int64_t i : {3, 1, 2}) {
    RunRequest part = asked;
    part.shard = Shard{i, 3};
    run(settled(part), {}, {}, [&](const RunRequest& now, const RunState& sums) {
      kept = {now, std::make_shared<RunState>(sums)};
    });
    CHECK(kept.sums->first() % 1024 == 0);
    shards.shards.emplace_back("part " + std::to_string(i), kept);
  }
  const KeptRun joined = merged(shards);
  CHECK(validation::bits_of(run(joined.request, {}, {joined.sums}).statistics) == validation::bits_of(s));
  asked.shard = Shard{20, 20};
  CHECK(refusal([&] { settled(asked); }).find("10048 samples are only 10 chunks of 1024") != std::string::npos);

  const LargeSample& largest = s.largest.front();
  const ReplayReport again = replay({&problem(), strata, 5, largest.index + 13});
  CHECK(again.trace.sample.value == largest.value);
  CHECK(again.trace.member == 13);
  std::ostringstream replayed;
  print(replayed, again);
  CHECK_THAT(replayed.str(),
             Catch::Contains("block " + std::string(8, ' ') + std::to_string(largest.index / 64) + ", samples ") &&
                 Catch::Contains("this one is member 13"));

  const TradeoffReport sweep = tradeoff({.problem = &problem(), .points = 3, .shape = {.block = 16}, .samples = 4000});
  bool measured = false;
  for (const TradeoffPoint& p : sweep.points) {
    if (!p.measured) continue;
    measured = true;
    const Statistics one = problem().run(
        {sweep.form.base == Base::every_sample ? catalog::Method::single_term : catalog::Method::single_term_outcome,
         p.pmf, sweep.form.base_level, "", 16},
        {.samples = 4000});
    CHECK(p.variance == one.components[0].variance);
    CHECK(p.work == one.work_per_sample());
  }
  CHECK(measured);
}

TEST_CASE("a caller that ends a sweep gets its finished points, and takes them up again", "[commands][exact]") {
  // One thread: of several, the others may draw all chunks before the one that tells has its first.
  const TradeoffRequest request{.problem = &problem(), .points = 3, .samples = 4000, .threads = 1};
  const TradeoffReport whole = tradeoff(request);
  Memory memory;
  const auto until_third = [](std::string_view what, double, double) {
    return what.find("point 3") == std::string_view::npos;
  };
  const TradeoffReport part = tradeoff(request, {until_third, &memory});
  CHECK(!part.complete);
  REQUIRE(part.points.size() == 2);
  const TradeoffReport resumed = tradeoff(request, {{}, &memory});
  REQUIRE(resumed.points.size() == 3);
  CHECK(resumed.complete);
  for (std::size_t i = 0; i < 3; ++i) CHECK(resumed.points[i].variance == whole.points[i].variance);
  memory.parts.begin()->second.pop_back();
  CHECK_THROWS_AS(tradeoff(request, {{}, &memory}), BadPart);
}

TEST_CASE("JSON has null for what is not finite, and the digits of every double", "[commands][exact]") {
  const double infinity = std::numeric_limits<double>::infinity();
  const Fields f = {{"x", infinity},
                    {"y", 0.1},
                    {"n", std::uint64_t{18446744073709551615u}},
                    {"text", "\xff"},
                    {"list", List{true, nullptr, 5.0}}};
  CHECK(json_line(f) ==
        "{\"x\":null,\"y\":0.1,\"n\":18446744073709551615,\"text\":\"\xef\xbf\xbd\",\"list\":[true,null,5.0]}");
}

TEST_CASE("the full text of a report holds more than the brief one, and JSON does not depend on it",
          "[commands][exact]") {
  const auto lines = [](const auto& report, bool full) {
    std::ostringstream text;
    print(text, report, full);
    const std::string all = text.str();
    return std::count(all.begin(), all.end(), '\n');
  };
  const auto longer = [&](const auto& report) { return lines(report, true) > lines(report, false); };
  const RunReport by_recipe = run({.problem = &problem(),
                                   .shape = {.estimator = commands::Estimator{.recipe = true}},
                                   .sampling = {.samples = 20'000}});
  CHECK(lines(by_recipe, false) <= 8 + std::ssize(by_recipe.statistics.warnings));
  CHECK(longer(by_recipe));
  CHECK(longer(run({.problem = &problem(), .sampling = {.samples = 1000}})));
  CHECK(longer(survey({.problem = &problem(), .levels = 4, .samples = 100})));
  CHECK(longer(advise({.problem = &problem(), .sampling = {.samples = 1000}})));
  CHECK(longer(multilevel({.problem = &problem(), .error = 0.1})));
  for (const char* key : {"\"evidence\"", "\"levels\"", "\"upper_tail\"", "\"reasons\"", "\"largest\"", "\"recipe\""}) {
    CHECK(to_json(by_recipe).find(key) != std::string::npos);
  }
}

TEST_CASE("a warning in JSON has a code and a text", "[commands][exact]") {
  CHECK(json_line(std::vector<Warning>{{WarningCode::coupling, "wrong."}, {WarningCode::few_draws, "few."}}) ==
        R"([{"code":"coupling","text":"wrong."},{"code":"few_draws","text":"few."}])");
  const RunReport one = run({.problem = &problem(), .sampling = {.samples = 1}});
  CHECK(to_json(one).find(R"("code": "one_sample")") != std::string::npos);
}

// Readers of JSON and of Python's `warnings` did not see what a recipe doubts, nor did whoever resumed a run.
TEST_CASE("what a recipe doubts is said by its run, and by all that it becomes", "[commands][exact]") {
  const std::vector<Warning> doubts = {{WarningCode::declared_rates, "of the first levels"},
                                       {WarningCode::declared_rates, "of the last"},
                                       {WarningCode::one_sample, "which the run says itself"}};
  const auto said = [&](const RunRequest& request, const Earlier& earlier = {}) {
    const RunReport report = run(request, {}, earlier);
    std::ostringstream text;
    print(text, report);
    const Fields all = fields(report);
    const auto warnings =
        std::find_if(all.begin(), all.end(), [](const auto& field) { return field.name == "warnings"; });
    REQUIRE(warnings != all.end());
    const std::string json = pretty_json(Fields{*warnings});
    for (const Warning& warning : report.statistics.warnings) {
      CHECK_THAT(text.str(), Catch::Contains(warning.text));
      CHECK_THAT(json, Catch::Contains(warning.text));
    }
    return report.statistics.warnings;
  };
  RunRequest request{.problem = &problem(), .sampling = {.samples = 1}, .doubts = doubts};
  std::vector<Warning> all = said(request);
  REQUIRE(all.size() == 3);
  CHECK(all[0].code == WarningCode::one_sample);
  CHECK(all[0].text != doubts[2].text);
  CHECK(std::vector<Warning>(all.begin() + 1, all.end()) == std::vector<Warning>(doubts.begin(), doubts.begin() + 2));

  request.sampling.samples = 5000;
  KeptRun kept;
  run(request, {}, {}, [&](const RunRequest& now, const RunState& sums) {
    kept = {now, std::make_shared<RunState>(sums)};
  });
  CHECK(kept.request.doubts == doubts);
  for (const ResumeRequest& resumed : {ResumeRequest{.kept = kept}, ResumeRequest{.kept = kept, .samples = 6000},
                                       ResumeRequest{.kept = kept, .goal = {.error = 0.01}}}) {
    const auto [longer, earlier] = extended(resumed);
    CHECK(said(longer, earlier) == doubts);
  }

  MergeRequest shards;
  shards.same = [](const RunRequest& a, const RunRequest& b) { return a.doubts == b.doubts; };
  for (const std::int64_t i : {1, 2}) {
    RunRequest part = request;
    part.shard = Shard{i, 2};
    if (i == 2) part.doubts = {doubts[1], {WarningCode::unexplained_time, "by the clock of one shard"}};
    run(part, {}, {}, [&](const RunRequest& now, const RunState& sums) {
      shards.shards.emplace_back("part", KeptRun{now, std::make_shared<RunState>(sums)});
    });
  }
  const KeptRun whole = merged(shards);
  std::vector<Warning> both = doubts;
  both.push_back(shards.shards[1].second.request.doubts[1]);
  CHECK(said(whole.request, {whole.sums}) == both);
}

TEST_CASE("a run by a recipe keeps what the recipe doubts", "[commands][exact]") {
  for (const auto& [name, seed, doubt] :
       {std::tuple("A08", 1, WarningCode::no_second_moment), {"I05", 1, WarningCode::declared_rates}}) {
    INFO(name);
    KeptRun kept;
    const RunReport report = run({.problem = &catalog::find(name),
                                  .shape = {.estimator = commands::Estimator{.recipe = true}},
                                  .sampling = {.samples = 20'000, .seed = static_cast<std::uint64_t>(seed)}},
                                 {}, {}, [&](const RunRequest& now, const RunState& sums) {
                                   kept = {now, std::make_shared<RunState>(sums)};
                                 });
    REQUIRE(kept.request.doubts.size() == 1);
    CHECK(kept.request.doubts[0].code == doubt);
    const auto [request, earlier] = extended({.kept = kept});
    const std::vector<Warning> again = run(request, {}, earlier).statistics.warnings;
    CHECK(again == report.statistics.warnings);
    CHECK(std::any_of(again.begin(), again.end(), [doubt = doubt](const Warning& w) { return w.code == doubt; }));
  }
}

TEST_CASE("no PMF is another refusal than a request that cannot be done", "[commands][exact]") {
  const auto refused = [](const RunRequest& request) -> std::optional<NoPmfError> {
    try {
      run(request);
    } catch (const NoPmfError& e) {
      return e;
    } catch (const std::invalid_argument&) {
    }
    return std::nullopt;
  };
  for (const char* id : {"E06", "C12"}) {
    const catalog::Problem& none = catalog::find(id);
    const std::optional<NoPmfError> declared = refused({.problem = &none, .sampling = {.samples = 100}});
    REQUIRE(declared);
    CHECK(declared->grade() == NoPmfError::Grade::declared);
    CHECK(declared->variance_decay().value == none.rates.variance_decay);
    CHECK(json_line(describe(*declared)).find(R"("variance_decay_error":null)") != std::string::npos);
  }
  RunRequest typo{.problem = &problem(), .sampling = {.samples = 100}};
  typo.shape.block = 4;
  typo.shape.estimator = commands::Estimator{catalog::Method::independent_sum};
  CHECK_FALSE(refused(typo));
  CHECK_THROWS_AS(run(typo), BadRequest);
}

TEST_CASE("each report has a text and fields", "[commands][exact]") {
  const auto said = [](const auto& report) {
    std::ostringstream text;
    print(text, report);
    return text.str().find("A10 square-of-mean") != std::string::npos &&
           to_json(report).find("\"id\": \"A10\"") != std::string::npos;
  };
  CHECK(said(run({.problem = &problem(), .sampling = {.samples = 100}})));
  CHECK(said(survey({.problem = &problem(), .levels = 3, .samples = 100})));
  CHECK(said(replay({.problem = &problem(), .sample = 7})));
  CHECK(said(advise({.problem = &problem(), .sampling = {.samples = 1000}})));
  CHECK(said(multilevel({.problem = &problem(), .error = 0.1})));
}
