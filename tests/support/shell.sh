# shell.sh - what test scripts share: programs, a folder that goes in the end, and expectations that are
# counted in `failures`. To be sourced. Uses HELIO_BUILD_DIR; a script that starts a daemon or a
# client keeps its number in `daemon` or `client`, so that it ends with the script.
set -u
helio=$HELIO_BUILD_DIR/bin/helio
heliod=$HELIO_BUILD_DIR/bin/heliod
models=$HELIO_BUILD_DIR/tests/models # what support/models.py makes
data=${HELIO_TEST_DATA:-$(realpath -m "${BASH_SOURCE[0]%/*}/../../../shared/data")}
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
# A daemon at $url, which ends with the script. Its worker starts once for all pictures, where a private one
# loads libraries, opens the device and makes pipelines for each. A shared worker takes compiled shaders from
# $MESA_SHADER_CACHE_DIR, where that of a tenant (install.sh has one) compiles its own.
start_daemon() { # asset roots...
    local root roots=()
    for root; do roots+=(--asset-root "$root"); done
    url=unix:$temp/sock
    "$heliod" --listen "$url" "${roots[@]}" --hang-timeout 3600 --isolation shared --sandbox best-effort --log warn &
    daemon=$!
    answers() { "$helio" ping --count 1 --connect "$url" >/dev/null 2>&1; }
    until_true answers
}
# Is there this file of the test data? A missing one is a failure where HELIO_TEST_DATA is set or
# CI=true (test_data.h).
has_data() {
    [ -e "$data/$1" ] && return 0
    if [ -n "${HELIO_TEST_DATA:-}" ] || [ "${CI:-}" = true ]; then
        fail "test data is missing: $1"
    else
        echo "SKIPPED: test data is missing: $1"
    fi
    return 1
}
need() { [ -e "$1" ] || { echo "$1 is missing"; exit 1; }; }
