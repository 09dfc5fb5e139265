#!/bin/bash
# quotas.sh - what a command says, and its exit code, where a quota of the daemon refuses it: 6, which queues
# of farms try again, and not that of a bad file. Uses HELIO_BUILD_DIR.
. "$(dirname "$0")/../support/shell.sh"

for file in "$helio" "$heliod"; do need "$file"; done
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n' >"$temp/triangle.obj"
url=unix:$temp/sock
"$heliod" --listen "$url" --max-upload 0 --max-pixels 1000 --isolation shared --sandbox best-effort --log warn &
daemon=$!
answers() { "$helio" ping --count 1 --connect "$url" >/dev/null 2>&1; }
until_true answers
refused() { # option command...
    local limit=$1
    shift
    expect 6 "$@"
    grep -q "($limit)" "$temp/out" || fail "$limit is not named: $(tail -n 2 "$temp/out")"
}
refused max-upload "$helio" render "$temp/triangle.obj" --upload -o "$temp/a.png" --size 16x16 --connect "$url"
refused max-pixels "$helio" render demo: -o "$temp/a.png" --size 64x64 --connect "$url"
[ -e "$temp/a.png" ] && fail "a picture was written"
[ "$failures" = 0 ] && echo "all good"
exit $((failures > 0))
