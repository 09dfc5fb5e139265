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
    # Why a file cannot be read is said.
    ("tls-cert = none.pem", 2, "none.pem: no certificate can be read from it: No such file or directory"),
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
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
