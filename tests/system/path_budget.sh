#!/bin/bash
# path_budget.sh - a path-traced picture whose textures do not fit: the same bytes as with room for all;
# so is a real-time picture with its planes.
. "$(dirname "$0")/../support/shell.sh"

sponza=$data/scenes/Sponza/glTF/Sponza.gltf
env=$data/hdr/lightroom_14b_from_filament_ktx.hdr
for file in "$helio" "$sponza" "$env"; do need "$file"; done

trace() { # MiB options...
    local budget=$1
    shift
    expect 0 "$helio" render "$sponza" -o "$temp/$budget.exr" --exr float --size 480x270 \
        --eye 6,1.6,0 --target 5,1.7,0 --fov 60 --env "$env" --spp 2 --texture-budget "$budget" \
        --asset-root "$data" --stats "$temp/$budget.json" --progress none "$@"
}
evicted() { grep -q '"evicted": [1-9]' "$temp/$1.json"; }
compare() { # options...
    trace 16 "$@"
    evicted 16 || fail "16 MiB held all pages: nothing was tested"
    trace 4096 "$@"
    evicted 4096 && fail "4096 MiB did not hold all pages"
    same "$temp/16.exr" "$temp/4096.exr"
}

compare --mode path
compare --mode realtime --aov all

[ $failures = 0 ] || exit 1
echo "path_budget: good"
