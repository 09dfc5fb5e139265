#!/usr/bin/env python3
"""A client of heliod in 40 lines: loads a scene and writes its picture.

    client.py unix:/run/heliod.sock|tcp:HOST:PORT SCENE OUT.png     (a token comes from HELIO_TOKEN)
"""
import os
import socket
import struct
import sys

HELLO, WELCOME, AUTH, ERROR, PROGRESS, NOTICE = 0x0101, 0x0102, 0x0103, 0x0105, 0x010b, 0x010c
SCENE_OPEN, ASSET_LOAD, VIEW_SET, FRAME_REQUEST, PNG8 = 0x0201, 0x0207, 0x0301, 0x0304, 3


def text(value):
    return struct.pack("<I", len(value.encode())) + value.encode()


class Client:
    def __init__(self, url):
        kind, _, place = url.partition(":")
        host, _, port = place.rpartition(":")
        self.socket = (socket.create_connection((host, int(port))) if kind == "tcp"
                       else socket.socket(socket.AF_UNIX))
        if kind == "unix":
            self.socket.connect(place)
        self.stream, self.request = self.socket.makefile("rb"), 0
        self.socket.sendall(b"HGP\r\n\x1a\n\x01")

    def call(self, kind, payload):
        self.request += 1
        self.socket.sendall(struct.pack("<IHHII", len(payload), kind, 0, self.request, 0) + payload)
        while True:
            length, answer, _, _, _ = struct.unpack("<IHHII", self.stream.read(16))
            body = self.stream.read(length)
            if answer == ERROR:
                sys.exit("refused: %r" % body)
            if answer not in (PROGRESS, NOTICE):
                return body


def picture_of(frame):
    """The last field of a frame that is always there; stages and an optional hash come before it."""
    at = 4 + 52 + (32 if frame[0] & 1 else 0)
    (stages,) = struct.unpack_from("<I", frame, at)
    at += 4
    for _ in range(stages):
        at += 4 + struct.unpack_from("<I", frame, at)[0] + 8
    (size,) = struct.unpack_from("<I", frame, at)
    return frame[at + 4:at + 4 + size]


def main(url, scene, out):
    client = Client(url)
    welcome = client.call(HELLO, struct.pack("<HH", 1, 1) + text("example/1.0") + struct.pack("<I", 0))
    (server,) = struct.unpack_from("<I", welcome, 2)
    if welcome[2 + 4 + server + 8]:
        client.call(AUTH, text(os.environ["HELIO_TOKEN"]))
    opened = client.call(SCENE_OPEN, text(""))
    (first_id,) = struct.unpack_from("<I", opened, 9)
    client.call(ASSET_LOAD, struct.pack("<II", 0, first_id) + text(scene) + struct.pack("<I", 0))
    client.call(VIEW_SET, struct.pack("<IIII", 0b11, 1, 640, 360))  # bits: width and height
    frame = client.call(FRAME_REQUEST, struct.pack("<II?H", 0b1, 1, True, PNG8))  # bit: encoding
    with open(out, "wb") as file:
        file.write(picture_of(frame))


main(*sys.argv[1:])
