#pragma once

// Terms of f(A) by Chebyshev polynomials: of traces, quadratic forms, solves, and of log det with its gradient.
//
//   z^T f(A) z = sum_k c_k z^T T_k z,   w_(k+1) = 2 t(A) w_k - w_(k-1),  w_0 = z
//   level j of a quadratic form holds degrees 2 j + 1 and 2 j + 2 for one product (level 0 also degree 0):
//   z^T T_(2k) z = 2 w_k^T w_k - z^T z,  z^T T_(2k+1) z = 2 w_(k+1)^T w_k - z^T w_1
//
//   Notation: c_k, q and kappa of operators/chebyshev.hpp, T_k = T_k(t(A)), t maps [a, b] to [-1, 1].
// All are TermSequences: for `roulette` and for `levels_of`; a probe holds two vectors (three for operators without
// entries in rows), for each column of its kind, allocated once a sample. Differences fall like q^(-2 j) where a product
// brings two degrees, like q^-j in solves and gradients: declared as `rates`. Roulette with the survival ratio q^-2 (q^-1), the
// default, has the best product of variance and work of a geometric PMF; `split_work` of recipe/terms.hpp also chooses how many terms
// to take before it, by the shares of probes and terms in the variance.
// The interval has to hold the spectrum: operators/bounds.hpp.
// Sources: Han, Malioutov, Avron & Shin, SIAM J. Sci. Comput. 39 (2017), a fixed degree; Rhee & Glynn 2015, the roulette.
//
//   Eigen::SparseMatrix<double> a = ...;                                       // symmetric, positive definite
//   const auto terms = debias::log_determinant_spd(a, {.lower = 0.004});       // the nugget or shift
//   std::cout << debias::estimate(debias::roulette(terms), {.samples = 64});

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <debias/core/rates.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/functions/elementary.hpp>
#include <debias/operators/bounds.hpp>
#include <debias/operators/chebyshev.hpp>
#include <debias/operators/probes.hpp>
#include <debias/operators/spectrum.hpp>
#include <debias/operators/symmetric.hpp>

namespace debias {

namespace detail {

/// About a million numbers a chunk, so that the default stays for small operators: a power of two.
inline std::int64_t chunk_of_rows(std::size_t numbers) {
  const std::uint64_t samples = std::bit_floor((std::uint64_t{1} << 20) / (static_cast<std::uint64_t>(numbers) + 1));
  return static_cast<std::int64_t>(std::clamp<std::uint64_t>(samples, 1, 512));
}

/// One given vector in place of a probe.
struct ReadyVector {
  std::shared_ptr<const std::vector<double>> vector;

  [[nodiscard]] static std::size_t columns() { return 1; }
  void draw(std::span<double> z, Stream& /*rng*/) const { std::copy(vector->begin(), vector->end(), z.begin()); }
  [[nodiscard]] static double centre(std::int64_t /*degree*/) { return 0; }
  [[nodiscard]] static double total() { return 0; }
};

/// T_k z and T_(k-1) z of all columns of a probe.
template <SymmetricOperator A>
class ProbePath {
 public:
  template <class Ready>
  ProbePath(const Recurrence<A>& a, const Ready& probes, Stream& rng)
      : a_(&a), current_(a.rows() * probes.columns()), previous_(current_.size()), scratch_(a.scratch_size()) {
    probes.draw(current_, rng);
    length_ = dot(current_, current_);
  }

  /// On by one degree: one product for each column.
  void advance() {
    const std::size_t n = a_->rows();
    products_ = {};
    for (std::size_t first = 0; first < current_.size(); first += n) {
      const std::span<const double> x = std::span(current_).subspan(first, n);
      const std::span<double> y = std::span(previous_).subspan(first, n);
      const StepProducts p = degree_ == 0 ? a_->first(x, y, scratch_) : a_->next(x, y, scratch_);
      products_.cross += p.cross;
      products_.square += p.square;
    }
    current_.swap(previous_);
    if (degree_++ == 0) first_ = products_.cross;
  }

  /// The sum over the columns of z^T T_k z, for 2 degree() - 1 and 2 degree().
  [[nodiscard]] double odd_moment() const { return 2 * products_.cross - first_; }
  [[nodiscard]] double even_moment() const { return 2 * products_.square - length_; }
  [[nodiscard]] double zeroth_moment() const { return length_; }
  [[nodiscard]] std::int64_t degree() const { return degree_; }
  /// T_degree z.
  [[nodiscard]] std::span<const double> current() const { return current_; }

 private:
  const Recurrence<A>* a_;
  std::vector<double> current_;
  std::vector<double> previous_;
  std::vector<double> scratch_;
  StepProducts products_;
  double length_ = 0;
  double first_ = 0;
  std::int64_t degree_ = 0;
};

}  // namespace detail

/// The terms of z^T f(A) z, z from `Ready` probes.
template <SymmetricOperator A, class Ready>
class QuadraticTerms {
 public:
  QuadraticTerms(detail::Recurrence<A> a, ChebyshevSeries series, Ready probes, Spectrum spectrum)
      : rates(series.rates(2)),
        a_(std::move(a)),
        series_(std::move(series)),
        probes_(std::move(probes)),
        spectrum_(std::move(spectrum)) {}

  /// Yields the terms in order; the terms have to outlive it.
  class Cursor {
   public:
    Cursor(const QuadraticTerms& terms, Stream& rng) : terms_(&terms), path_(terms.a_, terms.probes_, rng) {}

    Term<double> operator()() {
      const QuadraticTerms& t = *terms_;
      const double work = static_cast<double>(t.probes_.columns());
      const std::int64_t odd = 2 * path_.degree() + 1;
      if (t.series_.last() && odd > *t.series_.last() && odd > 1) return {0, work};  // nothing can follow
      double value = path_.degree() == 0 ? t.probes_.total() + term(0, path_.zeroth_moment()) : 0;
      path_.advance();
      value += term(odd, path_.odd_moment());
      value += term(odd + 1, path_.even_moment());
      return {value, work};
    }

   private:
    [[nodiscard]] double term(std::int64_t degree, double moment) const {
      return terms_->series_(degree) * (moment - terms_->probes_.centre(degree));
    }

    const QuadraticTerms* terms_;
    detail::ProbePath<A> path_;
  };

  Cursor operator()(Stream& rng) const { return {*this, rng}; }

  /// Samples of a chunk of a run, so that few probes of many rows keep all threads busy.
  [[nodiscard]] std::int64_t chunk() const { return detail::chunk_of_rows(a_.rows() * probes_.columns()); }
  /// The interval of the terms, and what spoke for it.
  [[nodiscard]] const Spectrum& spectrum() const { return spectrum_; }
  [[nodiscard]] const ChebyshevSeries& series() const { return series_; }
  /// Products of one term.
  [[nodiscard]] std::size_t columns() const { return probes_.columns(); }

  Rates rates;

 private:
  detail::Recurrence<A> a_;
  ChebyshevSeries series_;
  Ready probes_;
  Spectrum spectrum_;
};

/// The same for a function whose coefficients end.
template <SymmetricOperator A, class Ready>
class EndingQuadraticTerms : public QuadraticTerms<A, Ready> {
 public:
  explicit EndingQuadraticTerms(QuadraticTerms<A, Ready> terms)
      : QuadraticTerms<A, Ready>(std::move(terms)),
        exact_from(std::max<std::int64_t>(0, (*this->series().last() - 1) / 2)) {}
  std::int64_t exact_from;
};

namespace detail {

template <class F, SymmetricOperator A, class MakeReady>
auto quadratic_terms(const char* name, A a, const F& f, const SpectrumBounds& bounds, const MakeReady& make_ready) {
  HeldOperator<A> held(name, std::move(a));
  Spectrum spectrum = checked_spectrum(name, held, bounds, singular_at_zero<F>);
  ChebyshevSeries series = chebyshev_series(f, spectrum.lower, spectrum.upper);
  Recurrence<A> recurrence(std::move(held), spectrum.lower, spectrum.upper);
  auto ready = make_ready(recurrence, series);
  QuadraticTerms<A, decltype(ready)> terms(std::move(recurrence), std::move(series), std::move(ready),
                                           std::move(spectrum));
  if constexpr (is_users_function<F>) {
    return EndingQuadraticTerms<A, decltype(ready)>(std::move(terms));
  } else {
    return terms;
  }
}

inline std::vector<double> checked_vector(const char* name, const char* what, const Eigen::VectorXd& v,
                                          std::size_t rows) {
  if (static_cast<std::size_t>(v.size()) != rows) {
    refuse_operator(name, std::string(what) + " has " + std::to_string(v.size()) + " components, the operator " +
                              std::to_string(rows) + " rows (must be equal)");
  }
  check_finite(name, what, v);
  return {v.data(), v.data() + v.size()};
}

}  // namespace detail

/// tr f(A) for symmetric A. f: functions::Log, Reciprocal, Sqrt (A positive definite), Exp, or a function of yours that is
/// analytic on the interval of the bounds.
/// Throws std::invalid_argument for operators that are not symmetric or not finite, or not positive definite where f asks for it;
/// for bounds that are missing or refuted; for probes that do not fit.
template <SymmetricOperator A, class F, class Probes = RandomSigns>
requires std::invocable<const F&, double>
auto trace_of_function(A a, const F& f, const SpectrumBounds& bounds = {}, const Probes& probes = {}) {
  return detail::quadratic_terms("trace_of_function", std::move(a), f, bounds,
                                 [&](const auto& recurrence, const ChebyshevSeries& series) {
                                   return detail::ready("trace_of_function", probes, recurrence, series);
                                 });
}

/// log det A of a symmetric positive definite A. Throws as trace_of_function does.
template <SymmetricOperator A, class Probes = RandomSigns>
auto log_determinant_spd(A a, const SpectrumBounds& bounds = {}, const Probes& probes = {}) {
  return detail::quadratic_terms("log_determinant_spd", std::move(a), functions::Log{}, bounds,
                                 [&](const auto& recurrence, const ChebyshevSeries& series) {
                                   return detail::ready("log_determinant_spd", probes, recurrence, series);
                                 });
}

/// z^T f(A) z for one vector z, f as above: b^T A^-1 b with functions::Reciprocal. Only the roulette is random.
/// Throws as trace_of_function does, and for a z that is not finite or does not fit.
template <SymmetricOperator A, class F>
requires std::invocable<const F&, double>
auto quadratic_form(A a, const F& f, const Eigen::VectorXd& z, const SpectrumBounds& bounds = {}) {
  return detail::quadratic_terms("quadratic_form", std::move(a), f, bounds,
                                 [&](const auto& recurrence, const ChebyshevSeries& /*series*/) {
                                   return detail::ReadyVector{std::make_shared<const std::vector<double>>(
                                       detail::checked_vector("quadratic_form", "z", z, recurrence.rows()))};
                                 });
}

/// The terms of <c, A^-1 b>: level j is degree j + 1 (level 0 also degree 0), one product each.
template <SymmetricOperator A>
class SolveTerms {
 public:
  SolveTerms(detail::Recurrence<A> a, ChebyshevSeries series, std::vector<double> b, std::vector<double> c,
             Spectrum spectrum)
      : rates(series.rates(1)),
        a_(std::move(a)),
        series_(std::move(series)),
        b_{std::make_shared<const std::vector<double>>(std::move(b))},
        c_(std::make_shared<const std::vector<double>>(std::move(c))),
        spectrum_(std::move(spectrum)) {}

  /// Yields the terms in order; the terms have to outlive it.
  class Cursor {
   public:
    Cursor(const SolveTerms& terms, Stream& rng) : terms_(&terms), path_(terms.a_, terms.b_, rng) {}

    Term<double> operator()() {
      const SolveTerms& t = *terms_;
      double value = path_.degree() == 0 ? t.series_(0) * detail::dot(*t.c_, path_.current()) : 0;
      path_.advance();
      value += t.series_(path_.degree()) * detail::dot(*t.c_, path_.current());
      return {value};
    }

   private:
    const SolveTerms* terms_;
    detail::ProbePath<A> path_;
  };

  Cursor operator()(Stream& rng) const { return {*this, rng}; }
  [[nodiscard]] std::int64_t chunk() const { return detail::chunk_of_rows(a_.rows()); }
  [[nodiscard]] const Spectrum& spectrum() const { return spectrum_; }

  Rates rates;

 private:
  detail::Recurrence<A> a_;
  ChebyshevSeries series_;
  detail::ReadyVector b_;
  std::shared_ptr<const std::vector<double>> c_;
  Spectrum spectrum_;
};

/// <functional, x> of the solution x of A x = b, A symmetric positive definite: a component of x with a unit vector. Only
/// the roulette is random. Where functional and b are equal, `quadratic_form` takes half the products.
/// Throws as log_determinant_spd does, and for vectors that are not finite or do not fit.
template <SymmetricOperator A>
SolveTerms<A> solve(A a, const Eigen::VectorXd& b, const Eigen::VectorXd& functional,
                    const SpectrumBounds& bounds = {}) {
  detail::HeldOperator<A> held("solve", std::move(a));
  std::vector<double> right = detail::checked_vector("solve", "b", b, held.rows());
  std::vector<double> left = detail::checked_vector("solve", "functional", functional, held.rows());
  Spectrum spectrum = detail::checked_spectrum("solve", held, bounds, true);
  ChebyshevSeries series = ChebyshevSeries::inverse(spectrum.lower, spectrum.upper);
  detail::Recurrence<A> recurrence(std::move(held), spectrum.lower, spectrum.upper);
  return {std::move(recurrence), std::move(series), std::move(right), std::move(left), std::move(spectrum)};
}

/// log det A and its derivatives tr(A^-1 dA/dtheta_i), from the same probes.
///
/// The value is an array: component 0 is log det A, component i the derivative by parameter i; then, for their covariances,
/// the sums of components i and j, i < j, in the order (0, 1), (0, 2), ..., (1, 2), ...: Var(X + Y) - Var X - Var Y is 2 Cov(X, Y).
template <SymmetricOperator A, class Ready, SymmetricOperator... Derivatives>
class GradientTerms {
 public:
  static constexpr int outputs = 1 + static_cast<int>(sizeof...(Derivatives));
  using Value = Eigen::Array<double, outputs*(outputs + 1) / 2, 1>;

  GradientTerms(detail::Recurrence<A> a, Ready probes, Spectrum spectrum,
                detail::HeldOperator<Derivatives>... derivatives)
      : a_(std::move(a)),
        log_(ChebyshevSeries::log(spectrum.lower, spectrum.upper)),
        inverse_(ChebyshevSeries::inverse(spectrum.lower, spectrum.upper)),
        probes_(std::move(probes)),
        spectrum_(std::move(spectrum)),
        derivatives_(std::move(derivatives)...) {
    rates = inverse_.rates(1);
  }

  /// Yields the terms in order; the terms have to outlive it.
  class Cursor {
   public:
    Cursor(const GradientTerms& terms, Stream& rng) : terms_(&terms), path_(terms.a_, terms.probes_, rng) {
      const std::size_t n = terms.a_.rows();
      std::size_t i = 0;
      const auto multiply = [&](const auto& derivative) {
        std::vector<double>& out = images_[i++];
        out.resize(path_.current().size());
        for (std::size_t first = 0; first < out.size(); first += n) {
          derivative.apply(path_.current().subspan(first, n), std::span(out).subspan(first, n));
        }
      };
      std::apply([&](const auto&... derivative) { (multiply(derivative), ...); }, terms.derivatives_);
    }

    Term<Value> operator()() {
      const GradientTerms& t = *terms_;
      Value v = Value::Zero();
      if (path_.degree() == 0) add(v, t.log_(0) * path_.zeroth_moment());
      path_.advance();
      const std::int64_t k = path_.degree();
      v[0] += t.log_(2 * k - 1) * path_.odd_moment() + t.log_(2 * k) * path_.even_moment();
      for (int i = 1; i < outputs; ++i) v[i] += t.inverse_(k) * along(i);
      int at = outputs;
      for (int i = 0; i < outputs; ++i) {
        for (int j = i + 1; j < outputs; ++j) v[at++] = v[i] + v[j];
      }
      // The first sample of a derivative costs a product, too.
      const double products = k == 1 ? static_cast<double>(outputs) : 1;
      return {v, products * static_cast<double>(t.probes_.columns())};
    }

   private:
    void add(Value& v, double log_term) const {
      v[0] += log_term;
      for (int i = 1; i < outputs; ++i) v[i] += terms_->inverse_(0) * along(i);
    }
    [[nodiscard]] double along(int i) const {
      return detail::dot(images_[static_cast<std::size_t>(i - 1)], path_.current());
    }

    const GradientTerms* terms_;
    detail::ProbePath<A> path_;
    std::array<std::vector<double>, sizeof...(Derivatives)> images_;
  };

  Cursor operator()(Stream& rng) const { return {*this, rng}; }
  [[nodiscard]] std::int64_t chunk() const { return detail::chunk_of_rows(a_.rows() * probes_.columns()); }
  [[nodiscard]] const Spectrum& spectrum() const { return spectrum_; }

  Rates rates{};

 private:
  detail::Recurrence<A> a_;
  ChebyshevSeries log_;
  ChebyshevSeries inverse_;
  Ready probes_;
  Spectrum spectrum_;
  std::tuple<detail::HeldOperator<Derivatives>...> derivatives_;
};

/// The covariance of the means of outputs i and j of a run of `log_determinant_gradient`: 0 is log det A, i its derivative by
/// parameter i. Throws std::out_of_range for an output that the result does not have.
template <class Result>
double gradient_covariance(const Result& result, int i, int j) {
  const auto variance = [&](int component) {
    const double error = result.components.at(static_cast<std::size_t>(component)).standard_error;
    return error * error;
  };
  int outputs = 1;
  while (outputs * (outputs + 1) / 2 < static_cast<int>(result.components.size())) ++outputs;
  if (i < 0 || j < 0 || i >= outputs || j >= outputs) {
    throw std::out_of_range("gradient_covariance: outputs " + std::to_string(i) + " and " + std::to_string(j) +
                            " (the result has 0 ... " + std::to_string(outputs - 1) + ")");
  }
  if (i == j) return variance(i);
  const int low = std::min(i, j);
  const int sum = outputs + low * outputs - low * (low + 1) / 2 + std::max(i, j) - low - 1;
  return (variance(sum) - variance(i) - variance(j)) / 2;
}

/// log det A(theta) and its gradient, dA/dtheta_i symmetric operators of the same size: what a Gaussian process maximises by. Probes: all but
/// HutchPlusPlus, whose space is that of one function.
/// Throws as log_determinant_spd does, for A and for the derivatives.
template <SymmetricOperator A, class Probes, SymmetricOperator... Derivatives>
requires(sizeof...(Derivatives) > 0 && !std::same_as<Probes, HutchPlusPlus>) auto log_determinant_gradient(
    A a, const SpectrumBounds& bounds, const Probes& probes, Derivatives... derivatives) {
  constexpr const char* name = "log_determinant_gradient";
  detail::HeldOperator<A> held(name, std::move(a));
  Spectrum spectrum = detail::checked_spectrum(name, held, bounds, true);
  const auto hold = [&](auto derivative) {
    detail::HeldOperator<decltype(derivative)> d(name, std::move(derivative));
    if (d.rows() != held.rows()) {
      detail::refuse_operator(name, "a derivative has " + std::to_string(d.rows()) + " rows, the operator " +
                                        std::to_string(held.rows()) + " (must be equal)");
    }
    detail::check_symmetric(name, d);
    return d;
  };
  std::tuple<detail::HeldOperator<Derivatives>...> all{hold(std::move(derivatives))...};
  detail::Recurrence<A> recurrence(std::move(held), spectrum.lower, spectrum.upper);
  auto ready = detail::ready(name, probes, recurrence, ChebyshevSeries::inverse(spectrum.lower, spectrum.upper));
  return std::apply(
      [&](auto&... d) {
        return GradientTerms<A, decltype(ready), Derivatives...>(std::move(recurrence), std::move(ready),
                                                                 std::move(spectrum), std::move(d)...);
      },
      all);
}

}  // namespace debias
