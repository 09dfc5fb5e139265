"""websocket_frames.py - frames of RFC 6455 as bytes, and those that break a rule of it."""

import struct

MASK = bytes([0x37, 0xFA, 0x21, 0x3D])


def frame(first, payload=b"", mask=MASK, form=None):
    size, length = len(payload), b""
    if form is None:
        form = 7 if size < 126 else 16 if size < 65536 else 64
    if form == 7:
        second = size
    else:
        second, length = (126, struct.pack(">H", size)) if form == 16 else (127, struct.pack(">Q", size))
    head = bytes([first, second | (0x80 if mask else 0)]) + length
    if not mask:
        return head + payload
    return head + mask + bytes(b ^ mask[i % 4] for i, b in enumerate(payload))


# What breaks a rule of RFC 6455: bytes behind the handshake, and the code that the daemon closes with.
BROKEN = [
    ("reserved bit 1", frame(0xC2), 1002), ("reserved bit 2", frame(0xA2), 1002), ("reserved bit 3", frame(0x92), 1002),
    ("a deflated text", frame(0xC1, b"\xf2H\xcd"), 1002),
    *((f"opcode {n}", frame(0x80 | n), 1002) for n in (3, 4, 5, 6, 7, 11, 12, 13, 14, 15)),
    ("not masked", frame(0x82, b"a", mask=None), 1002),
    ("an unmasked ping", frame(0x89, mask=None), 1002),
    ("a fragmented ping", frame(0x09), 1002), ("a fragmented close", frame(0x08), 1002),
    ("a ping of 126 bytes", frame(0x89, b"a" * 126), 1002), ("a close of 126 bytes", frame(0x88, b"a" * 126), 1002),
    ("a continuation of nothing", frame(0x80, b"a"), 1002),
    ("a message within another", frame(0x02, b"a") + frame(0x82, b"b"), 1002),
    ("a long form of a short length", frame(0x82, b"a", form=16), 1002),
    ("the longest form of a short length", frame(0x82, b"a" * 126, form=64), 1002),
    ("a length with its highest bit", b"\x82\xff\x80" + b"\0" * 7 + MASK, 1002),
    ("a message that is too large", b"\x82\xff\0\0\1" + b"\0" * 5 + MASK, 1009),
    ("a text that is too large", b"\x81\xff" + struct.pack(">Q", 65537) + MASK, 1009),
    ("a text", frame(0x81, b"hello"), 1003), ("an empty text", frame(0x81), 1003),
    ("a text in fragments", frame(0x01, b"\xe2\x82") + frame(0x80, b"\xac"), 1003),
    ("no UTF-8", frame(0x81, b"\xff"), 1007), ("overlong UTF-8", frame(0x81, b"\xc0\xaf"), 1007),
    ("a surrogate", frame(0x81, b"\xed\xa0\x80"), 1007), ("a cut sequence", frame(0x81, b"\xe2\x82"), 1007),
    ("a bad byte before the end", frame(0x01, b"ab\xfe"), 1007),
    ("a close of one byte", frame(0x88, b"\x03"), 1002),
    *((f"close code {n}", frame(0x88, struct.pack(">H", n)), 1002)
      for n in (0, 999, 1004, 1005, 1006, 1015, 1016, 2999, 5000, 65535)),
    ("a reason that is no UTF-8", frame(0x88, struct.pack(">H", 1000) + b"\xff"), 1007),
]
