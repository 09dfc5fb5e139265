// Brightness of imported lights, whose units differ from exporter to exporter. The rules and their
// sources are in docs/internals/scene.md.
#include <assimp/commonMetaData.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "renderer/scene/formats/import/import.h"
#include "renderer/scene/xform.h"

#define PI 3.14159265f
// Lumens per watt that Blender's glTF exporter counts with: what it writes is the same light.
#define LUMENS_PER_WATT 683.0f

unsigned hg_import_light_kind(const struct aiLight *from, bool *known)
{
    *known = true;
    switch (from->mType) {
    case aiLightSource_DIRECTIONAL:
        return HG_LIGHT_DIRECTIONAL;
    case aiLightSource_SPOT:
        return HG_LIGHT_SPOT;
    case aiLightSource_AREA:
        return from->mSize.x > 0 && from->mSize.y > 0 ? HG_LIGHT_RECTANGLE : HG_LIGHT_POINT;
    case aiLightSource_POINT:
    case aiLightSource_UNDEFINED: // of FBX: area and volume lights
        return HG_LIGHT_POINT;
    default:
        *known = false; // ambient light
        return HG_LIGHT_POINT;
    }
}

// From 2.80 on Blender's lamps have watts.
static bool is_in_watts(const struct hg_import *im)
{
    const struct aiMetadata *meta = im->scene->mMetaData;
    for (unsigned i = 0; meta && i < meta->mNumProperties; i++) {
        const struct aiMetadataEntry *entry = &meta->mValues[i];
        if (strcmp(meta->mKeys[i].data, AI_METADATA_SOURCE_GENERATOR) != 0 ||
            entry->mType != AI_AISTRING)
            continue;
        const char *text = ((const struct aiString *)entry->mData)->data;
        const char *version = strstr(text, "Blender");
        int major = 0, minor = 0;
        version = version ? strpbrk(version, "0123456789") : NULL;
        return version && sscanf(version, "%3d.%3d", &major, &minor) == 2 &&
               (major > 2 || minor >= 80);
    }
    return false;
}

// ---- where the scene is ------------------------------------------------------------------------

static void world_matrix(const struct hg_node *node, float out[16])
{
    hg_mat4_identity(out);
    for (; node; node = node->parent) {
        float below[16];
        memcpy(below, out, sizeof below);
        hg_mat4_mul(node->matrix, below, out);
    }
}

struct extent {
    float low[3], high[3]; // of all meshes, metres; low > high: none
};

static struct extent find_extent(const struct hg_asset *asset)
{
    struct extent e;
    hg_bounds_clear(e.low, e.high);
    for (uint32_t i = 0; i < asset->node_count; i++) {
        const struct hg_node *node = asset->nodes[i];
        float m[16];
        if (!node->mesh)
            continue;
        world_matrix(node, m);
        for (uint32_t p = 0; p < node->mesh->part_count; p++)
            hg_bounds_add_box(
                e.low, e.high, m, node->mesh->parts[p].bounds_min, node->mesh->parts[p].bounds_max);
    }
    return e;
}

// How far a lamp is from what it lights: from the middle of all meshes, but at least half of their
// radius, for lamps inside. Metres; 1 where there is no mesh.
static float lit_distance(const struct extent *e, const float lamp[16])
{
    float d[3], size[3];
    for (int a = 0; a < 3; a++) {
        d[a] = lamp[12 + a] - 0.5f * (e->low[a] + e->high[a]);
        size[a] = e->high[a] - e->low[a];
    }
    const float distance = sqrtf(hg_dot3(d, d)), radius = 0.5f * sqrtf(hg_dot3(size, size));
    const float lit = fmaxf(distance, 0.5f * radius);
    return e->low[0] <= e->high[0] && isfinite(lit) && lit > 0 ? lit : 1;
}

// ---- attenuation -------------------------------------------------------------------------------

// Share of a lamp's light that is left at a distance, in units of the file. Collada 1.4,
// "constant_attenuation".
static float collada_attenuation(const struct aiLight *from, float distance)
{
    const float sum = from->mAttenuationConstant + from->mAttenuationLinear * distance +
                      from->mAttenuationQuadratic * distance * distance;
    return sum > 0 && isfinite(sum) ? 1 / sum : 1;
}

// The same for FBX, of whose decay assimp (FBXConverter::ConvertLight) makes: none: constant =
// start; linear: 2 / start; quadratic: 2 / start^2; cubic: 1 beside a linear part of 1. Light falls
// off from the start on (3ds Max); without a start quadratic decay is one over the square (Maya).
static float fbx_attenuation(const struct aiLight *from, float distance)
{
    const float linear = from->mAttenuationLinear, quadratic = from->mAttenuationQuadratic;
    const bool none = linear == 0 && quadratic == 0, cubic = linear == 1 && quadratic == 1;
    if (none || cubic)
        return 1;
    if (!isfinite(linear) || !isfinite(quadratic))
        return linear == 0 ? 1 / (distance * distance) : 1 / distance;
    const float share =
        quadratic > 0 ? 2 / (quadratic * distance * distance) : 2 / (linear * distance);
    return share > 0 && isfinite(share) ? share : 1;
}

// Metres per unit of the file.
static float unit_of(const struct hg_import *im, const float lamp[16], bool fbx)
{
    const float scale = sqrtf(hg_dot3(lamp + 8, lamp + 8)); // Collada: assimp scales the root
    const float unit = fbx ? hg_import_file_unit(im) : scale;
    return unit > 0 && isfinite(unit) ? unit : 1;
}

// ---- all lights --------------------------------------------------------------------------------

// Illuminance on what a lamp lights, per unit of its colour. A colour of 1 makes a white surface
// that faces the light white, in all engines before physical units; here that takes pi lux.
static float conventional(
    const struct hg_import *im, const struct aiLight *from, const float lamp[16], float distance)
{
    const bool fbx = strcmp(im->asset->file.format, "fbx") == 0;
    const float units = distance / unit_of(im, lamp, fbx);
    return PI * (fbx ? fbx_attenuation(from, units) : collada_attenuation(from, units));
}

static const struct hg_node *node_of(const struct hg_asset *asset, const struct hg_light *light)
{
    for (uint32_t i = 0; i < asset->node_count; i++)
        if (asset->nodes[i]->light == light)
            return asset->nodes[i];
    return NULL;
}

void hg_import_light_units(struct hg_import *im)
{
    const struct extent extent = find_extent(im->asset);
    const bool watts = is_in_watts(im);
    uint32_t index = 0;
    for (unsigned i = 0; i < im->scene->mNumLights && index < im->asset->light_count; i++) {
        const struct aiLight *from = im->scene->mLights[i];
        bool known;
        (void)hg_import_light_kind(from, &known);
        if (!known)
            continue;
        struct hg_light *light = im->asset->lights[index++];
        float lamp[16];
        world_matrix(node_of(im->asset, light), lamp);
        const float distance = lit_distance(&extent, lamp);
        const bool sun = light->kind == HG_LIGHT_DIRECTIONAL;
        const bool flat = light->kind == HG_LIGHT_RECTANGLE;
        float scale;
        if (watts)
            scale = sun    ? LUMENS_PER_WATT
                    : flat ? LUMENS_PER_WATT / PI // on the axis of a Lambertian surface
                           : LUMENS_PER_WATT / (4 * PI);
        else if (sun)
            scale = PI;
        else
            scale = conventional(im, from, lamp, distance) * distance * distance;
        light->intensity *= scale;
        if (flat) {
            light->width = fminf(from->mSize.x * sqrtf(hg_dot3(lamp, lamp)), HG_LIGHT_MOST_SIZE_M);
            light->height =
                fminf(from->mSize.y * sqrtf(hg_dot3(lamp + 4, lamp + 4)), HG_LIGHT_MOST_SIZE_M);
        } else if (from->mType == aiLightSource_AREA || from->mType == aiLightSource_UNDEFINED)
            hg_asset_warn(im->asset, from->mName.data, "an area light is shown as a point light");
    }
}
