# exr_blender.py - does Blender's compositor read the parts of our EXR files, value for value?
#
#   blender -b --factory-startup --python-exit-code 1 --python tests/bench/exr_blender.py -- FILE.exr
#
# Every part of FILE must be a socket of the image node; what comes out of the sockets is written as
# float EXR and compared with the part as OpenImageIO reads it (Debian: blender, python3-openimageio).
import os
import sys
import tempfile

import bpy
import numpy
import OpenImageIO as oiio


def parts_of(path):
    """Part name -> float array [height][width][channels]."""
    source = oiio.ImageInput.open(path)
    if source is None:
        sys.exit(f"{path}: {oiio.geterror()}")
    parts, number = {}, 0
    while source.seek_subimage(number, 0):
        spec = source.spec()
        pixels = source.read_image(number, 0, 0, spec.nchannels, oiio.FLOAT)
        parts[spec.get_string_attribute("oiio:subimagename")] = pixels
        number += 1
    source.close()
    return parts


def composite(path, folder, size):
    """Writes what comes out of each socket; socket name -> file."""
    scene = bpy.context.scene
    scene.use_nodes = True
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform = "Raw"
    tree = scene.node_tree
    tree.nodes.clear()
    image = tree.nodes.new("CompositorNodeImage")
    image.image = bpy.data.images.load(path)
    out = tree.nodes.new("CompositorNodeOutputFile")
    out.base_path = folder
    out.format.file_format = "OPEN_EXR"
    out.format.color_depth = "32"
    out.file_slots.clear()
    names = [socket.name for socket in image.outputs if socket.enabled]
    for name in names:
        out.file_slots.new(name + "_")
        tree.links.new(image.outputs[name], out.inputs[name + "_"])
    end = tree.nodes.new("CompositorNodeComposite")
    tree.links.new(image.outputs[names[0]], end.inputs[0])
    scene.camera = bpy.data.objects["Camera"]
    bpy.ops.render.render()
    frame = scene.frame_current
    return {name: os.path.join(folder, f"{name}_{frame:04d}.exr") for name in names}


def main():
    path = os.path.abspath(sys.argv[sys.argv.index("--") + 1])
    parts = parts_of(path)
    height, width = next(iter(parts.values())).shape[:2]
    bad = 0
    with tempfile.TemporaryDirectory() as folder:
        files = composite(path, folder, (width, height))
        for name, pixels in parts.items():
            socket = "Combined" if name == "rgba" else name
            if socket not in files:
                print(f"{name}: Blender shows no such pass; it has {', '.join(files)}")
                bad += 1
                continue
            seen = next(iter(parts_of(files[socket]).values()))
            channels = min(pixels.shape[2], 3)
            difference = numpy.abs(seen[:, :, :channels] - pixels[:, :, :channels]).max()
            print(f"{name}: {pixels.shape[2]} channels, greatest difference {difference:g}")
            bad += not difference == 0
    if bad:
        sys.exit(f"{bad} of {len(parts)} parts are not read back as they were written")
    print(f"{len(parts)} parts are read back as they were written")


main()
