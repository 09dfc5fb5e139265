#!/bin/sh
# generate.sh HELIO [--check]: writes client/man and client/completion from the program's option
# table, or (--check) fails when they are not current.
set -eu
helio=$1
check=${2:-}
here=$(cd "$(dirname "$0")" && pwd)
temp=$(mktemp)
trap 'rm -f "$temp"' EXIT
bad=0
one() { # folder name
    "$helio" --generate "$2" >"$temp"
    if [ "$check" = --check ]; then
        cmp -s "$temp" "$here/$1/$2" || { echo "client/$1/$2 is not current"; bad=1; }
    else
        cp "$temp" "$here/$1/$2"
        chmod 644 "$here/$1/$2"
    fi
}
one man helio.1
for command in $("$helio" --help | sed -n '/^commands:/,/^$/s/^  \([a-z]*\) .*/\1/p'); do
    one man "helio-$command.1"
done
one completion helio.bash
one completion _helio
[ "$bad" = 0 ] || { echo "run client/generate.sh build/bin/helio"; exit 1; }
