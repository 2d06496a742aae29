#include "advise.hpp"

#include <ostream>

#include "describe.hpp"
#include "store.hpp"
#include "text.hpp"

namespace debias::commands {

AdviceReport advise(const AdviseRequest& request, const Watch& watch) {
  const catalog::Problem& problem = *request.problem;
  Plan plan = plan_of(request.sampling);
  const Caller caller{watch};
  plan.progress = [&](std::int64_t done) {
    return caller.goes_on(problem.id + ": pilot", static_cast<double>(done), 0);
  };
  return {&problem, debias::advise(levels_of(problem), plan, recipe_of(request.shape, problem))};
}

void print(std::ostream& out, const AdviceReport& a, bool full) {
  print_line(out, "problem", title(*a.problem));
  full ? print_full(out, a.advice) : void(out << a.advice);
}

Fields fields(const AdviceReport& report) {
  const Advice& a = report.advice;
  Fields f = describe(*report.problem);
  append(f, {{"seed", a.survey.seed},
             {"pmf", a.pmf.spec()},
             {"base_level", a.base_level},
             {"base", a.base == Base::one_outcome ? "one_outcome" : "every_sample"},
             {"block", a.block}});
  append(f, describe(a));
  append(f, versions());
  return f;
}

}  // namespace debias::commands
