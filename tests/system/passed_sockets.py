#!/usr/bin/env python3
"""passed_sockets.py HELIOD FAKE_WORKER - sockets that a service manager passes: those that it names tls
(FileDescriptorName=tls of a systemd.socket) speak TLS, and never clear text."""
import os
import socket
import sys
import tempfile

import transports


def passed_sockets_speak_tls(heliod, worker):
    """Those that the service manager names tls; the others do not."""
    with tempfile.TemporaryDirectory(prefix="helio-pki-") as pki, socket.create_server(("127.0.0.1", 0)) as plain, \
            socket.create_server(("127.0.0.1", 0)) as tls:
        transports.make_certificates(pki)
        options = ["--tls-cert", os.path.join(pki, "localhost.pem"), "--tls-key", os.path.join(pki, "localhost.key")]
        passed = [("plain", plain), ("tls", tls)]
        d = transports.Daemon(heliod, worker, *options, passed=passed)
        try:
            ports = [s.getsockname()[1] for _, s in passed]
            assert sorted(d.ports) == sorted(ports), (d.ports, ports)
            assert transports.Http(ports[0]).get("/healthz")[0] == 200
            secured = transports.secure(transports.trusting(pki, "http/1.1"), ports[1])
            assert transports.Http(0, secured).get("/healthz")[0] == 200
            s = transports.connect(ports[1])
            s.sendall(b"GET /healthz HTTP/1.1\r\nHost: a\r\n\r\n")
            assert b" 200 " not in transports.read_all(s)
        finally:
            d.stop()
    with socket.create_server(("127.0.0.1", 0)) as only:  # without a certificate it does not start in clear text
        try:
            transports.Daemon(heliod, worker, passed=[("tls", only)]).stop()
            raise AssertionError("it started")
        except ChildProcessError as wrong:
            assert "tls-cert" in str(wrong), wrong


if __name__ == "__main__":
    passed_sockets_speak_tls(*sys.argv[1:3])
