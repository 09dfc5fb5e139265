// Meshes, nodes, lights, cameras, skins and animations of imported files.
#include <assimp/cimport.h>
#include <assimp/version.h>
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/formats/import/import.h"
#include "renderer/scene/mesh_tools.h"
#include "renderer/scene/xform.h"

enum { MAX_DEPTH = 1024 };

static void to_matrix(const struct aiMatrix4x4 *from, float m[16]) // rows to columns
{
    const float rows[16] = {from->a1, from->b1, from->c1, from->d1, from->a2, from->b2, from->c2,
        from->d2, from->a3, from->b3, from->c3, from->d3, from->a4, from->b4, from->c4, from->d4};
    memcpy(m, rows, sizeof rows);
    for (int i = 0; i < 16; i++)
        if (!isfinite(m[i]))
            hg_mat4_identity(m);
    m[3] = m[7] = m[11] = 0;
    m[15] = 1;
}

// Node of the asset by name; NULL when there is none.
static struct hg_node *find_node(const struct hg_import *im, const char *name)
{
    for (uint32_t i = 0; i < im->asset->node_count; i++)
        if (strcmp(im->asset->nodes[i]->head.name, name) == 0)
            return im->asset->nodes[i];
    return NULL;
}

// ---- meshes ------------------------------------------------------------------------------------

static enum hg_status copy_indices(
    struct hg_import *im, const struct aiMesh *from, struct hg_mesh_part *part)
{
    unsigned corners = from->mPrimitiveTypes & aiPrimitiveType_TRIANGLE ? 3
                       : from->mPrimitiveTypes & aiPrimitiveType_LINE   ? 2
                                                                        : 1;
    part->topology = corners == 3   ? HG_TOPOLOGY_TRIANGLES
                     : corners == 2 ? HG_TOPOLOGY_LINES
                                    : HG_TOPOLOGY_POINTS;
    if ((uint64_t)from->mNumFaces * corners > INT32_MAX)
        return hg_import_fail(im, HG_E_LIMIT, NULL, "too many faces");
    part->indices = hg_import_alloc(im, (uint64_t)from->mNumFaces * corners, sizeof(uint32_t));
    if (!part->indices)
        return im->err->status;
    for (unsigned f = 0; f < from->mNumFaces; f++) {
        const struct aiFace *face = &from->mFaces[f];
        bool sound = face->mNumIndices == corners;
        for (unsigned c = 0; sound && c < corners; c++)
            sound = face->mIndices[c] < from->mNumVertices;
        for (unsigned c = 0; sound && c < corners; c++)
            part->indices[part->index_count++] = face->mIndices[c];
    }
    return HG_OK;
}

static bool copy_vectors(struct hg_import *im, const struct aiVector3D *from, uint32_t count,
    uint32_t width, float **out)
{
    if (!from)
        return true;
    *out = hg_import_alloc(im, count, width * sizeof(float));
    for (size_t v = 0; *out && v < count; v++) {
        const float xyz[3] = {from[v].x, from[v].y, from[v].z};
        for (uint32_t c = 0; c < width; c++)
            (*out)[v * width + c] = isfinite(xyz[c]) ? xyz[c] : 0;
    }
    return *out != NULL;
}

static bool copy_colors(struct hg_import *im, const struct aiMesh *from, struct hg_mesh_part *part)
{
    const struct aiColor4D *colors = from->mColors[0];
    if (!colors)
        return true;
    part->colors = hg_import_alloc(im, from->mNumVertices, 4 * sizeof(float));
    for (size_t v = 0; part->colors && v < from->mNumVertices; v++) {
        const float rgba[4] = {colors[v].r, colors[v].g, colors[v].b, colors[v].a};
        for (int c = 0; c < 4; c++)
            part->colors[v * 4 + c] = isfinite(rgba[c]) && rgba[c] > 0 ? rgba[c] : 0;
    }
    return part->colors != NULL;
}

// Those without a length stay so: hg_part_fill_normals follows.
static void normalize_normals(struct hg_mesh_part *part)
{
    for (size_t v = 0; part->normals && v < part->vertex_count; v++)
        if (!hg_normalize3(part->normals + v * 3))
            memset(part->normals + v * 3, 0, 3 * sizeof(float));
}

static enum hg_status copy_part(
    struct hg_import *im, const struct aiMesh *from, struct hg_mesh_part *part)
{
    part->vertex_count = from->mNumVertices;
    bool ok = copy_vectors(im, from->mVertices, from->mNumVertices, 3, &part->positions) &&
              copy_vectors(im, from->mNormals, from->mNumVertices, 3, &part->normals) &&
              copy_vectors(im, from->mTextureCoords[0], from->mNumVertices, 2, &part->uv[0]) &&
              copy_vectors(im, from->mTextureCoords[1], from->mNumVertices, 2, &part->uv[1]) &&
              copy_colors(im, from, part);
    if (!ok)
        return im->err->status;
    normalize_normals(part);
    enum hg_status status = copy_indices(im, from, part);
    if (!status && part->normals && hg_part_fill_normals(part))
        status = hg_import_fail(im, HG_E_NOMEM, NULL, "no memory");
    if (from->mMaterialIndex < im->asset->material_count)
        part->material = im->asset->materials[from->mMaterialIndex];
    return status;
}

// Up to four joints a vertex; the loader limited them.
static enum hg_status copy_weights(
    struct hg_import *im, const struct aiMesh *from, struct hg_mesh_part *part)
{
    part->joint_sets = 1;
    part->joints = hg_import_alloc(im, part->vertex_count, 4 * sizeof(uint16_t));
    part->weights =
        part->joints ? hg_import_alloc(im, part->vertex_count, 4 * sizeof(float)) : NULL;
    if (!part->weights)
        return im->err->status;
    for (unsigned b = 0; b < from->mNumBones && b < UINT16_MAX; b++)
        for (unsigned i = 0; i < from->mBones[b]->mNumWeights; i++) {
            const struct aiVertexWeight *w = &from->mBones[b]->mWeights[i];
            float *weights = part->weights + (size_t)w->mVertexId * 4;
            if (w->mVertexId >= part->vertex_count || !(w->mWeight > 0))
                continue;
            for (int k = 0; k < 4; k++)
                if (weights[k] == 0) {
                    weights[k] = w->mWeight;
                    part->joints[(size_t)w->mVertexId * 4 + k] = (uint16_t)b;
                    break;
                }
        }
    for (size_t v = 0; v < part->vertex_count; v++) {
        float *w = part->weights + v * 4, sum = w[0] + w[1] + w[2] + w[3];
        for (int k = 0; k < 4; k++)
            w[k] = sum > 0 ? w[k] / sum : (float)(k == 0);
    }
    return HG_OK;
}

static enum hg_status make_skin(
    struct hg_import *im, const struct aiMesh *from, struct hg_skin **out)
{
    struct hg_skin *skin = hg_asset_add_skin(im->asset);
    if (!skin)
        return hg_import_fail(im, HG_E_NOMEM, NULL, "no memory for a skin");
    skin->joints = hg_import_alloc(im, from->mNumBones, sizeof *skin->joints);
    skin->inverse_bind =
        skin->joints ? hg_import_alloc(im, from->mNumBones, sizeof *skin->inverse_bind) : NULL;
    if (!skin->inverse_bind)
        return im->err->status;
    for (unsigned b = 0; b < from->mNumBones; b++) {
        struct hg_node *joint = find_node(im, from->mBones[b]->mName.data);
        if (!joint)
            return hg_import_fail(
                im, HG_E_FORMAT, from->mBones[b]->mName.data, "a bone without a node");
        skin->joints[b] = joint;
        to_matrix(&from->mBones[b]->mOffsetMatrix, skin->inverse_bind[b]);
    }
    skin->joint_count = from->mNumBones;
    *out = skin;
    return HG_OK;
}

static enum hg_status finish_part(struct hg_mesh *mesh)
{
    struct hg_mesh_part *part = &mesh->parts[0];
    enum hg_status status = HG_OK;
    const struct hg_texture_ref *normal =
        part->material ? &part->material->slots[HG_SLOT_NORMAL] : NULL;
    if (part->topology == HG_TOPOLOGY_TRIANGLES && !part->normals)
        status = part->targets ? hg_part_make_flat_normals(part, mesh->target_count)
                               : hg_part_make_crease_normals(part, NULL);
    if (!status && part->topology == HG_TOPOLOGY_TRIANGLES && normal && normal->texture &&
        part->uv[normal->uv_set])
        status = hg_part_make_tangents(part, mesh->target_count, normal->uv_set);
    if (!status)
        hg_mesh_part_update_bounds(part, mesh->target_count);
    return status;
}

// Nodes hold mesh numbers until now.
static enum hg_status give_mesh(
    struct hg_import *im, unsigned number, struct hg_mesh *mesh, struct hg_skin *skin)
{
    enum hg_status status = HG_OK;
    for (uint32_t n = 0; n < im->asset->node_count && !status; n++) {
        if (im->asset->nodes[n]->instance_count != number + 1)
            continue;
        im->asset->nodes[n]->mesh = mesh;
        im->asset->nodes[n]->skin = skin;
        status = hg_import_weights(im, im->asset->nodes[n]);
    }
    return status;
}

enum hg_status hg_import_meshes(struct hg_import *im)
{
    for (unsigned i = 0; i < im->scene->mNumMeshes; i++) {
        const struct aiMesh *from = im->scene->mMeshes[i];
        if (from->mNumFaces == 0 || from->mNumVertices == 0)
            continue; // a part of a file that holds nothing
        struct hg_mesh *mesh = hg_asset_add_mesh(im->asset, from->mName.data);
        if (mesh)
            mesh->parts = hg_import_alloc(im, 1, sizeof *mesh->parts);
        if (!mesh || !mesh->parts)
            return hg_import_fail(im, HG_E_NOMEM, NULL, "no memory for a mesh");
        mesh->part_count = 1;
        enum hg_status status = copy_part(im, from, mesh->parts);
        struct hg_skin *skin = NULL;
        if (!status && from->mNumBones)
            status = copy_weights(im, from, mesh->parts);
        if (!status && from->mNumBones)
            status = make_skin(im, from, &skin);
        if (!status)
            status = hg_import_targets(im, from, mesh);
        if (!status)
            status = finish_part(mesh);
        if (!status)
            status = give_mesh(im, i, mesh, skin);
        if (status)
            return im->err->status ? status : hg_import_fail(im, status, NULL, "no memory");
    }
    for (uint32_t n = 0; n < im->asset->node_count; n++)
        im->asset->nodes[n]->instance_count = 0;
    return HG_OK;
}

// ---- nodes -------------------------------------------------------------------------------------

static enum hg_status add_node(
    struct hg_import *im, const struct aiNode *from, struct hg_node *parent, uint32_t depth)
{
    struct hg_node *node =
        depth < MAX_DEPTH ? hg_asset_add_node(im->asset, from->mName.data) : NULL;
    if (!node)
        return hg_import_fail(im, depth < MAX_DEPTH ? HG_E_NOMEM : HG_E_LIMIT, from->mName.data,
            "the node hierarchy is too deep or memory is short");
    node->has_matrix = true;
    to_matrix(&from->mTransformation, node->matrix);
    if (parent)
        hg_node_append_child(parent, node);
    for (unsigned m = 0; m < from->mNumMeshes; m++) {
        struct hg_node *holder = m ? hg_asset_add_node(im->asset, from->mName.data) : node;
        if (!holder)
            return hg_import_fail(im, HG_E_NOMEM, NULL, "no memory for a node");
        holder->instance_count = from->mMeshes[m] + 1; // resolved by hg_import_meshes
        if (m)
            hg_node_append_child(node, holder);
    }
    for (unsigned c = 0; c < from->mNumChildren; c++) {
        enum hg_status status = add_node(im, from->mChildren[c], node, depth + 1);
        if (status)
            return status;
    }
    return HG_OK;
}

// A node below `parent` that looks along `forward`, since imported lights and cameras have their
// own directions.
static struct hg_node *add_looking(struct hg_import *im, const char *name,
    const struct aiVector3D *at, const struct aiVector3D *forward, const struct aiVector3D *up)
{
    struct hg_node *parent = find_node(im, name);
    struct hg_node *node = hg_asset_add_node(im->asset, name);
    if (!node)
        return NULL;
    float z[3] = {-forward->x, -forward->y, -forward->z}, y[3] = {up->x, up->y, up->z}, x[3];
    if (!hg_normalize3(z))
        z[2] = 1;
    hg_cross3(y, z, x);
    if (!hg_normalize3(x)) {
        const float side[3] = {fabsf(z[0]) < 0.9f, 0, fabsf(z[0]) >= 0.9f};
        hg_cross3(z, side, y);
        hg_normalize3(y);
        hg_cross3(y, z, x);
        hg_normalize3(x);
    }
    hg_cross3(z, x, y);
    const float m[16] = {
        x[0], x[1], x[2], 0, y[0], y[1], y[2], 0, z[0], z[1], z[2], 0, at->x, at->y, at->z, 1};
    node->has_matrix = true;
    memcpy(node->matrix, m, sizeof m);
    if (parent)
        hg_node_append_child(parent, node);
    return node;
}

static enum hg_status add_light(struct hg_import *im, const struct aiLight *from)
{
    bool known;
    const unsigned kind = hg_import_light_kind(from, &known);
    if (!known)
        return HG_OK;
    struct hg_light *light = hg_asset_add_light(im->asset, from->mName.data);
    struct hg_node *node =
        light ? add_looking(im, from->mName.data, &from->mPosition, &from->mDirection, &from->mUp)
              : NULL;
    if (!node)
        return hg_import_fail(im, HG_E_NOMEM, NULL, "no memory for a light");
    light->kind = kind;
    float rgb[3] = {from->mColorDiffuse.r, from->mColorDiffuse.g, from->mColorDiffuse.b};
    float peak = fmaxf(rgb[0], fmaxf(rgb[1], rgb[2]));
    light->intensity = peak > 0 && isfinite(peak) ? peak : 0; // hg_import_light_units follows
    for (int i = 0; i < 3; i++)
        light->color[i] = light->intensity > 0 ? fmaxf(rgb[i] / peak, 0) : 1;
    float outer = from->mAngleOuterCone / 2, inner = from->mAngleInnerCone / 2; // full angles
    light->outer_cone_rad = outer > 0.001f && outer < 1.5708f ? outer : 0.785398f;
    light->inner_cone_rad = inner > 0 && inner < light->outer_cone_rad ? inner : 0;
    node->light = light;
    return HG_OK;
}

// Metres per unit of lengths that assimp does not scale with the nodes.
float hg_import_file_unit(const struct hg_import *im)
{
    const struct aiMetadata *meta = im->scene->mMetaData;
    for (unsigned i = 0; meta && i < meta->mNumProperties; i++) {
        const struct aiMetadataEntry *entry = &meta->mValues[i];
        double value = 0;
        float single = 0;
        if (strcmp(meta->mKeys[i].data, "UnitScaleFactor") != 0)
            continue;
        if (entry->mType == AI_DOUBLE)
            memcpy(&value, entry->mData, sizeof value);
        else if (entry->mType == AI_FLOAT)
            memcpy(&single, entry->mData, sizeof single);
        value += (double)single;
        if (value > 0 && isfinite(value)) // FBX counts in centimetres
            return (float)(value * 0.01);
    }
    return 1;
}

// Importers store the full horizontal angle, but that of FBX half of it from assimp 5.3 on (its
// pull request 5175).
static float half_angle(const struct hg_import *im, const struct aiCamera *from)
{
    const unsigned version = aiGetVersionMajor() * 100 + aiGetVersionMinor();
    const bool halved = version >= 503 && strcmp(im->asset->file.format, "fbx") == 0;
    return halved ? from->mHorizontalFOV : from->mHorizontalFOV / 2;
}

static const double aspect_else = 16.0 / 9; // of a camera that states only its width

// What a Collada file says of the next camera that this node holds. False: nothing of use.
static bool set_collada_optics(struct hg_import *im, const char *node, struct hg_camera *camera)
{
    const struct hg_collada_optics *optics = hg_collada_next_camera(&im->cameras, node);
    float angle, half_height, aspect;
    if (optics &&
        hg_collada_half_height(optics, im->cameras.unit_m, aspect_else, &half_height, &aspect)) {
        camera->kind = HG_CAMERA_ORTHOGRAPHIC;
        camera->half_height = half_height;
    } else if (optics && hg_collada_vertical_angle(optics, aspect_else, &angle, &aspect)) {
        camera->vfov_rad = angle;
    } else {
        return false;
    }
    camera->aspect = aspect;
    if (optics->near > 0)
        camera->near = (float)(optics->near * im->cameras.unit_m);
    if (optics->far * im->cameras.unit_m > (double)camera->near)
        camera->far = (float)(optics->far * im->cameras.unit_m);
    return true;
}

static void set_field_of_view(
    struct hg_import *im, const struct aiCamera *from, struct hg_camera *camera)
{
    const float aspect = from->mAspect > 0 ? from->mAspect : (float)aspect_else;
    const float half = half_angle(im, from);
    camera->aspect = from->mAspect > 0 ? from->mAspect : 0;
    if (half > 0.008f && half < 1.57f)
        camera->vfov_rad = 2 * atanf(tanf(half) / aspect);
    else
        hg_asset_warn(im->asset, from->mName.data,
            "the camera's field of view cannot be read; %.0f degrees are used",
            (double)camera->vfov_rad * 180 / 3.14159265358979);
}

static enum hg_status add_camera(struct hg_import *im, const struct aiCamera *from)
{
    struct hg_camera *camera = hg_asset_add_camera(im->asset, from->mName.data);
    struct hg_node *node =
        camera ? add_looking(im, from->mName.data, &from->mPosition, &from->mLookAt, &from->mUp)
               : NULL;
    if (!node)
        return hg_import_fail(im, HG_E_NOMEM, NULL, "no memory for a camera");
    node->camera = camera;
    if (set_collada_optics(im, from->mName.data, camera))
        return HG_OK;
    const float unit = hg_import_file_unit(im);
    set_field_of_view(im, from, camera);
    if (from->mClipPlaneNear > 0)
        camera->near = from->mClipPlaneNear * unit;
    if (from->mClipPlaneFar * unit > camera->near)
        camera->far = from->mClipPlaneFar * unit;
    return HG_OK;
}

enum hg_status hg_import_nodes(struct hg_import *im)
{
    enum hg_status status = add_node(im, im->scene->mRootNode, NULL, 0);
    for (unsigned i = 0; !status && i < im->scene->mNumLights; i++)
        status = add_light(im, im->scene->mLights[i]);
    for (unsigned i = 0; !status && i < im->scene->mNumCameras; i++)
        status = add_camera(im, im->scene->mCameras[i]);
    if (status)
        return status;
    im->asset->roots = hg_import_alloc(im, im->asset->node_count, sizeof *im->asset->roots);
    for (uint32_t n = 0; im->asset->roots && n < im->asset->node_count; n++)
        if (!im->asset->nodes[n]->parent)
            im->asset->roots[im->asset->root_count++] = im->asset->nodes[n];
    return im->asset->roots ? HG_OK : im->err->status;
}

// ---- animations --------------------------------------------------------------------------------

// A channel with room for `count` keys.
static struct hg_anim_channel *begin_channel(struct hg_import *im, struct hg_animation *animation,
    struct hg_node *node, enum hg_anim_path path, uint32_t count)
{
    struct hg_anim_channel *c = &animation->channels[animation->channel_count];
    uint32_t width = path == HG_ANIM_ROTATION ? 4 : 3;
    c->times = hg_import_alloc(im, count, sizeof *c->times);
    c->values = c->times ? hg_import_alloc(im, (uint64_t)count * width, sizeof *c->values) : NULL;
    animation->channel_count++;
    if (!c->values)
        return NULL;
    c->node = node;
    c->path = path;
    c->interpolation = HG_ANIM_LINEAR;
    c->width = width;
    return c;
}

// Appends a key unless its time does not grow.
static void add_key(struct hg_anim_channel *c, double time_s, const float *value)
{
    float t = (float)time_s;
    if (!isfinite(t) || (c->key_count && t <= c->times[c->key_count - 1]))
        return;
    c->times[c->key_count] = t;
    memcpy(c->values + (size_t)c->key_count * c->width, value, c->width * sizeof *value);
    c->key_count++;
}

struct vector_track {
    enum hg_anim_path path; // translation or scale
    const struct aiVectorKey *keys;
    unsigned count;
};

static bool add_vector_keys(struct hg_import *im, struct hg_animation *animation,
    struct hg_node *node, const struct vector_track *from, double rate)
{
    if (from->count == 0)
        return true;
    struct hg_anim_channel *c = begin_channel(im, animation, node, from->path, from->count);
    for (unsigned k = 0; c && k < from->count; k++) {
        const struct aiVectorKey *key = &from->keys[k];
        const float v[3] = {key->mValue.x, key->mValue.y, key->mValue.z};
        add_key(c, key->mTime / rate, v);
    }
    return c != NULL;
}

static bool add_rotation_keys(struct hg_import *im, struct hg_animation *animation,
    struct hg_node *node, const struct aiNodeAnim *from, double rate)
{
    if (from->mNumRotationKeys == 0)
        return true;
    struct hg_anim_channel *c =
        begin_channel(im, animation, node, HG_ANIM_ROTATION, from->mNumRotationKeys);
    for (unsigned k = 0; c && k < from->mNumRotationKeys; k++) {
        const struct aiQuaternion *q = &from->mRotationKeys[k].mValue;
        float v[4] = {q->x, q->y, q->z, q->w};
        hg_quat_normalize(v);
        add_key(c, from->mRotationKeys[k].mTime / rate, v);
    }
    return c != NULL;
}

// Animated nodes move by translation, rotation and scale.
static void split_matrix(struct hg_node *node)
{
    if (!node->has_matrix)
        return;
    const float *m = node->matrix;
    struct aiMatrix4x4 from = {m[0], m[4], m[8], m[12], m[1], m[5], m[9], m[13], m[2], m[6], m[10],
        m[14], m[3], m[7], m[11], m[15]};
    struct aiVector3D scale, position;
    struct aiQuaternion q;
    aiDecomposeMatrix(&from, &scale, &q, &position);
    const float t[3] = {position.x, position.y, position.z}, s[3] = {scale.x, scale.y, scale.z};
    const float r[4] = {q.x, q.y, q.z, q.w};
    memcpy(node->translation, t, sizeof t);
    memcpy(node->scale, s, sizeof s);
    memcpy(node->rotation, r, sizeof r);
    hg_quat_normalize(node->rotation);
    node->has_matrix = false;
}

static enum hg_status add_animation(
    struct hg_import *im, const struct aiAnimation *from, struct hg_animation *animation)
{
    double rate = from->mTicksPerSecond > 0 ? from->mTicksPerSecond : 25; // assimp's convention
    animation->name = hg_strdup(from->mName.data);
    animation->channels =
        hg_import_alloc(im, (uint64_t)from->mNumChannels * 3 + hg_import_count_morphs(im, from),
            sizeof *animation->channels);
    if (!animation->name || !animation->channels)
        return hg_import_fail(im, HG_E_NOMEM, NULL, "no memory for an animation");
    for (unsigned i = 0; i < from->mNumChannels; i++) {
        const struct aiNodeAnim *c = from->mChannels[i];
        struct hg_node *node = find_node(im, c->mNodeName.data);
        if (!node)
            continue;
        split_matrix(node);
        const struct vector_track positions = {
            HG_ANIM_TRANSLATION, c->mPositionKeys, c->mNumPositionKeys};
        const struct vector_track scales = {HG_ANIM_SCALE, c->mScalingKeys, c->mNumScalingKeys};
        if (!add_vector_keys(im, animation, node, &positions, rate) ||
            !add_rotation_keys(im, animation, node, c, rate) ||
            !add_vector_keys(im, animation, node, &scales, rate))
            return im->err->status;
    }
    const enum hg_status status = hg_import_morphs(im, from, rate, animation);
    if (status)
        return status;
    for (uint32_t c = 0; c < animation->channel_count; c++) {
        const struct hg_anim_channel *channel = &animation->channels[c];
        double end = channel->key_count ? (double)channel->times[channel->key_count - 1] : 0;
        animation->duration_s = fmax(animation->duration_s, end);
    }
    return HG_OK;
}

enum hg_status hg_import_animations(struct hg_import *im)
{
    unsigned count = im->scene->mNumAnimations;
    im->asset->animations = hg_import_alloc(im, count, sizeof *im->asset->animations);
    if (!im->asset->animations)
        return im->err->status;
    im->asset->animation_count = count;
    enum hg_status status = HG_OK;
    for (unsigned i = 0; !status && i < count; i++)
        status = add_animation(im, im->scene->mAnimations[i], &im->asset->animations[i]);
    return status;
}
