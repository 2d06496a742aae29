#!/bin/sh
# CONTRIBUTING.md draws the arrows that the includes have, and they form no ring.
set -eu
command -v python3 >/dev/null || { echo "arrows_test.sh: no Python; skipped"; exit 77; }
exec python3 "$(dirname "$0")/arrows.py" --check
