#!/usr/bin/env python3
"""websocket_ws.py HELIOD FAKE_WORKER - the daemon's WebSocket by npm's ws (tests/browser/websocket.mjs): a
session, refused upgrades, and all rows of websocket_frames.py's table of broken rules. Exit code 77: no Node, or
`npm ci --prefix tests/browser` was not run."""

import base64
import json
import os
import shutil
import subprocess
import sys

from transport_peers import HELLO, Daemon, auth
from transports import is_served
from websocket_frames import BROKEN

BROWSER = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "browser")


def main():
    for there, what in ((shutil.which("node"), "node"),
                        (os.path.isdir(os.path.join(BROWSER, "node_modules", "ws")), "npm ci --prefix tests/browser")):
        if not there:
            print("SKIPPED: missing: " + what)
            sys.exit(77)

    def pack(data):
        return base64.b64encode(data).decode()

    table = {"broken": [{"what": what, "data": pack(data), "code": code} for what, data, code in BROKEN],
             "hello": pack(HELLO), "auth": pack(auth("view-token-1"))}
    d = Daemon(*sys.argv[1:3], "--listen", "tcp:127.0.0.1:0")
    try:
        counter = 'heliod_refused_total{reason="websocket"}'
        subprocess.run(["node", os.path.join(BROWSER, "websocket.mjs"), f"ws://127.0.0.1:{d.ports[0]}/hgp"],
                       input=json.dumps(table), text=True, timeout=100, check=True)
        assert d.metric(counter) == len(BROKEN), d.metric(counter)
        is_served(d)
    finally:
        d.stop()


if __name__ == "__main__":
    main()
