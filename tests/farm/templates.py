#!/usr/bin/env python3
"""templates.py BUILD SOURCE NODE - what deploy/farm submits is what helio takes, and renders the frames.

The farm's own programs are stood in for: Flamenco's compiler by node with the functions that scripts get, PyOutline
by a module that keeps what it is given, srun and scontrol by scripts. The commands that come out are run.
"""
import json
import os
import stat
import subprocess
import sys
import tempfile

BUILD, SOURCE, NODE = sys.argv[1:4]
HELIO, FARM = os.path.join(BUILD, "bin", "helio"), os.path.join(SOURCE, "deploy", "farm")
SCENE = os.path.join(BUILD, "tests", "models", "worm.glb")
SMALL = ["--size=48x32", "--samples=2", "--gi=none"]
wrong = []

COMPILE = """
const fs = require("fs"), path = require("path");
const author = { Command: (name, parameters) => ({ name, parameters }),
    Task: (name, type) => ({ name, type, commands: [], addCommand(c) { this.commands.push(c); } }) };
function frameChunker(frames, size) {
    const [first, last] = frames.split("-").map(Number), chunks = [];
    for (let at = first; at <= last; at += size)
        chunks.push(at < last ? `${at}-${Math.min(at + size - 1, last)}` : `${at}`);
    return chunks;
}
const made = new Function("author", "frameChunker", "path",
    fs.readFileSync(process.argv[1], "utf8") + "; return { JOB_TYPE, compileJob };")(author, frameChunker, path);
const settings = Object.fromEntries(made.JOB_TYPE.settings.map((s) => [s.key, s.default]));
const tasks = [];
made.compileJob({ name: "test", settings: { ...settings, ...JSON.parse(process.argv[2]) }, addTask: (t) => tasks.push(t) });
console.log(JSON.stringify({ type: made.JOB_TYPE, tasks }));
"""

OUTLINE = """
import json
class Outline:
    def __init__(self, name, **options): self.made = {"name": name, **options}
    def add_layer(self, layer): self.made["layer"] = layer.options
class Shell:
    def __init__(self, name, **options): self.options = {"name": name, **options}
def launch(job, **options): print(json.dumps(job.made))
"""


def expect(holds, message):
    if not holds:
        wrong.append(message)


def run(command, **options):
    return subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=250, **options)


def expect_frames(folder, ending, numbers):
    names = sorted("f-%02d.%s" % (n, ending) for n in numbers)
    found = sorted(os.listdir(folder)) if os.path.isdir(folder) else []
    expect(found == names, "%s holds %s instead of %s" % (folder, found, names))


def flamenco(folder, settings):
    done = run([NODE, "-e", COMPILE, os.path.join(FARM, "heliograph-render.js"), json.dumps(settings)])
    expect(done.returncode == 0, "heliograph-render.js: " + done.stdout)
    compiled = json.loads(done.stdout) if done.returncode == 0 else {"tasks": []}
    for task in compiled["tasks"]:
        for command in task["commands"]:
            expect(command["name"] == "exec", "no command of Flamenco workers: " + command["name"])
            exe = command["parameters"]["exe"].replace("{helio}", HELIO)
            done = run([exe, *command["parameters"]["args"]], cwd=folder)
            expect(done.returncode == 0, "%s: exit %d: %s" % (task["name"], done.returncode, done.stdout))
    return [task["name"] for task in compiled["tasks"]]


def check_flamenco(folder):
    out = os.path.join(folder, "path")
    tasks = flamenco(folder, {"scene": SCENE, "render_output": out + "/f-##.exr", "frames": "0-4", "chunk_size": 2,
                              "size": "48x32", "samples": 2, "aov": "albedo,depth", "options": " --max-bounces=2  "})
    expect(tasks == ["render-0-1", "render-2-3", "render-4"], "tasks of Flamenco: %s" % tasks)
    expect_frames(out, "exr", range(5))
    out = os.path.join(folder, "realtime")
    flamenco(folder, {"scene": SCENE, "render_output": out + "/f-##.png", "frames": "1-2", "chunk_size": 4,
                      "size": "48x32", "samples": 2, "mode": "realtime", "options": "--gi=none"})
    expect_frames(out, "png", (1, 2))


def check_opencue(folder):
    modules = os.path.join(folder, "modules", "outline")
    os.makedirs(os.path.join(modules, "modules"))
    for name, words in {"__init__": "from outline.stand_in import Outline", "cuerun": "from outline.stand_in import launch",
                        "stand_in": OUTLINE, "modules/__init__": "", "modules/shell": "from outline.stand_in import Shell"}.items():
        with open(os.path.join(modules, name + ".py"), "w", encoding="utf-8") as f:
            f.write(words)
    submit = [sys.executable, os.path.join(FARM, "opencue_submit.py"), SCENE, os.path.join(folder, "cue", "f-##.png"),
              "--helio", HELIO, "--chunk", "2"]
    environment = {**os.environ, "PYTHONPATH": os.path.dirname(modules)}
    done = run([*submit, "--frames", "1-5x2", "--", *SMALL], env=environment)
    expect(done.returncode == 0, "opencue_submit.py: " + done.stdout)
    if done.returncode:
        return
    layer = json.loads(done.stdout)["layer"]
    expect((layer["range"], layer["chunk"]) == ("1-5x2", 2), "layer of OpenCue: %s" % layer)
    for first, last in ((1, 3), (5, 5)):
        command = [w.replace("#FRAME_START#", str(first)).replace("#FRAME_END#", str(last)) for w in layer["command"]]
        expect(not any("#FRAME" in w for w in command), "unknown tokens: %s" % command)
        done = run(command)
        expect(done.returncode == 0, "OpenCue: exit %d: %s" % (done.returncode, done.stdout))
    expect_frames(os.path.join(folder, "cue"), "png", (1, 3, 5))
    done = run([*submit, "--frames", "1,5,9", "--", *SMALL], env=environment)
    expect(done.returncode != 0 and "needs --chunk 1" in done.stdout, "a list in chunks: " + done.stdout)
    done = run([*submit, "--frames", "0-3", "--", "--mode=path"], env=environment)
    expect('"--resume"' in done.stdout, "path mode is not resumed: " + done.stdout)


def check_slurm(folder):
    programs, queued = os.path.join(folder, "bin"), os.path.join(folder, "requeued")
    os.mkdir(programs)
    for name, words in {"srun": 'exec "$@"', "scontrol": 'echo "$@" >> ' + queued}.items():
        path = os.path.join(programs, name)
        with open(path, "w", encoding="utf-8") as f:
            f.write("#!/bin/sh\n%s\n" % words)
        os.chmod(path, stat.S_IRWXU)
    environment = {**os.environ, "PATH": programs + ":" + os.environ["PATH"], "HELIO": HELIO, "SCENE": SCENE,
                   "OUT": os.path.join(folder, "slurm", "f-##.png"), "FRAMES": "0-5", "SLURM_JOB_ID": "9",
                   "SLURM_ARRAY_JOB_ID": "7", "SLURM_ARRAY_TASK_ID": "1", "SLURM_CPUS_PER_TASK": "1"}
    script = ["bash", os.path.join(FARM, "slurm.sbatch"), *SMALL]
    others = subprocess.Popen(script, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    done = run(script, env=environment)
    others.communicate(timeout=250)
    expect((done.returncode, others.returncode) == (0, 0), "slurm.sbatch: " + done.stdout)
    expect_frames(os.path.join(folder, "slurm"), "png", range(6))
    done = run(script, env={**environment, "SCENE": "gone.glb"})
    expect(done.returncode == 3 and not os.path.exists(queued), "a missing scene is queued again")
    done = run([*script, "--geometry-budget=1", "--seed=1", "--gi=auto"], env=environment)
    expect(done.returncode == 6 and os.path.exists(queued), "a limit is not queued again: " + done.stdout)
    with open(queued, encoding="utf-8") as f:
        expect(f.read() == "requeue 7_1\n", "the wrong task is queued again")
    run([*script, "--geometry-budget=1", "--seed=1", "--gi=auto"], env={**environment, "SLURM_RESTART_COUNT": "5"})
    with open(queued, encoding="utf-8") as f:
        expect(len(f.readlines()) == 1, "it is queued again for ever")


with tempfile.TemporaryDirectory(prefix="heliograph_farm_") as temp:
    if NODE and os.path.exists(NODE):
        check_flamenco(temp)
    check_opencue(temp)
    check_slurm(temp)
for line in wrong:
    print(line)
sys.exit(1 if wrong else 0)
