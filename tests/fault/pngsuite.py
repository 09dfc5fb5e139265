#!/usr/bin/env python3
"""PngSuite through hg_image_read_file, against a PNG decoder written here on zlib alone.

usage: pngsuite.py IMAGE_CORPORA_PROGRAM
Every valid picture must decode to exactly these bytes at 8 and at 16 bits; every x*.png must be
refused.
"""
import os
import struct
import subprocess
import sys
import zlib

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../support"))
import test_data


def chunks(data):
    at = 8
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        yield kind, data[at + 8:at + 8 + size]
        at += size + 12


def unfilter(raw, at, rows, row_bytes, step):
    """Rows of one pass and the offset behind them (PNG specification, section 9)."""
    out, above = [], bytearray(row_bytes)
    for _ in range(rows):
        kind, row = raw[at], bytearray(raw[at + 1:at + 1 + row_bytes])
        at += 1 + row_bytes
        for i in range(row_bytes):
            a = row[i - step] if i >= step else 0
            b, c = above[i], above[i - step] if i >= step else 0
            if kind == 1:
                add = a
            elif kind == 2:
                add = b
            elif kind == 3:
                add = (a + b) // 2
            elif kind == 4:
                p = a + b - c
                add = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
            else:
                add = 0
            row[i] = (row[i] + add) & 255
        out.append(row)
        above = row
    return out, at


PASSES = ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2),
          (0, 1, 1, 2))


def samples(row, width, channels, depth):
    if depth == 16:
        values = struct.unpack(">%dH" % (width * channels), row)
    elif depth == 8:
        values = row[:width * channels]
    else:
        values = [row[x * depth // 8] >> (8 - depth - x * depth % 8) & (1 << depth) - 1
                  for x in range(width)]
    return [tuple(values[x * channels:(x + 1) * channels]) for x in range(width)]


def decode(data):
    """(width, height, list of RGBA values scaled to 16 bits)."""
    parts, idat = {}, b""
    for kind, body in chunks(data):
        if kind == b"IDAT":
            idat += body
        parts.setdefault(kind, body)
    width, height, depth, color, _, _, interlaced = struct.unpack(">IIBBBBB", parts[b"IHDR"])
    channels = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[color]
    raw, at = zlib.decompress(idat), 0
    pixels = [None] * (width * height)
    for x0, y0, dx, dy in (PASSES if interlaced else ((0, 0, 1, 1),)):
        columns, rows = len(range(x0, width, dx)), len(range(y0, height, dy))
        if not columns or not rows:
            continue
        bits = channels * depth
        lines, at = unfilter(raw, at, rows, (columns * bits + 7) // 8, max(1, bits // 8))
        for j, line in enumerate(lines):
            for i, value in enumerate(samples(line, columns, channels, depth)):
                pixels[(y0 + j * dy) * width + x0 + i * dx] = value
    return width, height, [to_rgba(p, color, depth, parts) for p in pixels]


def to_rgba(p, color, depth, parts):
    key, full = parts.get(b"tRNS"), 65535
    scale = full // ((1 << depth) - 1)
    if color == 3:
        palette = parts[b"PLTE"]
        alpha = key[p[0]] if key and p[0] < len(key) else 255
        return tuple(v * 257 for v in palette[p[0] * 3:p[0] * 3 + 3]) + (alpha * 257,)
    alpha = full
    if key:
        alpha = 0 if p == struct.unpack(">%dH" % (len(key) // 2), key) else full
    if color == 0:
        return (p[0] * scale,) * 3 + (alpha,)
    if color == 2:
        return tuple(v * scale for v in p) + (alpha,)
    if color == 4:
        return (p[0] * scale,) * 3 + (p[1] * scale,)
    return tuple(v * scale for v in p)


def read_dump(program, bits, files):
    """For each file None, or (width, height, values)."""
    done = subprocess.run([program, "--dump", str(bits)], input=("\n".join(files) + "\n").encode(),
                          stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=True)
    out, data, at = [], done.stdout, 0
    for _ in files:
        end = data.index(b"\n", at)
        words, at = data[at:end].split(), end + 1
        if words[0] == b"error":
            out.append(None)
            continue
        width, height, size = (int(w) for w in words[1:4])
        body = data[at:at + size]
        at += size
        values = body if bits == 8 else struct.unpack("=%dH" % (size // 2), body)
        out.append((width, height, tuple(values)))
    return out


def main():
    program = sys.argv[1]
    folder, = test_data.need("image-corpora/pngsuite")
    names = sorted(n for n in os.listdir(folder) if n.endswith(".png"))
    if len(names) < 160:
        sys.exit("%s: PngSuite is not there (%d pictures)" % (folder, len(names)))
    files = [os.path.join(folder, n) for n in names]
    wrong = 0
    for bits in (8, 16):
        for name, path, got in zip(names, files, read_dump(program, bits, files)):
            if name.startswith("x"):
                ok = got is None
            else:
                width, height, pixels = decode(open(path, "rb").read())
                flat = tuple(v for p in pixels for v in p)
                if bits == 8:
                    flat = tuple((v + 128) // 257 for v in flat)
                ok = got == (width, height, flat)
            if not ok:
                wrong += 1
                print("%s at %d bits: %s" % (name, bits, "was accepted" if name[0] == "x" else
                                             "refused" if got is None else "other pixels"))
    print("%d pictures at 8 and 16 bits, %d wrong" % (len(names), wrong))
    sys.exit(1 if wrong else 0)


main()
