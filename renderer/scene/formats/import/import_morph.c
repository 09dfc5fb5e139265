// import_morph.c - morph targets (blend shapes) of imported meshes, and animations of their
// weights.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/formats/import/import.h"
#include "renderer/scene/mesh_tools.h"

// ---- targets -----------------------------------------------------------------------------------

// Targets of Collada files that are relative hold differences; all others are whole shapes.
static bool is_relative(const struct hg_import *im, const struct aiMesh *from)
{
    return strcmp(im->asset->file.format, "fbx") != 0 &&
           from->mMethod == aiMorphingMethod_MORPH_RELATIVE;
}

// What is added to `base` for the shape; *most: its largest component. False: no memory.
static bool copy_difference(struct hg_import *im, const struct aiVector3D *base,
    const struct aiVector3D *shape, uint32_t count, float **out, float *most)
{
    *out = hg_import_alloc(im, count, 3 * sizeof **out);
    *most = 0;
    for (size_t v = 0; *out && v < count; v++) {
        const float b[3] = {base ? base[v].x : 0, base ? base[v].y : 0, base ? base[v].z : 0};
        const float s[3] = {shape[v].x, shape[v].y, shape[v].z};
        for (int i = 0; i < 3; i++) {
            const float d = s[i] - b[i];
            (*out)[v * 3 + (size_t)i] = isfinite(d) ? d : 0;
            *most = isfinite(d) ? fmaxf(*most, fabsf(d)) : *most;
        }
    }
    return *out != NULL;
}

// Exporters that have no normals of shapes repeat those of the mesh.
static bool copy_normals(struct hg_import *im, const struct aiMesh *from,
    const struct aiAnimMesh *shape, struct hg_mesh_part *part, struct hg_morph_target *to)
{
    const struct aiVector3D *base = is_relative(im, from) ? NULL : from->mNormals;
    const uint32_t count = from->mNumVertices;
    float most = 0;
    if (!part->normals)
        return true; // they are made with the mesh's
    if (shape->mNormals && !copy_difference(im, base, shape->mNormals, count, &to->normals, &most))
        return false;
    if (most > 1e-4f || part->topology != HG_TOPOLOGY_TRIANGLES)
        return true;
    if (!to->normals)
        to->normals = hg_import_alloc(im, count, 3 * sizeof *to->normals);
    return to->normals && hg_part_make_target_normals(part, to->positions, to->normals) == HG_OK;
}

enum hg_status hg_import_targets(
    struct hg_import *im, const struct aiMesh *from, struct hg_mesh *mesh)
{
    struct hg_mesh_part *part = &mesh->parts[0];
    const struct aiVector3D *base = is_relative(im, from) ? NULL : from->mVertices;
    const uint32_t count = from->mNumAnimMeshes;
    float most;
    if (count == 0)
        return HG_OK;
    if (count > HG_IMPORT_TARGETS_MAX)
        return hg_import_fail(im, HG_E_LIMIT, from->mName.data, "too many morph targets");
    part->targets = hg_import_alloc(im, count, sizeof *part->targets);
    mesh->weights = part->targets ? hg_import_alloc(im, count, sizeof *mesh->weights) : NULL;
    if (!mesh->weights)
        return im->err->status;
    mesh->target_count = count;
    for (uint32_t t = 0; t < count; t++) {
        const struct aiAnimMesh *shape = from->mAnimMeshes[t];
        struct hg_morph_target *to = &part->targets[t];
        // Of FBX files assimp does not tell the weight of a shape that stands alone in its channel.
        if (strcmp(im->asset->file.format, "fbx") != 0 && isfinite(shape->mWeight))
            mesh->weights[t] = shape->mWeight;
        if (!shape->mVertices || shape->mNumVertices != from->mNumVertices)
            continue;
        if (!copy_difference(
                im, base, shape->mVertices, from->mNumVertices, &to->positions, &most) ||
            !copy_normals(im, from, shape, part, to))
            return im->err->status ? im->err->status
                                   : hg_import_fail(im, HG_E_NOMEM, NULL, "no memory");
    }
    return HG_OK;
}

enum hg_status hg_import_weights(struct hg_import *im, struct hg_node *node)
{
    const uint32_t count = node->mesh->target_count;
    if (count == 0)
        return HG_OK;
    node->weights = hg_import_alloc(im, count, sizeof *node->weights);
    if (!node->weights)
        return im->err->status;
    memcpy(node->weights, node->mesh->weights, count * sizeof *node->weights);
    return HG_OK;
}

// ---- animations --------------------------------------------------------------------------------

// Channels are named after the node; assimp adds "*" and a number to that of FBX files.
static bool is_of(const struct aiMeshMorphAnim *from, const struct hg_node *node)
{
    const size_t size = strlen(node->head.name);
    const char *rest = from->mName.data + size;
    return node->weights && strncmp(from->mName.data, node->head.name, size) == 0 &&
           (*rest == '\0' || *rest == '*');
}

uint32_t hg_import_count_morphs(const struct hg_import *im, const struct aiAnimation *from)
{
    uint32_t count = 0;
    for (unsigned i = 0; i < from->mNumMorphMeshChannels; i++)
        for (uint32_t n = 0; n < im->asset->node_count; n++)
            count += is_of(from->mMorphMeshChannels[i], im->asset->nodes[n]);
    return count;
}

// Keys of a target that say nothing of it, NAN, lie on the line between those that do.
static void fill_gaps(struct hg_anim_channel *c, uint32_t target)
{
    float *at = c->values + target;
    uint32_t last = UINT32_MAX;
    for (uint32_t k = 0; k < c->key_count; k++) {
        const float value = at[(size_t)k * c->width];
        if (isnan(value))
            continue;
        for (uint32_t g = last == UINT32_MAX ? 0 : last + 1; g < k; g++) {
            const float before = last == UINT32_MAX ? value : at[(size_t)last * c->width];
            const float start = last == UINT32_MAX ? c->times[0] : c->times[last];
            const float s = (c->times[g] - start) / (c->times[k] - start);
            at[(size_t)g * c->width] = before + (value - before) * s;
        }
        last = k;
    }
    const float rest = last == UINT32_MAX ? c->node->weights[target] : at[(size_t)last * c->width];
    for (uint32_t g = last == UINT32_MAX ? 0 : last + 1; g < c->key_count; g++)
        at[(size_t)g * c->width] = rest;
}

static void read_keys(const struct aiMeshMorphAnim *from, double rate, struct hg_anim_channel *c)
{
    for (unsigned k = 0; k < from->mNumKeys; k++) {
        const struct aiMeshMorphKey *key = &from->mKeys[k];
        const float t = (float)(key->mTime / rate);
        float *values = c->values + (size_t)c->key_count * c->width;
        if (!isfinite(t) || (c->key_count && t <= c->times[c->key_count - 1]))
            continue;
        for (uint32_t i = 0; i < c->width; i++)
            values[i] = NAN;
        for (unsigned i = 0; i < key->mNumValuesAndWeights; i++)
            if (key->mValues[i] < c->width && isfinite((float)key->mWeights[i]))
                values[key->mValues[i]] = (float)key->mWeights[i];
        c->times[c->key_count++] = t;
    }
    for (uint32_t i = 0; i < c->width; i++)
        fill_gaps(c, i);
}

enum hg_status hg_import_morphs(struct hg_import *im, const struct aiAnimation *from, double rate,
    struct hg_animation *animation)
{
    for (unsigned i = 0; i < from->mNumMorphMeshChannels; i++)
        for (uint32_t n = 0; n < im->asset->node_count; n++) {
            const struct aiMeshMorphAnim *keys = from->mMorphMeshChannels[i];
            struct hg_node *node = im->asset->nodes[n];
            if (keys->mNumKeys == 0 || !is_of(keys, node))
                continue;
            const uint32_t width = node->mesh->target_count;
            struct hg_anim_channel *c = &animation->channels[animation->channel_count++];
            c->times = hg_import_alloc(im, keys->mNumKeys, sizeof *c->times);
            c->values =
                c->times ? hg_import_alloc(im, (uint64_t)keys->mNumKeys * width, sizeof *c->values)
                         : NULL;
            if (!c->values)
                return im->err->status;
            c->node = node;
            c->path = HG_ANIM_WEIGHTS;
            c->interpolation = HG_ANIM_LINEAR;
            c->width = width;
            read_keys(keys, rate, c);
        }
    return HG_OK;
}
