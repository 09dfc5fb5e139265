#include "renderer/scene/up_axis.h"

#include <math.h>
#include <string.h>
#include <strings.h>

#include "renderer/scene/asset.h"

enum { HEADER_BYTES = 4096 }; // in which an exporter names itself

// ---- exporters
// -----------------------------------------------------------------------------------

// Programs that write one axis by default, as their comments spell them.
static const struct {
    const char *format, *name;
    enum hg_up_axis up;
} exporters[] = {
    {"obj", "FreeCAD", HG_UP_Z},
    {"obj", "Tinkercad", HG_UP_Z},
    {"obj", "OpenSCAD", HG_UP_Z},
    {"obj", "Gmsh", HG_UP_Z},
    {"obj", "Agisoft", HG_UP_Z},
    {"obj", "Metashape", HG_UP_Z},
    {"obj", "PhotoScan", HG_UP_Z},
    {"obj", "Pix4D", HG_UP_Z},
    {"obj", "RealityCapture", HG_UP_Z},
    {"obj", "CloudCompare", HG_UP_Z},
    {"obj", "CityJSON", HG_UP_Z},
    {"obj", "Blender", HG_UP_Y},
    {"obj", "3ds Max", HG_UP_Y},
    {"obj", "Maya", HG_UP_Y},
    {"obj", "ZBrush", HG_UP_Y},
    {"obj", "SketchUp", HG_UP_Y},
    {"obj", "Rhino", HG_UP_Y},
    {"obj", "Cinema 4D", HG_UP_Y},
    {"obj", "LightWave", HG_UP_Y},
    {"ply", "Blender", HG_UP_Z},
    {"ply", "Agisoft", HG_UP_Z},
    {"ply", "Metashape", HG_UP_Z},
    {"ply", "PhotoScan", HG_UP_Z},
    {"ply", "Pix4D", HG_UP_Z},
    {"ply", "RealityCapture", HG_UP_Z},
    {"ply", "CloudCompare", HG_UP_Z},
    {"ply", "PDAL", HG_UP_Z},
    {"ply", "zipper", HG_UP_Y},
};

static bool line_names(const char *line, size_t size, const char *name)
{
    const size_t n = strlen(name);
    for (size_t i = 0; i + n <= size; i++)
        if (strncasecmp(line + i, name, n) == 0)
            return true;
    return false;
}

static bool is_comment(const char *format, const char *line, size_t size)
{
    if (strcmp(format, "obj") == 0)
        return size > 0 && line[0] == '#';
    return size > 8 && memcmp(line, "comment ", 8) == 0;
}

// The axis of the first exporter that a comment names; HG_UP_AUTO: none.
static enum hg_up_axis axis_of_exporter(const char *format, const struct hg_refbuf *data)
{
    const char *at = data ? (const char *)data->data : NULL;
    size_t left = data ? data->size : 0;
    left = left < HEADER_BYTES ? left : HEADER_BYTES;
    while (left) {
        const char *end = memchr(at, '\n', left);
        const size_t size = end ? (size_t)(end - at) : left;
        for (size_t i = 0; is_comment(format, at, size) && i < sizeof exporters / sizeof *exporters;
             i++)
            if (strcmp(exporters[i].format, format) == 0 && line_names(at, size, exporters[i].name))
                return exporters[i].up;
        at += size + (end != NULL);
        left -= size + (end != NULL);
    }
    return HG_UP_AUTO;
}

// ---- ground
// --------------------------------------------------------------------------------------

// Modellers put a thing on the ground around the origin: it stands on z = 0, has some height, and
// the origin lies well inside of its other extents. A thing that is modelled Y-up has y = 0 there.
// CAD programs also put its corner there, and are Z-up; unless y is the odd one of its extents, as
// of terrains (flat) and towers that are modelled Y-up.
static bool stands_on_z(const struct hg_asset *asset)
{
    float min[3], max[3];
    if (!hg_asset_bounds(asset, min, max))
        return false;
    const float extent[3] = {max[0] - min[0], max[1] - min[1], max[2] - min[2]};
    const float across = fmaxf(extent[0], extent[1]);
    int around = 0, corner = 0;
    for (int i = 0; i < 2; i++) {
        around += min[i] < -0.1f * extent[i] && max[i] > 0.1f * extent[i];
        corner += fabsf(min[i]) <= 1e-3f * extent[i];
    }
    const float low = fminf(extent[0], extent[2]), high = fmaxf(extent[0], extent[2]);
    const bool odd_y = extent[1] < 0.8f * low || extent[1] > 1.25f * high;
    return (around == 2 || (corner == 2 && !odd_y)) && fabsf(min[2]) <= 1e-3f * extent[2] &&
           extent[2] >= 0.1f * across;
}

// Coordinates of a map: metres east and north in the hundred thousands, heights above the sea.
static bool is_map(const struct hg_asset *asset)
{
    const double *origin = asset->file.origin;
    const double across = fmax(fabs(origin[0]), fabs(origin[1]));
    return across > 1e4 && fabs(origin[2]) < 0.1 * across;
}

// ---- the turn
// ------------------------------------------------------------------------------------

static enum hg_up_axis guess(
    const struct hg_asset *asset, const struct hg_refbuf *data, const char **reason)
{
    const char *format = asset->file.format;
    if (strcmp(format, "stl") == 0) {
        *reason = "STL files are Z-up by convention";
        return HG_UP_Z;
    }
    if (strcmp(format, "obj") != 0 && strcmp(format, "ply") != 0 && strcmp(format, "off") != 0) {
        *reason = "the format or the file says so";
        return HG_UP_Y;
    }
    const enum hg_up_axis known = axis_of_exporter(format, data);
    if (known != HG_UP_AUTO) {
        *reason = "the exporter that a comment of the file names writes it so";
        return known;
    }
    if (is_map(asset)) {
        *reason = "its coordinates are those of a map";
        return HG_UP_Z;
    }
    if (stands_on_z(asset)) {
        *reason = "the geometry stands on the plane z = 0";
        return HG_UP_Z;
    }
    *reason = "nothing in the file says otherwise";
    return HG_UP_Y;
}

// Column-major rotations that bring the axis to +Y.
static const float turns[][16] = {
    [HG_UP_X] = {0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1},
    [HG_UP_Z] = {1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1},
    [HG_UP_MINUS_X] = {0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1},
    [HG_UP_MINUS_Y] = {-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1},
    [HG_UP_MINUS_Z] = {1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1},
};

enum hg_status hg_up_axis_apply(
    const struct hg_load_params *params, const struct hg_refbuf *data, struct hg_asset *asset)
{
    const bool given = params->up != HG_UP_AUTO;
    const char *reason = "given";
    const enum hg_up_axis up = given ? params->up : guess(asset, data, &reason);
    asset->file.up = up;
    asset->file.up_reason = reason;
    return up == HG_UP_Y ? HG_OK : hg_asset_transform_roots(asset, turns[up]);
}
