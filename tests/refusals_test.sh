#!/bin/sh
# The mistakes that a person makes first do not compile, and one sentence says why, by g++ and by clang++ where it is.
# sh tests/refusals_test.sh [PROGRAM, which it does not need]
set -eu
root=$(CDPATH= cd -- "$(dirname -- "$0")/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
: > "$work/cases"

printf '%s\n' '#include <debias/debias.hpp>' '#include <iostream>' '#include <random>' \
  'using namespace debias;' > "$work/all.hpp"

# refused WORDS CODE: the function body CODE has exactly one error, a sentence of debias with these words.
# accepted CODE: it compiles.
refused() { printf '%s\t%s\n' "$1" "$2" >> "$work/cases"; }
accepted() { printf '\t%s\n' "$1" >> "$work/cases"; }

eigen=/usr/include/eigen3
by_value='takes its Stream by value'
mutable='is mutable'
seq='auto seq = [](std::int64_t level, Stream& rng) { const double u = rng.uniform(); if (level == 0) return base(u); return coupled(u, u / 2); };'
x='auto x = [](Stream& rng) { return 1 + rng.uniform(); };'
terms='auto terms = [](Stream& rng) { return [&rng, w = 1.0]() mutable { return Term<double>{w *= rng.uniform()}; }; };'

# ---- what must compile: the right form of what follows
accepted "$seq std::cout << estimate(single_term(seq, Geometric(0.5)), {.samples = 10});"
accepted "$seq std::cout << estimate(recipe(seq)) << survey(seq, 3) << multilevel(seq, 0.1);"
accepted "$seq const SingleTermOptions o{.base_level = 1}; std::cout << estimate(single_term(seq, Geometric(0.5), o));"
accepted "$x const SingleTermOptions o{.base_level = 1}; std::cout << estimate(single_term(reciprocal(x), o));"
accepted "$terms std::cout << estimate(roulette(terms, Geometric(0.5), {.base_level = 1})) << estimate(single_term(levels_of(terms), Geometric(0.5)));"
accepted 'std::cout << estimate(single_term([](auto level, auto& rng) { return base(static_cast<double>(level) + rng.uniform()); }, Zeta(2.5)));'
accepted 'std::cout << estimate(single_term([](const int& level, Stream& rng) { return base(level + rng.uniform()); }, Zeta(2.5)));'
accepted 'std::cout << estimate([](Stream& rng, auto& record) { record.base(0, 1.0, 1.0); return Sample<float>{static_cast<float>(rng.uniform())}; });'
accepted 'std::cout << estimate(reciprocal_trials([](Stream& rng) { Stream again(rng); return (rng.uniform() + again.uniform()) / 2; }, 1));'
accepted 'base<double>(1); coupled<double>(1, 2); base(1.0f, 3); coupled(1.0, 2.0, 4);'
accepted 'std::cout << estimate([](Stream& rng) { return std::gamma_distribution<>(2, 1)(rng); }); static_assert(std::uniform_random_bit_generator<Stream>);'
accepted 'std::vector<Stream> all; all.emplace_back(1, 2); Stream one(all[0]); one = Stream(all[0]); one = one.split(3);'

accepted 'std::cout << estimate(single_term(function_of_integral([](std::span<const double> x) { return x[0] + x[1]; }, Cube(2), functions::Exp{})));'

# ---- a stream by value: at every door that takes a callable of a stream
refused "$by_value" 'std::cout << estimate([](debias::Stream rng) { return rng.uniform(); });'
refused "$by_value" 'std::cout << estimate([](auto rng) { return rng.uniform(); });'
refused "$by_value" 'std::cout << estimate([](Stream rng, auto& record) { record.base(0, 1.0, 1.0); return Sample<double>{rng.uniform()}; });'
refused "$by_value" 'double (*f)(Stream) = nullptr; std::cout << estimate(f);'
refused "$by_value" 'std::function<double(Stream)> f; std::cout << estimate(single_term(reciprocal(f)));'
refused "$by_value" 'struct X { double operator()(Stream rng) const { return rng.uniform(); } }; trace(X{}, 1, 2);'
refused "$by_value" 'std::cout << estimate(single_term([](std::int64_t, Stream rng) { return base(rng.uniform()); }, Geometric(0.5)));'
refused "$by_value" 'std::cout << estimate(single_term([](auto, auto rng) { return base(rng.uniform()); }, Geometric(0.5), {.base_level = 1}));'
refused "$by_value" 'std::cout << estimate(recipe([](int, const Stream rng) { return base(Stream(rng).uniform()); }));'
refused "$by_value" 'std::cout << survey([](int, Stream rng) { return base(rng.uniform()); }, 5);'
refused "$by_value" 'std::cout << multilevel([](int, Stream rng) { return base(rng.uniform()); }, 0.1);'
refused "$by_value" 'std::cout << estimate(independent_sum([](int, Stream rng) { return base(rng.uniform()); }, Geometric(0.5)));'
refused "$by_value" 'std::cout << estimate(progressive([](int, Stream rng) { return base(rng.uniform()); }, Geometric(0.5)));'
refused "$by_value" 'std::cout << estimate(biased_progressive([](int, Stream rng) { return base(rng.uniform()); }));'
refused "$by_value" 'std::cout << estimate(truncated([](int, Stream rng) { return base(rng.uniform()); }, 3));'
refused "$by_value" 'std::cout << estimate(roulette([](Stream rng) { return [rng = std::move(rng)]() mutable { return Term<double>{rng.uniform()}; }; }, Geometric(0.5)));'
refused "$by_value" 'levels_of([](auto rng) { return [s = Stream(rng)]() mutable { return Term<double>{s.uniform()}; }; });'
refused "$by_value" 'std::cout << estimate(single_term(function_of_mean([](auto rng) { return rng.uniform(); }, functions::Log{})));'
refused "$by_value" 'clamped_reciprocal([](Stream rng) { return rng.uniform(); });'
refused "$by_value" 'reciprocal_series([](Stream rng) { return rng.uniform(); }, 1.0);'
refused "$by_value" 'reciprocal_trials([](Stream rng) { return rng.uniform(); }, 1);'
refused "$by_value" 'reciprocal_product([](Stream rng) { return rng.uniform(); }, 1, 0.5);'
refused "$by_value" 'reciprocal_residual([](Stream rng) { return 1 + rng.uniform(); }, 1, 2);'
refused "$by_value" 'taylor([](Stream rng) { return rng.uniform(); }, functions::Exp{}, 0.5);'
refused "$by_value" 'taylor_sum([](Stream rng) { return rng.uniform(); }, functions::Exp{}, 0.5, Geometric(0.5));'
refused "$by_value" 'nested([](Stream rng) { return rng.uniform(); }, [](double y, Stream& rng) { return y + rng.uniform(); }, functions::Exp{});'
refused "$by_value" 'nested([](Stream& rng) { return rng.uniform(); }, [](double y, Stream rng) { return y + rng.uniform(); }, functions::Exp{});'
refused "$by_value" 'nested([](Stream& rng) { return rng.uniform(); }, estimated([](double) { return [](Stream rng) { return rng.uniform(); }; }), functions::Exp{});'
refused "$by_value" 'std::cout << estimate(single_term(finite_difference([](double a, Stream rng) { return a * rng.uniform(); }, 1.0)));'
refused "$by_value" 'complex_step([](auto z, Stream rng) { return z * rng.uniform(); }, 1.0);'
refused "$by_value" 'series([](std::int64_t, Stream rng) { return rng.uniform(); });'
refused "$by_value" 'series([](std::int64_t, Stream rng) { return rng.uniform(); }, geometric_terms(0.5));'
refused "$by_value" 'path_series([](Stream& rng) { return rng.uniform(); }, [](double s, Stream rng) { return s * rng.uniform(); }, [](double s) { return s; }, geometric_terms(0.5));'
refused "$by_value" 'steady_state([](double s, Stream rng) { return s / 2 + rng.normal(); }, 0.0, [](double s) { return s; }, contraction(0.5));'
refused "$by_value" 'photon_levels([](Stream rng) { return Photon{rng.uniform(), 1}; }, GeometricRadii{});'
refused "$by_value" 'progressive_photons([](Stream rng) { return Photon{rng.uniform(), 1}; }, {});'
refused "$by_value" 'davis_mixture(1, [](double) { return [](Stream rng) { return rng.uniform(); }; });'

# ---- a mutable lambda
refused "$mutable" 'std::cout << estimate([n = 0](Stream& rng) mutable { return rng.uniform() + ++n; });'
refused "$mutable" 'std::cout << estimate(single_term([n = 0](std::int64_t, Stream& rng) mutable { return base(rng.uniform() + ++n); }, Geometric(0.5)));'
refused "$mutable" 'std::cout << estimate(recipe([e = std::mt19937()](auto, auto&) mutable { return base(std::normal_distribution<>()(e)); }));'
refused "$mutable" 'std::cout << estimate(single_term(reciprocal([n = 0](Stream& rng) mutable { return rng.uniform() + ++n; })));'
refused "$mutable" 'series([n = 0](std::int64_t k) mutable { return static_cast<double>(k + ++n); });'
refused "$mutable" 'finite_difference([n = 0](double a) mutable { return a + ++n; }, 1.0);'

# ---- what a callable returns
refused 'does not return a Draw' 'std::cout << estimate(single_term([](std::int64_t level, Stream& rng) { return static_cast<double>(level) + rng.uniform(); }, Geometric(0.5)));'
refused 'does not return a Draw' 'std::cout << estimate(recipe([](std::int64_t, Stream& rng) { return rng.uniform(); }));'
refused 'does not return a Draw' 'std::cout << estimate(recipe([](std::int64_t, Stream& rng) { return Term<double>{rng.uniform()}; }));'
refused 'does not return a Draw' 'std::cout << survey([](std::int64_t, Stream& rng) { return std::pair(rng.uniform(), 1.0); }, 4);'
refused 'returns a Draw without taking a level' 'std::cout << estimate([](Stream& rng) { return base(rng.uniform()); });'
refused 'returns an integer or a bool' 'std::cout << estimate([](Stream& rng) { return rng.uniform() < 0.5; });'
refused 'returns an integer or a bool' 'std::cout << estimate(single_term(reciprocal([](Stream& rng) { return rng.uniform() < 0.5 ? 1 : 2; })));'
refused 'returns an integer or a bool' 'series([](std::int64_t k) { return 1 / (k + 1); });'
refused 'returns nothing' 'std::cout << estimate([](Stream& rng) { rng.uniform(); });'
refused 'is no value' 'std::cout << estimate([](Stream& rng) { return static_cast<long double>(rng.uniform()); });'
refused 'returns a Sample where a plain value is due' 'reciprocal([](Stream& rng) { return Sample<double>{rng.uniform()}; });'
refused 'does not return a debias::Sample' 'std::cout << estimate([](Stream& rng, auto& record) { record.base(0, 1.0, 1.0); return rng.uniform(); });'
refused 'does not return a Term' 'roulette([](Stream& rng) { return [&rng] { return rng.uniform(); }; }, Geometric(0.5));'

# ---- what a callable takes
refused 'in the wrong order' 'std::cout << estimate(single_term([](Stream& rng, std::int64_t) { return base(rng.uniform()); }, Geometric(0.5)));'
refused 'in the wrong order' 'std::cout << estimate(recipe([](Stream rng, int) { return base(rng.uniform()); }));'
refused 'takes its level by reference' 'std::cout << estimate(recipe([](std::int64_t& level, Stream& rng) { level = 1; return base(rng.uniform()); }));'
refused 'takes its level by reference' 'std::cout << estimate(recipe([](int& level, Stream& rng) { level = 1; return base(rng.uniform()); }));'
refused 'takes no Stream' 'std::cout << estimate([] { return 1.0; });'
refused 'takes no Stream' 'std::cout << estimate(recipe([](std::int64_t level) { return base(static_cast<double>(level)); }));'
refused 'function of a number' 'reciprocal([](double t) { return 1 + t; });'

refused 'this Stream is const' 'std::cout << estimate([](const Stream& rng) { return rng.uniform(); });'

# ---- one thing at the door of another
refused 'a sequence is no estimator' "$seq std::cout << estimate(seq);"
refused 'a sequence is no estimator' "$seq std::cout << estimate(seq, {.samples = 10});"
refused 'a sequence is no estimator' "$x std::cout << estimate(reciprocal(x));"
refused 'a sequence is no estimator' "$seq std::cout << estimate(stratified(seq, 64));"
refused 'a sequence is no estimator' "$seq trace(seq, 1, 2);"
refused 'terms of a series are no estimator' "$terms std::cout << estimate(terms);"
refused 'only estimate takes a recipe' "$seq trace(recipe(seq), 1, 2);"
refused 'only estimate takes a recipe' "$seq stratified(recipe(seq), 64);"
refused 'cannot be drawn from outside' "$x stratified(x, 64);"
refused 'PMF and sequence are exchanged' "$seq std::cout << estimate(single_term(Geometric(.5), seq));"
refused 'PMF and sequence are exchanged' "$seq std::cout << estimate(independent_sum(AnyPmf(Zeta(2.5)), seq));"
refused 'PMF and sequence are exchanged' "$terms std::cout << estimate(roulette(Geometric(.5), terms));"
refused 'PMF and sequence are exchanged' "$seq progressive(Poisson(3), seq);"
refused 'a number is no PMF' "$seq single_term(seq, 0.5);"
refused 'this is no PMF' "$seq single_term(seq, seq);"
refused 'declares no rates' "$seq std::cout << estimate(single_term(seq));"
refused 'declares no rates' "$terms roulette(terms);"
refused 'is a random variable, not a sequence' "$x std::cout << estimate(recipe(x));"
refused 'is a random variable, not a sequence' "$x std::cout << estimate(single_term(x, Geometric(0.5)));"
refused 'is an estimator, not a sequence' "$seq std::cout << estimate(recipe(single_term(seq, Geometric(0.5))));"
refused 'terms in order, without levels' "$terms single_term(terms, Geometric(0.5));"
refused 'a sequence of levels, not of terms' "$seq roulette(seq, Geometric(0.5));"
refused 'is a sequence, where draws of X' "$seq reciprocal(seq);"
refused 'is no sequence' 'std::cout << estimate(recipe(1.5));'
refused 'is no estimator' 'std::cout << estimate(1.5);'
refused 'has no power series' "$x taylor(x, [](double m) { return m; }, 0.5);"

# ---- Eigen
if [ -d "$eigen" ]; then
  echo '#include <Eigen/Dense>' >> "$work/all.hpp"
  echo '#include <debias/derivative/partial.hpp>' >> "$work/all.hpp"
  accepted 'std::cout << estimate(single_term(gradient([](const Eigen::Vector2d& a, Stream& rng) { return a.sum() * rng.uniform(); }, Eigen::Vector2d(1, 2))));'
  refused "$by_value" 'gradient([](const Eigen::Vector2d& a, Stream rng) { return a.sum() * rng.uniform(); }, Eigen::Vector2d(1, 2));'
  refused "$by_value" 'jacobian([](const auto& a, auto rng) { return Eigen::Vector2d(a * rng.uniform()); }, Eigen::Vector2d(1, 2), Eigen::Matrix2d());'
  refused 'returns an Eigen expression' 'std::cout << estimate([](Stream& rng) { return Eigen::Array3d::Constant(rng.uniform()); });'
  refused 'returns an Eigen expression' 'reciprocal([a = Eigen::Array2d(1, 2)](Stream& rng) { return a * rng.uniform(); });'
  refused 'an Eigen expression is no value' 'const Eigen::Array2d a(1, 2); base(a + a);'
  refused 'an Eigen expression is no value' 'const Eigen::Array2d a(1, 2); coupled(a, 2 * a);'
fi

# ---- numbers
refused 'write base(1.0)' 'base(1);'
refused 'write base(1.0)' 'std::cout << estimate(recipe([](std::int64_t level, Stream& rng) { if (level == 0) return base(1u); return coupled(rng.uniform(), 0.5); }));'
refused 'write base(1.0)' 'coupled(1L, 2L);'
refused 'write base(1.0)' 'coupled(1.0, 0);'
refused 'write base(1.0)' 'base(true);'
refused 'are of two types' 'coupled(1.0f, 2.0);'
refused 'are of two types' 'coupled(std::complex<double>(1), 2.0, 3);'
refused 'this is no value' 'base(1.0L);'

# ---- integrands over a Cube
refused 'takes the coordinates of a point' 'function_of_integral([](double x) { return x; }, Cube(2), functions::Log{});'
refused 'takes the coordinates of a point' 'function_of_integral([](double x, double y) { return x + y; }, Cube(2), functions::Log{});'
refused 'is no value' 'function_of_integral([](std::span<const double>) { return "one"; }, Cube(2), functions::Log{});'
refused 'over a Cube takes outer' 'nested([](Stream& rng) { return rng.uniform(); }, [](double y, double x) { return x + y; }, Cube(1), functions::Log{});'

# ---- slopes of paths
echo '#include <debias/sde/sensitivities.hpp>' >> "$work/all.hpp"
spot='const auto model = []<class X>(const X& s) { return BlackScholes<X>{.start = s, .volatility = X(0.2)}; };'
tree='Branched<Smoothed<MilsteinStep>>{}'
accepted "$spot std::cout << estimate(single_term(sensitivities($tree, model, discounted(DigitalPayoff{1}), 1.0)));"
accepted "$spot std::cout << estimate(single_term(sensitivities(Branched<MilsteinStep>{}, model, Average{}, [](const auto& p) { return positive_part(p.average() - 1); }, Rates{1.67, 1.2}, 1.0)));"
refused 'does not know its expectation' "$spot struct P { Dual<1> operator()(const Dual<1>& x) const { return x * x; } }; sensitivities($tree, model, P{}, 1.0);"
refused 'does not know its expectation' "$spot std::cout << estimate(recipe(sensitivities($tree, model, [](const auto& x) { return exp(x); }, 1.0)));"
refused 'does not know its expectation' "$spot single_term(second_sensitivities($tree, model, discounted([](const auto& x) { return x; }), 1.0));"
refused 'a payoff that jumps' "$spot single_term(component_of(sensitivities(MilsteinStep{}, model, DigitalPayoff{1}, 1.0), 1));"
refused 'a payoff with a kink' "$spot single_term(second_sensitivities(Branched<MilsteinStep>{}, model, CallPayoff{1}, 1.0));"
refused 'no summary of it' "$spot sensitivities($tree, model, Minimum{}, [](const auto& p) { return p.minimum; }, Rates{2, 1}, 1.0);"
refused 'is no model of dual numbers' "sensitivities(MilsteinStep{}, [](const auto& s) { return s; }, CallPayoff{1}, 1.0);"
refused 'needs diffusion_derivative' "struct M { Dual<1> start; double horizon; Dual<1> drift(const Dual<1>& x, double) const { return x; } Dual<1> diffusion(const Dual<1>& x, double) const { return x; } }; sensitivities(MilsteinStep{}, [](const auto& s) { return M{s, 1.0}; }, CallPayoff{1}, 1.0);"

# Each case is a function on a line of its own: `N<tab>words` says which lines are refused, and how.
awk -F '\t' '{ print "void case_" NR "() { " $2 " }" }' "$work/cases" > "$work/bodies"
awk -F '\t' '$1 != "" { print NR "\t" $1 }' "$work/cases" > "$work/expected"
accepted=$(awk -F '\t' '$1 == ""' "$work/cases" | wc -l)
[ "$(wc -l < "$work/expected")" -ge 90 ] && [ "$accepted" -ge 12 ] || { echo "cases are missing"; exit 1; }
{ cat "$work/all.hpp"; echo '#line 1 "case.cpp"'; cat "$work/bodies"; } > "$work/all.cpp"
failed=0

# all COMPILER: what it says to all of them.
all() {
  flags="-std=c++20 -I$root/include -isystem $eigen -fsyntax-only -w"
  case $1 in
    *clang*) flags="$flags -ferror-limit=0 -ftemplate-backtrace-limit=0 -fno-caret-diagnostics" ;;
    *) flags="$flags -fno-diagnostics-show-caret -ftemplate-backtrace-limit=0" ;;
  esac
  LC_ALL=C $1 $flags "$work/all.cpp" > "$work/said" 2>&1 && { echo "$1 accepts everything"; exit 1; }
  # The line of the case is in the error, in the notes before it (g++) or in those after it (clang).
  awk -v after="$(case $1 in *clang*) echo 1 ;; esac)" '
    match($0, /^case[.]cpp:[0-9]+:/) { line = substr($0, RSTART + 9, RLENGTH - 10) }
    /error: / {
      if (pending != "") print "?\t" pending
      pending = $0
      if (after == "" || $0 ~ /^case[.]cpp/) { print line "\t" pending; pending = "" }
      next
    }
    pending != "" && /^case[.]cpp/ { print line "\t" pending; pending = "" }
    END { if (pending != "") print "?\t" pending }' "$work/said" > "$work/errors"
  compare "$1" "$work/expected" "$work/errors" > "$work/wrong" || failed=1
  cut -c1-400 "$work/wrong"
  sed -nE 's/^.* case ([0-9]+)[:,].*/\1/p' "$work/wrong" | sort -nu | while read -r n; do sed -n "${n}p" "$work/bodies"; done
}

# compare COMPILER EXPECTED ERRORS: one error a refused case, with its words, and none of the others.
compare() {
  awk -F '\t' -v compiler="$1" '
    NR == FNR { words[$1] = $2; next }
    !($1 in words) { print compiler " refuses case " $1 ": " $2; bad = 1; next }
    seen[$1]++ { print compiler " says more than one thing of case " $1 ": " $2; bad = 1; next }
    index($2, words[$1]) == 0 || $2 !~ /debias: / { print compiler " does not say \"" words[$1] "\" of case " $1 ": " $2; bad = 1 }
    END {
      for (i in words) if (!(i in seen)) { print compiler " accepts case " i ", " words[i]; bad = 1 }
      exit bad
    }' "$2" "$3"
}

all "${CXX:-g++}"
if command -v clang++ > /dev/null && [ "${CXX:-g++}" != clang++ ]; then all clang++; fi

# The comparison can fail: another word, a case that is not refused, one that is, and one error too many.
fails() { ! compare wrong "$1" "$2" > /dev/null || { echo "the comparison does not see $3"; failed=1; }; }
sed '1s/value/reference/' "$work/expected" > "$work/other"
fails "$work/other" "$work/errors" "another sentence"
sed 1d "$work/errors" > "$work/other"
fails "$work/expected" "$work/other" "an accepted mistake"
sed 1d "$work/expected" > "$work/other"
fails "$work/other" "$work/errors" "a refused program"
{ cat "$work/errors"; printf '%s\tcase.cpp: error: no member\n' "$(sed -n 1p "$work/expected" | cut -f1)"; } > "$work/other"
fails "$work/expected" "$work/other" "a second error"
[ "$failed" -eq 0 ]
