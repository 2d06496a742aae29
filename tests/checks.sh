# What the tests of the program share; sourced with the program as $1. Leaves $debias, an empty folder to work in, and
#   check WHAT COMMAND...    the command must succeed, else one line says what failed
#   same, lines, has, lacks  such commands
#   refused_by CODE WORD COMMAND...   `debias COMMAND...`: that exit code, nothing on stdout, a line with WORD on stderr
#   end_checks               prints the number of checks; fails if one did
set -u
[ $# -eq 1 ] || { echo "usage: sh $0 PROGRAM" >&2; exit 2; }
case $1 in
  /*) debias=$1 ;;
  *) debias=$PWD/$1 ;;
esac
here=$(mktemp -d)
trap 'rm -rf "$here"' EXIT
cd "$here" || exit 2

checks=0
failed=0
check() {
  what=$1
  shift
  checks=$((checks + 1))
  "$@" || { failed=$((failed + 1)); echo "FAILED: $what"; }
}
same() { [ "$1" = "$2" ] || { echo "  '$1' is not '$2'"; false; }; }
lines() { wc -l < "$1" | tr -d ' '; }
has() { grep -aq -- "$1" "$2" || { echo "  no '$1' in: $(head -c 300 "$2")"; false; }; }
lacks() { ! grep -aq -- "$1" "$2" || { echo "  '$1' in: $(head -c 300 "$2")"; false; }; }
refused_by() {
  code=$1
  word=$2
  shift 2
  "$debias" "$@" > out 2> err < /dev/null
  check "exit code of: debias $*" same $? "$code"
  check "empty stdout of: debias $*" same "$(lines out)" 0
  check "one line on stderr of: debias $*" same "$(lines err)" 1
  check "helpful line of: debias $*" has "^debias: .*$word" err
}
end_checks() {
  echo "$((checks - failed)) of $checks checks passed"
  [ "$failed" -eq 0 ]
}
