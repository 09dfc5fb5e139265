#!/usr/bin/env python3
"""strangers.py - who has no token, over WebSocket and TLS: guesses tokens, and begins handshakes that it never
finishes, from many addresses. Beside it sessions of two tenants go on, and memory stays as it was.

  strangers.py HELIOD FAKE_WORKER

Loopback only, from addresses of 127.0.0.0/8."""

import contextlib
import os
import re
import socket
import ssl
import struct
import subprocess
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "system"))
from transports import (HELLO, MANY, Daemon, Http, Stream, WebSocket, auth, frame, is_served,  # noqa: E402
                        message, trusting, wait, with_tls)

GUESSES, TOGETHER, FLOOD, MIB = 1500, 50, 240, 2**20
TOKENS = "edit-token-bert edit bert\n"


def connect_from(number, port):
    """From another address, of another /24 network every 50."""
    s = socket.socket()
    s.bind((f"127.{1 + number // 50}.7.{1 + number % 50}", 0))
    s.connect(("127.0.0.1", port))
    s.settimeout(60)
    return s


class Honest:
    """A session with a scene, over a stream of its own."""

    def __init__(self, d, token, s=None):
        self.ws = WebSocket(d.ports[0] if s is None else 0, s=s, early=frame(0x82, HELLO + auth(token)))
        assert [kind for kind, _ in self.ws.hgp(2)] == [0x0102, 0x0104]
        self.number = 10

    def is_served(self):
        self.number += 1
        self.ws.send(frame(0x82, message(0x0107, struct.pack("<Q", self.number), self.number)))
        kind, payload = self.ws.hgp(1)[0]
        assert kind == 0x0108 and struct.unpack("<Q", payload[:8])[0] == self.number, (kind, payload)


def metric(d, name):
    """Over the unix socket, where the daemon's own user has slots that are kept."""
    s = socket.socket(socket.AF_UNIX)
    s.settimeout(60)
    s.connect(d.path("sock"))
    body = Http(0, s).get("/metrics")[2].decode()
    s.close()
    found = re.search("^" + re.escape(name) + r" (\S+)", body, re.M)
    return float(found.group(1)) if found else 0.0


def memory(d):
    return metric(d, "heliod_memory_bytes")


def guess_together(d, first, count, honest):
    """As many WebSockets at a time, each with a token that nobody has."""
    guessing = [WebSocket(d.ports[0], s=connect_from(n % 200, d.ports[0]),
                          early=frame(0x82, HELLO + auth(f"guess-{n:020d}"))) for n in range(first, first + count)]
    for it in honest:
        it.is_served()
    for ws in guessing:
        kinds = [kind for kind, _ in ws.hgp(3)]
        assert kinds[0] == 0x0102 and 0x0105 in kinds, kinds
        assert ws.close_code() == 1000
        ws.http.stream.s.close()


def tokens_are_guessed(d):
    honest = [Honest(d, "view-token-1"), Honest(d, "edit-token-bert")]
    guess_together(d, 0, TOGETHER, honest)
    wrong, before = metric(d, "heliod_wrong_tokens_total"), memory(d)
    for first in range(TOGETHER, TOGETHER + GUESSES, TOGETHER):
        guess_together(d, first, TOGETHER, honest)
    after = memory(d)
    assert metric(d, "heliod_wrong_tokens_total") == wrong + GUESSES
    assert metric(d, "heliod_sessions") == len(honest)
    print(f"  {GUESSES} guesses over WebSocket: memory {(after - before) / MIB:+.1f} MiB", flush=True)
    assert after < before + 4 * MIB
    is_served(d)


def guessing_waits(d):
    """With the usual limits: guesses of one address wait, whatever the number of its connections."""
    honest = [Honest(d, "view-token-1"), Honest(d, "edit-token-bert")]
    # One after the other, until the next one waits.
    for n in range(10):
        ws = WebSocket(d.ports[0], early=frame(0x82, HELLO + auth(f"guess-{n:020d}")))
        assert 0x0105 in [kind for kind, _ in ws.hgp(3)]
    wrong = metric(d, "heliod_wrong_tokens_total")
    waiting = [WebSocket(d.ports[0], early=frame(0x82, HELLO + auth(f"later-{n:020d}"))) for n in range(20)]
    for ws in waiting:
        assert ws.hgp(1)[0][0] == 0x0102  # all that is judged at once
    assert metric(d, "heliod_wrong_tokens_total") < wrong + len(waiting)
    for it in honest:
        it.is_served()
    is_served(d)  # from the same address, after a wait


def client_hello():
    """What a TLS client says first, by OpenSSL itself."""
    out = ssl.MemoryBIO()
    context = ssl.create_default_context()
    with contextlib.suppress(ssl.SSLWantReadError):
        context.wrap_bio(ssl.MemoryBIO(), out, server_hostname="localhost").do_handshake()
    return out.read()


def upgrade():
    fields = ("Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13",
              "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Protocol: hgp.1")
    return "\r\n".join(["GET /hgp HTTP/1.1", "Host: here:80", *fields, "", ""]).encode()


def enters_at_last(d, open_one):
    """A newcomer is refused at random while the flood lasts, and tries again."""
    for _ in range(400):
        with contextlib.suppress(ConnectionError, AssertionError, ssl.SSLError, TimeoutError):
            open_one().is_served()
            return
        time.sleep(0.05)  # slots come back, those of handshakes that take too long
    raise AssertionError("nobody gets in beside the flood")


def flood(d, port, beginnings, honest, open_one):
    """FLOOD handshakes that are begun, from many addresses, and not finished."""
    opened = []
    before = memory(d)
    for n in range(FLOOD):
        s = connect_from(n, port)
        with contextlib.suppress(ConnectionError):
            s.sendall(beginnings[n % len(beginnings)])
        opened.append(s)
        if n % 20 == 0:
            for it in honest:
                it.is_served()
    opening = metric(d, "heliod_connections_opening")
    assert opening <= 65, opening  # max-handshakes, and the one that asks
    during = memory(d)
    enters_at_last(d, open_one)
    assert metric(d, 'heliod_refused_total{reason="max-handshakes"}') > 0
    wait(lambda: metric(d, "heliod_connections_opening") <= 1, "the end of the handshakes (handshake-timeout)")
    for it in honest:
        it.is_served()
    for s in opened:
        s.close()
    print(f"  {FLOOD} handshakes begun: memory {(during - before) / MIB:+.1f} MiB", flush=True)
    assert during < before + 16 * MIB


def tls_handshakes_are_begun(d, pki):
    def open_one():
        return Honest(d, "view-token-1", trusting(pki, "http/1.1").wrap_socket(
            connect_from(400, d.ports[1]), server_hostname="localhost"))

    honest = [open_one(), Honest(d, "edit-token-bert")]
    hello = client_hello()
    flood(d, d.ports[1], [hello, hello[:5], hello[:-1], b"\x16\x03\x01\x40\x00", b""], honest, open_one)


def websockets_are_begun(d, pki):
    del pki
    honest = [Honest(d, "view-token-1"), Honest(d, "edit-token-bert")]
    half = frame(0x82, HELLO)
    flood(d, d.ports[0], [upgrade(), upgrade()[:-2], upgrade() + half, upgrade() + half[:3], upgrade() + frame(0x89)],
          honest, lambda: Honest(d, "view-token-1"))


def renegotiation_is_refused(d, pki):
    """In TLS 1.2 a client could ask for handshakes again and again; it is not given any."""
    context = trusting(pki, "hgp/1")
    context.maximum_version = ssl.TLSVersion.TLSv1_2
    with context.wrap_socket(connect_from(401, d.ports[1]), server_hostname="localhost") as s:
        s.sendall(HELLO + auth("view-token-1"))
        assert Stream(s).take(16)[4:6] == struct.pack("<H", 0x0102)
    asked = subprocess.run(["openssl", "s_client", "-connect", f"127.0.0.1:{d.ports[1]}", "-tls1_2", "-CAfile",
                            os.path.join(pki, "ca.pem")], input=b"R\n", capture_output=True, timeout=60, check=False)
    assert b"RENEGOTIATING" in asked.stdout + asked.stderr
    assert b"no renegotiation" in asked.stdout + asked.stderr, asked.stderr
    is_served(d)


def main():
    heliod, worker = sys.argv[1:3]
    plain = ["--listen", "tcp:127.0.0.1:0"]
    for options, case in (([*MANY, "--auth-failures", "100000", "--auth-failures-total", "1000000"], tokens_are_guessed),
                          ([], guessing_waits)):
        d = Daemon(heliod, worker, *plain, *options, tokens=TOKENS)
        try:
            case(d)
            print("ok", case.__name__, flush=True)
        finally:
            d.stop()
    usual = ["--max-connections", "600", "--max-per-network", "600", "--max-handshakes", "64", "--handshake-timeout", "3"]
    for case in (tls_handshakes_are_begun, websockets_are_begun, renegotiation_is_refused):
        with_tls(heliod, worker, plain, case, options=usual, tokens=TOKENS)


if __name__ == "__main__":
    main()
