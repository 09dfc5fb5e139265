"""Files as ordinary exporters write them, for ordinary.py: no test is about their content alone, but
about what `helio render FILE -o picture.png` makes of them without any other option.

The start-up scene of Blender (a cube of 2 m, a point lamp of 1000 W, a camera) in every format that
holds so much; the cube alone in the others; towers that stand; clouds of points; sizes and places
far from one; what exporters forget.
"""
import math
import os
import struct
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, "../support"))
import models

# --- shapes, z up, counter-clockwise from outside -------------------------------------------------

CORNERS = [(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
SIDES = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]


def box(low, high):
    """Corners and quads of a box."""
    points = [tuple(low[i] if c[i] < 0 else high[i] for i in range(3)) for c in CORNERS]
    return points, SIDES


def join(*parts):
    points, quads = [], []
    for p, q in parts:
        quads += [tuple(i + len(points) for i in side) for side in q]
        points += p
    return points, quads


CUBE = box((-1, -1, -1), (1, 1, 1))
# A wide foot and a thin shaft: a silhouette that tells which end is up.
TOWER = join(box((-1, -1, 0), (1, 1, 0.5)), box((-0.3, -0.3, 0.5), (0.3, 0.3, 4)))


def sphere(columns=32, rows=16):
    points = [(0, 0, 1)]
    for j in range(1, rows):
        t = math.pi * j / rows
        points += [(math.sin(t) * math.cos(2 * math.pi * i / columns),
                    math.sin(t) * math.sin(2 * math.pi * i / columns), math.cos(t))
                   for i in range(columns)]
    points.append((0, 0, -1))
    ring = lambda j, i: 1 + (j - 1) * columns + i % columns
    faces = [(0, ring(1, i), ring(1, i + 1)) for i in range(columns)]
    for j in range(1, rows - 1):
        faces += [(ring(j, i), ring(j + 1, i), ring(j + 1, i + 1), ring(j, i + 1))
                  for i in range(columns)]
    last = len(points) - 1
    faces += [(ring(rows - 1, i + 1), ring(rows - 1, i), last) for i in range(columns)]
    return points, faces


def y_up(points):
    return [(x, z, -y) for x, y, z in points]


def moved(points, scale=1.0, by=(0, 0, 0)):
    return [tuple(c * scale + d for c, d in zip(p, by)) for p in points]


def triangles(faces):
    return [(f[0], f[i], f[i + 1]) for f in faces for i in range(1, len(f) - 1)]


# --- formats --------------------------------------------------------------------------------------


def write_text(path, text, encoding="utf-8"):
    models.write(path, text.encode(encoding))


def write_obj(path, points, faces, digits=6):
    lines = ["# exported\no Shape\n"]
    lines += ["v %.*f %.*f %.*f\n" % (digits, p[0], digits, p[1], digits, p[2]) for p in points]
    lines += ["f %s\n" % " ".join(str(i + 1) for i in f) for f in faces]
    write_text(path, "".join(lines))


def write_ply(path, points, faces, kind="float", colours=None):
    head = "ply\nformat binary_little_endian 1.0\nelement vertex %d\n" % len(points)
    head += "".join("property %s %s\n" % (kind, axis) for axis in "xyz")
    if colours:
        head += "".join("property uchar %s\n" % c for c in ("red", "green", "blue"))
    if faces:
        head += "element face %d\nproperty list uchar int vertex_indices\n" % len(faces)
    data = bytearray((head + "end_header\n").encode())
    for i, p in enumerate(points):
        data += struct.pack("<3d" if kind == "double" else "<3f", *p)
        data += bytes(colours[i]) if colours else b""
    for f in faces:
        data += struct.pack("<B%di" % len(f), len(f), *f)
    models.write(path, bytes(data))


def write_stl(path, points, faces):
    """Binary; normals are left zero, as many exporters do."""
    flat = triangles(faces)
    data = bytearray(b"exported".ljust(80, b"\0") + struct.pack("<I", len(flat)))
    for t in flat:
        data += bytes(12) + b"".join(struct.pack("<3f", *points[i]) for i in t) + bytes(2)
    models.write(path, bytes(data))


def write_stl_text(path, points, faces):
    """Two solids, of which the first is empty."""
    lines = ["solid nothing\nendsolid nothing\nsolid shape\n"]
    for t in triangles(faces):
        lines.append(" facet normal 0 0 0\n  outer loop\n")
        lines += ["   vertex %.6f %.6f %.6f\n" % points[i] for i in t]
        lines.append("  endloop\n endfacet\n")
    write_text(path, "".join(lines) + "endsolid shape\n")


def look_at(eye, target):
    """Column-major matrix of a camera that looks along its -z, y up."""
    back = models.normalize(tuple(e - t for e, t in zip(eye, target)))
    right = models.normalize(models.cross((0, 1, 0), back))
    up = models.cross(back, right)
    return [*right, 0, *up, 0, *back, 0, *eye, 1]


LAMP = (4.0762, 1.0055, 5.9039)
EYE = (7.3589, -6.9258, 4.9583)


def write_glb(path, points, faces, lamp=True, camera=True):
    """As Blender exports it: flat normals, y up, a lamp of 1000 W as 54351 cd."""
    gltf = models.Gltf()
    corners, normals, flat = [], [], []
    up = y_up(points)
    for f in faces:
        a, b, c = (up[i] for i in f[:3])
        normal = models.normalize(models.cross(tuple(x - y for x, y in zip(b, a)),
                                               tuple(x - y for x, y in zip(c, a))))
        first = len(corners)
        corners += [up[i] for i in f]
        normals += [normal] * len(f)
        flat += [(first, first + i, first + i + 1) for i in range(1, len(f) - 1)]
    gltf.json["materials"] = [{"name": "Material", "doubleSided": True, "pbrMetallicRoughness": {
        "baseColorFactor": [0.8, 0.8, 0.8, 1], "metallicFactor": 0, "roughnessFactor": 0.5}}]
    gltf.json["meshes"] = [{"name": "Cube", "primitives": [{"material": 0, "attributes": {
        "POSITION": gltf.attribute("VEC3", corners, bounds=True),
        "NORMAL": gltf.attribute("VEC3", normals)}, "indices": gltf.indices(flat)}]}]
    nodes = [{"name": "Cube", "mesh": 0}]
    if lamp:
        gltf.json["extensionsUsed"] = ["KHR_lights_punctual"]
        gltf.json["extensions"] = {"KHR_lights_punctual": {"lights": [
            {"name": "Light", "type": "point", "color": [1, 1, 1], "intensity": 54351.41}]}}
        nodes.append({"name": "Light", "translation": list(y_up([LAMP])[0]),
                      "extensions": {"KHR_lights_punctual": {"light": 0}}})
    if camera:
        gltf.json["cameras"] = [{"type": "perspective", "perspective": {
            "aspectRatio": 1.7778, "yfov": 0.39960, "znear": 0.1, "zfar": 100}}]
        nodes.append({"name": "Camera", "camera": 0, "matrix": look_at(y_up([EYE])[0], (0, 0, 0))})
    gltf.json["nodes"] = nodes
    gltf.json["scenes"] = [{"nodes": list(range(len(nodes)))}]
    gltf.write_glb(path)


def dae_matrix(column_major):
    return " ".join("%.6f" % column_major[c * 4 + r] for r in range(4) for c in range(4))


def look_at_z_up(eye, target):
    back = models.normalize(tuple(e - t for e, t in zip(eye, target)))
    right = models.normalize(models.cross((0, 0, 1), back))
    up = models.cross(back, right)
    return [*right, 0, *up, 0, *back, 0, *eye, 1]


def write_dae(path, points, faces, scene=True, transparency="", encoding="utf-8"):
    """As Blender exports it: z up, the lamp's energy in its colour."""
    flat = triangles(faces)
    extra = """
 <library_cameras><camera id="Camera-camera"><optics><technique_common><perspective>
  <xfov>39.59775</xfov><aspect_ratio>1.777778</aspect_ratio><znear>0.1</znear><zfar>100</zfar>
 </perspective></technique_common></optics></camera></library_cameras>
 <library_lights><light id="Light-light" name="Light"><technique_common><point>
  <color sid="color">1000 1000 1000</color><constant_attenuation>1</constant_attenuation>
  <linear_attenuation>0</linear_attenuation><quadratic_attenuation>0.00111109</quadratic_attenuation>
 </point></technique_common><extra><technique profile="blender"><type sid="type">0</type>
  <energy sid="energy">1000</energy></technique></extra></light></library_lights>"""
    nodes = """
  <node id="Light" name="Light"><matrix sid="transform">1 0 0 %f 0 1 0 %f 0 0 1 %f 0 0 0 1</matrix>
   <instance_light url="#Light-light"/></node>
  <node id="Camera" name="Camera"><matrix sid="transform">%s</matrix>
   <instance_camera url="#Camera-camera"/></node>""" % (*LAMP, dae_matrix(look_at_z_up(EYE, (0, 0, 0))))
    text = """<?xml version="1.0" encoding="%s"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
 <asset><contributor><authoring_tool>Blender 3.6.5</authoring_tool></contributor>
  <unit name="meter" meter="1"/><up_axis>Z_UP</up_axis></asset>%s
 <library_effects><effect id="Material-effect"><profile_COMMON><technique sid="common"><lambert>
  <emission><color>0 0 0 1</color></emission><diffuse><color>0.8 0.8 0.8 1</color></diffuse>%s
 </lambert></technique></profile_COMMON></effect></library_effects>
 <library_materials><material id="Material-material" name="Material">
  <instance_effect url="#Material-effect"/></material></library_materials>
 <library_geometries><geometry id="Cube-mesh" name="Cube"><mesh>
  <source id="Cube-positions"><float_array id="Cube-array" count="%d">%s</float_array>
   <technique_common><accessor source="#Cube-array" count="%d" stride="3"><param name="X" type="float"/>
    <param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
  <vertices id="Cube-vertices"><input semantic="POSITION" source="#Cube-positions"/></vertices>
  <triangles material="Material-material" count="%d"><input semantic="VERTEX" source="#Cube-vertices" offset="0"/>
   <p>%s</p></triangles></mesh></geometry></library_geometries>
 <library_visual_scenes><visual_scene id="Scene" name="Scene">
  <node id="Cube" name="Cube"><instance_geometry url="#Cube-mesh"><bind_material><technique_common>
   <instance_material symbol="Material-material" target="#Material-material"/></technique_common>
   </bind_material></instance_geometry></node>%s
 </visual_scene></library_visual_scenes>
 <scene><instance_visual_scene url="#Scene"/></scene>
</COLLADA>
""" % (encoding, extra if scene else "", transparency, 3 * len(points),
       "  ".join("%.6f %.6f\t%.6f" % p for p in points), len(points), len(flat),
       " ".join("%d %d %d" % t for t in flat), nodes if scene else "")
    write_text(path, text, encoding)


def fbx_rotation(eye, target):
    """Degrees about x, then y, then z, of an FBX camera, which looks along its +x, y up, in a z-up file."""
    m = look_at_z_up(eye, target)
    x, y, z = [-c for c in m[8:11]], m[4:7], m[0:3]  # columns
    return [math.degrees(a) for a in (math.atan2(y[2], z[2]), math.asin(-x[2]), math.atan2(x[1], x[0]))]


def write_fbx(path, points, faces):
    """ASCII FBX 7.4, z up, in centimetres as its unit says; the lamp as Blender writes it (W x 100)."""
    flat = [c for f in faces for c in (*f[:-1], -f[-1] - 1)]
    numbers = lambda values: ",".join("%g" % v for v in values)
    text = """; FBX 7.4.0 project file
FBXHeaderExtension:  {
	FBXHeaderVersion: 1003
	FBXVersion: 7400
	Creator: "Blender (stable FBX IO)"
}
GlobalSettings:  {
	Version: 1000
	Properties70:  {
		P: "UpAxis", "int", "Integer", "",2
		P: "UpAxisSign", "int", "Integer", "",1
		P: "FrontAxis", "int", "Integer", "",1
		P: "FrontAxisSign", "int", "Integer", "",-1
		P: "CoordAxis", "int", "Integer", "",0
		P: "CoordAxisSign", "int", "Integer", "",1
		P: "UnitScaleFactor", "double", "Number", "",100
	}
}
Objects:  {
	Geometry: 1000, "Geometry::Cube", "Mesh" {
		Vertices: *%d {
			a: %s
		}
		PolygonVertexIndex: *%d {
			a: %s
		}
		GeometryVersion: 124
	}
	Model: 2000, "Model::Cube", "Mesh" {
		Version: 232
	}
	Model: 2001, "Model::Light", "Light" {
		Version: 232
		Properties70:  {
			P: "Lcl Translation", "Lcl Translation", "", "A",%g,%g,%g
		}
	}
	NodeAttribute: 3001, "NodeAttribute::Light", "Light" {
		Properties70:  {
			P: "LightType", "enum", "", "",0
			P: "Color", "Color", "", "A",1,1,1
			P: "Intensity", "Number", "", "A",100000
			P: "DecayType", "enum", "", "",2
			P: "CastShadows", "bool", "", "",1
		}
		TypeFlags: "Light"
	}
	Model: 2002, "Model::Camera", "Camera" {
		Version: 232
		Properties70:  {
			P: "Lcl Translation", "Lcl Translation", "", "A",%g,%g,%g
			P: "Lcl Rotation", "Lcl Rotation", "", "A",%.6f,%.6f,%.6f
		}
	}
	NodeAttribute: 3002, "NodeAttribute::Camera", "Camera" {
		Properties70:  {
			P: "AspectWidth", "double", "Number", "",1920
			P: "AspectHeight", "double", "Number", "",1080
			P: "FieldOfView", "FieldOfView", "", "A",39.59775
			P: "NearPlane", "double", "Number", "",0.1
			P: "FarPlane", "double", "Number", "",100
		}
		TypeFlags: "Camera"
		GeometryVersion: 124
	}
	Material: 4000, "Material::Material", "" {
		Version: 102
		ShadingModel: "phong"
		Properties70:  {
			P: "DiffuseColor", "Color", "", "A",0.8,0.8,0.8
		}
	}
}
Connections:  {
	C: "OO",2000,0
	C: "OO",2001,0
	C: "OO",1000,2000
	C: "OO",4000,2000
	C: "OO",3001,2001
	C: "OO",2002,0
	C: "OO",3002,2002
}
""" % (3 * len(points), numbers(c for p in points for c in p), len(flat),
       ",".join(str(i) for i in flat), *LAMP, *EYE, *fbx_rotation(EYE, (0, 0, 0)))
    write_text(path, text)


# --- the set --------------------------------------------------------------------------------------


def cloud():
    """20,000 points on a sphere, by the golden angle, coloured by their place."""
    points, colours = [], []
    for i in range(20000):
        z = 1 - (2 * i + 1) / 20000
        r, a = math.sqrt(1 - z * z), i * 2.399963
        points.append((r * math.cos(a), r * math.sin(a), z))
        colours.append(tuple(int(127 + 120 * c) for c in points[-1]))
    return points, colours


def write_cloud_obj(path, points, colours):
    lines = ["v %.6f %.6f %.6f %.4f %.4f %.4f\n" % (*p, *(c / 255 for c in rgb)) for p, rgb in zip(points, colours)]
    lines += ["p %d\n" % (i + 1) for i in range(len(points))]
    write_text(path, "".join(lines))


def write_cloud_glb(path, points, colours):
    """Colours are linear there."""
    linear = [tuple((c / 255) ** 2.2 for c in rgb) for rgb in colours]
    gltf = models.Gltf()
    gltf.json["meshes"] = [{"primitives": [{"mode": 0, "attributes": {
        "POSITION": gltf.attribute("VEC3", points, bounds=True), "COLOR_0": gltf.attribute("VEC3", linear)}}]}]
    gltf.json["nodes"] = [{"mesh": 0}]
    gltf.json["scenes"] = [{"nodes": [0]}]
    gltf.write_glb(path)


def make(folder):
    at = lambda name: os.path.join(folder, name)
    points, faces = CUBE
    write_glb(at("blender.glb"), points, faces)
    write_dae(at("blender.dae"), points, faces)
    write_fbx(at("blender.fbx"), points, faces)
    write_obj(at("cube.obj"), y_up(points), faces)
    write_ply(at("cube.ply"), points, faces)
    write_stl(at("cube.stl"), points, faces)
    write_glb(at("cube.glb"), points, faces, lamp=False, camera=False)
    write_stl(at("tower.stl"), *TOWER)
    write_stl_text(at("tower_text.stl"), *TOWER)
    write_obj(at("tower.obj"), y_up(TOWER[0]), TOWER[1])
    write_dae(at("tower.dae"), *TOWER, scene=False)
    write_obj(at("tower_corner.obj"), moved(TOWER[0], 1, (1, 1, 0)), TOWER[1])  # z up, its corner at the origin
    dots, colours = cloud()
    write_ply(at("cloud.ply"), dots, [], colours=colours)
    write_cloud_obj(at("cloud.obj"), dots, colours)
    write_cloud_glb(at("cloud.glb"), dots, colours)
    write_glb(at("behind.glb"), points, faces, lamp=False, camera=False)
    room, inside = box((-3, -2, 0), (3, 2, 2.5))
    write_obj(at("room.obj"), y_up(room), [tuple(reversed(f)) for f in inside])  # faces look inwards
    write_obj(at("tiny.obj"), y_up(moved(points, 1e-5)), faces, 9)
    write_obj(at("huge.obj"), y_up(moved(points, 1e5)), faces)
    far = (5e6, 4.2e5, 300)
    write_obj(at("far.obj"), y_up(moved(points, 1, far)), faces, 3)
    write_ply(at("far.ply"), moved(points, 1, far), faces, "double")
    write_obj(at("smooth.obj"), y_up(sphere()[0]), sphere()[1])
    opaque = "<transparent opaque=\"A_ONE\"><color>1 1 1 1</color></transparent>" \
             "<transparency><float>0</float></transparency>"
    write_dae(at("transparency.dae"), points, faces, False, opaque)
    write_dae(at("wide.dae"), points, faces, True, "", "utf-16")


if __name__ == "__main__":
    make(sys.argv[1])
