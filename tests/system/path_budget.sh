#!/bin/bash
# path_budget.sh - a path-traced picture whose textures do not fit: the same bytes as with room for all;
# so is a real-time picture with its planes.
. "$(dirname "$0")/../support/shell.sh"

trace() { # MiB scene options...
    local budget=$1 scene=$2
    shift 2
    expect 0 "$helio" render "$scene" -o "$temp/$budget.exr" --exr float --size 480x270 --spp 2 \
        --fov 60 --exposure 0 --texture-budget "$budget" --asset-root "$data" \
        --stats "$temp/$budget.json" --progress none "$@"
}
evicted() { grep -q '"evicted": [1-9]' "$temp/$1.json"; }
compare() { # scene options...
    trace 16 "$@"
    evicted 16 || fail "16 MiB held all pages: nothing was tested"
    trace 4096 "$@"
    evicted 4096 && fail "4096 MiB did not hold all pages"
    same "$temp/16.exr" "$temp/4096.exr"
}

need "$helio"
sponza=scenes/Sponza/glTF/Sponza.gltf
env=hdr/lightroom_14b_from_filament_ktx.hdr
if has_data $sponza && has_data $env; then
    nave=("$data/$sponza" --eye 6,1.6,0 --target 5,1.7,0 --env "$data/$env")
    compare "${nave[@]}" --mode path
    # Light that is gathered at rest comes by the same paths as above.
    compare "${nave[@]}" --mode realtime --aov all --gi none
else
    [ $failures = 0 ] && exit 77 # skipped (ctest)
fi

[ $failures = 0 ] || exit 1
echo "path_budget: good"
