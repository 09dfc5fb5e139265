"""transport_peers.py - a daemon for tests of its streams, and peers of it in independent code: raw sockets,
HTTP, WebSocket frames, messages of HGP as bytes."""

import contextlib
import fcntl
import os
import re
import shutil
import socket
import ssl
import struct
import subprocess
import tempfile
import time

from websocket_frames import frame

PREFACE = b"HGP\r\n\x1a\n\x01"
KEY = "dGhlIHNhbXBsZSBub25jZQ=="


def message(kind, payload, request=1):
    return struct.pack("<IHHII", len(payload), kind, 0, request, 0) + payload


def text(value):
    return struct.pack("<I", len(value)) + value.encode()


HELLO = PREFACE + message(0x0101, struct.pack("<HH", 1, 1) + text("test") + struct.pack("<I", 0))


def auth(token):
    return message(0x0103, text(token), 2)


class Daemon:
    def __init__(self, heliod, worker, *options, tokens="", env=None, passed=()):
        """passed: (name, socket) as from a service manager, from descriptor 3 on."""
        self.folder = tempfile.mkdtemp(prefix="helio-transports-")
        with open(self.path("tokens"), "w", encoding="utf-8") as f:
            os.fchmod(f.fileno(), 0o600)
            f.write("view-token-1 view anna\n" + tokens)
        os.mkdir(self.path("web"))
        self.write("web/index.html", "<!doctype html><title>t</title>")
        self.write("web/a.js", "export const a = 1\n" * 1000)
        self.write("web/a.js.gz", "as gzip")
        self.write("web/.secret", "no")
        self.args = [heliod, "--listen", "unix:" + self.path("sock"), "--port-file", self.path("ports"),
                     "--tokens", self.path("tokens"), "--cache-dir", self.path("cache"), "--worker", worker,
                     "--web-root", self.path("web"), "--isolation", "shared", "--sandbox", "off", *options]
        self.log = open(self.path("log"), "wb")
        if passed:
            env = dict(os.environ, LISTEN_FDS=str(len(passed)), LISTEN_FDNAMES=":".join(name for name, _ in passed))
            far = [fcntl.fcntl(s, fcntl.F_DUPFD, 50) for _, s in passed]
            self.args = ["sh", "-c", "export LISTEN_PID=$$; exec \"$@\"", "sh", *self.args]
            self.process = subprocess.Popen(
                self.args, stderr=self.log, env=env, pass_fds=range(3, 3 + len(far)),
                preexec_fn=lambda: [os.dup2(fd, 3 + i) for i, fd in enumerate(far)])
            for fd in far:
                os.close(fd)
        else:
            self.process = subprocess.Popen(self.args, stderr=self.log, env=env)
        wait(lambda: os.path.exists(self.path("ports")) or self.process.poll() is not None, "the port file")
        if self.process.poll() is not None:
            said = self.read_log()
            self.stop()
            raise ChildProcessError(said)
        with open(self.path("ports"), encoding="ascii") as f:
            self.ports = [int(line) for line in f]

    def path(self, name):
        return os.path.join(self.folder, name)

    def write(self, name, content):
        with open(self.path(name), "w", encoding="utf-8") as f:
            f.write(content)

    def read_log(self):
        with open(self.path("log"), encoding="utf-8", errors="replace") as f:
            return f.read()

    def stop(self):
        self.process.kill()
        self.process.wait()
        self.log.close()
        shutil.rmtree(self.folder)

    def metric(self, name):
        body = Http(self.ports[0]).get("/metrics")[2].decode()
        found = re.search("^" + re.escape(name) + r" (\S+)", body, re.M)
        return float(found.group(1)) if found else 0.0


def wait(condition, what, seconds=60):
    for _ in range(seconds * 50):
        if condition():
            return
        time.sleep(0.02)
    raise AssertionError("waited too long for " + what)


def connect(port):
    s = socket.create_connection(("127.0.0.1", port))
    s.settimeout(60)
    return s


def read_all(s):
    data = b""
    with contextlib.suppress(ConnectionError, ssl.SSLError):
        while part := s.recv(65536):
            data += part
    return data


class Stream:
    """A socket with what was read ahead."""

    def __init__(self, s):
        self.s, self.ahead = s, b""

    def take(self, count):
        while len(self.ahead) < count:
            part = self.s.recv(65536)
            assert part, "the daemon closed the connection"
            self.ahead += part
        out, self.ahead = self.ahead[:count], self.ahead[count:]
        return out

    def line(self):
        while b"\r\n" not in self.ahead:
            part = self.s.recv(65536)
            assert part, "the daemon closed the connection"
            self.ahead += part
        out, self.ahead = self.ahead.split(b"\r\n", 1)
        return out


class Http:
    def __init__(self, port, s=None):
        self.stream = Stream(s or connect(port))

    def send(self, data):
        self.stream.s.sendall(data)

    def answer(self, with_body=True):
        status = int(self.stream.line().split()[1])
        fields = {}
        while line := self.stream.line():
            name, value = line.split(b":", 1)
            fields[name.decode().lower()] = value.strip().decode()
        size = int(fields.get("content-length", "0")) if with_body else 0
        return status, fields, self.stream.take(size)

    def get(self, path, *fields, method="GET"):
        self.send("\r\n".join([f"{method} {path} HTTP/1.1", "Host: here", *fields, "", ""]).encode())
        return self.answer(method != "HEAD")


class WebSocket:
    def __init__(self, port, *fields, s=None, early=b""):
        self.http = Http(port, s)
        given = {"Upgrade": "websocket", "Connection": "keep-alive, Upgrade", "Sec-WebSocket-Version": "13",
                 "Sec-WebSocket-Key": KEY, "Sec-WebSocket-Protocol": "other, hgp.1",
                 "Sec-WebSocket-Extensions": "permessage-deflate; client_max_window_bits"}
        given.update(dict(f.split(": ", 1) for f in fields))
        lines = [f"{k}: {v}" for k, v in given.items() if v]
        self.http.send("\r\n".join(["GET /hgp HTTP/1.1", "Host: here:80", *lines, "", ""]).encode() + early)
        self.status, self.fields, self.body = self.http.answer()

    def send(self, *parts):
        self.http.send(b"".join(parts))

    def next(self):
        """Opcode and payload; a server's frame is final here and never masked."""
        first, second = self.http.stream.take(2)
        assert first & 0xF0 == 0x80 and not second & 0x80, (first, second)
        size = second
        if size == 126:
            size = struct.unpack(">H", self.http.stream.take(2))[0]
        elif size == 127:
            size = struct.unpack(">Q", self.http.stream.take(8))[0]
        return first & 15, self.http.stream.take(size)

    def close_code(self):
        """Of the close frame that comes next; then the stream ends."""
        opcode, payload = self.next()
        while opcode != 8:
            opcode, payload = self.next()
        code = struct.unpack(">H", payload[:2])[0] if payload else 1005
        with contextlib.suppress(ConnectionError):
            self.send(frame(0x88, payload[:2]))
        self.http.stream.s.settimeout(60)
        assert read_all(self.http.stream.s) == b""
        return code

    def hgp(self, count):
        """`count` messages of HGP: type and payload."""
        data, out = b"", []
        while len(out) < count:
            opcode, payload = self.next()
            assert opcode == 2
            data += payload
            while len(data) >= 16 and len(data) >= 16 + struct.unpack("<I", data[:4])[0]:
                size, kind = struct.unpack("<IH", data[:6])
                out.append((kind, data[16:16 + size]))
                data = data[16 + size:]
        return out
