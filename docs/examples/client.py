#!/usr/bin/env python3
"""A client of heliod in 40 lines: loads a scene and writes its picture.

    client.py unix:/run/heliod.sock|tcp:HOST:PORT SCENE OUT.png     (a token comes from HELIO_TOKEN)
"""
import itertools
import os
import socket
import struct
import sys

HELLO, WELCOME, AUTH, ERROR, PROGRESS, NOTICE = 0x0101, 0x0102, 0x0103, 0x0105, 0x010b, 0x010c
SCENE_OPEN, ASSET_LOAD, VIEW_SET, FRAME_REQUEST, PNG8 = 0x0201, 0x0207, 0x0301, 0x0304, 3

if len(sys.argv) != 4:
    sys.exit(print(__doc__, file=sys.stderr) or 2)
url, scene, out = sys.argv[1:]
kind, _, place = url.partition(":")
link = socket.create_connection(place.rsplit(":", 1)) if kind == "tcp" else socket.socket(socket.AF_UNIX)
if kind == "unix":
    link.connect(place)
link.sendall(b"HGP\r\n\x1a\n\x01")
stream, requests = link.makefile("rb"), itertools.count(1)


def text(value):
    return struct.pack("<I", len(value.encode())) + value.encode()


def call(message, payload):
    link.sendall(struct.pack("<IHHII", len(payload), message, 0, next(requests), 0) + payload)
    answer = PROGRESS
    while answer in (PROGRESS, NOTICE):
        length, answer, _, _, _ = struct.unpack("<IHHII", stream.read(16))
        body = stream.read(length)
    if answer == ERROR:
        sys.exit("refused: %r" % body)
    return body


welcome = call(HELLO, struct.pack("<HH", 1, 1) + text("example/1.0") + struct.pack("<I", 0))
if welcome[2 + 4 + struct.unpack_from("<I", welcome, 2)[0] + 8]:  # behind the server's name
    call(AUTH, text(os.environ["HELIO_TOKEN"]))
(first_id,) = struct.unpack_from("<I", call(SCENE_OPEN, text("")), 9)
call(ASSET_LOAD, struct.pack("<II", 0, first_id) + text(scene) + struct.pack("<I", 0))
call(VIEW_SET, struct.pack("<IIII", 0b11, 1, 320, 180))  # bits: width and height
frame = call(FRAME_REQUEST, struct.pack("<II?H", 0b1, 1, True, PNG8))  # bit: encoding
at = 4 + 52 + (32 if frame[0] & 1 else 0) + 4  # stages and an optional hash come before the picture
for _ in range(*struct.unpack_from("<I", frame, at - 4)):
    at += 4 + struct.unpack_from("<I", frame, at)[0] + 8
with open(out, "wb") as file:
    file.write(frame[at + 4:at + 4 + struct.unpack_from("<I", frame, at)[0]])
