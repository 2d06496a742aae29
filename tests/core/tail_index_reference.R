# The reference values of tail_index_test.cpp, from Debian's r-cran-loo 2.5.1:
#   Rscript tests/core/tail_index_reference.R
suppressPackageStartupMessages(library(loo))

# Quantiles of a generalised Pareto law of shape xi, shifted a little so that they are no regular grid.
values <- function(n, xi, shift) {
  i <- seq_len(n)
  u <- (i - 0.5 + 0.4 * sin(shift * i)) / n
  if (xi == 0) -log(u) else expm1(-xi * log(u)) / xi
}

cat("// n, xi, shift, k, sigma of gpdfit(wip = FALSE)\n")
for (n in c(20, 60, 300, 3000)) {
  for (xi in c(-0.4, 0, 0.3, 0.7, 1.2)) {
    shift <- 1 + n / 7 + xi
    fit <- gpdfit(values(n, xi, shift), wip = FALSE)
    cat(sprintf("{%d, %.1f, %.17g, %.17g, %.17g},\n", n, xi, shift, fit$k, fit$sigma))
  }
}
cat("// n, xi, shift, pareto_k of psis(r_eff = 1)\n")
for (n in c(400, 2500, 10000)) {
  for (xi in c(0.2, 0.6)) {
    shift <- 1 + n / 7 + xi
    k <- suppressWarnings(psis(log(values(n, xi, shift)), r_eff = 1)$diagnostics$pareto_k)
    cat(sprintf("{%d, %.1f, %.17g, %.17g},\n", n, xi, shift, k))
  }
}
