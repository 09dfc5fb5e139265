#!/bin/bash
# full_cache.sh - a cache folder whose disk is full costs no frame: Mesa maps the index of its shader
# cache, and a page of it without room is SIGBUS. Mounts a small tmpfs in a mount namespace of its
# own; skipped where that is not allowed.
if [ -z "${HELIO_SMALL_DISK:-}" ]; then
    small=$(mktemp -d)
    trap 'rmdir "$small"' EXIT
    unshare --mount mount -t tmpfs -o size=64k tmpfs "$small" 2>/dev/null || { echo "SKIPPED: no mount"; exit 77; }
    HELIO_SMALL_DISK=$small unshare --mount "$0"
    exit
fi
small=$HELIO_SMALL_DISK
. "$(dirname "$0")/../support/shell.sh"
worm=$models/worm.glb
need "$worm"
unset MESA_SHADER_CACHE_DIR MESA_SHADER_CACHE_DISABLE
picture() { expect 0 "$helio" render "$worm" -o "$temp/$1.png" --size 32x32 --samples 1 --exposure 0 --env none --gi none "${@:2}"; }
picture usual
for free in 0 8 40; do # KiB
    mount -t tmpfs -o size=64k tmpfs "$small"
    head -c $(((64 - free) * 1024)) /dev/zero >"$small/filler"
    picture "full-$free" --cache-dir "$small"
    grep -q "shaders are not kept: .*No space left" "$temp/out" || fail "the full disk is not said"
    same "$temp/usual.png" "$temp/full-$free.png"
    umount "$small"
done
# With room the index has all of its blocks, so that a disk which fills up later does no harm.
mount -t tmpfs -o size=32m tmpfs "$small"
picture roomy --cache-dir "$small"
index=$small/shaders/mesa_shader_cache/index
[ "$(stat -c %b "$index")" -ge $((1310728 / 512)) ] || fail "the index has holes"
find "$small/shaders" -mindepth 2 -name '??' -exec rm -r {} + # its shaders are compiled and noted again
dd if=/dev/zero of="$small/filler" bs=4k 2>/dev/null
[ "$(df --output=avail "$small" | tail -n 1)" -eq 0 ] || fail "the disk is not full: $(df "$small")"
picture later --cache-dir "$small"
same "$temp/usual.png" "$temp/later.png"
umount "$small"

# A limit of the size of files is an error of what is written, not a signal.
(
    ulimit -f 2
    "$helio" render "$worm" -o "$temp/limit.png" --size 640x480 --samples 1 --exposure 0 --background 0.1,0.5,0.9 \
        --bit-depth 16 --cache-dir "$temp/limited" --log error --progress none 2>&1 | cat >/dev/null
    exit "${PIPESTATUS[0]}"
)
[ $? = 6 ] || fail "a file size limit is not exit code 6"
[ -e "$temp/limit.png" ] && fail "half a picture was written"

[ "$failures" = 0 ] && echo "all good"
exit $((failures > 0))
