// textures.c - see textures.h. Wants (what materials ask for) -> page sets (shared texels) ->
// records (a set seen through a sampler).
#include "renderer/texture/textures.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/log.h"
#include "renderer/texture/cache/page_cache.h"

#define BACKGROUND_ID UINT64_MAX // no object has it

// A texture as one kind of material slot uses it.
struct want {
    uint64_t id, revision;
    uint32_t use, cutoff; // cutoff: 0..255, 0 unless masked
    const struct hg_texture *texture;
    struct hg_page_set *set; // one reference; NULL: cannot be opened
    uint32_t record;
};

struct open_job {
    struct hg_page_sources *sources;
    struct want *want;
    struct hg_page_source *source;
    struct hg_error err;
    enum hg_status status;
};

struct hg_textures {
    struct hg_gpu *gpu;
    struct hg_page_cache *cache;
    bool owns_cache, wide;
    uint64_t cache_revision;
    struct want *wants; // ordered by id, use, cutoff
    size_t want_capacity;
    uint32_t want_count;
    struct hg_gpu_texture *records;
    size_t record_capacity;
    uint32_t record_count;
    struct hg_gpu_buffer list_buffer;
    uint64_t revision;
    uint32_t unopened; // wants whose image could not even be opened
};

// What one sync works with.
struct sync {
    struct hg_textures *t;
    struct hg_jobs *jobs;
    struct want *wants;
    size_t want_capacity;
    uint32_t want_count;
    struct open_job *opens;
    uint32_t open_count;
};

enum hg_status hg_textures_create(struct hg_gpu *gpu, const struct hg_textures_params *params,
    struct hg_textures **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_textures *t = hg_calloc(1, sizeof *t);
    if (t == NULL)
        return hg_error_set(err, HG_E_NOMEM, "textures", NULL, "no memory");
    t->gpu = gpu;
    t->cache = params != NULL ? params->cache : NULL;
    if (t->cache == NULL) {
        struct hg_page_cache_params cache = {0};
        if (params != NULL) {
            cache.budget_bytes = params->budget_bytes;
            cache.limits = params->limits;
        }
        const enum hg_status status = hg_page_cache_create(gpu, &cache, &t->cache, err);
        if (status != HG_OK) {
            hg_free(t);
            return status;
        }
        t->owns_cache = true;
    }
    *out = t;
    return HG_OK;
}

static void release_wants(struct hg_textures *t)
{
    for (uint32_t i = 0; i < t->want_count; i++)
        if (t->wants[i].set != NULL)
            hg_page_cache_release(t->cache, t->wants[i].set);
    t->want_count = 0;
}

void hg_textures_destroy(struct hg_textures *t)
{
    if (t == NULL)
        return;
    release_wants(t);
    if (t->owns_cache)
        hg_page_cache_destroy(t->cache);
    hg_gpu_buffer_destroy(t->gpu, &t->list_buffer);
    hg_free(t->wants);
    hg_free(t->records);
    hg_free(t);
}

// --- what is wanted ------------------------------------------------------------------------------

enum hg_texture_use hg_texture_slot_use(
    const struct hg_material *material, enum hg_texture_slot slot)
{
    if (slot == HG_SLOT_BASE_COLOR && material->alpha_mode == HG_ALPHA_MASK)
        return HG_TEXTURE_MASK;
    if (slot == HG_SLOT_BASE_COLOR && material->alpha_mode == HG_ALPHA_BLEND)
        return HG_TEXTURE_BLEND;
    if (slot == HG_SLOT_NORMAL || slot == HG_SLOT_CLEARCOAT_NORMAL)
        return HG_TEXTURE_NORMAL;
    return hg_texture_slot_is_srgb(slot) ? HG_TEXTURE_COLOR : HG_TEXTURE_DATA;
}

static uint32_t quantise_cutoff(enum hg_texture_use use, float cutoff)
{
    if (use != HG_TEXTURE_MASK || !(cutoff > 0.0f))
        return 0;
    return cutoff >= 1.0f ? 255 : (uint32_t)lrintf(cutoff * 255.0f);
}

static int compare_wants(const void *a, const void *b)
{
    const struct want *x = a, *y = b;
    if (x->id != y->id)
        return x->id < y->id ? -1 : 1;
    if (x->use != y->use)
        return x->use < y->use ? -1 : 1;
    return x->cutoff < y->cutoff ? -1 : x->cutoff > y->cutoff;
}

static const struct want *find_want(
    const struct want *wants, uint32_t count, const struct want *key)
{
    return count == 0 ? NULL : bsearch(key, wants, count, sizeof *wants, compare_wants);
}

static enum hg_status add_material_wants(struct sync *s, const struct hg_material *material)
{
    for (int i = HG_SLOT_BASE_COLOR; i < HG_SLOT_COUNT; i++) {
        const enum hg_texture_slot slot = (enum hg_texture_slot)i;
        const struct hg_texture *texture = material->slots[slot].texture;
        if (!hg_material_uses_slot(material, slot) || texture->image == NULL)
            continue;
        const enum hg_status status =
            hg_grow(&s->wants, &s->want_capacity, s->want_count + 1, sizeof *s->wants);
        if (status != HG_OK)
            return status;
        const enum hg_texture_use use = hg_texture_slot_use(material, slot);
        s->wants[s->want_count++] = (struct want){.id = texture->head.id,
            .revision = texture->head.revision,
            .use = use,
            .cutoff = quantise_cutoff(use, material->alpha_cutoff),
            .texture = texture,
            .record = HG_TEXTURE_NONE};
    }
    return HG_OK;
}

// What is behind the scene, as if some material used it.
static enum hg_status add_background(struct sync *s, const struct hg_environment *environment)
{
    const struct hg_texture *texture = &environment->background;
    if (environment->kind != HG_ENV_IMAGE || texture->image == NULL)
        return HG_OK;
    const enum hg_status status =
        hg_grow(&s->wants, &s->want_capacity, s->want_count + 1, sizeof *s->wants);
    if (status == HG_OK)
        s->wants[s->want_count++] = (struct want){.id = BACKGROUND_ID,
            .revision = texture->head.revision,
            .use = HG_TEXTURE_RADIANCE,
            .texture = texture,
            .record = HG_TEXTURE_NONE};
    return status;
}

static enum hg_status collect_wants(struct sync *s, const struct hg_scene *scene)
{
    const struct hg_object_list *list = &scene->objects[HG_OBJECT_MATERIAL];
    for (uint32_t i = 0; i < list->count; i++) {
        const enum hg_status status =
            add_material_wants(s, (const struct hg_material *)list->items[i]);
        if (status != HG_OK)
            return status;
    }
    const enum hg_status status = add_background(s, &scene->environment);
    if (status != HG_OK || s->want_count == 0)
        return status;
    qsort(s->wants, s->want_count, sizeof *s->wants, compare_wants);
    uint32_t kept = 1;
    for (uint32_t i = 1; i < s->want_count; i++)
        if (compare_wants(&s->wants[kept - 1], &s->wants[i]) != 0)
            s->wants[kept++] = s->wants[i];
    s->want_count = kept;
    return HG_OK;
}

static bool same_wants(const struct sync *s)
{
    const struct hg_textures *t = s->t;
    if (s->want_count != t->want_count)
        return false;
    for (uint32_t i = 0; i < s->want_count; i++)
        if (compare_wants(&s->wants[i], &t->wants[i]) != 0 ||
            s->wants[i].revision != t->wants[i].revision)
            return false;
    return true;
}

// --- from wants to sets --------------------------------------------------------------------------

static void open_image(void *user, size_t index)
{
    struct open_job *job = (struct open_job *)user + index;
    const struct want *w = job->want;
    const struct hg_page_source_params params = {.image = w->texture->image,
        .use = (enum hg_texture_use)w->use,
        .cutoff = (uint8_t)w->cutoff,
        .wrap_s = w->texture->wrap_s,
        .wrap_t = w->texture->wrap_t};
    job->status = hg_page_source_open(job->sources, &params, &job->source, &job->err);
}

static void report_failure(const struct want *w, const struct hg_error *err)
{
    char text[512];
    hg_error_format(err, text, sizeof text);
    if (w->id == BACKGROUND_ID)
        hg_warn(TEXTURE, "the environment is shown black: %s", text);
    else
        hg_warn(TEXTURE, "texture \"%s\" is shown white: %s", w->texture->head.name, text);
}

static enum hg_status out_of_memory(struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, "textures", NULL, "no memory");
}

// Sets of textures that did not change move over from the old wants; the others are opened.
static enum hg_status open_images(struct sync *s)
{
    s->opens = hg_calloc(s->want_count, sizeof *s->opens);
    if (s->opens == NULL)
        return HG_E_NOMEM;
    for (uint32_t i = 0; i < s->want_count; i++) {
        struct want *w = &s->wants[i];
        const struct want *old = find_want(s->t->wants, s->t->want_count, w);
        if (old == NULL || old->revision != w->revision)
            s->opens[s->open_count++] =
                (struct open_job){.sources = hg_page_cache_sources(s->t->cache), .want = w};
    }
    if (s->jobs != NULL)
        hg_jobs_for(s->jobs, s->open_count, open_image, s->opens);
    for (uint32_t i = 0; s->jobs == NULL && i < s->open_count; i++)
        open_image(s->opens, i);
    for (uint32_t i = 0; i < s->open_count; i++)
        if (s->opens[i].status == HG_E_NOMEM)
            return HG_E_NOMEM;
    return HG_OK;
}

static void close_images(struct sync *s)
{
    for (uint32_t i = 0; i < s->open_count; i++)
        hg_page_source_close(s->opens[i].source);
}

// Each want holds one reference on its set, also while two lists of wants exist.
static enum hg_status acquire_sets(struct sync *s, struct hg_error *err)
{
    for (uint32_t i = 0; i < s->open_count; i++) {
        struct open_job *job = &s->opens[i];
        struct hg_page_source *source = job->source;
        job->source = NULL;
        if (job->status != HG_OK) {
            report_failure(job->want, &job->err);
            continue;
        }
        const enum hg_status status = hg_page_cache_acquire(s->t->cache, source,
            job->want->texture->image, (enum hg_texture_use)job->want->use, &job->want->set, err);
        if (status != HG_OK)
            return status;
    }
    return HG_OK;
}

static bool was_opened(const struct sync *s, const struct want *w)
{
    for (uint32_t i = 0; i < s->open_count; i++)
        if (s->opens[i].want == w)
            return true;
    return false;
}

// The new wants take the place of the old ones; sets that are no longer wanted are let go.
static void exchange_wants(struct sync *s)
{
    struct hg_textures *t = s->t;
    for (uint32_t i = 0; i < s->want_count; i++) {
        struct want *w = &s->wants[i];
        struct want *old = (struct want *)find_want(t->wants, t->want_count, w);
        if (old == NULL || was_opened(s, w))
            continue;
        w->set = old->set;
        old->set = NULL;
    }
    release_wants(t);
    struct want *wants = t->wants;
    const size_t capacity = t->want_capacity;
    t->wants = s->wants;
    t->want_capacity = s->want_capacity;
    t->want_count = s->want_count;
    s->wants = wants;
    s->want_capacity = capacity;
    s->want_count = 0;
}

// --- records -------------------------------------------------------------------------------------

static uint32_t sampler_bits(const struct hg_texture *texture)
{
    static const uint32_t wraps[] = {[HG_WRAP_REPEAT] = HG_TEX_WRAP_REPEAT,
        [HG_WRAP_CLAMP] = HG_TEX_WRAP_CLAMP,
        [HG_WRAP_MIRROR] = HG_TEX_WRAP_MIRROR};
    return wraps[texture->wrap_s] << HG_TEX_WRAP_S_SHIFT |
           wraps[texture->wrap_t] << HG_TEX_WRAP_T_SHIFT |
           (texture->mag_nearest ? HG_TEX_MAG_NEAREST : 0) |
           (texture->min_nearest ? HG_TEX_MIN_NEAREST : 0) |
           (texture->mip_nearest ? HG_TEX_MIP_NEAREST : 0) |
           (texture->mip_none ? HG_TEX_MIP_NONE : 0);
}

static struct hg_gpu_texture make_record(const struct want *w)
{
    const struct hg_page_source_info *info = hg_page_set_info(w->set);
    const uint32_t right = info->layout.width - 1, bottom = info->layout.height - 1;
    return (struct hg_gpu_texture){.size = (right & 0xffffu) | bottom << 16,
        .bits = hg_page_layout_bits(&info->layout) | sampler_bits(w->texture) |
                info->pool << HG_TEX_POOL_SHIFT | HG_TEX_PRESENT |
                (right > 0xffffu ? HG_TEX_WIDTH_17 : 0) | (bottom > 0xffffu ? HG_TEX_HEIGHT_17 : 0),
        .table = hg_page_set_table(w->set)};
}

static enum hg_status write_records(struct hg_textures *t, struct hg_error *err)
{
    if (hg_grow(&t->records, &t->record_capacity, t->want_count, sizeof *t->records) != HG_OK)
        return out_of_memory(err);
    t->record_count = t->unopened = 0;
    t->wide = false;
    for (uint32_t i = 0; i < t->want_count; i++) {
        struct want *w = &t->wants[i];
        w->record = HG_TEXTURE_NONE;
        t->unopened += w->set == NULL;
        if (w->set == NULL || hg_page_set_failed(w->set))
            continue;
        w->record = t->record_count++;
        t->records[w->record] = make_record(w);
        t->wide |= (t->records[w->record].bits & (HG_TEX_WIDTH_17 | HG_TEX_HEIGHT_17)) != 0;
    }
    const uint64_t bytes = (uint64_t)t->record_count * sizeof *t->records;
    if (bytes == 0)
        return HG_OK;
    const enum hg_status status = hg_gpu_buffer_reserve(
        t->gpu, HG_GPU_BUFFER_DEVICE, bytes, "textures", &t->list_buffer, err);
    return status == HG_OK
               ? hg_gpu_buffer_upload(t->gpu, &t->list_buffer, 0, t->records, bytes, err)
               : status;
}

// --- sync ----------------------------------------------------------------------------------------

static enum hg_status sync_changed(struct sync *s, struct hg_error *err)
{
    struct hg_textures *t = s->t;
    enum hg_status status = open_images(s);
    if (status != HG_OK)
        return out_of_memory(err);
    status = acquire_sets(s, err);
    if (status != HG_OK) { // the old wants stay as they were
        for (uint32_t i = 0; i < s->want_count; i++)
            if (s->wants[i].set != NULL)
                hg_page_cache_release(t->cache, s->wants[i].set);
        return status;
    }
    exchange_wants(s);
    status = hg_page_cache_fit(t->cache, err);
    t->cache_revision = hg_page_cache_revision(t->cache);
    t->revision++;
    if (status == HG_OK)
        status = write_records(t, err);
    if (status != HG_OK) { // nothing is known to be complete
        release_wants(t);
        t->record_count = 0;
    }
    return status;
}

enum hg_status hg_textures_sync(
    struct hg_textures *t, const struct hg_scene *scene, struct hg_jobs *jobs, struct hg_error *err)
{
    struct sync s = {.t = t, .jobs = jobs};
    enum hg_status status = collect_wants(&s, scene);
    if (status != HG_OK)
        status = out_of_memory(err);
    else if (!same_wants(&s))
        status = sync_changed(&s, err);
    else if (hg_textures_is_stale(t)) {
        t->cache_revision = hg_page_cache_revision(t->cache);
        t->revision++;
        status = write_records(t, err);
    }
    close_images(&s);
    hg_free(s.wants);
    hg_free(s.opens);
    return status;
}

uint64_t hg_textures_revision(const struct hg_textures *t)
{
    return t->revision;
}

bool hg_textures_is_stale(const struct hg_textures *t)
{
    return t->want_count > 0 && t->cache_revision != hg_page_cache_revision(t->cache);
}

struct hg_page_cache *hg_textures_cache(struct hg_textures *t)
{
    return t->cache;
}

enum hg_status hg_textures_load_all(struct hg_textures *t, struct hg_error *err)
{
    return hg_page_cache_load_all(t->cache, err);
}

uint32_t hg_textures_find(const struct hg_textures *t, const struct hg_texture *texture,
    enum hg_texture_use use, float cutoff)
{
    if (texture == NULL || texture->image == NULL)
        return HG_TEXTURE_NONE;
    const struct want key = {
        .id = texture->head.id, .use = use, .cutoff = quantise_cutoff(use, cutoff)};
    const struct want *w = find_want(t->wants, t->want_count, &key);
    return w != NULL ? w->record : HG_TEXTURE_NONE;
}

struct hg_gpu_texture hg_textures_record(const struct hg_textures *t, uint32_t index)
{
    return index < t->record_count ? t->records[index] : (struct hg_gpu_texture){0};
}

struct hg_gpu_texture hg_textures_background(const struct hg_textures *t)
{
    const struct want key = {.id = BACKGROUND_ID, .use = HG_TEXTURE_RADIANCE};
    const struct want *w = find_want(t->wants, t->want_count, &key);
    return hg_textures_record(t, w != NULL ? w->record : HG_TEXTURE_NONE);
}

bool hg_textures_has_float(const struct hg_textures *t)
{
    for (uint32_t i = 0; i < t->want_count; i++)
        if (t->wants[i].id != BACKGROUND_ID && t->wants[i].record != HG_TEXTURE_NONE &&
            hg_page_set_info(t->wants[i].set)->pool == HG_POOL_FLOAT)
            return true;
    return false;
}

bool hg_textures_has_wide(const struct hg_textures *t)
{
    return t->wide;
}

void hg_textures_fill(const struct hg_textures *t, uint32_t mode, struct hg_gpu_textures *out)
{
    *out = (struct hg_gpu_textures){.list = t->list_buffer.address, .count = t->record_count};
    hg_page_cache_fill(t->cache, mode == HG_TEXTURES_EXACT ? HG_PAGES_EXACT : HG_PAGES_SHOW, out);
}

struct hg_gpu_image *hg_textures_pool(struct hg_textures *t, uint32_t pool)
{
    return hg_page_cache_pool(t->cache, pool);
}

// Wants are in order of textures: equal sets are counted once by looking back.
static bool is_first(const struct hg_textures *t, uint32_t want)
{
    for (uint32_t i = 0; i < want; i++)
        if (t->wants[i].set == t->wants[want].set)
            return false;
    return true;
}

static void count_sets(const struct hg_textures *t, struct hg_textures_stats *out)
{
    for (uint32_t i = 0; i < t->want_count; i++) {
        const struct hg_page_set *set = t->wants[i].set;
        if (set == NULL || !is_first(t, i))
            continue;
        const struct hg_page_source_info *info = hg_page_set_info(set);
        out->failed += hg_page_set_failed(set);
        out->sets += !hg_page_set_failed(set);
        for (uint32_t m = 0; !hg_page_set_failed(set) && m < info->layout.mips; m++)
            out->source_bytes += (uint64_t)hg_mips_side(info->layout.width, m) *
                                 hg_mips_side(info->layout.height, m) * info->texel_bytes;
    }
}

void hg_textures_stats(const struct hg_textures *t, struct hg_textures_stats *out)
{
    struct hg_page_cache_stats c;
    struct hg_page_sources_stats sources;
    hg_page_cache_stats(t->cache, &c);
    hg_page_sources_stats(hg_page_cache_sources(t->cache), &sources);
    *out = (struct hg_textures_stats){.budget_bytes = c.budget_bytes,
        .pool_bytes = c.pool_bytes,
        .peak_bytes = c.peak_bytes,
        .table_bytes = c.table_bytes,
        .pages = c.resident,
        .slots = c.slots,
        .textures = t->record_count,
        .failed = t->unopened,
        .missing = c.missing,
        .requested = c.requested,
        .evicted = c.evicted,
        .loaded = c.pages_loaded,
        .bytes_read = sources.bytes_read,
        .decode_ns = c.read_ns,
        .upload_ns = c.upload_ns,
        .sharp_ns = c.sharp_ns,
        .bias = c.bias};
    count_sets(t, out);
}
