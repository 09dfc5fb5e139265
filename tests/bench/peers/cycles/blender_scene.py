# blender_scene.py - one scene in Blender Cycles, as Heliograph describes it. Runs inside of Blender:
#
#   blender -b --factory-startup --python-exit-code 1 -P blender_scene.py -- JOB.json
#
# The job: scene (glTF file), environment (equirectangular file or null), environment_intensity,
# eye, target (metres, y up), vfov_deg, width, height, bounces, materials (principled|diffuse),
# blends (true: between texels), several (true: facets reflect more than once),
# renders: [{samples, seed, out (EXR)}]. Prints one line "cycles: JSON" per render: seconds of the
# whole render, writing the file included.
import json
import math
import sys
import time

import bpy
import mathutils
import numpy

numpy.bool = bool  # the importer of 3.4 asks for the old name, Debian's numpy has dropped it


def y_up(v):
    """glTF's y up to Blender's z up, as its importer does."""
    return mathutils.Vector((v[0], -v[2], v[1]))


def look(job):
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    bpy.context.collection.objects.link(camera)
    bpy.context.scene.camera = camera
    eye, target = y_up(job["eye"]), y_up(job["target"])
    camera.location = eye
    camera.rotation_mode = "QUATERNION"
    camera.rotation_quaternion = (target - eye).to_track_quat("-Z", "Y")
    camera.data.sensor_fit = "VERTICAL"
    camera.data.angle = math.radians(job["vfov_deg"])
    camera.data.clip_start = 1e-3
    camera.data.clip_end = 1e5


def light(job):
    world = bpy.data.worlds.new("world")
    bpy.context.scene.world = world
    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    background = nodes["Background"]
    background.inputs["Strength"].default_value = job.get("environment_intensity", 1.0)
    if not job.get("environment"):
        background.inputs["Color"].default_value = (0, 0, 0, 1)
        return
    # u = 0.5 + atan2(z, x) / 2 pi of y-up directions in both: no turn is needed.
    image = nodes.new("ShaderNodeTexEnvironment")
    image.image = bpy.data.images.load(job["environment"])
    links.new(image.outputs["Color"], background.inputs["Color"])
    world.cycles.sampling_method = "AUTOMATIC"


def cut_alpha(material):
    """glTF's alphaMode MASK: Cycles knows no threshold, so the alpha goes through one."""
    tree = material.node_tree
    for node in [n for n in tree.nodes if n.type == "BSDF_PRINCIPLED"]:
        alpha = node.inputs["Alpha"]
        if not alpha.is_linked:
            continue
        source = alpha.links[0].from_socket
        step = tree.nodes.new("ShaderNodeMath")
        step.operation = "GREATER_THAN"
        step.inputs[1].default_value = material.alpha_threshold
        tree.links.new(source, step.inputs[0])
        tree.links.new(step.outputs[0], alpha)


def make_diffuse(material):
    """Lambert's law with the base colour, in place of Disney's diffuse lobe and its highlights."""
    tree = material.node_tree
    for node in [n for n in tree.nodes if n.type == "BSDF_PRINCIPLED"]:
        lambert = tree.nodes.new("ShaderNodeBsdfDiffuse")
        for name, to in (("Base Color", "Color"), ("Normal", "Normal")):
            socket = node.inputs[name]
            if socket.is_linked:
                tree.links.new(socket.links[0].from_socket, lambert.inputs[to])
            elif name == "Base Color":
                lambert.inputs[to].default_value = socket.default_value
        shader = lambert.outputs["BSDF"]
        emission = node.inputs["Emission"]
        strength = node.inputs["Emission Strength"].default_value
        if strength > 0 and (emission.is_linked or max(emission.default_value[:3]) > 0):
            glow, both = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeAddShader")
            glow.inputs["Strength"].default_value = strength
            if emission.is_linked:
                tree.links.new(emission.links[0].from_socket, glow.inputs["Color"])
            else:
                glow.inputs["Color"].default_value = emission.default_value
            tree.links.new(shader, both.inputs[0])
            tree.links.new(glow.outputs[0], both.inputs[1])
            shader = both.outputs[0]
        alpha = node.inputs["Alpha"]
        if alpha.is_linked or alpha.default_value < 1:
            clear, mix = tree.nodes.new("ShaderNodeBsdfTransparent"), tree.nodes.new("ShaderNodeMixShader")
            if alpha.is_linked:
                tree.links.new(alpha.links[0].from_socket, mix.inputs[0])
            else:
                mix.inputs[0].default_value = alpha.default_value
            tree.links.new(clear.outputs[0], mix.inputs[1])
            tree.links.new(shader, mix.inputs[2])
            shader = mix.outputs[0]
        for link in list(node.outputs[0].links):
            tree.links.new(shader, link.to_socket)


def filter_linearly(material):
    """Cycles blends neighbouring texels of 8-bit pictures by their display values, which is darker than
    the mean of their light; without blending means are right."""
    for node in material.node_tree.nodes:
        if node.type == "TEX_IMAGE":
            node.interpolation = "Closest"


def reflect_again(material):
    """Light that one facet sends to another is kept, as here."""
    for node in material.node_tree.nodes:
        if node.type == "BSDF_PRINCIPLED":
            node.distribution = "MULTI_GGX"


def set_materials(kind, blends, several):
    for material in bpy.data.materials:
        if not material.use_nodes:
            continue
        if not blends:
            filter_linearly(material)
        if several:
            reflect_again(material)
        if material.blend_method == "CLIP":
            cut_alpha(material)
        if kind == "diffuse":
            make_diffuse(material)
        # glTF's single-sided surfaces are invisible from behind to neither engine's rays.


def settle(job):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = job["width"], job["height"]
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.image_settings.color_mode = "RGBA"
    scene.render.threads_mode = "FIXED"
    scene.render.threads = job.get("threads", 2)
    scene.render.use_persistent_data = True
    scene.view_settings.view_transform = "Raw"
    c = scene.cycles
    c.device = "CPU"
    c.use_adaptive_sampling = False
    c.use_denoising = False
    c.sample_clamp_direct = c.sample_clamp_indirect = 0
    c.blur_glossy = 0
    c.light_sampling_threshold = 0
    c.caustics_reflective = c.caustics_refractive = True
    c.pixel_filter_type = "BLACKMAN_HARRIS"
    c.filter_width = 1.5  # Cycles doubles the width of this one: 3 pixels
    c.max_bounces = c.diffuse_bounces = c.glossy_bounces = job["bounces"]
    c.transmission_bounces = c.transparent_max_bounces = max(job["bounces"], 32)
    c.film_exposure = 1


def main():
    with open(sys.argv[sys.argv.index("--") + 1]) as f:
        job = json.load(f)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(
        filepath=job["scene"], convert_lighting_mode="COMPAT")
    look(job)
    light(job)
    set_materials(job.get("materials", "principled"), job.get("blends", True), job.get("several", False))
    for item in bpy.data.objects:  # lifts rays off smooth meshes, which brightens them
        item.cycles.shadow_terminator_geometry_offset = 0
    settle(job)
    scene = bpy.context.scene
    for render in job["renders"]:
        scene.cycles.samples = render["samples"]
        scene.cycles.seed = render["seed"]
        scene.render.filepath = render["out"]
        start = time.monotonic()
        bpy.ops.render.render(write_still=True)
        print("cycles: " + json.dumps({"samples": render["samples"], "seed": render["seed"],
                                       "seconds": time.monotonic() - start}), flush=True)


main()
