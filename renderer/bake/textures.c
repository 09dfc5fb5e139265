// textures.c - the page packs of a scene's textures.
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/json.h"
#include "base/log.h"
#include "renderer/bake/internal.h"
#include "renderer/texture/source/page_source.h"

#define POLL_NS 100000000u

// One image seen through one use.
struct item {
    struct hg_page_source_params params;
    struct hg_page_source *source;
    uint64_t texels; // of mip 0; 0: cannot be opened, or an earlier item has the same content
    struct hg_page_bake result;
    enum hg_status status;
    struct hg_error err;
};

struct textures {
    const struct hg_bake *bake;
    struct hg_page_sources *sources;
    struct item *items;
    size_t capacity;
    uint32_t count;
    uint64_t texels;
    _Atomic uint64_t skipped_texels;
    atomic_bool stop, done;
    uint64_t ns;
};

// --- what materials use --------------------------------------------------------------------------

// As textures.c does: packs are found by it.
static uint8_t quantise_cutoff(enum hg_texture_use use, float cutoff)
{
    if (use != HG_TEXTURE_MASK || !(cutoff > 0.0f))
        return 0;
    return cutoff >= 1.0f ? 255 : (uint8_t)lrintf(cutoff * 255.0f);
}

static bool is_same(const struct hg_page_source_params *a, const struct hg_page_source_params *b)
{
    return a->image == b->image && a->use == b->use && a->cutoff == b->cutoff &&
           a->wrap_s == b->wrap_s && a->wrap_t == b->wrap_t;
}

static enum hg_status add_slot(
    struct textures *t, const struct hg_material *material, enum hg_texture_slot slot)
{
    const struct hg_texture *texture = material->slots[slot].texture;
    if (!hg_material_uses_slot(material, slot) || texture->image == NULL)
        return HG_OK;
    const enum hg_texture_use use = hg_texture_slot_use(material, slot);
    const struct hg_page_source_params params = {.image = texture->image,
        .use = use,
        .cutoff = quantise_cutoff(use, material->alpha_cutoff),
        .wrap_s = texture->wrap_s,
        .wrap_t = texture->wrap_t};
    for (uint32_t i = 0; i < t->count; i++) {
        if (is_same(&t->items[i].params, &params))
            return HG_OK;
    }
    if (hg_grow(&t->items, &t->capacity, t->count + 1, sizeof *t->items) != HG_OK)
        return HG_E_NOMEM;
    t->items[t->count++] = (struct item){.params = params};
    return HG_OK;
}

static enum hg_status collect(struct textures *t)
{
    const struct hg_object_list *list = &t->bake->scene->objects[HG_OBJECT_MATERIAL];
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < list->count && status == HG_OK; i++) {
        for (int k = HG_SLOT_BASE_COLOR; k < HG_SLOT_COUNT && status == HG_OK; k++)
            status =
                add_slot(t, (const struct hg_material *)list->items[i], (enum hg_texture_slot)k);
    }
    return status;
}

// A pack of the same content may serve several items; it counts once.
static bool counts(const struct textures *t, uint32_t index)
{
    const uint8_t *id = hg_page_source_info(t->items[index].source)->content_id;
    for (uint32_t i = 0; i < index; i++) {
        const struct hg_page_source *other = t->items[i].source;
        if (other != NULL && memcmp(hg_page_source_info(other)->content_id, id, 32) == 0)
            return false;
    }
    return true;
}

// --- threads -------------------------------------------------------------------------------------

static void open_item(void *user, size_t index)
{
    struct textures *t = user;
    struct item *item = &t->items[index];
    item->status = hg_page_source_open(t->sources, &item->params, &item->source, &item->err);
}

static void bake_item(void *user, size_t index)
{
    struct textures *t = user;
    struct item *item = &t->items[index];
    if (item->status == HG_OK && atomic_load(&t->stop))
        item->status = HG_E_CANCELLED;
    if (item->status == HG_OK)
        item->status = hg_page_source_bake(item->source, &item->result, &item->err);
    if (item->status != HG_OK || item->result.bake_ns == 0) // not among the sources' own numbers
        atomic_fetch_add(&t->skipped_texels, item->texels);
}

static void *bake_all(void *user)
{
    struct textures *t = user;
    hg_jobs_for(t->bake->jobs, t->count, bake_item, t);
    atomic_store(&t->done, true);
    return NULL;
}

static void watch(struct textures *t)
{
    while (!atomic_load(&t->done)) {
        struct hg_page_sources_stats stats;
        hg_page_sources_stats(t->sources, &stats);
        const uint64_t done = atomic_load(&t->skipped_texels) + stats.bake_texels_done;
        if (!hg_bake_tell(t->bake, "textures", done < t->texels ? done : t->texels, t->texels))
            atomic_store(&t->stop, true);
        hg_clock_sleep_ns(POLL_NS);
    }
}

static enum hg_status run(struct textures *t, struct hg_error *err)
{
    pthread_t thread;
    const uint64_t start = hg_clock_now_ns();
    hg_jobs_for(t->bake->jobs, t->count, open_item, t);
    for (uint32_t i = 0; i < t->count; i++) {
        struct item *item = &t->items[i];
        if (item->status != HG_OK || !counts(t, i))
            continue;
        const struct hg_page_layout *layout = &hg_page_source_info(item->source)->layout;
        item->texels = (uint64_t)layout->width * layout->height;
        t->texels += item->texels;
    }
    if (pthread_create(&thread, NULL, bake_all, t) != 0)
        return hg_error_set(err, HG_E_LIMIT, "bake", NULL, "cannot start a thread");
    watch(t);
    pthread_join(thread, NULL);
    t->ns = hg_clock_now_ns() - start;
    return atomic_load(&t->stop) ? hg_error_set(err, HG_E_CANCELLED, "bake", NULL, "cancelled")
                                 : HG_OK;
}

// --- report --------------------------------------------------------------------------------------

static uint64_t source_bytes(const struct hg_image_source *image)
{
    struct stat st;
    if (image->encoded != NULL)
        return image->encoded->size;
    return image->path != NULL && stat(image->path, &st) == 0 ? (uint64_t)st.st_size : 0;
}

static void put_failures(struct hg_writer *w, const struct textures *t)
{
    bool first = true;
    hg_json_put(w, "\"failures\":[");
    for (uint32_t i = 0; i < t->count; i++) {
        if (t->items[i].status == HG_OK)
            continue;
        hg_json_put(w, "%s{\"what\":", first ? "" : ",");
        hg_json_string(w, t->items[i].params.image->label);
        hg_json_put(w, ",\"reason\":");
        hg_json_string(w, t->items[i].err.reason);
        hg_json_put(w, "}");
        first = false;
    }
    hg_json_put(w, "]");
}

static void put_report(struct hg_writer *w, const struct textures *t)
{
    uint32_t packs = 0, found = 0, in_place = 0, failed = 0;
    uint64_t texels = 0, made_texels = 0, pages = 0, pack_bytes = 0, from_bytes = 0;
    for (uint32_t i = 0; i < t->count; i++) {
        const struct item *item = &t->items[i];
        failed += item->status != HG_OK;
        if (item->status != HG_OK || !counts(t, i))
            continue;
        const bool packed = item->result.pack_bytes > 0;
        packs += packed;
        in_place += !packed;
        found += packed && item->result.bake_ns == 0;
        texels += packed ? item->result.texels : 0;
        made_texels += packed && item->result.bake_ns > 0 ? item->result.texels : 0;
        pages += item->result.pages;
        pack_bytes += item->result.pack_bytes;
        from_bytes += packed ? source_bytes(item->params.image) : 0;
    }
    const double seconds = (double)t->ns * 1e-9;
    hg_json_put(w,
        "\"textures\":{\"packs\":%u,\"found\":%u,\"in_place\":%u,\"failed\":%u,\"texels\":%llu,"
        "\"pages\":%llu,\"pack_bytes\":%llu,\"source_bytes\":%llu,\"bytes_per_texel\":%.4f,"
        "\"texels_per_s\":%.0f,\"ms\":%.3f,",
        packs, found, in_place, failed, (unsigned long long)texels, (unsigned long long)pages,
        (unsigned long long)pack_bytes, (unsigned long long)from_bytes,
        texels > 0 ? (double)pack_bytes / (double)texels : 0,
        seconds > 0 ? (double)made_texels / seconds : 0, seconds * 1e3);
    put_failures(w, t);
    hg_json_put(w, "}");
}

static enum hg_status note_entries(
    const struct textures *t, struct hg_bake_entries *entries, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < t->count && status == HG_OK; i++) {
        const struct item *item = &t->items[i];
        if (item->status == HG_OK && item->result.pack_bytes > 0 && counts(t, i))
            status = hg_bake_note(entries, &item->result.key, err);
    }
    return status;
}

// A full disk, and where nothing could be written at all: that is the cache folder's fault, not the
// images'.
static enum hg_status folder_failure(const struct textures *t, struct hg_error *err)
{
    for (uint32_t i = 0; i < t->count; i++) {
        if (t->items[i].status == HG_E_NOSPACE) {
            *err = t->items[i].err;
            return HG_E_NOSPACE;
        }
    }
    for (uint32_t i = 0; i < t->count; i++) {
        const enum hg_status s = t->items[i].status;
        if (s != HG_E_IO && s != HG_E_PERM)
            return HG_OK;
    }
    if (t->count > 0)
        *err = t->items[0].err;
    return t->count > 0 ? t->items[0].status : HG_OK;
}

enum hg_status hg_bake_textures(const struct hg_bake *bake, struct hg_store *store,
    struct hg_bake_entries *entries, struct hg_writer *report, struct hg_error *err)
{
    struct textures t = {.bake = bake};
    const struct hg_page_sources_params params = {.store = store,
        .memory_bytes = bake->host_budget_bytes,
        .threads = hg_jobs_threads(bake->jobs)};
    enum hg_status status = collect(&t);
    if (status == HG_OK)
        status = hg_page_sources_create(&params, &t.sources, err);
    else
        hg_error_set(err, status, "bake", NULL, "no memory for the list of textures");
    if (status == HG_OK)
        status = run(&t, err);
    if (status == HG_OK)
        status = folder_failure(&t, err);
    if (status == HG_OK)
        status = note_entries(&t, entries, err);
    if (status == HG_OK)
        put_report(report, &t);
    for (uint32_t i = 0; i < t.count; i++)
        hg_page_source_close(t.items[i].source);
    hg_page_sources_destroy(t.sources);
    hg_free(t.items);
    return status;
}
