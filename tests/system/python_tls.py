#!/usr/bin/env python3
"""python_tls.py HELIOD FAKE_WORKER - helio.connect over ws, tls and wss: which certificates of the daemon are trusted and
what is said of the others, and the client's own certificate. HELIO_SOURCE_DIR and HELIO_LIBRARY come from ctest."""

import hashlib
import os
import pathlib
import ssl
import subprocess
import sys
import tempfile
import unittest

from transport_peers import Daemon
from transports import make_certificates

sys.path.insert(0, os.path.join(os.environ["HELIO_SOURCE_DIR"], "client", "python"))
import helio  # noqa: E402

TOKEN = "view-token-1"


class Tls(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="helio-pki-")
        cls.addClassCleanup(folder.cleanup)
        cls.pki = pathlib.Path(folder.name)
        make_certificates(folder.name)  # carla's is of ca.pem; the daemon's own signs itself
        subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-keyout", "own.key",
                        "-out", "own.pem", "-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1", "-days", "30"],
                       check=True, cwd=cls.pki, capture_output=True)
        cls.pin = hashlib.sha256(ssl.PEM_cert_to_DER_cert((cls.pki / "own.pem").read_text())).hexdigest()
        daemon = Daemon(*sys.argv[1:3], "--listen", "tcp:127.0.0.1:0", "--listen", "tls:127.0.0.1:0", "--tls-cert", str(cls.pki / "own.pem"),
                        "--tls-key", str(cls.pki / "own.key"), "--tls-client-ca", str(cls.pki / "ca.pem"),
                        tokens="subject:carla admin carla-tenant\n")
        cls.addClassCleanup(daemon.stop)
        plain, tls = daemon.ports
        cls.plain = ("tcp:127.0.0.1:%d" % plain, "ws://127.0.0.1:%d" % plain, "ws://127.0.0.1:%d/hgp" % plain)
        cls.secure = ("tls:localhost:%d" % tls, "tls://127.0.0.1:%d" % tls, "wss://localhost:%d" % tls, "wss://localhost:%d/hgp" % tls)

    def refused(self, url, status, **options):
        with self.assertRaises(helio.HelioError, msg=(url, options)) as caught:
            helio.connect(url, token=TOKEN, **options)
        self.assertEqual(caught.exception.status, status, (url, options, caught.exception))
        return str(caught.exception)

    def test_trusted(self):
        for urls, ways in ((self.plain, ({},)), (self.secure, (
                {"tls_ca": str(self.pki / "own.pem")}, {"tls_ca": self.pki / "own.pem"}, {"tls_pin": self.pin}, {"tls_insecure": True}))):
            for url in urls:
                for options in ways:
                    with helio.connect(url, token=TOKEN, **options) as session:
                        self.assertEqual(session.info.role, helio.Role.VIEW)
                        self.assertGreater(session.ping(), 0)

    def test_others_are_refused(self):
        for url in self.secure:
            for options, said in (({}, "the server's certificate: self-signed certificate"),
                                  ({"tls_ca": self.pki / "ca.pem"}, "the server's certificate: self-signed certificate"),
                                  ({"tls_pin": "0" * 64}, "the server's certificate is not the pinned one")):
                text = self.refused(url, helio.Status.E_AUTH, **options)
                self.assertIn(said, text)
                self.assertIn(url, text)
            self.assertIn("64 digits", self.refused(url, helio.Status.E_INVAL, tls_pin="abc"))
            for options in ({"tls_ca": "/nonexistent/none.pem"}, {"tls_cert": "/nonexistent/none.pem", "tls_pin": self.pin}):
                self.assertIn("from /nonexistent/none.pem: No such file", self.refused(url, helio.Status.E_INVAL, **options))
        self.assertIn("may not speak TLS", self.refused(self.plain[0].replace("tcp:", "tls:"), helio.Status.E_CLOSED, tls_insecure=True))

    def test_own_certificate(self):
        both = self.pki / "both.pem"
        both.write_text((self.pki / "carla.pem").read_text() + (self.pki / "carla.key").read_text())
        for url in self.secure:
            for options in ({"tls_cert": self.pki / "carla.pem", "tls_key": self.pki / "carla.key"}, {"tls_cert": both}):
                with helio.connect(url, tls_pin=self.pin, **options) as session:
                    self.assertEqual(session.info.role, helio.Role.ADMIN)

    def test_without_waiting(self):
        with helio.connect(self.secure[2], token=TOKEN, wait=False) as session:
            with self.assertRaises(helio.HelioError) as caught:
                while True:
                    session.wait(20)
            self.assertEqual(caught.exception.status, helio.Status.E_AUTH)


if __name__ == "__main__":
    os.environ.pop("HELIO_TOKEN", None)
    unittest.main(argv=sys.argv[:1])
