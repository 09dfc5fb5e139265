#!/usr/bin/env python3
"""tls_refusals.py - who is refused by a tls listener, or by another one for speaking TLS: each refusal is logged with its
reason and the address, counted by its kind, where it is about a client's certificate audited, and seen by the client. And certificates
of the daemon that expire.

  tls_refusals.py HELIOD FAKE_WORKER HELIO

Clients are raw sockets and OpenSSL of Python's ssl. Loopback only."""

import json
import os
import shutil
import signal
import ssl
import subprocess
import sys
import tempfile

from transport_peers import HELLO, Daemon, connect, read_all, wait
from transports import is_served, make_certificates, trusting


def make_more(folder):
    """Certificates of carla: one that has expired, one of another authority, one for servers only."""
    def run(*args):
        subprocess.run(["openssl", *args], check=True, cwd=folder, capture_output=True)

    key = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes")
    with open(os.path.join(folder, "ca.cnf"), "w", encoding="ascii") as f:
        f.write("[ca]\ndefault_ca=d\n[d]\ndatabase=index\nnew_certs_dir=.\nserial=number\ndefault_md=sha256\npolicy=p\n"
                "unique_subject=no\n[p]\ncommonName=supplied\n")
    with open(os.path.join(folder, "index"), "w", encoding="ascii"):
        pass
    with open(os.path.join(folder, "number"), "w", encoding="ascii") as f:
        f.write("4000\n")
    for name in ("expired", "strange", "server_only"):
        run("req", *key, "-keyout", name + ".key", "-out", name + ".csr", "-subj", "/CN=carla")
    run("ca", "-batch", "-notext", "-config", "ca.cnf", "-cert", "ca.pem", "-keyfile", "ca.key", "-in", "expired.csr", "-out",
        "expired.pem", "-startdate", "20200101000000Z", "-enddate", "20210101000000Z")
    run("req", "-x509", *key, "-keyout", "other.key", "-out", "other.pem", "-subj", "/CN=another authority", "-days", "30")
    run("x509", "-req", "-in", "strange.csr", "-CA", "other.pem", "-CAkey", "other.key", "-CAcreateserial", "-days", "30",
        "-out", "strange.pem")
    with open(os.path.join(folder, "use"), "w", encoding="ascii") as f:
        f.write("extendedKeyUsage=serverAuth\n")
    run("x509", "-req", "-in", "server_only.csr", "-CA", "ca.pem", "-CAkey", "ca.key", "-CAcreateserial", "-days", "30",
        "-extfile", "use", "-out", "server_only.pem")


def client(pki, own=None, alpn=None, most=None, ciphers=None, trusts=True):
    context = trusting(pki, *(alpn or []), own=own)
    if not trusts:
        context = ssl.create_default_context()
    if most:
        context.minimum_version = ssl.TLSVersion.TLSv1
        context.maximum_version = most
    if ciphers:
        context.set_ciphers(ciphers)
    return context


def alert_of(context, port):
    """How a client learns that it is refused: in the handshake, or with TLS 1.3 at its first read."""
    try:
        with context.wrap_socket(connect(port), server_hostname="localhost") as s:
            s.sendall(HELLO)
            assert s.recv(1) == b"", "it was let in"
            return "the end"
    except ssl.SSLError as err:
        return str(err).upper().replace(" ", "_")


ANY = "ALL:@SECLEVEL=0"
OLD, NEW = ssl.TLSVersion.TLSv1_2, ssl.TLSVersion.TLSv1_3
# What the client is, the counter, the daemon's reason, the client's.
CERTIFICATES = [
    ({"own": own, "most": most}, "certificate", reason, alert) for most in (OLD, NEW) for own, reason, alert in (
        (None, "the client has no certificate (tls-client-auth=require)", ("HANDSHAKE_FAILURE", "CERTIFICATE_REQUIRED")),
        ("expired", "the client's certificate 'carla' is refused: certificate has expired", ("CERTIFICATE_EXPIRED",)),
        ("strange", "the client's certificate 'carla' is refused: unable to get local issuer", ("UNKNOWN_CA",)),
        ("server_only", "the client's certificate 'carla' is refused: un", ("UNSUPPORTED_CERTIFICATE", "CERTIFICATE")))]
OTHERS = [
    ({"own": "carla", "most": ssl.TLSVersion.TLSv1, "ciphers": ANY}, "tls", "the client speaks TLS 1.0; 1.2 is the oldest", ("PROTOCOL_VERSION",)),
    ({"own": "carla", "most": ssl.TLSVersion.TLSv1_1, "ciphers": ANY}, "tls", "the client speaks TLS 1.1; 1.2 is the oldest", ("PROTOCOL_VERSION",)),
    ({"own": "carla", "most": OLD, "ciphers": "AES128-SHA:@SECLEVEL=0"}, "tls", "TLS: no shared cipher", ("HANDSHAKE_FAILURE",)),
    ({"own": "carla", "alpn": ["h2"]}, "tls", "asks for neither hgp/1 nor http/1.1", ("NO_APPLICATION_PROTOCOL",)),
    ({"trusts": False}, "tls", "the client ended the handshake: unknown CA", ("CERTIFICATE_VERIFY_FAILED",)),
]


class Watch:
    """What the daemon says of a refusal."""

    def __init__(self, d):
        self.d, self.log = d, len(d.read_log())

    def counts(self):
        names = ("certificate", "tls", "preface", "handshake-timeout")
        return {n: self.d.metric(f'heliod_refused_total{{reason="{n}"}}') for n in names}

    def expect(self, before, kind, reason):
        wait(lambda: "closing 127.0.0.1: " in self.d.read_log()[self.log:], reason)
        said = self.d.read_log()[self.log:]
        assert reason in said, f"{said!r} has not {reason!r}"
        after = self.counts()
        assert after == dict(before, **{kind: before[kind] + 1}), (reason, before, after)


def are_refused(d, pki):
    port = d.ports[1]
    for what, kind, reason, alerts in CERTIFICATES + OTHERS:
        watch = Watch(d)
        before = watch.counts()
        alert = alert_of(client(pki, **what), port)
        assert any(a in alert for a in alerts), (what, alert)
        watch.expect(before, kind, reason)
    for listener, data, kind, reason in (
            (1, b"GET / HTTP/1.1\r\nHost: a\r\n\r\n", "tls", "a request of plain HTTP came; this listener speaks https and wss"),
            (1, HELLO, "tls", "what came is not TLS"),
            (0, b"\x16\x03\x01\x02\0\x01\0", "preface", "speaks TLS; this listener does not")):
        watch = Watch(d)
        before = watch.counts()
        s = connect(d.ports[listener])
        s.sendall(data)
        read_all(s)
        watch.expect(before, kind, reason)
    with open(d.path("audit"), encoding="utf-8") as f:
        lines = [json.loads(line) for line in f]
    refused = [line for line in lines if line["event"] == "login" and line["result"] == "auth"]
    assert [line["detail"][5:20] for line in refused] == [row[2][:15] for row in CERTIFICATES], refused
    assert all(line["peer"] == "127.0.0.1" for line in refused)
    with client(pki, own="carla").wrap_socket(connect(port), server_hostname="localhost") as s:
        s.sendall(HELLO)
        assert s.recv(1), "who has a good certificate is let in"
    is_served(d)


def helio_says_why(d, pki, helio):
    """The command's message and exit code, also where TLS 1.3 tells it behind the handshake."""
    rows = [(None, "the server asks for a certificate (--tls-cert)"),
            ("expired", "the server refuses this client's certificate: certificate expired"),
            ("strange", "the server refuses this client's certificate: unknown CA")]
    for scheme in ("tls:localhost:", "wss://localhost:"):
        for own, said in rows:
            shown = ["--tls-cert", os.path.join(pki, own + ".pem"), "--tls-key", os.path.join(pki, own + ".key")] if own else []
            got = subprocess.run([helio, "ping", "--count", "1", "-c", scheme + str(d.ports[1]), "--token", "view-token-1", "--tls-ca",
                                  os.path.join(pki, "ca.pem"), *shown], capture_output=True, text=True, check=False)
            assert got.returncode == 5 and said in got.stderr, (scheme, own, got)
    got = subprocess.run([helio, "ping", "--count", "1", "-c", f"tls:localhost:{d.ports[0]}", "--insecure"], capture_output=True, text=True,
                         check=False)
    assert got.returncode == 4 and "it may not speak TLS there" in got.stderr, got


def expiry_is_watched(d, pki):
    """The metric is the file's date; an expired certificate is taken, since all but those who check it can go on, and warned of."""
    def ends(name):
        dates = subprocess.run(["openssl", "x509", "-noout", "-enddate", "-in", os.path.join(pki, name)], check=True,
                               capture_output=True, text=True).stdout
        return ssl.cert_time_to_seconds(dates.strip().split("=")[1])

    metric = "heliod_tls_certificate_not_after_timestamp_seconds"
    assert d.metric(metric) == ends("localhost.pem")
    for suffix in (".pem", ".key"):
        shutil.copy(os.path.join(pki, "expired" + suffix), os.path.join(pki, "localhost" + suffix))
    os.chmod(os.path.join(pki, "localhost.key"), 0o644)
    warnings = (f"the certificate in {pki}/localhost.pem has expired at 2021-01-01T00:00:00Z", f"the private key in {pki}/localhost.key can be read")
    got = subprocess.run([*d.args, "--check-config"], check=False, capture_output=True, text=True)
    assert got.returncode == 0 and all(w in got.stderr for w in warnings), got
    d.process.send_signal(signal.SIGHUP)
    wait(lambda: "reloaded:" in d.read_log(), "the reload")
    assert all(w in d.read_log() for w in warnings)
    assert d.metric(metric) == ends("expired.pem")


def keys_of_root_are_warned_of(heliod, worker, pki):
    """Started as root the daemon reads a key that only root may read, once: the next certificate would not be taken."""
    if os.geteuid() != 0:
        return
    with tempfile.TemporaryDirectory(prefix="helio-root-") as folder:
        for path, mode in ((folder, 0o777), (pki, 0o755), (os.path.join(pki, "second.key"), 0o600)):
            os.chmod(path, mode)
        log = os.path.join(folder, "log")
        with open(log, "wb") as f:
            process = subprocess.Popen([heliod, "--user", "nobody", "--listen", "unix:" + os.path.join(folder, "sock"), "--cache-dir",
                                        os.path.join(folder, "cache"), "--worker", worker, "--sandbox", "off", "--tls-cert",
                                        os.path.join(pki, "second.pem"), "--tls-key", os.path.join(pki, "second.key")], stderr=f)
        try:
            wait(lambda: "runs as nobody" in open(log, encoding="utf-8").read(), "the daemon")
            wait(lambda: f"nobody cannot read {pki}/second.key: every reload will be refused" in open(log, encoding="utf-8").read(), "the warning")
            assert "second.pem: every" not in open(log, encoding="utf-8").read()
        finally:
            process.kill()
            process.wait()


def main():
    with tempfile.TemporaryDirectory(prefix="helio-pki-") as pki:
        make_certificates(pki)
        make_more(pki)
        keys_of_root_are_warned_of(sys.argv[1], sys.argv[2], pki)
        audit = os.path.join(pki, "audit")
        d = Daemon(*sys.argv[1:3], "--listen", "tcp:127.0.0.1:0", "--listen", "tls:127.0.0.1:0", "--tls-cert", os.path.join(pki, "localhost.pem"),
                   "--tls-key", os.path.join(pki, "localhost.key"), "--tls-client-ca", os.path.join(pki, "ca.pem"),
                   "--tls-client-auth", "require", "--audit", audit, tokens="subject:carla admin carla-tenant\n")
        os.symlink(audit, d.path("audit"))
        try:
            are_refused(d, pki)
            helio_says_why(d, pki, sys.argv[3])
            expiry_is_watched(d, pki)
        finally:
            d.stop()


if __name__ == "__main__":
    main()
