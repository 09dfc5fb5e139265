#!/usr/bin/env python3
"""Submits a render to OpenCue: needs PyOutline, and helio on every host.

    opencue_submit.py hall.glb '/shots/010/beauty.####.exr' --frames 0-119 --show hall --shot 010 \\
        -- --mode=path --samples=256 --noise=0.02 --strict

What stands behind -- are options of `helio render`. A task is a chunk of frames; OpenCue may repeat it on any
host: frames that are there and whole stay, and one that was being path traced goes on from its checkpoint.
"""
import argparse
import getpass
import os
import re
import sys

import outline
import outline.cuerun
from outline.modules.shell import Shell


def frames_of_chunk(args):
    """Cuebot puts the first and the last frame of the chunk in; the step between them stays."""
    plain = re.fullmatch(r"-?\d+(--?\d+(x\d+)?)?", args.frames)
    if not plain and args.chunk > 1:
        raise SystemExit("--frames: a list of ranges needs --chunk 1")
    return "#FRAME_START#..#FRAME_END#" + ((plain and plain[2]) or "")


def command(args):
    words = [args.helio, "render", os.path.abspath(args.scene), "--output=" + os.path.abspath(args.output),
             "--frames=" + frames_of_chunk(args), "--skip-existing"]
    if "--mode=path" in args.options:
        words += ["--resume", "--checkpoint=300"]
    if not any(o == "--exposure" or o.startswith("--exposure=") for o in args.options):
        words.append("--exposure=0")  # else each task would meter its own first frame
    return words + args.options


def job(args):
    made = outline.Outline(args.name, show=args.show, shot=args.shot, user=getpass.getuser())
    layer = Shell("render", command=command(args), range=args.frames, chunk=args.chunk,
                  threads=args.cores, threadable=True)
    made.add_layer(layer)
    return made


def parse():
    split = sys.argv.index("--") if "--" in sys.argv else len(sys.argv)
    parser = argparse.ArgumentParser(description="submit a Heliograph render to OpenCue",
                                     epilog="behind -- stand options of helio render")
    parser.add_argument("scene", help="a path that all hosts have")
    parser.add_argument("output", help="files to write, with #### for the frame")
    parser.add_argument("--frames", required=True, help="such as 0-119")
    parser.add_argument("--chunk", type=int, default=4, help="frames of a task; default 4")
    parser.add_argument("--cores", type=float, default=4, help="of a task; default 4")
    parser.add_argument("--name", default="heliograph")
    parser.add_argument("--show", default=os.environ.get("SHOW", "testing"))
    parser.add_argument("--shot", default=os.environ.get("SHOT", "default"))
    parser.add_argument("--helio", default="helio", help="the program on the hosts")
    args = parser.parse_args(sys.argv[1:split])
    args.options = sys.argv[split + 1:]
    return args


def main():
    args = parse()
    os.makedirs(os.path.dirname(os.path.abspath(args.output)), exist_ok=True)
    outline.cuerun.launch(job(args), use_pycuerun=False)


if __name__ == "__main__":
    main()
