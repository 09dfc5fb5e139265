#!/usr/bin/env python3
"""broker_config.py - what `heliod --check-config` says of configurations, good and wrong ones.

  broker_config.py HELIOD

Each row is a file of options, the exit code, and what the message says."""

import os
import subprocess
import sys
import tempfile

ROWS = [
    ("max-views = 3", 0, "the configuration is good"),
    # Client certificates that are required, and no authority to judge them by: not as if they were optional.
    ("tls-client-auth = require", 2, "--tls-client-auth: require needs --tls-client-ca"),
    # What a start needs is there, or the check fails as the start would.
    ("user = nosuchuser", 2, "--user: there is no user 'nosuchuser'"),
    ("worker = /none/worker", 2, "/none/worker: the worker's program is not there (--worker)"),
    ("asset-root = /none", 2, "/none: --asset-root: no worker starts without it: No such file or directory"),
    ("state-dir = state", 0, "the configuration is good"),
    ("state-dir = none/state", 2, "none: --state-dir: No such file or directory"),
    ("state-dir = config", 2, "config: --state-dir: Not a directory"),
    ("cache-dir = none/cache", 0, "the configuration is good"),
    ("cache-dir = config", 2, "config: --cache-dir: Not a directory"),
    ("web-root = none", 2, "none: --web-root: No such file or directory"),
    ("web-root = off", 0, "the configuration is good"),
    ("shader-dir = none", 2, "none: --shader-dir: No such file or directory"),
    ("cgroup = /none", 2, "/none: --cgroup: No such file or directory"),
    ("audit = none/audit.log", 2, "none: --audit: No such file or directory"),
    ("port-file = none/ports", 2, "none: --port-file: No such file or directory"),
    ("listen = unix:none/sock", 2, "none: --listen: No such file or directory"),
    ("listen = unix:sock\nport-file = ports\naudit = audit.log", 0, "the configuration is good"),
    # An origin that no browser sends would never match.
    ("allowed-origins = example.org", 2, "'example.org' is no origin: expected https://HOST[:PORT]"),
    ("allowed-origins = https://example.org/", 2, "is no origin"),
    ("allowed-origins = https://*.example.org", 2, "is no origin"),
    ("allowed-origins = https://example.org:8443", 0, "the configuration is good"),
    # Why a file cannot be read is said.
    ("tls-cert = none.pem", 2, "none.pem: no certificate can be read from it: No such file or directory"),
    # Units: which one is meant, in numbers that can be read.
    ("max-message = 4GB", 2, "line 1: max-message takes MiB, a whole number from 1 to 2047 without a unit, not '4GB'"),
    ("cache-limit = 10 MiB", 2, "takes MiB, a whole number from 0 to 16777216 without a unit"),
    ("min-fill = 1KB", 2, "takes KiB, a whole number from 0 to 1048576"),
    ("drain-timeout = 30s", 2, "takes seconds, a number from 0 to 86400 without a unit, not '30s'"),
]
# Lines of tokens likewise.
TOKENS = [
    ("view-token-1 view anna weight=0", 2, "tokens: line 1: weight= takes 1 to 10000, not '0'"),
    ("view-token-1 view anna expires=tomorrow", 2, "expires= takes YYYY-MM-DD[Thh:mm:ssZ], not 'tomorrow'"),
    ("view-token-1 view anna sesions=3", 2, "'sesions' is no key; there are tenant, expires,"),
    ("view-token-1 view anna pixels=60000 tickets=3", 0, "the configuration is good"),
]


def check(heliod, folder, text, *flags):
    config = os.path.join(folder, "config")
    with open(config, "w", encoding="utf-8") as f:
        f.write(text + "\n")
    got = subprocess.run([heliod, "--check-config", "--config", config, *flags], capture_output=True, text=True, check=False,
                         cwd=folder)
    return got.returncode, got.stdout + got.stderr


def main():
    failed = 0
    with tempfile.TemporaryDirectory(prefix="helio-config-") as folder:
        for text, code, said in ROWS:
            got, output = check(sys.argv[1], folder, text)
            if got != code or said not in output:
                print(f"{text!r}: {got} {output!r}, not {code} {said!r}")
                failed += 1
        for line, code, said in TOKENS:
            with open(os.path.join(folder, "tokens"), "w", encoding="utf-8") as f:
                f.write(line + "\n")
            got, output = check(sys.argv[1], folder, "tokens = tokens")
            if got != code or said not in output:
                print(f"{line!r}: {got} {output!r}, not {code} {said!r}")
                failed += 1
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
