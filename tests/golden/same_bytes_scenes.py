"""Small scenes for same_bytes.py, written in every format that `helio render` reads besides glTF.

All of them hold the same wavy ring (a torus whose tube swells), so that each format goes through
normals or their absence, and through the vertex order that its importer makes of it.
"""
import json
import math
import os
import shutil
import struct
import zlib

RING, TUBE = 48, 24


def surface():
    """Vertices and quads of the ring: (x, y, z), (i, j, k, l) counter-clockwise from outside."""
    points, quads = [], []
    for i in range(RING):
        a = 2 * math.pi * i / RING
        thick = 0.3 + 0.08 * math.sin(5 * a)
        for j in range(TUBE):
            b = 2 * math.pi * j / TUBE
            r = 1 + thick * math.cos(b)
            points.append((r * math.cos(a), thick * math.sin(b), -r * math.sin(a)))
            k, l = (i + 1) % RING, (j + 1) % TUBE
            quads.append((i * TUBE + j, k * TUBE + j, k * TUBE + l, i * TUBE + l))
    return points, quads


def triangles(quads):
    return [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]


def text_of(points):
    return " ".join("%.6f" % x for p in points for x in p)


def write_png(path, side=64):
    """A checker of two colours with a gradient."""
    rows = b""
    for y in range(side):
        rows += b"\0" + bytes(v for x in range(side) for v in (
            (200, 3 * x, 40) if (x // 8 + y // 8) % 2 else (30, 90, 3 * y)))

    def chunk(kind, body):
        return (struct.pack(">I", len(body)) + kind + body +
                struct.pack(">I", zlib.crc32(kind + body)))

    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" +
                   chunk(b"IHDR", struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0)) +
                   chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def write_obj(folder, points, quads):
    write_png(os.path.join(folder, "checker.png"))
    with open(os.path.join(folder, "ring.mtl"), "w") as file:
        file.write("newmtl checked\nKd 1 1 1\nNs 80\nmap_Kd checker.png\n"
                   "newmtl red\nKd 0.8 0.1 0.1\nNs 12\n")
    with open(os.path.join(folder, "ring.obj"), "w") as file:
        file.write("mtllib ring.mtl\no Ring\n")
        for p in points:
            file.write("v %.6f %.6f %.6f\n" % p)
        for i in range(len(points)):
            file.write("vt %.6f %.6f\n" % (i // TUBE * 4 / RING, i % TUBE / TUBE))
        for part, name in ((quads[:len(quads) // 2], "checked"), (quads[len(quads) // 2:], "red")):
            file.write("usemtl %s\n" % name)
            for q in part:
                file.write("f %s\n" % " ".join("%d/%d" % (i + 1, i + 1) for i in q))


def write_ply(folder, points, quads):
    head = "ply\nformat %s 1.0\nelement vertex %d\nproperty float x\nproperty float y\n" \
           "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n" \
           "element face %d\nproperty list uchar int vertex_indices\nend_header\n"
    colours = [(i * 7 % 256, i * 3 % 256, 255 - i % 256) for i in range(len(points))]
    with open(os.path.join(folder, "ring.ply"), "w") as file:
        file.write(head % ("ascii", len(points), len(quads)))
        for p, c in zip(points, colours):
            file.write("%.6f %.6f %.6f %d %d %d\n" % (p + c))
        for q in quads:
            file.write("4 %d %d %d %d\n" % q)
    with open(os.path.join(folder, "ring_binary.ply"), "wb") as file:
        file.write((head % ("binary_little_endian", len(points), len(quads))).encode())
        for p, c in zip(points, colours):
            file.write(struct.pack("<3f3B", *p, *c))
        for q in quads:
            file.write(struct.pack("<B4i", 4, *q))


def write_stl(folder, points, quads):
    faces = [[points[i] for i in t] for t in triangles(quads)]
    with open(os.path.join(folder, "ring.stl"), "w") as file:
        file.write("solid ring\n")
        for face in faces:
            file.write("facet normal 0 0 0\nouter loop\n%sendloop\nendfacet\n" % "".join(
                "vertex %.6f %.6f %.6f\n" % p for p in face))
        file.write("endsolid ring\n")
    with open(os.path.join(folder, "ring_binary.stl"), "wb") as file:
        file.write(bytes(80) + struct.pack("<I", len(faces)))
        for face in faces:
            file.write(struct.pack("<12fH", 0, 0, 0, *face[0], *face[1], *face[2], 0))


def write_dae(folder, points, quads):
    """A ring that turns about x in two seconds, a camera and a lamp."""
    indices = " ".join("%d" % i for t in triangles(quads) for i in t)
    xyz = "".join('<param name="%s" type="float"/>' % a for a in "XYZ")
    with open(os.path.join(folder, "ring.dae"), "w") as file:
        file.write(
            '<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" '
            'version="1.4.1"><asset><unit meter="1"/><up_axis>Y_UP</up_axis></asset>'
            '<library_cameras><camera id="eye"><optics><technique_common><perspective>'
            '<yfov>45</yfov><aspect_ratio>1.5</aspect_ratio><znear>0.1</znear><zfar>50</zfar>'
            '</perspective></technique_common></optics></camera></library_cameras>'
            '<library_lights><light id="lamp"><technique_common><point><color>30 30 24</color>'
            '</point></technique_common></light></library_lights>'
            '<library_geometries><geometry id="ring"><mesh><source id="p">'
            '<float_array id="pa" count="%d">%s</float_array><technique_common>'
            '<accessor source="#pa" count="%d" stride="3">%s</accessor></technique_common></source>'
            '<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>'
            '<triangles count="%d"><input semantic="VERTEX" source="#v" offset="0"/><p>%s</p>'
            '</triangles></mesh></geometry></library_geometries>'
            '<library_animations><animation id="turn"><source id="t"><float_array id="ta" '
            'count="2">0 2</float_array><technique_common><accessor source="#ta" count="2">'
            '<param name="TIME" type="float"/></accessor></technique_common></source>'
            '<source id="o"><float_array id="oa" count="2">0 90</float_array><technique_common>'
            '<accessor source="#oa" count="2"><param name="ANGLE" type="float"/></accessor>'
            '</technique_common></source><source id="i"><Name_array id="ia" count="2">LINEAR LINEAR'
            '</Name_array><technique_common><accessor source="#ia" count="2">'
            '<param name="INTERPOLATION" type="name"/></accessor></technique_common></source>'
            '<sampler id="s"><input semantic="INPUT" source="#t"/><input semantic="OUTPUT" '
            'source="#o"/><input semantic="INTERPOLATION" source="#i"/></sampler>'
            '<channel source="#s" target="ringnode/rx.ANGLE"/></animation></library_animations>'
            '<library_visual_scenes><visual_scene id="scene">'
            '<node id="ringnode"><rotate sid="rx">1 0 0 0</rotate>'
            '<instance_geometry url="#ring"/></node>'
            '<node id="eyenode"><translate>0 1 4</translate><rotate>1 0 0 -14</rotate>'
            '<instance_camera url="#eye"/></node>'
            '<node id="lampnode"><translate>1 3 2</translate><instance_light url="#lamp"/></node>'
            '</visual_scene></library_visual_scenes>'
            '<scene><instance_visual_scene url="#scene"/></scene></COLLADA>' %
            (3 * len(points), text_of(points), len(points), xyz, len(triangles(quads)), indices))


def write_fbx(folder, points, quads):
    flat = ",".join("%.6f" % (100 * x) for p in points for x in p)
    # The last index of a polygon is stored as its complement.
    polygons = ",".join("%d,%d,%d,%d" % (a, b, c, -d - 1) for a, b, c, d in quads)
    with open(os.path.join(folder, "ring.fbx"), "w") as file:
        file.write("""; FBX 7.4.0 project file
FBXHeaderExtension:  {
	FBXHeaderVersion: 1003
	FBXVersion: 7400
}
GlobalSettings:  {
	Version: 1000
	Properties70:  {
		P: "UnitScaleFactor", "double", "Number", "",1
	}
}
Objects:  {
	Geometry: 1001, "Geometry::Ring", "Mesh" {
		Vertices: *%d {
			a: %s
		}
		PolygonVertexIndex: *%d {
			a: %s
		}
		GeometryVersion: 124
		LayerElementMaterial: 0 {
			Version: 101
			Name: ""
			MappingInformationType: "AllSame"
			ReferenceInformationType: "IndexToDirect"
			Materials: *1 {
				a: 0
			}
		}
		Layer: 0 {
			Version: 100
			LayerElement:  {
				Type: "LayerElementMaterial"
				TypedIndex: 0
			}
		}
	}
	Model: 1002, "Model::Ring", "Mesh" {
		Version: 232
	}
	Material: 1003, "Material::Blue", "" {
		Version: 102
		ShadingModel: "phong"
		Properties70:  {
			P: "DiffuseColor", "Color", "", "A",0.1,0.3,0.8
		}
	}
}
Connections:  {
	C: "OO",1002,0
	C: "OO",1001,1002
	C: "OO",1003,1002
}
""" % (3 * len(points), flat, 4 * len(quads), polygons))


def write_large_texture(folder, picture):
    """A square with an 8K picture on it: more pages than a small budget holds."""
    shutil.copyfile(picture, os.path.join(folder, "large.jpg"))
    body = struct.pack("<12f8f6H", -1, -0.5, 0, 1, -0.5, 0, 1, 0.5, 0, -1, 0.5, 0,
                       0, 1, 1, 1, 1, 0, 0, 0, 0, 1, 2, 0, 2, 3)
    with open(os.path.join(folder, "large.bin"), "wb") as file:
        file.write(body)
    views = [(0, 48), (48, 32), (80, 12)]
    with open(os.path.join(folder, "large.gltf"), "w") as file:
        json.dump({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0, "name": "sheet"}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1},
                                        "indices": 2, "material": 0}]}],
            "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0},
                                                    "metallicFactor": 0}}],
            "textures": [{"source": 0}], "images": [{"uri": "large.jpg"}],
            "buffers": [{"uri": "large.bin", "byteLength": len(body)}],
            "bufferViews": [{"buffer": 0, "byteOffset": o, "byteLength": n} for o, n in views],
            "accessors": [
                {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
                 "min": [-1, -0.5, 0], "max": [1, 0.5, 0]},
                {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
                {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"}],
        }, file)


def write(folder, large_picture):
    """Writes all of them into folder; the large texture only where its picture is there."""
    os.makedirs(folder, exist_ok=True)
    points, quads = surface()
    for make in (write_obj, write_ply, write_stl, write_dae, write_fbx):
        make(folder, points, quads)
    if os.path.exists(large_picture):
        write_large_texture(folder, large_picture)
