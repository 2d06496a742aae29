// The door of the command line: words in, typed requests out, and back again for a checkpoint.

#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "catch_shim.hpp"
#include "cli/requests.hpp"

using namespace debias;
using namespace debias::cli;

namespace {

template <class R>
R read(const std::string& command, const std::vector<std::pair<std::string, std::string>>& typed) {
  Words words = usual_words(command);
  for (const auto& [field, word] : typed) words.values[field] = word;
  return std::get<R>(read_request(command, words));
}

std::string complaint(const std::string& command, const std::vector<std::pair<std::string, std::string>>& typed) {
  Words words = usual_words(command);
  for (const auto& [field, word] : typed) words.values[field] = word;
  try {
    read_request(command, words);
    return "read";
  } catch (const commands::BadRequest& e) {
    return e.spelled(option);
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
}

bool equal(const Saved& a, const Saved& b) {
  return a.command == b.command && a.words.values == b.words.values && a.words.flags == b.words.flags &&
         a.words.names == b.words.names;
}

// A request that is saved is read as itself.
template <class R>
bool survives(const R& request) {
  const Saved once = saved(request);
  return equal(saved(std::get<R>(read_request(once.command, once.words))), once);
}

}  // namespace

TEST_CASE("what nobody types is the default of the request", "[cli][requests][exact]") {
  const auto run = read<commands::RunRequest>("run", {{"problem", "A01"}});
  CHECK(run.problem == &catalog::find("A01"));
  CHECK(!run.shape.estimator);
  CHECK(std::holds_alternative<commands::Declared>(run.shape.pmf));
  CHECK(!run.shape.base_level);
  CHECK(run.shape.block == 1);
  CHECK(!run.sampling.samples);
  CHECK(!run.sampling.goal.asked());
  CHECK(run.sampling.seed == 1);
  CHECK(run.confidence == 0.95);
  CHECK(!run.shard);
  CHECK(read<commands::SurveyRequest>("survey", {{"problem", "A01"}}).samples == commands::SurveyRequest().samples);
  CHECK(read<commands::TradeoffRequest>("tradeoff", {{"problem", "A01"}}).points == commands::TradeoffRequest().points);
  CHECK(read<commands::ValidateRequest>("validate", {}).samples == commands::ValidateRequest().samples);
  CHECK(read<RenderPhotons>("render photons", {}).request.photons == commands::PhotonRequest().photons);
  CHECK(usual_words("render photons").values["photons"] == "4e6");
  CHECK(usual_words("tradeoff").values["samples"] == "1e5");
  CHECK(usual_words("survey").values["levels"] == "10");
}

TEST_CASE("words have types once they are read", "[cli][requests][exact]") {
  const auto run = read<commands::RunRequest>("run", {{"problem", "square-of-mean"},
                                                      {"pmf", "zeta:s=2.5"},
                                                      {"estimator", "single_term_outcome"},
                                                      {"base_level", "3"},
                                                      {"block", "1e1"},
                                                      {"seconds", "2.5s"},
                                                      {"shard", "2/5"},
                                                      {"seed", "18446744073709551615"}});
  CHECK(run.problem->id == "A10");
  CHECK(std::get<AnyPmf>(run.shape.pmf).spec() == "zeta:s=2.5");
  CHECK(run.shape.estimator->method == catalog::Method::single_term_outcome);
  CHECK(run.shape.base_level == 3);
  CHECK(run.shape.block == 10);
  CHECK(run.sampling.goal.seconds == 2.5);
  CHECK(run.shard->index == 2);
  CHECK(run.shard->of == 5);
  CHECK(run.sampling.seed == 18446744073709551615u);
  CHECK(read<commands::RunRequest>("run", {{"problem", "A01"}, {"estimator", "recipe"}}).shape.by_recipe());
  CHECK(read<commands::RunRequest>("run", {{"problem", "A01"}, {"estimator", "ratio_tracking"}})
            .shape.estimator->special == "ratio_tracking");
  CHECK(read<commands::MultilevelRequest>("run", {{"problem", "A01"}, {"estimator", "multilevel"}, {"error", "0.5"}})
            .error == 0.5);
  CHECK(!run.shape.points);
  CHECK(read<commands::RunRequest>("run", {{"problem", "E02"}, {"points", "auto"}}).shape.points == std::nullopt);
  CHECK(read<commands::RunRequest>("run", {{"problem", "E02"}, {"points", "nets"}}).shape.points == Points::nets);
  CHECK(
      read<commands::ReplayRequest>("replay", {{"problem", "E02"}, {"points", "plain"}, {"seed", "1"}, {"sample", "0"}})
          .shape.points == Points::plain);
  CHECK(!read<commands::TradeoffRequest>("tradeoff", {{"problem", "A01"}, {"points", "3"}}).shape.points);
  CHECK(read<RenderTransmittance>("render transmittance", {{"size", "3x4"}}).request.height == 4);
  CHECK(read<commands::TradeoffRequest>("tradeoff", {{"problem", "A01"}, {"family", "poisson"}}).family ==
        commands::Family::poisson);
}

TEST_CASE("a refusal names the option as it is typed, wherever it was found out", "[cli][requests][exact]") {
  CHECK(complaint("run", {{"problem", "A01"}, {"base_level", "-1"}}).rfind("--base-level = '-1' (", 0) == 0);
  CHECK(complaint("run", {{"problem", "A01"}, {"relative_error", "0"}}) == "--relative-error = '0' (must be positive)");
  CHECK(complaint("run", {{"problem", "A01"}, {"estimator", "multilevel"}}) ==
        "--estimator multilevel (takes its draws from --error); write --error 0.01");
  CHECK(complaint("tradeoff", {{"problem", "A01"}, {"family", "geometrc"}}) ==
        "--family = 'geometrc' (write geometric, zeta or poisson); did you mean 'geometric'?");
  CHECK(complaint("run", {{"problem", "A01"}, {"points", "net"}}) ==
        "--points = 'net' (the members of a level are points of nets, or have plain numbers); did you mean 'nets'?");
  CHECK(complaint("validate", {{"samples", "1"}}).rfind("--samples = '1' (has no standard error)", 0) == 0);
  CHECK(complaint("render transmittance", {{"dims", "2x2x2"}}) == "--dims = '2x2x2' (of no volume); add --volume FILE");
}

TEST_CASE("a request that a checkpoint keeps is read as itself", "[cli][requests][exact]") {
  const catalog::Problem& problem = catalog::find("A01");
  using commands::Estimator;
  for (const commands::PmfChoice& pmf :
       std::vector<commands::PmfChoice>{commands::Declared{}, AnyPmf(Geometric(0.1)), AnyPmf(Poisson(1.0 / 3))}) {
    for (const std::int64_t block : {1, 1000, 100'000}) {
      commands::RunRequest r{.problem = &problem, .shape = {.pmf = pmf, .block = block}};
      CHECK(survives(r));
      r.shape.estimator = Estimator{catalog::Method::single_term_outcome};
      r.shape.base_level = 12;
      r.sampling.samples = 123'456'789;
      r.sampling.seed = 18446744073709551615u;
      r.confidence = 0.1 + 0.2;
      r.shard = commands::Shard{3, 7};
      CHECK(survives(r));
      r.shard.reset();
      r.served.relative_error = 1e-300;
      CHECK(survives(r));
      r.doubts = {{WarningCode::no_second_moment, "a = b: c"}, {WarningCode::no_second_moment, ""}};
      CHECK(survives(r));
      r.sampling.samples.reset();
      r.sampling.goal.seconds = 1.0 / 3;
      CHECK(survives(r));
    }
  }
  CHECK(survives(commands::RunRequest{.problem = &catalog::find("B01"),
                                      .shape = {.estimator = Estimator{.special = "ratio_tracking"}}}));
  CHECK(survives(commands::RunRequest{.problem = &problem, .shape = {.estimator = Estimator{.recipe = true}}}));
  for (const Points points : {Points::nets, Points::plain}) {
    commands::RunRequest r{.problem = &problem, .shape = {.points = points}};
    CHECK(survives(r));
    r.shape.estimator = Estimator{.recipe = true};
    CHECK(survives(r));
  }
  CHECK(survives(commands::MultilevelRequest{.problem = &problem, .error = 0.1, .seed = 7}));
  CHECK(survives(commands::ValidateRequest{.problems = {&problem, &catalog::find("E06")}, .samples = 2}));
  CHECK(survives(commands::TradeoffRequest{.problem = &problem, .family = commands::Family::zeta, .points = 3}));
  RenderTransmittance cloud{.density = 1.0 / 7, .volume = "a b=c:d.raw", .dims = {{2, 3, 4}}, .exposure = 0.3};
  cloud.request.method = &commands::transmittance_method("ratio_tracking");
  cloud.request.equal_time = 0.25;
  cloud.request.compare = true;
  CHECK(survives(cloud));
  RenderPhotons lamp;
  lamp.request.sphere = false;
  lamp.request.allow_infinite_mean = true;
  CHECK(survives(lamp));
}

TEST_CASE("threads are no part of what is kept", "[cli][requests][exact]") {
  commands::RunRequest r{.problem = &catalog::find("A01")};
  const Saved one = saved(r);
  r.sampling.threads = 7;
  CHECK(equal(saved(r), one));
  r.sampling.seed = 2;
  CHECK(!equal(saved(r), one));
}
