#!/usr/bin/env python3
"""haproxy.py - deploy/haproxy/haproxy.cfg with the real HAProxy and two daemons.

Six viewers of two scenes come over WebSockets through the proxy: four as browsers do, two by libhelio. Viewers of
a scene are on one daemon, whichever they are.
The daemons hear their addresses by the PROXY protocol, version 2, and the checks' LOCAL headers; a header of
an address that is not listed is refused. Then each daemon is drained and restarted, one after the other; every
viewer goes on with its session (ticket) and gets further frames. Workers are tests/system/fake_worker: nothing
is rendered.

Needs haproxy; without it the exit code is 77. HELIO_SOURCE_DIR, HELIO_BUILD_DIR, HELIO_LIBRARY from ctest.
"""
import base64
import json
import os
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
import urllib.parse

SOURCE, BUILD = os.environ["HELIO_SOURCE_DIR"], os.environ["HELIO_BUILD_DIR"]
sys.path.insert(0, os.path.join(SOURCE, "client", "python"))
import helio  # noqa: E402

PATIENCE_S = 120  # against hanging on a busy machine; nothing is measured
TOKEN = "haproxy-test-token"
PROXY, VIEWERS = "127.0.0.1", ("127.0.0.21", "127.0.0.22")  # where they come from


def until(holds, what):
    end = time.monotonic() + PATIENCE_S
    while not holds():
        if time.monotonic() > end:
            raise TimeoutError("not in time: " + what)
        time.sleep(0.05)


def dial(place, source=""):
    """place: the path of a unix socket, or a port of this machine."""
    if isinstance(place, int):
        return socket.create_connection((PROXY, place), 10, (source, 0))
    link = socket.socket(socket.AF_UNIX)
    link.settimeout(10)
    link.connect(place)
    return link


def http(place, target):
    """Status and body of a GET."""
    with dial(place) as link:
        link.sendall(("GET %s HTTP/1.1\r\nHost: test\r\nConnection: close\r\n\r\n" % target).encode())
        data = b"".join(iter(lambda: link.recv(65536), b""))
    head, _, body = data.partition(b"\r\n\r\n")
    return int(head.split()[1]), body.decode()


class Daemon:
    def __init__(self, folder, name):
        self.socket = os.path.join(folder, name + ".sock")
        self.ports, self.audit = os.path.join(folder, name + ".ports"), os.path.join(folder, name + ".audit")
        tokens = os.path.join(folder, "tokens")
        with open(tokens, "w", encoding="ascii") as f:
            os.fchmod(f.fileno(), 0o600)
            f.write(TOKEN + " edit viewer\n")
        self.log = open(os.path.join(folder, name + ".log"), "ab")
        self.arguments = [
            os.path.join(BUILD, "bin", "heliod"), "--listen", "unix:" + self.socket,
            "--state-dir", os.path.join(folder, name + ".state"), "--cache-dir", os.path.join(folder, name + ".cache"),
            "--worker", os.path.join(BUILD, "tests", "fake_worker"), "--sandbox", "off", "--cgroup", "off",
            "--durability", "written", "--drain-timeout", "10", "--tokens", tokens, "--proxy-from", PROXY,
            "--port-file", self.ports, "--audit", self.audit]
        self.port = 0
        self.scratch = os.path.join(folder, name + ".fake")
        for kind in (".state", ".cache", ".fake"):
            os.mkdir(os.path.join(folder, name + kind), 0o700)
        self.start()

    def start(self):
        listen = ["--listen", "tcp:%s:%d" % (PROXY, self.port)]
        self.process = subprocess.Popen(self.arguments + listen, stdout=self.log, stderr=self.log,
                                        env=dict(os.environ, HELIO_FAKE_DIR=self.scratch))
        until(self.is_ready, "a daemon that is ready")
        with open(self.ports, encoding="ascii") as f:
            self.port = int(f.read())

    def is_ready(self):
        if self.process.poll() is not None:
            raise RuntimeError("heliod ended with %d" % self.process.returncode)
        try:
            return http(self.socket, "/readyz")[0] == 200
        except OSError:
            return False

    def metric(self, name):
        body = http(self.socket, "/metrics")[1]
        return next(float(line.split()[1]) for line in body.splitlines() if line.startswith(name + " "))

    def logins(self):
        """Addresses of the audit log's sessions over tcp."""
        with open(self.audit, encoding="utf-8") as f:
            peers = [json.loads(line).get("peer", "") for line in f]
        return {peer for peer in peers if "127.0.0." in peer}

    def stop(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
        self.process.wait(PATIENCE_S)


class Tunnel:
    """A WebSocket client (RFC 6455) as a connected socket of raw bytes: `fd`."""

    def __init__(self, place, target, source=""):
        self.web = dial(place, source)
        self.web.settimeout(None)
        self.web.sendall(("GET %s HTTP/1.1\r\nHost: test\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                          "Sec-WebSocket-Key: %s\r\nSec-WebSocket-Version: 13\r\n"
                          "Sec-WebSocket-Protocol: hgp.1\r\n\r\n"
                          % (target, base64.b64encode(os.urandom(16)).decode())).encode())
        head = b""
        while not head.endswith(b"\r\n\r\n"):
            byte = self.web.recv(1)
            if not byte:
                raise ConnectionError("closed before it was a WebSocket")
            head += byte
        if head.split()[1] != b"101":
            self.web.close()
            raise ConnectionError(head.split(b"\r\n")[0].decode())
        self.near, far = socket.socketpair()
        self.fd = far.detach()
        for run in (self.send, self.receive):
            threading.Thread(target=run, daemon=True).start()

    def close(self):
        for link in (self.web, self.near):
            try:
                link.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass

    def frame(self, opcode, data):
        size = len(data)
        head = bytes([0x80 | opcode])
        head += bytes([0x80 | size]) if size < 126 else struct.pack(">BH", 0xfe, size) \
            if size < 65536 else struct.pack(">BQ", 0xff, size)
        mask = os.urandom(4)
        self.web.sendall(head + mask + bytes(b ^ mask[i % 4] for i, b in enumerate(data)))

    def send(self):
        try:
            while data := self.near.recv(65536):
                self.frame(2, data)
        except OSError:
            pass
        self.close()

    def exactly(self, size):
        data = b""
        while len(data) < size:
            more = self.web.recv(size - len(data))
            if not more:
                raise ConnectionError("end")
            data += more
        return data

    def receive(self):
        try:
            while True:
                first, second = self.exactly(2)
                size = second & 127
                if size > 125:
                    size = int.from_bytes(self.exactly(2 if size == 126 else 8), "big")
                data = self.exactly(size)
                if first & 15 == 8:
                    break
                if first & 15 == 9:
                    self.frame(10, data)
                elif first & 15 in (0, 2):
                    self.near.sendall(data)
        except OSError:
            pass
        self.close()


class Viewer(threading.Thread):
    """Looks at a scene until `stop`; goes on by its ticket when the connection ends."""

    def __init__(self, proxy, scene, source):
        super().__init__(daemon=True)
        self.proxy, self.scene, self.source = proxy, scene, source
        self.stop, self.frames, self.resumed, self.failure = False, 0, 0, None
        self.secret = None

    def dial(self):
        target = "/hgp?scene=" + urllib.parse.quote_plus(self.scene).replace("~", "%7E")  # as URLSearchParams
        self.tunnel = Tunnel(self.proxy, target, self.source)
        return helio.connect("tcp:proxy:1", token=TOKEN, fd=self.tunnel.fd, timeout=PATIENCE_S, answer_timeout=PATIENCE_S)

    def begin(self):
        session = self.dial()
        self.secret = session.call("keep", "ticket")["secret"]
        scene = session.scene(self.scene)
        if not scene.existed:
            scene.load("demo:")
        scene.view(16, 16)
        return session

    def go_on(self):
        """Dials until the daemon is back, as the browser's page does."""
        end = time.monotonic() + PATIENCE_S
        while True:
            try:
                session = self.dial()
                self.secret = session.call("resume", "resumed", secret=self.secret)["secret"]
                self.resumed += 1
                return session
            except (OSError, helio.HelioError) as wrong:
                lost = isinstance(wrong, OSError) or wrong.status in (
                    helio.Status.E_CLOSED, helio.Status.E_TIMEOUT, helio.Status.E_IO)
                if not lost or time.monotonic() > end:
                    raise
                time.sleep(0.1)

    def look(self, session):
        while not self.stop:
            answer = session.call("frame_request", "frame", view=1, settled=False, encoding="raw_rgba8")
            assert answer["width"] == 16
            self.frames += 1
            self.looked(session)
            time.sleep(0.02)

    def looked(self, session):
        pass

    def run(self):
        try:
            session = self.begin()
            while not self.stop:
                try:
                    self.look(session)
                except helio.HelioError as wrong:
                    if wrong.status not in (helio.Status.E_CLOSED, helio.Status.E_IO, helio.Status.E_STATE):
                        raise
                    session.close()
                    session = self.go_on()
            session.close()
        except BaseException as wrong:
            self.failure = wrong


class Native(Viewer):
    """By libhelio alone: the scene's name, WebSocket, and going on."""

    def __init__(self, proxy, scene):
        super().__init__(proxy, scene, "")

    def begin(self):
        session = native(self.proxy, self.scene, reconnect=PATIENCE_S)
        session.scene(self.scene).view(16, 16)
        return session

    def looked(self, session):
        self.resumed = session.info.reconnects

    def go_on(self):
        raise AssertionError("libhelio did not go on with the session")


def native(port, scene, **options):
    return helio.connect("ws://%s:%d" % (PROXY, port), token=TOKEN, timeout=PATIENCE_S, answer_timeout=PATIENCE_S, scene=scene, **options)


def admin(path, command):
    with socket.socket(socket.AF_UNIX) as link:
        link.connect(path)
        link.sendall((command + "\n").encode())
        return b"".join(iter(lambda: link.recv(4096), b"")).decode().strip()


def is_up(panel, count):
    rows = [line.split(",") for line in admin(panel, "show stat heliod 4 -1").splitlines()]
    return sum(row[1] in ("d1", "d2") and row[17].startswith("UP") for row in rows if len(row) > 17) == count


def restart(daemon, name, viewers, panel):
    """The procedure of docs/operations.md."""
    said = admin(panel, "set server heliod/%s state drain" % name)
    assert said == "", said
    before = {v: v.resumed for v in viewers}
    mine = int(daemon.metric("heliod_sessions"))
    daemon.stop()
    daemon.start()
    until(lambda: sum(v.resumed - before[v] for v in viewers) >= mine or any(v.failure for v in viewers),
          "%d sessions that go on" % mine)
    admin(panel, "set server heliod/%s state ready" % name)
    frames = {v: v.frames for v in viewers}
    until(lambda: all(v.frames > frames[v] or v.failure for v in viewers), "frames after the restart")
    return mine


def free_port():
    with socket.socket() as link:
        link.bind((PROXY, 0))
        return link.getsockname()[1]


def header(source):
    """Of the PROXY protocol, version 2: somebody at `source`."""
    there = socket.inet_aton(source) + socket.inet_aton(PROXY) + struct.pack(">HH", 5, 6)
    return b"\r\n\r\n\0\r\nQUIT\n\x21\x11" + struct.pack(">H", len(there)) + there


def only_listed_addresses_are_believed(daemon):
    before = daemon.metric("heliod_sessions")
    with dial(daemon.port, VIEWERS[0]) as link:  # not in proxy-from: what it says is no HTTP and no HGP
        link.sendall(header("127.0.0.77") + b"GET /readyz HTTP/1.1\r\nHost: test\r\nConnection: close\r\n\r\n")
        try:
            assert b" 200 " not in link.recv(4096)
        except ConnectionError:
            pass
    with dial(daemon.port, PROXY) as link:  # listed: without a header nothing is answered
        link.sendall(b"GET /readyz HTTP/1.1\r\nHost: test\r\nConnection: close\r\n\r\n")
        try:
            assert b" 200 " not in link.recv(4096)
        except ConnectionError:
            pass
    assert daemon.metric("heliod_sessions") == before


def limits_are_named(session, scene):
    session.scene(scene)
    try:
        for i in range(17):
            session.call("view_set", "ok", view=i + 1, width=16, height=16)
    except helio.HelioError as wrong:
        assert wrong.limit == "max-views" and wrong.retry_after is None, (wrong, wrong.limit, wrong.retry_after)
        return
    raise AssertionError("17 views")


def check(folder):
    bind, numbers, panel = free_port(), free_port(), os.path.join(folder, "admin.sock")
    daemons = [Daemon(folder, name) for name in ("d1", "d2")]
    env = dict(os.environ, HELIO_BIND="%s:%d" % (PROXY, bind), HELIO_ADMIN=panel, HELIO_METRICS="%s:%d" % (PROXY, numbers),
               **{"HELIO_D%d" % (i + 1): "%s:%d" % (PROXY, d.port) for i, d in enumerate(daemons)})
    proxy = subprocess.Popen(["haproxy", "-db", "-f", os.path.join(SOURCE, "deploy/haproxy/haproxy.cfg")], env=env,
                             stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    viewers = []
    try:
        until(lambda: os.path.exists(panel), "haproxy")
        until(lambda: is_up(panel, 2), "daemons that pass the checks")
        assert http(bind, "/readyz")[0] == 200
        assert http(bind, "/metrics")[0] == 403
        for path in ("/%6detrics", "/metric%73", "//metrics", "/metrics/"):  # not as the rule has it
            assert http(bind, path)[0] == http(daemons[0].socket, path)[0] == 404, path
        for name in ("d1", "d2"):
            status, said = http(numbers, "/%s/metrics" % name)
            assert status == 200 and "\nheliod_sessions 0\n" in said, said[:200]
        assert http(numbers, "/d3/metrics")[0] == http(numbers, "/readyz")[0] == 404
        names, i = {}, 0
        while len(names) < 2:  # two names that hash to different daemons
            name, i = "hall %d, größte & ~" % i, i + 1
            assert i < 64, "all scenes come to one daemon: their names are not seen"
            session = native(bind, name)
            at = [int(d.metric("heliod_sessions")) for d in daemons].index(1)
            names.setdefault(at, name)
            if not i > 1:
                limits_are_named(session, name)
            session.close()
            until(lambda: sum(d.metric("heliod_sessions") for d in daemons) == 0, "a session that has ended")
        only_listed_addresses_are_believed(daemons[0])
        viewers = [Viewer(bind, names[i % 2], VIEWERS[i // 2]) for i in range(4)]
        for viewer in viewers:
            viewer.start()
        until(lambda: all(v.frames > 3 or v.failure for v in viewers), "first frames")
        viewers += [Native(bind, names[i]) for i in range(2)]
        for viewer in viewers[4:]:
            viewer.start()
        until(lambda: all(v.frames > 3 or v.failure for v in viewers), "frames of libhelio")
        assert not any(v.failure for v in viewers), [v.failure for v in viewers]
        assert [d.metric("heliod_sessions") for d in daemons] == [3, 3], "viewers of a scene are together"
        assert [d.metric("heliod_scenes") for d in daemons] == [1, 1]
        restarted = sum(restart(d, name, viewers, panel) for d, name in zip(daemons, ("d1", "d2")))
        failures = [v.failure for v in viewers if v.failure]
        for viewer in viewers:
            viewer.stop = True
        for viewer in viewers:
            viewer.join(PATIENCE_S)
        print("6 viewers, 2 daemons restarted, %d sessions went on, %d failed, %d frames"
              % (restarted, len(failures), sum(v.frames for v in viewers)))
        assert not failures, failures
        for d in daemons:
            peers = " ".join(d.logins())
            assert all(address in peers for address in VIEWERS), peers
        assert restarted == 6 and all(v.resumed == 1 for v in viewers)
    finally:
        proxy.terminate()
        proxy.wait(PATIENCE_S)
        for d in daemons:
            d.stop()


def main():
    if not shutil.which("haproxy"):
        print("haproxy is not installed")
        sys.exit(77)
    with tempfile.TemporaryDirectory(prefix="hgp") as folder:
        try:
            check(folder)
        except BaseException:
            for name in filter(lambda n: n.endswith(".log"), sorted(os.listdir(folder))):
                with open(os.path.join(folder, name), encoding="utf-8", errors="replace") as f:
                    print("".join(f.readlines()[-15:]))
            raise


if __name__ == "__main__":
    main()
