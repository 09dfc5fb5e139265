// textures.c - see textures.h. Wants (what materials ask for) -> page sets (shared texels) ->
// records (a set seen through a sampler).
#include "renderer/texture/textures.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/log.h"
#include "renderer/texture/pages.h"
#include "renderer/texture/pool.h"
#include "renderer/texture/source.h"

#define NO_SET UINT32_MAX

// Identity of texels: equal keys are equal pages.
struct set_key {
    uint8_t hash[HG_SHA256_BYTES];
    uint8_t use, cutoff, wrap_s, wrap_t, pool, srgb; // srgb: transfer of the source
};

struct page_set {
    struct set_key key;
    struct hg_page_layout layout;
    uint32_t *slots; // [layout.pages]; NULL: not loaded
    uint32_t table;  // first entry
    bool failed, used;
};

// A texture as one kind of material slot uses it.
struct want {
    uint64_t id, revision;
    uint32_t use, cutoff; // cutoff: 0..255, 0 unless masked
    const struct hg_texture *texture;
    uint32_t set, record;
};

struct source_job {
    const struct hg_image_source *source;
    struct hg_source_info info;
    struct hg_error err;
    enum hg_status status;
};

struct load_job {
    struct hg_textures *textures;
    struct page_set *set;
    const struct hg_image_source *source;
    struct hg_source_info info;
    uint8_t *pages;
    struct hg_error err;
    enum hg_status status;
    uint64_t decode_ns, cut_ns;
};

struct hg_textures {
    struct hg_gpu *gpu;
    struct hg_textures_params params;
    struct hg_pool pools[HG_POOL_COUNT];
    struct page_set *sets;
    size_t set_capacity;
    uint32_t set_count;
    struct want *wants; // ordered by id, use, cutoff
    size_t want_capacity;
    uint32_t want_count;
    struct hg_gpu_texture *records;
    size_t record_capacity;
    uint32_t record_count;
    uint32_t *table;
    size_t table_capacity;
    uint32_t table_count;
    struct hg_gpu_buffer list_buffer, table_buffer;
    uint64_t revision;
    struct hg_textures_stats stats;
};

// What one sync works with.
struct sync {
    struct hg_textures *t;
    struct hg_jobs *jobs;
    struct want *wants;
    size_t want_capacity;
    uint32_t want_count;
    struct source_job *sources;
    size_t source_capacity;
    uint32_t source_count;
    struct load_job *loads;
    size_t load_capacity;
    uint32_t load_count;
};

enum hg_status hg_textures_create(struct hg_gpu *gpu, const struct hg_textures_params *params,
    struct hg_textures **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_textures *t = hg_calloc(1, sizeof *t);
    if (t == NULL)
        return hg_error_set(err, HG_E_NOMEM, "textures", NULL, "no memory");
    t->gpu = gpu;
    if (params != NULL)
        t->params = *params;
    for (uint32_t i = 0; i < HG_POOL_COUNT; i++)
        hg_pool_init(&t->pools[i], gpu, i);
    *out = t;
    return HG_OK;
}

void hg_textures_destroy(struct hg_textures *t)
{
    if (t == NULL)
        return;
    for (uint32_t i = 0; i < HG_POOL_COUNT; i++)
        hg_pool_finish(&t->pools[i]);
    for (uint32_t i = 0; i < t->set_count; i++)
        hg_free(t->sets[i].slots);
    hg_gpu_buffer_destroy(t->gpu, &t->list_buffer);
    hg_gpu_buffer_destroy(t->gpu, &t->table_buffer);
    hg_free(t->sets);
    hg_free(t->wants);
    hg_free(t->records);
    hg_free(t->table);
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

// Slots that are shaded today; the others are loaded when the path tracer reads them.
static const enum hg_texture_slot shaded_slots[] = {HG_SLOT_BASE_COLOR, HG_SLOT_EMISSIVE,
    HG_SLOT_NORMAL, HG_SLOT_METALLIC_ROUGHNESS, HG_SLOT_OCCLUSION};

static enum hg_status add_material_wants(struct sync *s, const struct hg_material *material)
{
    for (size_t i = 0; i < sizeof shaded_slots / sizeof *shaded_slots; i++) {
        const enum hg_texture_slot slot = shaded_slots[i];
        const struct hg_texture *texture = material->slots[slot].texture;
        if (texture == NULL || texture->image == NULL)
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
            .set = NO_SET,
            .record = HG_TEXTURE_NONE};
    }
    return HG_OK;
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
    if (s->want_count == 0)
        return HG_OK;
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

static void run_jobs(struct hg_jobs *jobs, size_t count, hg_jobs_fn *fn, void *user)
{
    if (jobs != NULL) {
        hg_jobs_for(jobs, count, fn, user);
        return;
    }
    for (size_t i = 0; i < count; i++)
        fn(user, i);
}

static void identify_job(void *user, size_t index)
{
    struct source_job *job = (struct source_job *)user + index;
    job->status = hg_source_identify(job->source, &job->info, &job->err);
}

static int compare_sources(const void *a, const void *b)
{
    const uintptr_t x = (uintptr_t)((const struct source_job *)a)->source;
    const uintptr_t y = (uintptr_t)((const struct source_job *)b)->source;
    return x < y ? -1 : x > y;
}

// Sets of textures that did not change are kept; sources of the others are identified once each.
static enum hg_status identify_sources(struct sync *s)
{
    for (uint32_t i = 0; i < s->want_count; i++) {
        struct want *w = &s->wants[i];
        const struct want *old = find_want(s->t->wants, s->t->want_count, w);
        if (old != NULL && old->revision == w->revision) {
            w->set = old->set;
            continue;
        }
        const enum hg_status status =
            hg_grow(&s->sources, &s->source_capacity, s->source_count + 1, sizeof *s->sources);
        if (status != HG_OK)
            return status;
        s->sources[s->source_count++] = (struct source_job){.source = w->texture->image};
    }
    if (s->source_count == 0)
        return HG_OK;
    qsort(s->sources, s->source_count, sizeof *s->sources, compare_sources); // only to find equals
    uint32_t kept = 1;
    for (uint32_t i = 1; i < s->source_count; i++)
        if (s->sources[i].source != s->sources[kept - 1].source)
            s->sources[kept++] = s->sources[i];
    s->source_count = kept;
    run_jobs(s->jobs, s->source_count, identify_job, s->sources);
    for (uint32_t i = 0; i < s->source_count; i++)
        if (s->sources[i].status == HG_E_NOMEM)
            return HG_E_NOMEM;
    return HG_OK;
}

static struct set_key key_of(const struct want *w, const struct source_job *source)
{
    struct set_key key;
    memset(&key, 0, sizeof key);
    memcpy(key.hash, source->info.hash, sizeof key.hash);
    key.use = (uint8_t)w->use;
    key.cutoff = (uint8_t)w->cutoff;
    key.wrap_s = (uint8_t)w->texture->wrap_s;
    key.wrap_t = (uint8_t)w->texture->wrap_t;
    // Shaders know the pool from the slot, float images aside: pixels whose transfer is not that of
    // the slot become linear floats.
    const bool expected = w->use <= HG_TEXTURE_MASK;
    const bool from_pixels = w->texture->image->pixels.pixels != NULL;
    const bool srgb = from_pixels ? w->texture->image->pixels_srgb : expected;
    key.srgb = srgb;
    if (source->info.is_float || srgb != expected)
        key.pool = HG_POOL_FLOAT;
    else
        key.pool = srgb ? HG_POOL_SRGB : HG_POOL_LINEAR;
    return key;
}

static void report_failure(const struct want *w, const struct hg_error *err)
{
    char text[512];
    hg_error_format(err, text, sizeof text);
    hg_warn(TEXTURE, "texture \"%s\" is shown white: %s", w->texture->head.name, text);
}

// A source that cannot be identified has no hash: its set is known by the texture instead.
static void key_of_failed(const struct want *w, struct set_key *key)
{
    memset(key, 0, sizeof *key);
    memcpy(key->hash, &w->id, sizeof w->id);
    memcpy(key->hash + 8, &w->revision, sizeof w->revision);
    key->pool = HG_POOL_COUNT;
}

static enum hg_status add_set(struct sync *s, const struct want *w, const struct source_job *source,
    const struct set_key *key, uint32_t *index)
{
    struct hg_textures *t = s->t;
    enum hg_status status = hg_grow(&t->sets, &t->set_capacity, t->set_count + 1, sizeof *t->sets);
    if (status == HG_OK)
        status = hg_grow(&s->loads, &s->load_capacity, s->load_count + 1, sizeof *s->loads);
    if (status != HG_OK)
        return status;
    *index = t->set_count++;
    struct page_set *set = &t->sets[*index];
    *set = (struct page_set){.key = *key, .failed = source->status != HG_OK};
    if (set->failed) {
        report_failure(w, &source->err);
        return HG_OK;
    }
    set->layout = hg_page_layout_of(source->info.width, source->info.height);
    s->loads[s->load_count++] =
        (struct load_job){.textures = t, .source = source->source, .info = source->info};
    return HG_OK;
}

static enum hg_status resolve_want(struct sync *s, struct want *w)
{
    const struct source_job probe = {.source = w->texture->image};
    const struct source_job *source =
        bsearch(&probe, s->sources, s->source_count, sizeof probe, compare_sources);
    struct set_key key = key_of(w, source);
    if (source->status != HG_OK)
        key_of_failed(w, &key);
    for (uint32_t i = 0; i < s->t->set_count; i++) {
        if (memcmp(&s->t->sets[i].key, &key, sizeof key) == 0) {
            w->set = i;
            return HG_OK;
        }
    }
    return add_set(s, w, source, &key, &w->set);
}

// --- loading -------------------------------------------------------------------------------------

static void load_job_run(void *user, size_t index)
{
    struct load_job *job = (struct load_job *)user + index;
    const struct page_set *set = job->set;
    const struct hg_image_limits *limits = &job->textures->params.limits;
    const struct hg_image *image;
    struct hg_image owned;
    const uint64_t start = hg_clock_now_ns();
    job->status = hg_source_decode(
        job->source, &job->info, limits->max_pixels > 0 ? limits : NULL, &image, &owned, &job->err);
    const uint64_t decoded = hg_clock_now_ns();
    job->decode_ns = decoded - start;
    if (job->status != HG_OK)
        return;
    struct hg_mips mips;
    const struct hg_mips_params params = {.srgb = set->key.srgb,
        .half = set->key.pool == HG_POOL_FLOAT,
        .use = set->key.use,
        .cutoff = (float)set->key.cutoff / 255.0f};
    job->status = hg_mips_build(image, &params, &mips);
    hg_image_finish(&owned);
    const size_t page_bytes = (size_t)HG_PAGE_PITCH * HG_PAGE_PITCH * mips.texel_bytes;
    if (job->status == HG_OK) {
        job->pages = hg_calloc(set->layout.pages, page_bytes);
        job->status = job->pages != NULL ? HG_OK : HG_E_NOMEM;
    }
    for (uint32_t i = 0; job->status == HG_OK && i < set->layout.pages; i++)
        hg_page_cut(
            &set->layout, &mips, i, set->key.wrap_s, set->key.wrap_t, job->pages + i * page_bytes);
    hg_mips_finish(&mips);
    job->cut_ns = hg_clock_now_ns() - decoded;
    if (job->status != HG_OK)
        hg_error_set(&job->err, job->status, job->source->label, NULL, "no memory for its pages");
}

static void free_slots(struct hg_textures *t, struct page_set *set)
{
    for (uint32_t i = 0; set->slots != NULL && i < set->layout.pages; i++)
        hg_pool_give(&t->pools[set->key.pool], set->slots[i]);
    hg_free(set->slots);
    set->slots = NULL;
}

static enum hg_status take_slots(struct hg_textures *t, struct page_set *set)
{
    set->slots = hg_calloc(set->layout.pages, sizeof *set->slots);
    if (set->slots == NULL)
        return HG_E_NOMEM;
    for (uint32_t i = 0; i < set->layout.pages; i++)
        set->slots[i] = hg_pool_take(&t->pools[set->key.pool]);
    return HG_OK;
}

// Uploads what a job made. An unreadable image is no error of the sync.
static enum hg_status finish_load(struct hg_textures *t, struct load_job *job, struct hg_error *err)
{
    struct page_set *set = job->set;
    struct hg_pool *pool = &t->pools[set->key.pool];
    t->stats.decoded_images++;
    if (job->status == HG_E_NOMEM) {
        *err = job->err;
        return HG_E_NOMEM;
    }
    if (job->status != HG_OK) {
        char text[512];
        hg_error_format(&job->err, text, sizeof text);
        hg_warn(TEXTURE, "image is shown white: %s", text);
        free_slots(t, set);
        set->failed = true;
        return HG_OK;
    }
    const size_t page_bytes = (size_t)HG_PAGE_PITCH * HG_PAGE_PITCH * pool->texel_bytes;
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; status == HG_OK && i < set->layout.pages; i++)
        status = hg_pool_write(pool, set->slots[i], job->pages + i * page_bytes, err);
    return status;
}

// Decodes and uploads in groups, so that few decoded images are in memory at once.
static enum hg_status run_loads(struct sync *s, struct hg_error *err)
{
    const uint32_t threads = s->jobs != NULL ? hg_jobs_threads(s->jobs) : 1;
    struct hg_textures_stats *stats = &s->t->stats;
    stats->decode_ns = stats->cut_ns = stats->upload_ns = 0;
    enum hg_status status = HG_OK;
    for (uint32_t first = 0; first < s->load_count && status == HG_OK; first += 2 * threads) {
        const uint32_t left = s->load_count - first;
        const uint32_t count = left < 2 * threads ? left : 2 * threads;
        run_jobs(s->jobs, count, load_job_run, s->loads + first);
        const uint64_t start = hg_clock_now_ns();
        for (uint32_t i = 0; i < count; i++) {
            struct load_job *job = &s->loads[first + i];
            if (status == HG_OK)
                status = finish_load(s->t, job, err);
            hg_free(job->pages);
            job->pages = NULL;
            stats->decode_ns += job->decode_ns;
            stats->cut_ns += job->cut_ns;
        }
        stats->upload_ns += hg_clock_now_ns() - start;
    }
    return status;
}

// --- budget and pools ----------------------------------------------------------------------------

static void mark_used(struct sync *s)
{
    for (uint32_t i = 0; i < s->t->set_count; i++)
        s->t->sets[i].used = false;
    for (uint32_t i = 0; i < s->want_count; i++)
        s->t->sets[s->wants[i].set].used = true;
}

static enum hg_status plan_layers(
    struct sync *s, uint32_t layers[HG_POOL_COUNT], struct hg_error *err)
{
    const struct hg_textures *t = s->t;
    uint64_t more[HG_POOL_COUNT] = {0}, freed[HG_POOL_COUNT] = {0}, bytes = 0;
    for (uint32_t i = 0; i < t->set_count; i++) {
        const struct page_set *set = &t->sets[i];
        if (set->failed)
            continue;
        if (set->slots == NULL)
            more[set->key.pool] += set->layout.pages;
        else if (!set->used)
            freed[set->key.pool] += set->layout.pages;
    }
    for (uint32_t i = 0; i < HG_POOL_COUNT; i++) {
        layers[i] = hg_pool_layers_for(&t->pools[i], more[i], freed[i]);
        if (layers[i] > 0 && layers[i] < t->pools[i].layers)
            layers[i] = t->pools[i].layers;
        bytes += layers[i] * hg_pool_layer_bytes(&t->pools[i]);
        if (layers[i] > hg_gpu_get_caps(t->gpu)->max_image_layers)
            return hg_error_set(err, HG_E_LIMIT, "textures", NULL,
                "%u pool layers are needed, the device has %u", layers[i],
                hg_gpu_get_caps(t->gpu)->max_image_layers);
    }
    if (t->params.budget_bytes > 0 && bytes > t->params.budget_bytes)
        return hg_error_set(err, HG_E_LIMIT, "texture budget", NULL,
            "%llu bytes of pages are needed, the budget is %llu", (unsigned long long)bytes,
            (unsigned long long)t->params.budget_bytes);
    return HG_OK;
}

static void note_peak(struct hg_textures *t, uint64_t extra)
{
    uint64_t bytes = 0;
    for (uint32_t i = 0; i < HG_POOL_COUNT; i++)
        bytes += t->pools[i].layers * hg_pool_layer_bytes(&t->pools[i]);
    t->stats.pool_bytes = bytes;
    if (bytes + extra > t->stats.peak_bytes)
        t->stats.peak_bytes = bytes + extra;
}

// Frees unused sets, compacts the list (wants follow) and brings the pools to their layers.
static enum hg_status resize_pools(
    struct sync *s, const uint32_t layers[HG_POOL_COUNT], struct hg_error *err)
{
    struct hg_textures *t = s->t;
    for (uint32_t i = 0; i < t->set_count; i++)
        if (!t->sets[i].used)
            free_slots(t, &t->sets[i]);
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < HG_POOL_COUNT && status == HG_OK; i++) {
        struct hg_pool *pool = &t->pools[i];
        if (layers[i] == 0) {
            hg_pool_finish(pool);
            hg_pool_init(pool, t->gpu, i);
        }
        const uint64_t old = pool->layers * hg_pool_layer_bytes(pool);
        const bool grows = layers[i] > pool->layers;
        status = hg_pool_grow(pool, layers[i], err);
        note_peak(t, grows ? old : 0);
    }
    return status;
}

static enum hg_status compact_sets(struct sync *s)
{
    struct hg_textures *t = s->t;
    uint32_t *moved = hg_calloc(t->set_count, sizeof *moved);
    if (moved == NULL)
        return HG_E_NOMEM;
    uint32_t kept = 0;
    for (uint32_t i = 0; i < t->set_count; i++) {
        moved[i] = kept;
        if (t->sets[i].used)
            t->sets[kept++] = t->sets[i];
    }
    t->set_count = kept;
    for (uint32_t i = 0; i < s->want_count; i++)
        s->wants[i].set = moved[s->wants[i].set];
    hg_free(moved);
    return HG_OK;
}

// Loads belong to the newest sets that did not fail, in order.
static enum hg_status prepare_loads(struct sync *s)
{
    uint32_t next = 0;
    for (uint32_t i = 0; i < s->t->set_count; i++) {
        struct page_set *set = &s->t->sets[i];
        if (set->failed || set->slots != NULL)
            continue;
        const enum hg_status status = take_slots(s->t, set);
        if (status != HG_OK)
            return status;
        s->loads[next++].set = set;
    }
    return HG_OK;
}

// Forgets sets that have no pages, after an error.
static void drop_unloaded(struct hg_textures *t)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < t->set_count; i++) {
        if (t->sets[i].slots != NULL || t->sets[i].failed)
            t->sets[kept++] = t->sets[i];
    }
    t->set_count = kept;
}

// --- records and the page table ------------------------------------------------------------------

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

static enum hg_status write_table(struct hg_textures *t)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < t->set_count; i++) {
        t->sets[i].table = count;
        count += t->sets[i].failed ? 0 : t->sets[i].layout.entries;
    }
    if (hg_grow(&t->table, &t->table_capacity, count, sizeof *t->table) != HG_OK)
        return HG_E_NOMEM;
    t->table_count = count;
    if (count > 0)
        memset(t->table, 0, count * sizeof *t->table);
    for (uint32_t i = 0; i < t->set_count; i++) {
        const struct page_set *set = &t->sets[i];
        for (uint32_t page = 0; !set->failed && page < set->layout.pages; page++)
            t->table[set->table + hg_page_entry(&set->layout, page)] = set->slots[page];
    }
    return HG_OK;
}

static enum hg_status write_records(struct hg_textures *t)
{
    if (hg_grow(&t->records, &t->record_capacity, t->want_count, sizeof *t->records) != HG_OK)
        return HG_E_NOMEM;
    t->record_count = 0;
    for (uint32_t i = 0; i < t->want_count; i++) {
        struct want *w = &t->wants[i];
        const struct page_set *set = &t->sets[w->set];
        w->record = HG_TEXTURE_NONE;
        if (set->failed)
            continue;
        w->record = t->record_count++;
        t->records[w->record] = (struct hg_gpu_texture){
            .size = (set->layout.width - 1) | (set->layout.height - 1) << 16,
            .bits = hg_page_layout_bits(&set->layout) | sampler_bits(w->texture) |
                    (uint32_t)set->key.pool << HG_TEX_POOL_SHIFT | HG_TEX_PRESENT,
            .table = set->table};
    }
    return HG_OK;
}

static enum hg_status upload_tables(struct hg_textures *t, struct hg_error *err)
{
    const uint64_t list_bytes = (uint64_t)t->record_count * sizeof *t->records;
    const uint64_t table_bytes = (uint64_t)t->table_count * sizeof *t->table;
    if (list_bytes == 0)
        return HG_OK;
    enum hg_status status = hg_gpu_buffer_reserve(
        t->gpu, HG_GPU_BUFFER_DEVICE, list_bytes, "textures", &t->list_buffer, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_reserve(
            t->gpu, HG_GPU_BUFFER_DEVICE, table_bytes, "page-table", &t->table_buffer, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_upload(t->gpu, &t->list_buffer, 0, t->records, list_bytes, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_upload(t->gpu, &t->table_buffer, 0, t->table, table_bytes, err);
    return status;
}

static void count_stats(struct hg_textures *t)
{
    struct hg_textures_stats *st = &t->stats;
    st->pages = st->slots = st->sets = st->failed = 0;
    st->source_bytes = 0;
    for (uint32_t i = 0; i < t->set_count; i++) {
        const struct page_set *set = &t->sets[i];
        st->failed += set->failed;
        st->sets += !set->failed;
        for (uint32_t m = 0; !set->failed && m < set->layout.mips; m++)
            st->source_bytes += (uint64_t)hg_mips_side(set->layout.width, m) *
                                hg_mips_side(set->layout.height, m) *
                                t->pools[set->key.pool].texel_bytes;
    }
    for (uint32_t i = 0; i < HG_POOL_COUNT; i++) {
        st->pages += t->pools[i].used;
        st->slots += t->pools[i].layers * HG_POOL_LAYER_SLOTS;
    }
    st->textures = t->record_count;
    st->table_bytes = (uint64_t)t->table_count * sizeof *t->table;
}

// --- sync ----------------------------------------------------------------------------------------

static enum hg_status out_of_memory(struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, "textures", NULL, "no memory");
}

// From wants with known sets to resident pages. On failure sets without pages are dropped and the
// next sync starts from what is there.
static enum hg_status load_sets(struct sync *s, struct hg_error *err)
{
    struct hg_textures *t = s->t;
    enum hg_status status = compact_sets(s);
    if (status == HG_OK)
        status = prepare_loads(s);
    if (status != HG_OK)
        return out_of_memory(err);
    status = run_loads(s, err);
    if (status != HG_OK) {
        for (uint32_t i = 0; i < s->load_count; i++)
            free_slots(t, s->loads[i].set);
        return status;
    }
    struct want *old = t->wants;
    t->wants = s->wants;
    s->wants = old;
    const size_t capacity = t->want_capacity;
    t->want_capacity = s->want_capacity;
    s->want_capacity = capacity;
    t->want_count = s->want_count;
    if (write_table(t) != HG_OK || write_records(t) != HG_OK)
        return out_of_memory(err);
    t->revision++;
    count_stats(t);
    return upload_tables(t, err);
}

static enum hg_status sync_changed(struct sync *s, struct hg_error *err)
{
    struct hg_textures *t = s->t;
    const uint32_t old_sets = t->set_count;
    enum hg_status status = identify_sources(s);
    for (uint32_t i = 0; i < s->want_count && status == HG_OK; i++)
        if (s->wants[i].set == NO_SET)
            status = resolve_want(s, &s->wants[i]);
    if (status != HG_OK) {
        t->set_count = old_sets;
        return out_of_memory(err);
    }
    mark_used(s);
    uint32_t layers[HG_POOL_COUNT];
    status = plan_layers(s, layers, err);
    if (status != HG_OK) {
        t->set_count = old_sets;
        return status;
    }
    status = resize_pools(s, layers, err);
    if (status == HG_OK)
        status = load_sets(s, err);
    if (status != HG_OK) {
        t->want_count = 0; // nothing is known to be complete
        drop_unloaded(t);
        t->revision++;
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
    hg_free(s.wants);
    hg_free(s.sources);
    hg_free(s.loads);
    return status;
}

uint64_t hg_textures_revision(const struct hg_textures *t)
{
    return t->revision;
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

void hg_textures_fill(const struct hg_textures *t, struct hg_gpu_textures *out)
{
    *out = (struct hg_gpu_textures){
        .list = t->list_buffer.address, .table = t->table_buffer.address, .count = t->record_count};
    for (uint32_t i = 0; i < HG_POOL_COUNT; i++)
        out->layers[i] = t->pools[i].layers;
}

struct hg_gpu_image *hg_textures_pool(struct hg_textures *t, uint32_t pool)
{
    return t->pools[pool].layers > 0 ? &t->pools[pool].image : NULL;
}

void hg_textures_stats(const struct hg_textures *t, struct hg_textures_stats *out)
{
    *out = t->stats;
    out->budget_bytes = t->params.budget_bytes;
}
