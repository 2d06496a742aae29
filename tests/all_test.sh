#!/bin/sh
# tests/all.sh leaves a line of a commit, holds it for that code and refuses it for any other.
set -u
command -v git > /dev/null || { echo "all_test.sh: no git; skipped"; exit 77; }
script=$(CDPATH= cd -- "$(dirname -- "$0")" && pwd)/all.sh
here=$(mktemp -d)
trap 'rm -rf "$here"' EXIT
cd "$here" && mkdir tests && cp "$script" tests/ && printf '/build/\n/out\n' > .gitignore
failed=0
check() { what=$1; shift; "$@" || { failed=$((failed + 1)); echo "FAILED: $what"; head -5 out; }; }
fails() { ! "$@"; }
all() { sh tests/all.sh "$@" > out 2>&1; }
commit() { git add -A && git -c user.name=a -c user.email=a@b commit -q -m "$1"; }
passed() { all --status; grep -Eq '^tree +passed' out; }
git -c init.defaultBranch=main init -q . && commit one

check "a piece that nobody has run" fails passed
check "a piece runs" all tree
check "and has passed" passed
check "the page quotes it" grep -q '^| tree |.*| passed |' tests/TRUST.md
check "pieces that were not run are a failure" fails all --status
commit "the page"
check "the page itself changes no code" passed
echo x > code
check "a tree with changes gets no line" fails all tree
check "and says which" grep -q code out
commit two
check "a line of another commit does not hold" fails passed
check "nor does the page quote it" grep -q '^| tree |.*| not run |' tests/TRUST.md
check "the piece runs again" all tree
check "and has passed there" passed
git checkout -q HEAD~1 -- code 2> /dev/null || git rm -q --cached code
rm -f code
commit "back"
check "code that is that of an earlier line has it" passed
check "no such piece" fails all such
check "a list of pieces" all --list
[ "$failed" -eq 0 ]
