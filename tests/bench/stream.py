#!/usr/bin/env python3
"""What an orbit costs in each encoding at equal quality: helio bench stream, decoded by ffmpeg.

    tests/bench/stream.py --helio build/bin/helio [--frames 300] [--size 1280x720] [--ssim 0.98]

For each quality all streams are kept, decoded by ffmpeg (package ffmpeg) and held against the exact
pictures with helio compare. Prints bytes, SSIM and FLIP, then the bytes at the wanted SSIM, between
the two qualities around it (logarithm of bytes over SSIM), and what edits cost in tiles.
"""
import argparse
import json
import math
import os
import subprocess
import tempfile

STREAMS = {"jpeg": "jpeg.mjpeg", "jpeg-444": "jpeg-444.mjpeg", "h264": "h264.h264",
           "h264-444": "h264-444.h264", "av1": "av1.obu"}


def bench(args, quality, folder):
    width, height = map(int, args.size.split("x"))
    options = {"width": width, "height": height, "frames": args.frames, "quality": quality,
               "scene": args.scene, "keep": folder}
    out = subprocess.run([args.helio, "bench", "stream", "--options", json.dumps(options)],
                         check=True, capture_output=True, text=True).stdout
    return json.loads(out)


def decode(stream, width, height, to):
    # The colours that the stream states, to full-range sRGB, with chroma interpolated.
    scale = "scale=in_color_matrix=bt709:in_range=limited:" if not stream.endswith("mjpeg") else "scale="
    subprocess.run(["ffmpeg", "-loglevel", "error", "-i", stream, "-vf",
                    scale + "out_range=full:flags=accurate_rnd+full_chroma_int+full_chroma_inp,"
                    f"crop={width}:{height}:0:0", "-fps_mode", "passthrough", "-pix_fmt", "rgb24",
                    os.path.join(to, "decoded-%04d.png")], check=True)


def compare(args, a, b):
    out = subprocess.run([args.helio, "compare", a, b, "--metric", "ssim,flip"], check=True,
                         capture_output=True, text=True).stdout
    values = dict(line.split()[:2] for line in out.splitlines())
    return float(values["ssim"]), float(values["flip"])


def judge(args, folder, name):
    width, height = map(int, args.size.split("x"))
    with tempfile.TemporaryDirectory() as to:
        decode(os.path.join(folder, STREAMS[name]), width, height, to)
        pairs = [compare(args, os.path.join(folder, f"pose-{i:04}.png"),
                         os.path.join(to, f"decoded-{i + 1:04}.png"))
                 for i in range(0, args.frames, args.every)]
    return [sum(v) / len(pairs) for v in zip(*pairs)]


def at_equal_quality(points, ssim):
    """points: (ssim, bytes). None where the qualities do not reach around it."""
    points = sorted(points)
    for (s0, b0), (s1, b1) in zip(points, points[1:]):
        if s0 <= ssim <= s1 and s1 > s0:
            return math.exp(math.log(b0) + (math.log(b1) - math.log(b0)) * (ssim - s0) / (s1 - s0))
    return None


def main():
    p = argparse.ArgumentParser()
    p.add_argument("--helio", default="build/bin/helio")
    p.add_argument("--scene", default="demo:")
    p.add_argument("--size", default="1280x720")
    p.add_argument("--frames", type=int, default=300)
    p.add_argument("--every", type=int, default=10, help="which pictures are compared")
    p.add_argument("--ssim", type=float, default=0.98)
    p.add_argument("--qualities", default="35,50,65,80,90,96")
    args = p.parse_args()
    points, report = {name: [] for name in STREAMS}, None
    print("quality encoding       bytes/frame   SSIM    FLIP")
    for quality in map(int, args.qualities.split(",")):
        with tempfile.TemporaryDirectory() as folder:
            report = bench(args, quality, folder)
            for name in STREAMS:
                if not report["codecs"].get(name):
                    continue
                per_frame = report["codecs"][name]["bytes_per_frame"]
                ssim, flip = judge(args, folder, name)
                points[name].append((ssim, per_frame))
                print(f"{quality:7} {name:14} {per_frame:11.0f} {ssim:7.4f} {flip:7.4f}", flush=True)
    print(f"\nbytes a frame at SSIM {args.ssim}")
    for name, of in points.items():
        value = at_equal_quality(of, args.ssim)
        print(f"{name:14} {value:11.0f}" if value else f"{name:14} out of range")
    print("\nedits: pixels that change, bytes in tiles (the more of hiding and showing), of a JPEG frame, ratio")
    for e in report["edits"]:
        most = max(e["hidden_bytes"], e["shown_bytes"])
        print(f"{100 * e['changed']:7.2f} % {most:9} {e['jpeg_bytes']:9} {e['ratio']:9.1f}")


if __name__ == "__main__":
    main()
