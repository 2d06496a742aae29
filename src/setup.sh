#!/bin/sh
# From a bare machine to a first answer: installs what is missing, builds the program, runs its main job.
#   sh src/setup.sh        results in out/, a summary here; BUILD_DIR and JOBS as in src/build.sh
set -eu
root=$(CDPATH= cd -- "$(dirname -- "$0")/.." && pwd)
. "$root/src/build.sh"

install_packages
build debias_cli
mkdir -p "$root/out"
"$build_dir/bin/debias" validate --samples 1e5 -o "$root/out/validation.txt"
