// Commands that draw, print and end: list, replay, survey, tradeoff.

#include <cmath>

#include "commands/pictures.hpp"
#include "core/text.hpp"
#include "execute.hpp"
#include "session.hpp"

namespace debias::cli {

int execute(const commands::ListRequest& request, const Delivery& delivery) {
  Output out;
  deliver(commands::list(request), delivery, out);
  return done;
}

int execute(const commands::ReplayRequest& request, const Delivery& delivery) {
  const commands::ReplayReport report = commands::replay(request);
  Output out;
  deliver(report, delivery, out);
  if (std::isfinite(report.trace.sample.value)) return done;
  complain("the sample is not finite");
  return nonfinite_samples;
}

int execute(const commands::SurveyRequest& request, const Delivery& delivery) {
  Output out(delivery.output);
  Picture plot(delivery.plot, delivery.output);
  Progress progress(delivery.quiet);
  const commands::SurveyReport report = commands::survey(request, watch_samples(progress));
  progress.erase();
  if (plot) plot.write(commands::picture(report));
  deliver(report, delivery, out);
  if (!interrupted()) return done;
  complain("interrupted; what is complete is printed");
  return interrupted_by_signal;
}

int execute(const commands::TradeoffRequest& request, const Delivery& delivery) {
  if (delivery.json && delivery.csv) throw std::invalid_argument("--json, --csv: both (keep one)");
  keep_apart(delivery.plot, delivery.checkpoint, "--plot");
  Session session(saved(request), delivery);
  Output out(delivery.output);
  Picture plot(delivery.plot, delivery.output);
  Progress progress(delivery.quiet);
  const commands::Caller caller = session.caller(watch_samples(progress));
  const commands::TradeoffReport report = session.guard([&] { return commands::tradeoff(request, caller); });
  progress.erase();
  report.complete ? session.flush() : session.suspend();
  if (plot) plot.write(commands::picture(report));
  if (delivery.csv) {
    print_csv(out.stream(), report);
    out.flush();
  } else {
    deliver(report, delivery, out);
  }
  if (report.complete) return done;
  complain("interrupted; " + std::to_string(report.points.size()) + " of " + counted(request.points, "point") +
           are(std::ssize(report.points)) + " complete");
  return interrupted_by_signal;
}

}  // namespace debias::cli
