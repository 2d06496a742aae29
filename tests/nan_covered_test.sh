#!/bin/sh
# Every public factory is in the tests of tests/nan, which pour NaN and infinity into its callables, or below among those
# that take none. Names each one that is in neither.
set -eu
here=$(CDPATH= cd -- "$(dirname -- "$0")/.." && pwd)

# Functions that take no callable and draw nothing, by what they take.
no_callable='
 values:      as_scalar component component_count difference epsilon_of gradient_covariance has_nan is_finite lopsided nan_like scaled
              set_component sum zero_like
 streams:     fill instructions normal_quantile normal_quantiles normal_density normal_distribution search_tails split split_level exp expm1 log log1p sin
 duals:       abs cos max min positive_part pow smoothness_of sqrt tanh
 nets:        net_bits net_bits_of_pair net_uniforms point_key
 numbers:     base_level_for_pole centre centre_between comb_of_u_statistics contraction doubled_draws exp_of geometric_terms
              poisson_quantile polynomial_terms power_law
 PMFs, rates: best_masses best_tails convergence_rate default_exponent dyadic_exponent finite_exponents inverse_weight
              inverse_weight_error invert_tail judge pmf_exists rates_of rates_of_sum refuse_uniform
              tail_exponent_for
 results:     batch_interval bound_of survey_of fit_pareto interval_of median_of_means merge model_of name_of predict
              samples_for_mean tail_index tail_size usable_tail_index warning_named with_error
 statistics:  believed dependence_of doubt_of exponent_of fourth_moment_diverges full interval_with is_note log2_work
              meeting_tail net_blocks part_in_variance print_full print_terms row_of slow_terms together upper weigh
 files:       read_run save_run
 what hands an estimator or a sequence on as it is:
              component_of covariance deepest_level_of facts_of greeks named with_covariance with_deepest_level
 what the estimators are made of, and runs of erased levels, by way of recipe, survey and multilevel:
              advise description difference_of estimator_of level_runs ranks_of survey_level survey_within
              term_moments value_of
'

# factories ROOT: the functions of the public headers that stand at namespace scope, without those of detail.
factories() {
  find "$1/include/debias" -name '*.hpp' | sort | while read -r file; do
    awk '/^namespace (debias::)?detail \{/ { hidden = 1 } !hidden { print }
         /^\}  \/\/ namespace (debias::)?detail/ { hidden = 0 }' "$file" |
      sed -n -E '/^[a-zA-Z]/ {
        /^(namespace|using|concept|struct|class|enum|template|static|friend|extern|inline constexpr)\>/ d
        s/requires *\([^)]*\)//g
        s/^(.*[ &*>])?([a-z_][a-z_0-9]*)\(.*$/\2/p
      }'
  done | grep -vx requires | sort -u
}

# check ROOT: prints the factories of a tree that no test covers.
check() {
  covered=$(cat "$here"/tests/nan/*_test.cpp | tr '\n' ' ' | grep -oE '\b(check|check_sequence|check_terms|check_run|covers)\( *"[a-z_0-9]+"' | sed 's/.*"\(.*\)"/\1/')
  factories "$1" | while read -r name; do
    printf '%s\n' $covered $no_callable | grep -qx "$name" ||
      echo "$name: a public function that is in no test of tests/nan; check its callables there, or name it in $0 if it takes none"
  done
}

# The check itself can fail: a factory that nobody has seen.
wrong=$(mktemp -d)
trap 'rm -rf "$wrong"' EXIT
mkdir -p "$wrong/include/debias"
cat > "$wrong/include/debias/new.hpp" <<'END'
namespace debias {
namespace detail {
inline int hidden(int x) { return x; }
}  // namespace detail
template <class F>
auto brand_new_estimator(F f, double x) {
  return helper(f, x);
}
template <class F>
requires(!Known<F>) Another<F> another_new_one(const F& f) {
  return {f};
}
}  // namespace debias
END
found=$(check "$wrong" | wc -l)
[ "$found" -eq 2 ] || { echo "the check found $found of 2 new factories"; check "$wrong"; exit 1; }
known=$(factories "$here" | wc -l)
[ "$known" -gt 100 ] || { echo "only $known public functions found: the headers are written otherwise"; exit 1; }

bad=$(check "$here")
[ -z "$bad" ] || { printf '%s\n' "$bad"; exit 1; }
calls=$(cat "$here"/tests/nan/*_test.cpp | tr '\n' ' ' |
  grep -oE '\b(check|check_sequence|check_terms|check_run|covers)\( *"[^"]+", *(std::string\()?("[^"]+"|name_of\(where\))' | sed 's/^[a-z_]*( *//' | sort -u)
echo "covered: $(printf '%s\n' "$calls" | cut -d, -f1 | sort -u | wc -l) factories, $(printf '%s\n' "$calls" | wc -l) callables"
