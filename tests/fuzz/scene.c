#include "tests/fuzz/scene.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/utf8.h"
#include "tests/fuzz/fuzz.h"

static void check_error(const struct hg_error *err, enum hg_status status)
{
    FUZZ_CHECK(err->status == status && err->what[0] && err->reason[0]);
    FUZZ_CHECK(status == HG_E_FORMAT || status == HG_E_UNSUPPORTED || status == HG_E_LIMIT ||
               status == HG_E_NOTFOUND || status == HG_E_PERM || status == HG_E_NOMEM);
    FUZZ_CHECK(hg_utf8_is_valid(err->where, strlen(err->where)));
}

// ---- what scene.h promises of every asset
// --------------------------------------------------------

static void check_finite(const float *values, size_t count)
{
    for (size_t i = 0; values && i < count; i++)
        FUZZ_CHECK(isfinite(values[i]));
}

static void check_part(const struct hg_mesh_part *part, uint32_t target_count)
{
    uint32_t corners = part->topology == HG_TOPOLOGY_TRIANGLES ? 3
                       : part->topology == HG_TOPOLOGY_LINES   ? 2
                                                               : 1;
    FUZZ_CHECK(part->index_count % corners == 0);
    for (uint32_t i = 0; i < part->index_count; i++)
        FUZZ_CHECK(part->indices[i] < part->vertex_count);
    FUZZ_CHECK(part->normals || part->topology != HG_TOPOLOGY_TRIANGLES);
    FUZZ_CHECK(part->joint_sets <= 2 && !part->joints == !part->weights);
    size_t n = part->vertex_count;
    check_finite(part->positions, n * 3);
    check_finite(part->normals, n * 3);
    check_finite(part->tangents, n * 4);
    check_finite(part->uv[0], n * 2);
    check_finite(part->uv[1], n * 2);
    check_finite(part->colors, n * 4);
    check_finite(part->weights, n * 4 * part->joint_sets);
    for (uint32_t i = 0; i < target_count; i++) {
        check_finite(part->targets[i].positions, n * 3);
        check_finite(part->targets[i].normals, n * 3);
        check_finite(part->targets[i].tangents, n * 3);
    }
}

// A shader reads the joint palette by these numbers.
static void check_joints(const struct hg_node *node)
{
    for (uint32_t p = 0; node->mesh && node->skin && p < node->mesh->part_count; p++) {
        const struct hg_mesh_part *part = &node->mesh->parts[p];
        for (size_t i = 0; part->joints && i < (size_t)part->vertex_count * 4 * part->joint_sets;
             i++)
            FUZZ_CHECK(part->joints[i] < node->skin->joint_count);
    }
}

static void check_channel(const struct hg_anim_channel *c)
{
    size_t per_key = c->interpolation == HG_ANIM_CUBIC ? 3 * (size_t)c->width : c->width;
    for (uint32_t i = 1; i < c->key_count; i++)
        FUZZ_CHECK(c->times[i] > c->times[i - 1]);
    check_finite(c->times, c->key_count);
    check_finite(c->values, c->key_count * per_key);
}

static void check_asset(const struct hg_asset *asset)
{
    for (uint32_t m = 0; m < asset->mesh_count; m++)
        for (uint32_t p = 0; p < asset->meshes[m]->part_count; p++)
            check_part(&asset->meshes[m]->parts[p], asset->meshes[m]->target_count);
    for (uint32_t i = 0; i < asset->node_count; i++)
        check_joints(asset->nodes[i]);
    for (uint32_t a = 0; a < asset->animation_count; a++)
        for (uint32_t c = 0; c < asset->animations[a].channel_count; c++)
            check_channel(&asset->animations[a].channels[c]);
    for (uint32_t i = 0; i < asset->warning_count; i++) {
        const struct hg_warning *w = &asset->warnings[i];
        FUZZ_CHECK(hg_utf8_is_valid(w->where, strlen(w->where)));
        FUZZ_CHECK(w->reason[0] && hg_utf8_is_valid(w->reason, strlen(w->reason)));
    }
}

// helio info: one JSON object, valid UTF-8.
static void describe_asset(const struct hg_asset *asset)
{
    char *json;
    FUZZ_CHECK(hg_asset_describe(asset, &json) == HG_OK);
    FUZZ_CHECK(json[0] == '{' && hg_utf8_is_valid(json, strlen(json)));
    hg_free(json);
}

// Shows the asset: posed, placed, measured. Owned by the scene from here on.
static void use_asset(struct hg_scene *scene, struct hg_asset *asset)
{
    float min[3], max[3];
    FUZZ_CHECK(hg_scene_add_asset(scene, asset, NULL) == HG_OK);
    for (double time_s = 0; time_s < 3; time_s += 0.7)
        FUZZ_CHECK(hg_asset_pose(asset, -1, time_s) == HG_OK);
    hg_scene_publish(scene);
    hg_scene_update(scene);
    (void)hg_scene_bounds(scene, NULL, min, max);
    FUZZ_CHECK(hg_scene_remove_asset(scene, 1) == HG_OK);
}

void fuzz_load(const struct hg_load_params *params)
{
    struct hg_asset *asset;
    struct hg_scene *scene;
    struct hg_error err = {0};
    enum hg_status status = hg_load_asset(params, &asset, &err);
    FUZZ_CHECK((status == HG_OK) == (asset != NULL));
    if (status) {
        check_error(&err, status);
        return;
    }
    check_asset(asset);
    describe_asset(asset);
    FUZZ_CHECK(hg_scene_create(&scene) == HG_OK);
    use_asset(scene, asset);
    hg_scene_destroy(scene);
}

// ---- one file ----------------------------------------------------------------------------------

struct file {
    const uint8_t *data;
    size_t size;
};

static enum hg_status fetch_same(
    void *user, const char *uri, uint64_t limit_bytes, struct hg_refbuf **out, struct hg_error *err)
{
    const struct file *file = user;
    *out = NULL;
    if (strstr(uri, "missing"))
        return hg_error_set(err, HG_E_NOTFOUND, uri, NULL, "no such file");
    if (file->size > limit_bytes)
        return hg_error_set(err, HG_E_LIMIT, uri, NULL, "too large");
    *out = hg_refbuf_create(file->size);
    if (!*out)
        return hg_error_set(err, HG_E_NOMEM, uri, NULL, "no memory");
    if (file->size)
        memcpy((*out)->data, file->data, file->size);
    return HG_OK;
}

void fuzz_load_file_within(
    const char *name, const uint8_t *data, size_t size, uint64_t memory_limit_bytes)
{
    struct file file = {data, size};
    fuzz_load(&(struct hg_load_params){.path = name,
        .fetch = fetch_same,
        .fetch_user = &file,
        .asset_number = 1,
        .scene_index = -1,
        .memory_limit_bytes = memory_limit_bytes});
}

void fuzz_load_file(const char *name, const uint8_t *data, size_t size)
{
    fuzz_load_file_within(name, data, size, 64 << 20);
}
