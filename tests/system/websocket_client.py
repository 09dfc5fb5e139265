#!/usr/bin/env python3
"""websocket_client.py HELIOD FAKE_WORKER - the daemon's WebSocket by Python's websockets (Debian's
python3-websockets), which knows nothing of this project. Exit code 77: it is not installed."""

import asyncio
import struct
import sys

from transport_peers import Daemon, HELLO, auth, message

try:
    import websockets
except ImportError:
    print("python3-websockets is not installed")
    sys.exit(77)


class Hgp:
    def __init__(self, ws):
        self.ws, self.data = ws, b""

    async def next(self):
        while len(self.data) < 16 or len(self.data) < 16 + struct.unpack("<I", self.data[:4])[0]:
            part = await asyncio.wait_for(self.ws.recv(), 60)
            assert isinstance(part, bytes)
            self.data += part
        size, kind = struct.unpack("<IH", self.data[:6])
        payload, self.data = self.data[16:16 + size], self.data[16 + size:]
        return kind, payload


async def talk(port):
    url = f"ws://127.0.0.1:{port}/hgp"
    # It offers permessage-deflate, which is not taken.
    async with websockets.connect(url, subprotocols=["hgp.1"], origin=f"http://127.0.0.1:{port}") as ws:
        assert ws.subprotocol == "hgp.1" and not ws.extensions
        both = HELLO + auth("view-token-1")
        await ws.send([both[:5], both[5:30], both[30:]])  # in fragments
        hgp = Hgp(ws)
        assert [(await hgp.next())[0] for _ in range(2)] == [0x0102, 0x0104]
        for size in (0, 125):
            await asyncio.wait_for(await ws.ping(b"p" * size), 60)
        await ws.send(message(0x0107, struct.pack("<Q", 5), 3))
        assert await hgp.next() == (0x0108, struct.pack("<Q", 5))
    assert ws.close_code == 1000
    # A token that is wrong: the reason in HGP, then an orderly close.
    async with websockets.connect(url, subprotocols=["hgp.1"]) as ws:
        await ws.send(HELLO + auth("wrong-token-1"))
        hgp = Hgp(ws)
        assert [(await hgp.next())[0] for _ in range(2)] == [0x0102, 0x0105]
        await ws.wait_closed()
        assert ws.close_code == 1000
    async with websockets.connect(url, subprotocols=["hgp.1"]) as ws:
        await ws.send("a text")
        await ws.wait_closed()
        assert ws.close_code == 1003
    for options, status in (({"origin": "http://evil.example"}, 403), ({"subprotocols": ["chat"]}, 400)):
        try:
            async with websockets.connect(url, **{"subprotocols": ["hgp.1"], **options}):
                raise AssertionError("it was let in")
        except websockets.exceptions.InvalidStatusCode as e:
            assert e.status_code == status


def main():
    d = Daemon(*sys.argv[1:3], "--listen", "tcp:127.0.0.1:0")
    try:
        asyncio.run(talk(d.ports[0]))
    finally:
        d.stop()


if __name__ == "__main__":
    main()
