#!/bin/bash
# points.sh - clouds of points in files, in both modes, and their size: --point-size and its word in scripts.
# Uses HELIO_BUILD_DIR.
. "$(dirname "$0")/../support/shell.sh"

need "$helio"
size=(--size 64x36 --samples 4 --exposure 0 --gi none --view front --background none)

# A square of 20 x 20 points, 0.1 m apart.
python3 - "$temp" <<'PY'
import sys
points = [(0.1 * x, 0.1 * y, 0.0) for y in range(20) for x in range(20)]
with open(sys.argv[1] + "/grid.obj", "w") as file:
    file.writelines("v %g %g %g\n" % p for p in points)
with open(sys.argv[1] + "/grid.ply", "w") as file:
    file.write("ply\nformat ascii 1.0\nelement vertex %d\n" % len(points))
    file.writelines("property float %s\n" % c for c in "xyz")
    file.writelines("property uchar %s\n" % c for c in ("red", "green", "blue"))
    file.write("end_header\n")
    file.writelines("%g %g %g 200 100 50\n" % p for p in points)
PY

start_daemon "$temp"
picture() { # name scene options...
    local name=$1 scene=$2
    shift 2
    expect 0 "$helio" render "$temp/$scene" -o "$temp/$name.png" "${size[@]}" --connect "$url" "$@"
}
covered() { # name: percent of the picture that is not transparent
    PYTHONPATH=$(dirname "$0")/../golden:$(dirname "$0")/../support python3 -B -c '
import sys, ordinary
mask = sum(ordinary.mask_of(sys.argv[1]), [])
print(round(100 * sum(mask) / len(mask)))' "$temp/$1.png"
}
between() { # low high name
    local share
    share=$(covered "$3")
    [ "$share" -ge "$1" ] && [ "$share" -le "$2" ] || fail "$3 covers $share %, not $1 to $2"
}

# Discs close the square, which fills the height of the frame up to the margin.
for scene in grid.ply grid.obj; do
    picture "$scene" "$scene"
    picture "$scene.path" "$scene" --mode path
    between 40 60 "$scene"
    between 40 60 "$scene.path"
done

# Twice the size covers more, half of it leaves gaps: discs of 0.075 m in squares of 0.1 m are 44 %.
picture twice grid.ply --point-size 2
picture half grid.ply --point-size 0.5
picture metres grid.ply --point-size 0.075m
whole=$(covered grid.ply) twice=$(covered twice)
[ "$twice" -gt "$whole" ] || fail "--point-size 2 covers $twice %, 1 covers $whole %"
between $((whole / 4)) $((whole * 3 / 4)) half
[ "$(covered half)" = "$(covered metres)" ] || fail "half covers $(covered half) %, 0.075m $(covered metres) %"

# Scripts.
{
    echo "set size 64x36"
    echo "set samples 4"
    echo "set exposure 0"
    echo "set background none"
    echo "load $temp/grid.ply point-size 0.075m"
    echo "camera fit view front"
    echo "frame $temp/script.png"
} >"$temp/script"
expect 0 "$helio" run "$temp/script"
same "$temp/metres.png" "$temp/script.png"

for wrong in 0 -1 wide m 1001 nan; do
    expect 2 "$helio" render "$temp/grid.ply" -o "$temp/no.png" --point-size "$wrong"
    echo "load $temp/grid.ply point-size $wrong" >"$temp/script"
    expect 2 "$helio" run "$temp/script"
    grep -q point-size "$temp/out" || fail "point-size $wrong: $(tail -n 1 "$temp/out")"
done

[ $failures = 0 ] || { echo "$failures failures"; exit 1; }
echo ok
