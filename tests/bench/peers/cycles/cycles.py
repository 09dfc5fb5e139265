#!/usr/bin/python3
"""cycles.py - Heliograph's path tracer and Blender Cycles on the CPU, the same scenes.

  cycles.py means [--scene NAME]...   converged means, region by region
  cycles.py speed [--scene NAME]...   time to a relative mean squared error of 1e-2

Options: --helio PROGRAM, --data FOLDER (default $HELIO_TEST_DATA or ../shared/data), --size WxH,
--spp N (means: samples of each engine), --reference-spp N, --rounds N, --threads N, --json FILE,
--keep FOLDER. Needs Debian's packages blender, python3-openimageio and python3-numpy.

Both engines read the same glTF file, the same environment, camera and bounces; no denoiser, no
clamping, a Blackman-Harris filter of 3 pixels. Scenes called "diffuse" have Lambert's law on every
surface, "metals" are of metal all over: both engines describe these in the same way. In the others
Cycles has its Principled BSDF, whose diffuse lobe is Disney's and which does not couple it to the
highlight as glTF's BRDF does.

means: all triangles are drawn (--error-px 0.01), as Cycles does, and facets of its Principled BSDF
reflect more than once. The picture is cut into --regions (8) in each direction; printed is how far
the regions' means differ, leaving out regions darker than a hundredth of the picture's mean. Each
engine draws four pictures of --spp / 4 samples with seeds of their own: how these differ is the
noise of their mean, printed as the median and the largest of one standard deviation of the
difference. A region counts as different when it is
off by more than 2 % and by more than three deviations of its own. speed: each engine is held against its
own converged picture, so that only noise counts; relMSE = mean((x - r)^2 / (r^2 + (0.01 mean)^2))
over pixels and channels, without the thousandth with the largest errors. Each round renders a
quarter of --spp and --spp itself, both engines in turn. The time of a sample follows from the two;
so does the power of N with which noise falls, by which the samples for 1e-2 are reckoned: choose
--spp near them. Scenes that are measured by default have sizes and samples of their own (SPEED):
about 17 minutes for Sponza and 5 for the head on two cores with nothing else running. What comes
before the first sample is printed apart. "head" is Blender's Suzanne with three textures of Sponza,
in place of a helmet. Neither engine stops early where there is less noise. Heliograph's samples
count for all pixels that the filter reaches, those of Cycles for one.
"""
import argparse
import json
import math
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

import numpy
import OpenImageIO as oiio

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.abspath(os.path.join(HERE, "../../../.."))
BOUNCES = 16
TARGET = 1e-2

SUN = {"towards": (0.25, 0.93, 0.27), "lux": 3.0}
NAVE = {"eye": (6.0, 1.6, 0.0), "target": (5.0, 1.7, 0.0), "vfov_deg": 60.0}
SCENES = {
    "sponza": {"file": "scenes/Sponza/glTF/Sponza.gltf", "sun": True,
               "env": "hdr/royal_esplanade_1k.hdr", **NAVE},
    "sponza-diffuse": {"file": "scenes/Sponza/glTF/Sponza.gltf", "sun": True, "diffuse": True,
                       "env": "hdr/royal_esplanade_1k.hdr", **NAVE},
    "sponza-flat": {"file": "scenes/Sponza/glTF/Sponza.gltf", "sun": True, "diffuse": True,
                    "flat": True, "env": "hdr/royal_esplanade_1k.hdr", **NAVE},
    "sponza-smooth": {"file": "scenes/Sponza/glTF/Sponza.gltf", "sun": True, "diffuse": True,
                      "unmapped": True, "env": "hdr/royal_esplanade_1k.hdr", **NAVE},
    "duck": {"file": "khronos/Duck/glTF/Duck.gltf", "fit": True,
             "env": "hdr/royal_esplanade_1k.hdr"},
    "cornell-diffuse": {"file": "extra-gltf/bevy-CornellBox/CornellBox.glb", "diffuse": True,
                        "fit": True},
    "duck-diffuse": {"file": "khronos/Duck/glTF/Duck.gltf", "diffuse": True, "fit": True,
                     "env": "hdr/noon_grass_1k.hdr"},
    "fox-diffuse": {"file": "khronos/Fox/glTF-Binary/Fox.glb", "diffuse": True, "fit": True,
                    "env": "hdr/narrow_moonlit_road_1k.hdr"},
    "head": {"file": "khronos/IridescenceSuzanne/glTF-Binary/IridescenceSuzanne.glb", "fit": True,
             "wear": ("scenes/Sponza/glTF/Sponza.gltf", 5), "env": "hdr/royal_esplanade_1k.hdr"},
    "man-diffuse": {"file": "khronos/CesiumMan/glTF-Binary/CesiumMan.glb", "diffuse": True, "fit": True,
                    "env": "hdr/royal_esplanade_1k.hdr"},
    "metals": {"file": "khronos/MetalRoughSpheresNoTextures/glTF-Binary/"
                       "MetalRoughSpheresNoTextures.glb", "metal": True, "fit": True,
               "env": "hdr/royal_esplanade_1k.hdr"},
    "orientation": {"file": "khronos/OrientationTest/glTF-Binary/OrientationTest.glb", "fit": True,
                    "env": "hdr/lightroom_14b_from_filament_ktx.hdr"},
    "metal-rough": {"file": "khronos/MetalRoughSpheresNoTextures/glTF-Binary/"
                            "MetalRoughSpheresNoTextures.glb", "fit": True,
                    "env": "hdr/royal_esplanade_1k.hdr"},
}


def fail(text):
    sys.exit(f"cycles.py: {text}")


# --- scenes ---------------------------------------------------------------------------------------

def sun_node():
    """Quaternion that turns -Z, where a glTF light shines, away from the sun."""
    x, y, z = (-v for v in SUN["towards"])
    length = (x * x + y * y + z * z) ** 0.5
    x, y, z = x / length, y / length, z / length
    q = (y, -x, 0.0, 1.0 - z)
    m = sum(v * v for v in q) ** 0.5
    return {"name": "sun", "rotation": [v / m for v in q],
            "extensions": {"KHR_lights_punctual": {"light": 0}}}


def add_sun(gltf):
    extensions = gltf.setdefault("extensionsUsed", [])
    if "KHR_lights_punctual" not in extensions:
        extensions.append("KHR_lights_punctual")
    gltf.setdefault("extensions", {})["KHR_lights_punctual"] = {
        "lights": [{"type": "directional", "intensity": SUN["lux"], "color": [1, 1, 1]}]}
    gltf["nodes"].append(sun_node())
    gltf["scenes"][gltf.get("scene", 0)]["nodes"].append(len(gltf["nodes"]) - 1)


def make_lambert(gltf):
    """No highlight, no metal: what is left of glTF's BRDF is Lambert's law."""
    for material in gltf.get("materials", []):
        pbr = material.setdefault("pbrMetallicRoughness", {})
        pbr["metallicFactor"], pbr["roughnessFactor"] = 0.0, 1.0
        pbr.pop("metallicRoughnessTexture", None)
        material.pop("occlusionTexture", None)
        kept = {k: v for k, v in material.get("extensions", {}).items()
                if k == "KHR_materials_emissive_strength"}
        kept["KHR_materials_specular"] = {"specularFactor": 0.0}
        material["extensions"] = kept
    used = set(gltf.get("extensionsUsed", [])) | {"KHR_materials_specular"}
    gltf["extensionsUsed"] = sorted(used)


def make_metal(gltf):
    """All of metal, colours and roughness as they are."""
    for material in gltf.get("materials", []):
        material.setdefault("pbrMetallicRoughness", {})["metallicFactor"] = 1.0


def wear(gltf, source, number, folder):
    """The first mesh alone, with a material of another file."""
    with open(source, encoding="utf8") as f:
        other = json.load(f)
    material = other["materials"][number]
    gltf["textures"], gltf["images"], gltf["samplers"] = [], [], [{}]
    pbr = material["pbrMetallicRoughness"]
    slots = {k: pbr[k] for k in ("baseColorTexture", "metallicRoughnessTexture")}
    for name, slot in [*slots.items(), ("normalTexture", material["normalTexture"])]:
        image = other["images"][other["textures"][slot["index"]]["source"]]["uri"]
        os.symlink(os.path.join(os.path.dirname(source), image), os.path.join(folder, image))
        slots[name] = {"index": len(gltf["textures"])}
        gltf["textures"].append({"source": len(gltf["images"]), "sampler": 0})
        gltf["images"].append({"uri": image})
    normal = slots.pop("normalTexture")
    gltf["materials"] = [{"pbrMetallicRoughness": slots, "normalTexture": normal}]
    gltf["meshes"] = gltf["meshes"][:1]
    for primitive in gltf["meshes"][0]["primitives"]:
        primitive["material"] = 0
    gltf["nodes"] = [{"mesh": 0}]
    gltf["scenes"], gltf["scene"] = [{"nodes": [0]}], 0
    for key in ("extensions", "extensionsUsed", "extensionsRequired", "cameras", "animations"):
        gltf.pop(key, None)


def make_flat(gltf):
    """Normals are those of the triangles: no interpolated ones, no normal maps."""
    for mesh in gltf["meshes"]:
        for part in mesh["primitives"]:
            for name in ("NORMAL", "TANGENT"):
                part["attributes"].pop(name, None)
    for material in gltf.get("materials", []):
        material.pop("normalTexture", None)


def read_gltf(file):
    """JSON and, of a .glb, its binary chunk."""
    with open(file, "rb") as f:
        data = f.read()
    if data[:4] != b"glTF":
        return json.loads(data), None
    size = int.from_bytes(data[12:16], "little")
    chunk = data[20 + size + 8:] if len(data) > 20 + size + 8 else b""
    return json.loads(data[20:20 + size]), chunk


def make_scene(spec, data, folder):
    """The scene as both engines read it, beside links to the files it names."""
    source = os.path.join(data, spec["file"])
    if not os.path.exists(source):
        fail(f"{source} is missing")
    for name in os.listdir(os.path.dirname(source)):
        os.symlink(os.path.join(os.path.dirname(source), name), os.path.join(folder, name))
    gltf, chunk = read_gltf(source)
    if chunk is not None:
        with open(os.path.join(folder, "chunk.bin"), "wb") as f:
            f.write(chunk)
        gltf["buffers"][0]["uri"] = "chunk.bin"
    if "wear" in spec:
        wear(gltf, os.path.join(data, spec["wear"][0]), spec["wear"][1], folder)
    gltf.pop("animations", None)  # Blender's importer would take the first pose of one
    if spec.get("sun"):
        add_sun(gltf)
    if spec.get("diffuse"):
        make_lambert(gltf)
    if spec.get("metal"):
        make_metal(gltf)
    if spec.get("unmapped"):
        for material in gltf.get("materials", []):
            material.pop("normalTexture", None)
    if spec.get("flat"):
        make_flat(gltf)
    out = os.path.join(folder, "peer-scene.gltf")
    with open(out, "w", encoding="utf8") as f:
        json.dump(gltf, f)
    return out


def fitted_camera(options, scene, roots):
    """A camera that sees all of the scene from the front, right and above."""
    text = subprocess.run([options.helio, "info", scene, "--json", *roots], check=True,
                          capture_output=True, text=True).stdout
    bounds = json.loads(text)["bounds"]
    low, high = numpy.array(bounds["min"]), numpy.array(bounds["max"])
    center, radius = (low + high) / 2, float(numpy.linalg.norm(high - low)) / 2
    towards = numpy.array((0.35, 0.25, 1.0))
    eye = center + towards / numpy.linalg.norm(towards) * radius * 2.4
    return {"eye": eye.tolist(), "target": center.tolist(), "vfov_deg": 40.0}


class Scene:
    def __init__(self, name, options):
        spec = SCENES[name]
        self.name, self.folder = name, tempfile.mkdtemp(dir=options.keep)
        self.file = make_scene(spec, options.data, self.folder)
        self.env = os.path.join(options.data, spec["env"]) if "env" in spec else None
        self.roots = ["--asset-root", options.data, "--asset-root", self.folder]
        camera = fitted_camera(options, self.file, self.roots) if spec.get("fit") else spec
        self.camera = {k: camera[k] for k in ("eye", "target", "vfov_deg")}
        self.materials = "diffuse" if spec.get("diffuse") else "principled"


# --- the two engines ------------------------------------------------------------------------------

def comma(values):
    return ",".join(f"{v:.9g}" for v in values)


def render_ours(options, scene, samples, seed, out):
    command = [options.helio, "render", scene.file, "-o", out, "--exr", "float", "--mode", "path",
               "--spp", str(samples), "--seed", str(seed), "--max-bounces", str(BOUNCES),
               "--size", options.size, "--eye=" + comma(scene.camera["eye"]),
               "--target=" + comma(scene.camera["target"]), "--fov", str(scene.camera["vfov_deg"]),
               "--env", scene.env or "none", "--exposure", "0", "--progress", "none", "--log", "error", *scene.roots]
    command += ["--error-px", "0.01"] if options.what == "means" else []
    environment = dict(os.environ, HELIO_THREADS=str(options.threads))
    start = time.monotonic()
    subprocess.run(command, check=True, env=environment, stderr=subprocess.DEVNULL)
    return time.monotonic() - start


def render_cycles(options, scene, renders):
    """renders: (samples, seed, out). Seconds of each."""
    width, height = (int(v) for v in options.size.split("x"))
    job = {"scene": scene.file, "environment": scene.env, "width": width, "height": height,
           "bounces": BOUNCES, "threads": options.threads, "materials": scene.materials,
           "blends": options.what != "means", "several": options.what == "means",
           "renders": [dict(zip(("samples", "seed", "out"), r)) for r in renders], **scene.camera}
    file = os.path.join(scene.folder, "job.json")
    with open(file, "w", encoding="utf8") as f:
        json.dump(job, f)
    run = subprocess.run(["blender", "-b", "--factory-startup", "--python-exit-code", "1", "-P",
                          os.path.join(HERE, "blender_scene.py"), "--", file],
                         capture_output=True, text=True)
    if run.returncode != 0:
        fail(f"{scene.name}: Blender failed:\n{run.stdout[-2000:]}{run.stderr[-2000:]}")
    return [json.loads(line[len("cycles: "):])["seconds"]
            for line in run.stdout.splitlines() if line.startswith("cycles: ")]


def read(file):
    image = oiio.ImageBuf(file)
    if image.has_error:
        fail(f"{file}: {image.geterror()}")
    pixels = numpy.asarray(image.get_pixels(oiio.FLOAT), dtype=numpy.float64)[:, :, :3]
    if not numpy.isfinite(pixels).all():
        fail(f"{file}: has pixels that are no numbers")
    return pixels


# --- means ----------------------------------------------------------------------------------------

def regions(pixels, count):
    height, width = pixels.shape[:2]
    rows = numpy.array_split(numpy.arange(height), count)
    columns = numpy.array_split(numpy.arange(width), count)
    return numpy.array([[pixels[numpy.ix_(r, c)].mean(axis=(0, 1)) for c in columns] for r in rows])


SEEDS = 4


def region_means(pictures, count):
    """Means of regions over pictures of several seeds, and the standard deviation of those means."""
    means = numpy.array([regions(read(p), count) for p in pictures])
    return means.mean(axis=0), means.std(axis=0, ddof=1) / len(pictures) ** 0.5


def compare_means(options, scene):
    path = lambda engine, seed: os.path.join(scene.folder, f"{engine}-{seed}.exr")
    seeds, samples = range(1, SEEDS + 1), max(options.spp // SEEDS, 1)
    for seed in seeds:
        render_ours(options, scene, samples, seed, path("ours", seed))
    render_cycles(options, scene, [(samples, seed, path("cycles", seed)) for seed in seeds])
    (a, noise_a), (b, noise_b) = (
        region_means([path(engine, seed) for seed in seeds], options.regions)
        for engine in ("ours", "cycles"))
    floor = 0.01 * b.mean()
    counted = b.mean(axis=2) > floor
    level = numpy.maximum(b.mean(axis=2), 1e-12)
    off = numpy.abs(a - b).max(axis=2) / level
    noise = numpy.sqrt((noise_a ** 2 + noise_b ** 2).max(axis=2)) / level
    different = counted & (off > 0.02) & (off > 3 * noise)
    off, noise = off[counted], noise[counted]
    result = {"regions": int(counted.sum()), "mean_ratio": float(a.mean() / b.mean()),
              "median_percent": float(numpy.median(off) * 100),
              "p95_percent": float(numpy.percentile(off, 95) * 100),
              "max_percent": float(off.max() * 100),
              "noise_median_percent": float(numpy.median(noise) * 100),
              "noise_max_percent": float(noise.max() * 100),
              "within_2_percent": float((off <= 0.02).mean()),
              "different": [[int(y), int(x), float(a[y, x].mean() / b[y, x].mean())]
                            for y, x in zip(*numpy.nonzero(different))]}
    print(f"{scene.name:18} mean {result['mean_ratio']:.4f}  regions off by median "
          f"{result['median_percent']:.2f} %, p95 {result['p95_percent']:.2f} %, worst "
          f"{result['max_percent']:.2f} %; noise median {result['noise_median_percent']:.2f} %, "
          f"worst {result['noise_max_percent']:.2f} %; {result['within_2_percent'] * 100:.0f} % "
          f"within 2 %, {len(result['different'])} of {result['regions']} different", flush=True)
    return result


# --- speed ----------------------------------------------------------------------------------------

def relative_error(pixels, reference):
    floor = (0.01 * reference.mean()) ** 2
    error = numpy.sort(((pixels - reference) ** 2 / (reference ** 2 + floor)).mean(axis=2), axis=None)
    return float(error[:max(1, int(error.size * 0.999))].mean())


def samples_to_target(options, pictures, reference):
    """pictures: {samples: files}. The error at the most samples, the power of N with which it falls,
    and the samples for the target. The reference has noise of its own, which falls alike: its share
    of what is measured is taken off."""
    few, many = sorted(pictures)
    measured = {n: statistics.median(relative_error(read(f), reference) for f in files)
                for n, files in pictures.items()}
    power, alone = 1.0, dict(measured)
    for _ in range(20):
        alone = {n: m / (1 + (n / options.reference_spp) ** power) for n, m in measured.items()}
        power = math.log(alone[few] / alone[many]) / math.log(many / few)
    return alone[many], power, many * (alone[many] / TARGET) ** (1 / power)


# Size, samples, samples of the reference: near those for 1e-2, and long enough to be timed.
SPEED = {"sponza": ("320x180", 256, 1024), "head": ("1280x720", 32, 320)}


def compare_speed(options, scene):
    many, few = options.spp, max(options.spp // 4, 1)
    path = lambda name: os.path.join(scene.folder, name + ".exr")
    print(f"{scene.name}: references", file=sys.stderr)
    render_ours(options, scene, options.reference_spp, 1001, path("ours-reference"))
    render_cycles(options, scene, [(options.reference_spp, 1001, path("cycles-reference"))])
    seconds = {"ours": [], "cycles": []}
    pictures = {e: {few: [], many: []} for e in seconds}
    for i in range(options.rounds):
        jobs = {e: [(n, 1 + i, path(f"{e}-{n}-{i}")) for n in (few, many)] for e in seconds}
        seconds["ours"].append([render_ours(options, scene, *job) for job in jobs["ours"]])
        seconds["cycles"].append(render_cycles(options, scene, jobs["cycles"]))
        for engine, done in jobs.items():
            for samples, _, file in done:
                pictures[engine][samples].append(file)
        print(f"{scene.name}: round {i + 1} of {options.rounds}", file=sys.stderr)
    result = {}
    for engine, rounds in seconds.items():
        per_sample = statistics.median((b - a) / (many - few) for a, b in rounds)
        error, power, needed = samples_to_target(
            options, pictures[engine], read(path(f"{engine}-reference")))
        result[engine] = {"s_per_sample": per_sample, "relmse": error, "at_samples": many,
                          "power": power, "samples_to_target": needed,
                          "s_to_target": needed * per_sample,
                          "s_before": statistics.median(a - few * per_sample for a, _ in rounds)}
    ratio = result["cycles"]["s_to_target"] / result["ours"]["s_to_target"]
    result["ratio"] = ratio
    for engine in ("ours", "cycles"):
        r = result[engine]
        print(f"{scene.name:18} {engine:6} {r['s_per_sample']:.3f} s per sample, relMSE "
              f"{r['relmse']:.4f} at {many}, falls with N^-{r['power']:.2f}, 1e-2 after "
              f"{r['samples_to_target']:.0f} samples = {r['s_to_target']:.1f} s; before the first "
              f"sample {r['s_before']:.1f} s")
    print(f"{scene.name:18} Heliograph is {ratio:.2f} times as fast to equal error")
    return result


def parse():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("what", choices=("means", "speed"))
    parser.add_argument("--scene", action="append", choices=sorted(SCENES))
    parser.add_argument("--helio", default=os.path.join(ROOT, "build/bin/helio"))
    parser.add_argument("--data", default=os.environ.get(
        "HELIO_TEST_DATA", os.path.join(ROOT, "../shared/data")))
    parser.add_argument("--size")
    parser.add_argument("--spp", type=int, default=0)
    parser.add_argument("--regions", type=int, default=8)
    parser.add_argument("--reference-spp", type=int, default=0)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--json")
    parser.add_argument("--keep")
    options = parser.parse_args()
    options.data = os.path.realpath(options.data)
    for program in (options.helio, "blender"):
        if shutil.which(program) is None:
            fail(f"{program} is missing")
    return options


def options_of(options, name):
    """What is asked for, and for the rest what suits the scene."""
    size, spp, reference = ("320x180", 1024, 0)
    if options.what == "speed":
        size, spp, reference = SPEED.get(name, ("320x180", 64, 1024))
    own = argparse.Namespace(**vars(options))
    own.size, own.spp = options.size or size, options.spp or spp
    own.reference_spp = options.reference_spp or reference
    return own


def measure(options, name):
    own = options_of(options, name)
    return (compare_means if own.what == "means" else compare_speed)(own, Scene(name, own))


def main():
    options = parse()
    own = options.keep is None
    options.keep = options.keep or tempfile.mkdtemp()
    os.makedirs(options.keep, exist_ok=True)
    names = options.scene or (list(SCENES) if options.what == "means" else ["sponza", "head"])
    try:
        results = {name: measure(options, name) for name in names}
    finally:
        if own:
            shutil.rmtree(options.keep)
    if options.json:
        with open(options.json, "w", encoding="utf8") as f:
            json.dump(results, f, indent=2)


main()
