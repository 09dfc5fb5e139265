# shell.sh - what test scripts share: programs, a folder that goes in the end, and expectations that are
# counted in `failures`. To be sourced. Uses HELIO_BUILD_DIR and HELIO_TEST_DATA; a script that starts a
# daemon or a client keeps its number in `daemon` or `client`, so that it ends with the script.
set -u
helio=$HELIO_BUILD_DIR/bin/helio
heliod=$HELIO_BUILD_DIR/bin/heliod
data=$HELIO_TEST_DATA
tmpdir=${TMPDIR:-}
[ ${#tmpdir} -lt 64 ] || export TMPDIR=/tmp # names of sockets have room for 108 bytes
temp=$(mktemp -d)
daemon= client=
trap 'kill $client $daemon 2>/dev/null; wait 2>/dev/null; rm -rf "$temp"' EXIT
export XDG_CACHE_HOME=$temp/cache
failures=0

fail() { echo "FAILED: $*"; failures=$((failures + 1)); }
expect() { # code command...
    local want=$1 got
    shift
    "$@" >"$temp/out" 2>&1
    got=$?
    [ "$got" = "$want" ] || fail "exit $got instead of $want: $* ($(tail -n 2 "$temp/out"))"
}
same() { cmp "$1" "$2" || fail "$1 and $2 differ"; }
until_true() { # command...: waits for it, a minute at most
    for i in $(seq 1200); do "$@" && return 0; sleep 0.05; done
    fail "never came true: $*"
}
need() { [ -e "$1" ] || { echo "$1 is missing"; exit 1; }; }
