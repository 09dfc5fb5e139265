#!/bin/sh
# product_alone.sh SOURCE: the product is configured without asking for what only tests need, so that
# `deploy/quickstart demo` works where that is not installed.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cmake -S "$1" -B "$dir" -G Ninja -DHELIO_TESTS=OFF >"$dir/log" 2>&1 || { cat "$dir/log"; exit 1; }
if grep -E '^(HELIO_NODE|HELIO_PYTHON3|CMOCKA_|WEBP_|_?Python3_)' "$dir/CMakeCache.txt"; then
    echo "these are for tests, and were asked for without them"
    exit 1
fi
