// cryptomatte_ids.c - groups draws by name for the Cryptomatte lists of pixels.
//
// A pixel lists names, not draws: all instances of a tree are one entry. A name is identified by
// the first draw that has it.
#include "renderer/pathtrace/cryptomatte_ids.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/image/cryptomatte.h"
#include "shaders/shared/path.h"

enum kind { OBJECT, MATERIAL, ASSET, KINDS }; // enum hg_matte_kind of renderer.h

void hg_cryptomatte_ids_destroy(struct hg_cryptomatte_ids *ids, struct hg_gpu *gpu)
{
    hg_gpu_buffer_destroy(gpu, &ids->names);
    ids->list_count = ids->draws = 0;
}

// Unnamed objects are named by kind and index in the file.
static void name_object(const char *kind, const struct hg_object *object, char out[HG_PATH_NAME])
{
    if (object->name[0] != '\0')
        snprintf(out, HG_PATH_NAME, "%s", object->name);
    else
        snprintf(out, HG_PATH_NAME, "%s %u", kind, (uint32_t)object->id);
}

void hg_path_name_draw(uint32_t kind, const struct hg_draw_info *d, char out[HG_PATH_NAME])
{
    if (kind == OBJECT)
        name_object("node", &d->node->head, out);
    else if (kind == MATERIAL && d->material != NULL)
        name_object("material", &d->material->head, out);
    else if (kind == MATERIAL)
        snprintf(out, HG_PATH_NAME, "default material");
    else
        snprintf(
            out, HG_PATH_NAME, "%s", d->node->asset != NULL ? d->node->asset->label : "client");
}

// Hash set with open addressing, keyed by Cryptomatte id: names with equal ids are one entry.
struct met {
    uint32_t *slots; // [mask + 1] draw + 1, 0 = free
    uint32_t *ids;   // [draws]
    uint32_t mask;
};

static uint32_t first_of(struct met *m, uint32_t draw, uint32_t id)
{
    m->ids[draw] = id;
    for (uint32_t at = id * 0x9e3779b1u;; at++) {
        uint32_t *slot = &m->slots[at & m->mask];
        if (*slot == 0)
            *slot = draw + 1;
        if (m->ids[*slot - 1] == id)
            return *slot - 1;
    }
}

static enum hg_status name_all(
    const struct hg_geometry *geometry, uint32_t kind, uint32_t draws, uint32_t *out)
{
    struct hg_draw_info info;
    char name[HG_PATH_NAME];
    struct met met = {.mask = 15};
    while (met.mask < 2 * (uint64_t)draws)
        met.mask = met.mask * 2 + 1;
    met.slots = hg_calloc((size_t)met.mask + 1, sizeof *met.slots);
    met.ids = hg_calloc((size_t)draws + 1, sizeof *met.ids);
    const enum hg_status status = met.slots != NULL && met.ids != NULL ? HG_OK : HG_E_NOMEM;
    for (uint32_t i = 0; i < draws && status == HG_OK; i++) {
        out[i] = i;
        if (!hg_geometry_draw_info(geometry, i, &info))
            continue;
        hg_path_name_draw(kind, &info, name);
        out[i] = first_of(&met, i, hg_cryptomatte_id(name));
    }
    hg_free(met.slots);
    hg_free(met.ids);
    return status;
}

static uint32_t kinds_of(const struct hg_path_settings *s)
{
    return (s->planes >> HG_PATH_PLANE_DRAWS & 1u) != 0 ? s->mattes : 0;
}

enum hg_status hg_cryptomatte_ids_make(struct hg_cryptomatte_ids *ids, struct hg_gpu *gpu,
    const struct hg_geometry *geometry, const struct hg_path_settings *settings,
    struct hg_error *err)
{
    struct hg_geometry_stats stats;
    const uint32_t kinds = kinds_of(settings);
    ids->list_count = (uint32_t)__builtin_popcount(kinds);
    if (ids->list_count == 0)
        return HG_OK;
    hg_geometry_stats(geometry, &stats);
    ids->draws = (uint32_t)stats.draws;
    enum hg_status status = hg_gpu_buffer_reserve(gpu, HG_GPU_BUFFER_UPLOAD,
        ((uint64_t)ids->list_count * ids->draws + 1) * 4, "names of draws", &ids->names, err);
    if (status != HG_OK)
        return status;
    uint32_t *to = ids->names.mapped;
    for (uint32_t kind = 0; kind < KINDS && status == HG_OK; kind++) {
        if ((kinds >> kind & 1u) == 0)
            continue;
        status = name_all(geometry, kind, ids->draws, to);
        to += ids->draws;
    }
    return status == HG_OK ? HG_OK : hg_error_set(err, status, "names", NULL, "out of host memory");
}

bool hg_cryptomatte_ids_list(const struct hg_path_settings *settings, uint32_t kind, uint32_t *list)
{
    const uint32_t kinds = kinds_of(settings);
    *list = (uint32_t)__builtin_popcount(kinds & ((1u << kind) - 1u));
    return (kinds >> kind & 1u) != 0;
}
