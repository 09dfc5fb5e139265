// obj.h - parts of the OBJ reader: statements (obj.c), material libraries (obj_material.c) and the
// asset (obj_mesh.c).
// Floor 2, private to scene/. Sources: Wavefront 1995, "Object Files (.obj)" and "Material Library
// File (.mtl)"; Exocortex 2015, "Extending the Wavefront MTL format for physically-based
// rendering".
#ifndef HG_RENDERER_SCENE_FORMATS_MESH_OBJ_H
#define HG_RENDERER_SCENE_FORMATS_MESH_OBJ_H

#include "renderer/scene/formats/mesh/mesh_file.h"
#include "renderer/scene/formats/mesh/polygons.h"

enum { HG_OBJ_NONE = UINT32_MAX }; // a corner without the index; a triangle without a group

enum hg_obj_kind { HG_OBJ_SHADED, HG_OBJ_UNSHADED, HG_OBJ_LINES, HG_OBJ_POINTS };

// The primitives of one kind, group and material.
struct hg_obj_part {
    uint32_t group, material;
    enum hg_obj_kind kind;
    struct hg_mesh_array corners;   // uint32_t[3]: numbers of v, vt, vn
    struct hg_mesh_array smoothing; // uint32_t of each unshaded triangle: statement s
};

struct hg_obj_material {
    struct hg_material *material;
    bool defined; // by a library; used only otherwise
    struct {
        float exponent, roughness, opacity; // roughness < 0: none is given
        char *metal_map, *rough_map, *alpha_map, *color_map;
    } raw;
};

// Lines of a text: those that end with a backslash go on in the next one.
struct hg_obj_lines {
    struct hg_text text;
    struct hg_mesh_array joined; // char
    const char *start;           // of the line in the text
};

struct hg_obj {
    struct hg_mesh_file file;
    struct hg_obj_lines lines;
    struct hg_mesh_array v, colors, vt, vn; // double[3], float[3], float[2], float[3]
    struct hg_key_table group_names, material_names, part_keys;
    struct hg_mesh_array groups;    // struct hg_text: names
    struct hg_mesh_array materials; // struct hg_obj_material
    struct hg_mesh_array parts;     // struct hg_obj_part
    struct hg_mesh_array loop, loop_xyz;
    struct hg_polygons polygons;
    uint32_t group, material, smoothing;
    float most_color;
    struct { // the highest number that was named, and where
        uint64_t index, offset;
    } most[3];
    bool has_free_forms;
    bool has_library; // one was read
};

// False at the end of the text or when memory is short (then the error is set).
bool hg_obj_next_line(struct hg_mesh_file *f, struct hg_obj_lines *lines, struct hg_text *line);
// The number of a material; one that no library defines is grey.
enum hg_status hg_obj_find_material(
    struct hg_obj *obj, struct hg_text name, uint32_t *number) HG_MUST_CHECK;
// Reads the libraries of a mtllib statement. A missing one is a warning. HG_E_NOMEM.
enum hg_status hg_obj_read_libraries(struct hg_obj *obj, struct hg_text names) HG_MUST_CHECK;
// What can be decided once all statements of a material are known.
enum hg_status hg_obj_finish_materials(struct hg_obj *obj) HG_MUST_CHECK;
enum hg_status hg_obj_make_asset(struct hg_obj *obj) HG_MUST_CHECK;

#endif
