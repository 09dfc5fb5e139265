"""Reads PNG files for scripts."""
import struct
import zlib


def unfilter(mode, row, before, step):
    """Takes the filter off a row of bytes; `step` bytes are a pixel."""
    for i in range(len(row) if mode else 0):
        left = row[i - step] if i >= step else 0
        up, corner = before[i], before[i - step] if i >= step else 0
        if mode == 1:
            row[i] = (row[i] + left) & 255
        elif mode == 2:
            row[i] = (row[i] + up) & 255
        elif mode == 3:
            row[i] = (row[i] + (left + up) // 2) & 255
        elif mode == 4:
            guess = left + up - corner
            near = min((abs(guess - left), 0, left), (abs(guess - up), 1, up),
                       (abs(guess - corner), 2, corner))
            row[i] = (row[i] + near[2]) & 255


def read(path, bits=8):
    """(width, height, channels, rows of bytes) of an RGB or RGBA PNG with so many bits per channel."""
    with open(path, "rb") as file:
        data = file.read()
    at, body, head = 8, b"", None
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        if kind == b"IHDR":
            head = struct.unpack(">IIBBBBB", data[at + 8:at + 21])
        body += data[at + 8:at + 8 + size] if kind == b"IDAT" else b""
        at += size + 12
    width, height, depth, kind = head[:4]
    assert depth == bits and kind in (2, 6), "not a %d-bit RGB or RGBA PNG" % bits
    channels = 3 if kind == 2 else 4
    step = channels * bits // 8
    raw, stride = zlib.decompress(body), width * step
    rows, before = [], bytearray(stride)
    for y in range(height):
        row = bytearray(raw[y * (stride + 1) + 1:(y + 1) * (stride + 1)])
        unfilter(raw[y * (stride + 1)], row, before, step)
        rows.append(bytes(row))
        before = row
    return width, height, channels, rows
