#!/usr/bin/env python3
"""prometheus.py HELIOD FAKE_WORKER - deploy/prometheus with the real Prometheus: it scrapes a daemon, every rule
is evaluated, a recorded rate and an alert's expression have values. Their intervals are a second here. Exit code
77: prometheus is not installed."""

import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import urllib.parse
import urllib.request

from transport_peers import HELLO, Daemon, WebSocket, auth, wait
from websocket_frames import frame

RULES = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "deploy", "prometheus")


def read(name):
    with open(os.path.join(RULES, name), encoding="utf-8") as f:
        return f.read()


def write(path, text):
    with open(path, "w", encoding="utf-8") as f:
        f.write(text)


class Prometheus:
    def __init__(self, folder, target):
        config = read("prometheus.yml").replace("scrape_interval: 15s", "scrape_interval: 1s\n  evaluation_interval: 1s")
        config = config.replace("['127.0.0.1:7401', '127.0.0.1:7402']", json.dumps([target]))
        assert target in config and "interval: 15s" in read("heliod.rules.yml")
        write(os.path.join(folder, "prometheus.yml"), config)
        write(os.path.join(folder, "heliod.rules.yml"), read("heliod.rules.yml").replace("interval: 15s", "interval: 1s"))
        with socket.socket() as s:
            s.bind(("127.0.0.1", 0))
            self.port = s.getsockname()[1]
        self.log = open(os.path.join(folder, "log"), "wb")
        self.process = subprocess.Popen(
            ["prometheus", "--config.file=" + os.path.join(folder, "prometheus.yml"), "--storage.tsdb.path=" + os.path.join(folder, "data"),
             f"--web.listen-address=127.0.0.1:{self.port}"], stdout=self.log, stderr=self.log)

    def ask(self, path, **query):
        """`data` of an answer; None: it is not up yet."""
        assert self.process.poll() is None, "prometheus ended"
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{self.port}/api/v1/{path}?{urllib.parse.urlencode(query)}", timeout=20) as r:
                answer = json.load(r)
        except OSError:
            return None
        assert answer["status"] == "success", answer
        return answer["data"]

    def value(self, expr):
        data = self.ask("query", query=expr)
        return float(data["result"][0]["value"][1]) if data and data["result"] else None

    def rules(self):
        data = self.ask("rules")
        return [rule for group in data["groups"] for rule in group["rules"]] if data else []

    def stop(self):
        self.process.kill()
        self.process.wait()
        self.log.close()


def check(p, target):
    def is_scraped():
        data = p.ask("targets")
        targets = data["activeTargets"] if data else []
        return [t["health"] for t in targets if t["labels"]["instance"] == target] == ["up"]

    wait(is_scraped, "a target that is up")
    wait(lambda: p.value("heliod_sessions") == 1, "the session")
    wait(lambda: p.rules() and all(r["health"] == "ok" for r in p.rules()), "rules that are evaluated")
    assert {"HeliodDown", "instance:heliod_bytes_out:rate1m"} <= {r["name"] for r in p.rules()}
    wait(lambda: p.value("instance:heliod_bytes_out:rate1m") is not None, "a recorded rate")
    assert p.value('up{job="heliod"}') == 1
    assert not [r for r in p.rules() if r.get("state") == "firing"]


def main():
    if not shutil.which("prometheus"):
        print("SKIPPED: missing: prometheus")
        sys.exit(77)
    d = Daemon(*sys.argv[1:3], "--listen", "tcp:127.0.0.1:0")
    try:
        ws = WebSocket(d.ports[0], early=frame(0x82, HELLO + auth("view-token-1")))
        ws.hgp(2)
        target = f"127.0.0.1:{d.ports[0]}"
        with tempfile.TemporaryDirectory(prefix="helio-prometheus-") as folder:
            p = Prometheus(folder, target)
            try:
                check(p, target)
            except BaseException:
                with open(os.path.join(folder, "log"), encoding="utf-8", errors="replace") as f:
                    print("".join(f.readlines()[-15:]))
                raise
            finally:
                p.stop()
    finally:
        d.stop()


if __name__ == "__main__":
    main()
