#!/bin/bash
# quotas.sh - what a command says, and its exit code, where a quota of the daemon refuses it: 6, which queues
# of farms try again, and not that of a bad file. And what the daemon tells its operator where it has no device
# to render on. Uses HELIO_BUILD_DIR.
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
kill $daemon
wait $daemon
"$heliod" --listen "$url" --device none --no-seed-shaders --isolation shared --sandbox best-effort 2>"$temp/log" &
daemon=$!
until_true answers
expect 9 "$helio" render demo: -o "$temp/a.png" --size 16x16 --connect "$url"
grep -Eq 'level=warn scope=session msg="session [0-9]+ \(local\): [a-z_]+ failed: none: no usable Vulkan .*\(device\)' "$temp/log" ||
    fail "the log does not say that there is no device: $(cat "$temp/log")"
python3 - "$temp/sock" >"$temp/metrics" <<'PY'
import socket, sys
s = socket.socket(socket.AF_UNIX)
s.connect(sys.argv[1])
s.sendall(b"GET /metrics HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n")
while part := s.recv(65536):
    sys.stdout.write(part.decode())
PY
grep -Eq '^heliod_request_errors_total\{status="device"\} [1-9]' "$temp/metrics" || fail "errors of the device are not counted"
grep -q '^heliod_request_errors_total{status="format"} 0' "$temp/metrics" || fail "there are others"
[ "$failures" = 0 ] && echo "all good"
exit $((failures > 0))
