#!/bin/sh
# Builds what is missing and runs the tests.
#   sh tests/run.sh            quick and statistical tests
#   sh tests/run.sh --long     the long ones too
# BUILD_DIR and JOBS as in src/build.sh.
set -eu
root=$(CDPATH= cd -- "$(dirname -- "$0")/.." && pwd)
. "$root/src/build.sh"

case $#:${1-} in
  0:) selection="-L ^(quick|stat)$" ;;
  1:--long) selection="-C long -L ^(quick|stat|long)$" ;;
  *) echo "usage: sh tests/run.sh [--long]" >&2; exit 2 ;;
esac

packages="$packages libopenmpi-dev openmpi-bin locales"
install_packages
build all
set -f  # the selection is split into words, and is no file name pattern
ctest --test-dir "$build_dir" $selection --parallel "$jobs" --no-tests=error --output-on-failure
