#!/bin/sh
# viewer.sh FILE - tests of the viewer in Chromium, where Chromium, Node and the packages of package.json are there.
# Without them it is skipped; where CI=true, a failure, but for the packages.
set -u
here=$(cd "$(dirname "$0")" && pwd)
missing() {
    if [ "${CI:-}" = true ]; then echo "missing: $1"; exit 1; fi
    echo "SKIPPED: missing: $1"
    exit 77
}
command -v node >/dev/null || missing node
[ -x /usr/bin/chromium ] || [ -x /usr/bin/chromium-browser ] || missing chromium
# From npm, which a machine need not reach: never a failure.
[ -d "$here/node_modules/puppeteer-core" ] || { echo "SKIPPED: missing: npm ci --prefix tests/browser"; exit 77; }
exec node --test "$here/$1"
