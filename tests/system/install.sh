#!/bin/bash
# install.sh - `cmake --install` into an empty folder holds all that runs: pictures are rendered there, embedded
# and through the daemon, a program is linked with libhelio, and nothing is left by the uninstall target.
# With an argument: the same of the .deb that CPack makes.
. "$(dirname "$0")/../support/shell.sh"

root=$temp/root prefix=/opt/heliograph
install_prefix() {
    expect 0 env DESTDIR="$root" cmake --install "$HELIO_BUILD_DIR" --prefix "$prefix"
}
install_package() {
    command -v dpkg-shlibdeps >/dev/null || exit 77
    prefix=/usr
    expect 0 cpack -G DEB --config "$HELIO_BUILD_DIR/CPackConfig.cmake" -B "$temp/package"
    deb=$(echo "$temp"/package/heliograph_*.deb)
    expect 0 dpkg-deb -x "$deb" "$root"
    dpkg-deb -f "$deb" Depends >"$temp/depends"
    for package in libc6 libvulkan1 libopenimageio libembree libssl libdeflate mesa-vulkan-drivers; do
        grep -q "$package" "$temp/depends" || fail "the package does not depend on $package"
    done
    # Of what the build found.
    for library in openh264:helio-worker aom:helio-worker SDL2-2.0:helio-view fontconfig:helio-view; do
        linked=$root/usr/libexec/${library#*:} name=${library%:*}
        [ -e "$linked" ] && readelf -d "$linked" | grep -q "\[lib$name\.so" || continue
        package=lib$(echo "$name" | tr '[:upper:]' '[:lower:]')
        grep -q "$package" "$temp/depends" || fail "the package does not depend on $package"
    done
    for page in helio.1 helio-render.1; do # as Debian wants them
        [ -f "$root/usr/share/man/man1/$page.gz" ] || fail "$page.gz is not in the package"
    done
    dpkg-deb -e "$deb" "$temp/control"
    sh -n "$temp/control/postinst" && sh -n "$temp/control/prerm" || fail "its scripts are no scripts"
}
look=(--size 64x48 --samples 1)
shared=() # the folder's daemon has all defaults: tenants, a worker that compiles its shaders
if [ "${1:-}" = package ]; then
    install_package
    shared=(--isolation shared)
else
    look+=(--gi none --exposure 0) # most of what there is to compile is for global illumination and for metering
    install_prefix
fi
here=$root$prefix

for file in bin/helio bin/heliod libexec/helio-worker libexec/helio-loader libexec/helio-bench include/helio/helio.h \
    share/man/man1/helio.1 share/man/man1/helio-render.1 share/man/man8/heliod.8 \
    share/bash-completion/completions/helio share/zsh/site-functions/_helio \
    lib/systemd/system/heliod.service lib/systemd/system/heliod.socket lib/sysusers.d/heliograph.conf \
    share/doc/heliograph/copyright share/doc/heliograph/docs/client.md share/helio/web/hgp.js \
    share/helio/web/index.html lib/python3/dist-packages/helio/__init__.py; do
    [ -e "$here/$file" ] || [ -e "$here/$file.gz" ] || fail "$file is not installed"
done
grep -q "^ExecStart=$prefix/bin/heliod " "$here/lib/systemd/system/heliod.service" ||
    fail "the unit starts another heliod"

# The folder is not where it was installed for: programs find each other beside themselves.
unset HELIO_WORKER HELIO_BENCH
PATH=/usr/bin:/bin
expect 0 "$here/bin/helio" render demo: -o "$temp/a.png" "${look[@]}"
"$here/bin/heliod" --listen "unix:$temp/sock" "${shared[@]}" --sandbox best-effort --log warn &
daemon=$!
answers() { "$here/bin/helio" ping --count 1 --connect "unix:$temp/sock" >/dev/null 2>&1; }
until_true answers
expect 0 "$here/bin/helio" render demo: -o "$temp/b.png" "${look[@]}" --connect "unix:$temp/sock"
same "$temp/a.png" "$temp/b.png"
expect 0 python3 - "$temp/sock" "$here/share/helio/web" <<'PY' # the viewer, over HTTP, compressed where it may be
import gzip, pathlib, socket, sys
def get(path, fields=b""):
    s = socket.socket(socket.AF_UNIX)
    s.connect(sys.argv[1])
    s.sendall(b"GET " + path + b" HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n" + fields + b"\r\n")
    head, _, body = b"".join(iter(lambda: s.recv(65536), b"")).partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 200"), head
    return head, body
assert b"<html" in get(b"/")[1]
total = 0
for file in pathlib.Path(sys.argv[2]).iterdir():
    if file.suffix == ".gz":
        continue
    head, body = get(b"/" + file.name.encode(), b"Accept-Encoding: gzip\r\n")
    assert b"Content-Encoding: gzip" in head and gzip.decompress(body) == file.read_bytes(), (file, head)
    total += len(body)
assert 50000 < total < 100 * 1024, total
PY
kill "$daemon" && wait "$daemon"
daemon=

PKG_CONFIG_PATH=$(dirname "$(find "$here" -name helio.pc)")
export PKG_CONFIG_PATH
cat >"$temp/use.c" <<'C'
#include <helio/helio.h>
#include <stdio.h>
int main(void) { return puts(helio_version()) < 0; }
C
# shellcheck disable=SC2046 # words
expect 0 cc "$temp/use.c" -o "$temp/use" $(pkg-config --cflags --libs helio)
expect 0 env LD_LIBRARY_PATH="$(pkg-config --variable=libdir helio)" "$temp/use"
grep -q "^[0-9]*\.[0-9]" "$temp/out" || fail "libhelio has no version: $(cat "$temp/out")"

if [ "${1:-}" != package ]; then
    touch "$here/lib/mine"
    expect 0 env DESTDIR="$root" cmake --build "$HELIO_BUILD_DIR" --target uninstall
    [ "$(find "$root" -type f -o -type l)" = "$here/lib/mine" ] || fail "left: $(find "$root" -type f | head)"
    rm "$here/lib/mine"
fi

[ "$failures" = 0 ] && echo "all good"
exit $((failures > 0))
