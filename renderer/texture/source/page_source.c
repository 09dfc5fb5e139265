// page_source.c - see page_source.h: opening, reading and waiting. The work is in page_load.c.
#include "renderer/texture/source/page_source.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/cond.h"
#include "base/jobs.h"
#include "base/refbuf.h"
#include "renderer/texture/source/page_image.h"
#include "renderer/texture/source/page_preview.h"
#include "renderer/texture/source/page_ondemand.h"

enum { DEFAULT_MEMORY = 512 << 20 };

#define TILE_SHARE 8 // of memory_bytes, for tiles of files that are read in place

static enum hg_status no_memory(struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, "textures", NULL, "no memory");
}

// --- what all sources share ----------------------------------------------------------------------

static void complete_params(struct hg_page_sources_params *p)
{
    p->memory_bytes = p->memory_bytes > 0 ? p->memory_bytes : DEFAULT_MEMORY;
    p->image_bytes = p->image_bytes > 0 ? p->image_bytes : p->memory_bytes / 4;
    p->threads = p->threads > 0 ? p->threads : hg_jobs_cores();
    p->threads = p->threads > HG_PAGE_LOAD_THREADS ? HG_PAGE_LOAD_THREADS : p->threads;
    p->limits.max_side_px = p->limits.max_side_px > 0 ? p->limits.max_side_px : HG_MIPS_SIDE_PX;
    p->limits.max_pixels = p->limits.max_pixels > 0 ? p->limits.max_pixels : UINT64_C(1) << 34;
    p->limits.max_bytes = p->limits.max_bytes > 0 ? p->limits.max_bytes : UINT64_C(1) << 31;
}

enum hg_status hg_page_sources_create(
    const struct hg_page_sources_params *params, struct hg_page_sources **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_page_sources *s = hg_calloc(1, sizeof *s);
    if (s == NULL)
        return no_memory(err);
    s->params = params != NULL ? *params : (struct hg_page_sources_params){0};
    complete_params(&s->params);
    if (hg_tile_cache_create(s->params.memory_bytes / TILE_SHARE, &s->tiles) != HG_OK ||
        hg_open_files_create(s->params.files, &s->files) != HG_OK) {
        hg_tile_cache_destroy(s->tiles);
        hg_free(s);
        return no_memory(err);
    }
    pthread_mutex_init(&s->lock, NULL);
    hg_cond_init(&s->work);
    hg_cond_init(&s->rush);
    hg_cond_init(&s->changed);
    if (s->params.threads > 1)
        s->jobs = hg_jobs_create(s->params.threads); // without it pages are compressed one by one
    while (s->thread_count < 2 * s->params.threads &&
           pthread_create(&s->threads[s->thread_count], NULL, hg_page_load_thread, s) == 0)
        s->thread_count++;
    if (s->thread_count == 0) {
        hg_page_sources_destroy(s);
        return no_memory(err);
    }
    *out = s;
    return HG_OK;
}

void hg_page_sources_destroy(struct hg_page_sources *s)
{
    if (s == NULL)
        return;
    pthread_mutex_lock(&s->lock);
    s->stop = true;
    pthread_cond_broadcast(&s->work);
    pthread_cond_broadcast(&s->rush);
    pthread_mutex_unlock(&s->lock);
    for (unsigned i = 0; i < s->thread_count; i++)
        pthread_join(s->threads[i], NULL);
    hg_jobs_destroy(s->jobs);
    hg_tile_cache_destroy(s->tiles);
    hg_open_files_destroy(s->files);
    for (size_t i = 0; i < s->scratch_count; i++)
        hg_page_scratch_destroy(s->scratches[i]);
    hg_free(s->scratches);
    pthread_cond_destroy(&s->work);
    pthread_cond_destroy(&s->rush);
    pthread_cond_destroy(&s->changed);
    pthread_mutex_destroy(&s->lock);
    hg_free(s);
}

void hg_page_sources_changed(struct hg_page_sources *s, bool pages_appeared)
{
    s->revision += pages_appeared;
    pthread_cond_broadcast(&s->changed);
}

void hg_page_sources_stats(struct hg_page_sources *s, struct hg_page_sources_stats *out)
{
    pthread_mutex_lock(&s->lock);
    struct hg_tile_cache_stats tiles;
    hg_tile_cache_stats(s->tiles, &tiles);
    *out = s->stats;
    out->memory_bytes = s->memory_bytes;
    out->tile_bytes = tiles.bytes;
    struct hg_open_files_stats files;
    hg_open_files_stats(s->files, &files);
    out->files_open = files.open;
    out->files_reopened = files.reopened;
    out->tiles_found = tiles.tiles_found;
    out->tiles_decoded = tiles.tiles_decoded;
    for (const struct hg_page_image *i = s->images; i != NULL; i = i->next) {
        out->loading += i->wanted && i->backing == NULL && !i->failed;
        out->baking += i->busy && i->backing != NULL;
        if (!i->busy && i->backing != NULL && i->backing->kind == HG_PAGES_IN_MEMORY &&
            hg_page_can_bake(s, i))
            out->bake_texels_total += hg_page_image_texels(i);
    }
    pthread_mutex_unlock(&s->lock);
}

uint64_t hg_page_sources_revision(struct hg_page_sources *s)
{
    pthread_mutex_lock(&s->lock);
    const uint64_t revision = s->revision;
    pthread_mutex_unlock(&s->lock);
    return revision;
}

void hg_page_sources_wait(struct hg_page_sources *s, uint64_t seen, uint64_t timeout_ns)
{
    const uint64_t until_ns = hg_cond_after(timeout_ns);
    pthread_mutex_lock(&s->lock);
    while (s->revision == seen && hg_cond_wait(&s->changed, &s->lock, until_ns))
        ;
    pthread_mutex_unlock(&s->lock);
}

// Whether there is a pack to wait for.
static bool is_baking(const struct hg_page_sources *s)
{
    const uint64_t now = hg_clock_now_ns();
    for (const struct hg_page_image *i = s->images; i != NULL; i = i->next) {
        if (i->backing == NULL || i->backing->kind != HG_PAGES_IN_MEMORY || !hg_page_can_bake(s, i))
            continue;
        if (i->busy || (i->retry_ns <= now && !i->failed && now < s->linger_ns))
            return true;
    }
    return false;
}

void hg_page_sources_linger(struct hg_page_sources *s, uint64_t most_ns)
{
    const uint64_t until_ns = hg_cond_after(most_ns);
    pthread_mutex_lock(&s->lock);
    s->linger_ns = until_ns;
    pthread_cond_broadcast(&s->work);
    while (is_baking(s) && hg_cond_wait(&s->changed, &s->lock, until_ns))
        ;
    pthread_mutex_unlock(&s->lock);
}

void hg_page_sources_hurry(struct hg_page_sources *s, bool hurry)
{
    pthread_mutex_lock(&s->lock);
    s->hurry += hurry ? 1u : ~0u;
    if (hurry)
        pthread_cond_broadcast(&s->rush);
    pthread_mutex_unlock(&s->lock);
}

// --- opening -------------------------------------------------------------------------------------

// Which pool and transfer an image needs for a use. Shaders know the pool from the slot, float
// images aside: pixels whose transfer is not that of the slot become linear floats.
static void choose_format(const struct hg_page_source_params *p, struct hg_page_image *image)
{
    const bool expected = p->use <= HG_TEXTURE_MASK;
    const struct hg_image_source *from = p->image;
    const bool given = from->tiles != NULL ||
                       (from->pixels.pixels != NULL && from->encoded == NULL && from->path == NULL);
    const bool srgb = given ? from->pixels_srgb : expected;
    image->chain.srgb = srgb;
    if (image->info.is_float || srgb != expected || p->use == HG_TEXTURE_RADIANCE)
        image->pool = HG_POOL_FLOAT;
    else
        image->pool = srgb ? HG_POOL_SRGB : HG_POOL_LINEAR;
    image->chain.texel_bytes = image->pool == HG_POOL_FLOAT ? 8 : 4;
}

static enum hg_status describe_image(struct hg_page_sources *s,
    const struct hg_page_source_params *p, struct hg_page_image *image, struct hg_error *err)
{
    enum hg_status status = hg_source_identify(s->params.store, p->image, &image->info, err);
    if (status == HG_E_NOMEM) { // maybe for want of descriptors
        hg_open_files_give_up(s->files);
        status = hg_source_identify(s->params.store, p->image, &image->info, err);
    }
    if (status != HG_OK)
        return status;
    const uint64_t pixels = (uint64_t)image->info.width * image->info.height;
    if (image->info.width > s->params.limits.max_side_px ||
        image->info.height > s->params.limits.max_side_px || pixels > s->params.limits.max_pixels)
        return hg_error_set(err, HG_E_LIMIT, p->image->label, NULL,
            "%u x %u texels are more than allowed", image->info.width, image->info.height);
    choose_format(p, image);
    memcpy(image->chain.content, image->info.hash, sizeof image->chain.content);
    image->chain.width = image->info.width;
    image->chain.height = image->info.height;
    image->chain.filter = hg_mips_filter(p->use);
    image->layout = hg_page_layout_of(image->info.width, image->info.height);
    return HG_OK;
}

static enum hg_status make_content_id(struct hg_page_source *source)
{
    const struct hg_page_image *image = source->image;
    struct hg_store_key key;
    if (hg_page_pack_key(&image->chain, &key) != HG_OK)
        return HG_E_NOMEM;
    struct hg_sha256 *h = hg_sha256_create();
    if (h == NULL)
        return HG_E_NOMEM;
    const uint8_t rest[3] = {(uint8_t)source->wrap_s, (uint8_t)source->wrap_t, source->cutoff};
    hg_sha256_update(h, key.hash, sizeof key.hash);
    hg_sha256_update(h, rest, sizeof rest);
    hg_sha256_end(h, source->info.content_id);
    return HG_OK;
}

static bool same_chain(const struct hg_page_chain *a, const struct hg_page_chain *b)
{
    return memcmp(a->content, b->content, sizeof a->content) == 0 && a->width == b->width &&
           a->height == b->height && a->texel_bytes == b->texel_bytes && a->filter == b->filter &&
           a->srgb == b->srgb;
}

// Puts the source into the image of its content; takes `fresh` or frees it.
static void join_image(
    struct hg_page_sources *s, struct hg_page_source *source, struct hg_page_image *fresh)
{
    pthread_mutex_lock(&s->lock);
    struct hg_page_image **at = &s->images;
    while (*at != NULL && !same_chain(&(*at)->chain, &fresh->chain))
        at = &(*at)->next;
    if (*at == NULL) {
        *at = fresh;
        fresh = NULL;
    }
    source->image = *at;
    source->next = source->image->members;
    source->image->members = source;
    s->stats.sources++;
    pthread_mutex_unlock(&s->lock);
    if (fresh != NULL && fresh->backing != NULL)
        hg_page_backing_unref(s, fresh->backing);
    hg_free(fresh);
}

// A file that is read in place, one of a bounded number that is open.
static enum hg_status open_in_place(struct hg_page_sources *s, const struct hg_image_source *origin,
    const struct hg_source_info *info, struct hg_open_file **out, struct hg_error *err)
{
    struct hg_image_reader *reader;
    enum hg_status status = hg_source_open_file(origin, info, &reader, err);
    if (status == HG_E_NOMEM) {
        hg_open_files_give_up(s->files);
        status = hg_source_open_file(origin, info, &reader, err);
    }
    *out = NULL;
    if (status != HG_OK)
        return status;
    const enum hg_pixel_format format = info->is_float ? HG_PIXEL_RGBA32F : HG_PIXEL_RGBA8;
    return hg_open_files_add(s->files, reader, format, out) == HG_OK ? HG_OK : no_memory(err);
}

// Backings that can be read at once: tiles, files in place, an existing pack.
static enum hg_status find_backing(struct hg_page_sources *s, const struct hg_page_source_params *p,
    struct hg_page_image *image, struct hg_error *err)
{
    struct hg_page_backing *b = hg_calloc(1, sizeof *b);
    if (b == NULL)
        return no_memory(err);
    atomic_init(&b->refs, 1);
    enum hg_status status = HG_E_NOTFOUND;
    b->format = image->info.is_float ? HG_PIXEL_RGBA32F : HG_PIXEL_RGBA8;
    const bool in_place = image->info.has_mips && image->chain.filter == HG_MIP_PLAIN;
    if (p->image->tiles != NULL) {
        b->kind = HG_PAGES_ON_DEMAND;
        b->tiles = p->image->tiles;
        b->format = b->tiles->format;
        status = HG_OK;
    } else if (in_place) {
        b->kind = HG_PAGES_ON_DEMAND;
        status = open_in_place(s, p->image, &image->info, &b->file, err);
    } else if (s->params.store != NULL) {
        b->kind = HG_PAGES_IN_PACK;
        status = hg_page_pack_open(s->params.store, &image->chain, &b->pack, NULL);
    }
    if (status == HG_OK)
        image->backing = b;
    else
        hg_free(b);
    if (status == HG_E_NOMEM)
        return no_memory(err);
    return in_place ? status : HG_OK;
}

static void fill_info(struct hg_page_source *source, const struct hg_page_image *image)
{
    source->info.layout = image->layout;
    source->info.pool = image->pool;
    source->info.texel_bytes = image->chain.texel_bytes;
    source->info.udim_columns = image->info.udim_columns;
    source->info.udim_rows = image->info.udim_rows;
}

enum hg_status hg_page_source_open(struct hg_page_sources *s,
    const struct hg_page_source_params *params, struct hg_page_source **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_page_source *source = hg_calloc(1, sizeof *source);
    struct hg_page_image *image = hg_calloc(1, sizeof *image);
    enum hg_status status =
        source != NULL && image != NULL ? describe_image(s, params, image, err) : no_memory(err);
    if (status == HG_OK)
        status = find_backing(s, params, image, err);
    if (status == HG_OK) {
        const bool masks =
            params->use == HG_TEXTURE_MASK && params->cutoff > 0 && image->chain.texel_bytes == 4;
        *source = (struct hg_page_source){.sources = s,
            .image = image,
            .origin = params->image,
            .wrap_s = params->wrap_s,
            .wrap_t = params->wrap_t,
            .cutoff = masks ? params->cutoff : 0};
        source->alpha = masks ? hg_calloc(HG_MIPS_MAX, sizeof *source->alpha) : NULL;
        snprintf(image->name, sizeof image->name, "%s",
            params->image->label != NULL ? params->image->label : "");
        fill_info(source, image);
        if ((masks && source->alpha == NULL) || make_content_id(source) != HG_OK)
            status = no_memory(err);
    }
    if (status != HG_OK) {
        if (image != NULL && image->backing != NULL)
            hg_page_backing_unref(s, image->backing);
        if (source != NULL)
            hg_free(source->alpha);
        hg_free(source);
        hg_free(image);
        return status;
    }
    join_image(s, source, image);
    *out = source;
    return HG_OK;
}

static void unlink_image(struct hg_page_sources *s, struct hg_page_image *image)
{
    struct hg_page_image **at = &s->images;
    while (*at != image)
        at = &(*at)->next;
    *at = image->next;
}

void hg_page_source_close(struct hg_page_source *source)
{
    if (source == NULL)
        return;
    struct hg_page_sources *s = source->sources;
    struct hg_page_image *image = source->image;
    pthread_mutex_lock(&s->lock);
    struct hg_page_source **at = &image->members;
    while (*at != source)
        at = &(*at)->next;
    *at = source->next;
    s->stats.sources--;
    while (image->borrowed == source || (image->members == NULL && image->busy)) {
        atomic_store(&image->cancel, true);
        pthread_cond_wait(&s->changed, &s->lock);
    }
    const bool last = image->members == NULL;
    if (last)
        unlink_image(s, image);
    pthread_mutex_unlock(&s->lock);
    if (last) {
        hg_page_backing_unref(s, image->backing);
        hg_page_preview_drop(image);
        hg_free(image);
    }
    hg_free(source->alpha);
    hg_free(source);
}

const struct hg_page_source_info *hg_page_source_info(const struct hg_page_source *source)
{
    return &source->info;
}

void hg_page_source_prefetch(struct hg_page_source *source)
{
    struct hg_page_sources *s = source->sources;
    pthread_mutex_lock(&s->lock);
    if (source->image->backing == NULL) {
        source->image->early = true;
        pthread_cond_signal(&s->work);
    }
    pthread_mutex_unlock(&s->lock);
}

// --- reading -------------------------------------------------------------------------------------

// The lock is held.
static void want(struct hg_page_sources *s, struct hg_page_image *image)
{
    image->wanted = true;
    pthread_cond_signal(&s->work);
    if (s->hurry > 0)
        pthread_cond_signal(&s->rush);
}

static struct hg_page_scratch *take_scratch(struct hg_page_sources *s)
{
    pthread_mutex_lock(&s->lock);
    struct hg_page_scratch *scratch =
        s->scratch_count > 0 ? s->scratches[--s->scratch_count] : NULL;
    pthread_mutex_unlock(&s->lock);
    return scratch != NULL ? scratch : hg_page_scratch_create();
}

static void give_scratch(struct hg_page_sources *s, struct hg_page_scratch *scratch)
{
    pthread_mutex_lock(&s->lock);
    const bool kept = hg_grow(&s->scratches, &s->scratch_capacity, s->scratch_count + 1,
                          sizeof(struct hg_page_scratch *)) == HG_OK;
    if (kept)
        s->scratches[s->scratch_count++] = scratch;
    pthread_mutex_unlock(&s->lock);
    if (!kept)
        hg_page_scratch_destroy(scratch);
}

// Tables that keep the coverage of a mask. The same whichever backing counted. The lock is held.
static void prepare_alpha(struct hg_page_source *source, const struct hg_page_backing *b)
{
    const struct hg_page_histograms *h =
        b->kind == HG_PAGES_IN_PACK ? b->pack.histograms : b->histograms;
    if (source->alpha == NULL || source->has_alpha || h == NULL)
        return;
    for (uint32_t i = 1; i < source->info.layout.mips; i++)
        hg_mips_mask_table(
            h->counts[0], h->counts[i], (float)source->cutoff / 255.0f, source->alpha[i]);
    source->has_alpha = true;
}

// Backing to read from, referenced; or why there is none.
static enum hg_status take_backing(
    struct hg_page_source *source, struct hg_page_backing **out, struct hg_error *err)
{
    struct hg_page_sources *s = source->sources;
    struct hg_page_image *image = source->image;
    enum hg_status status = HG_OK;
    pthread_mutex_lock(&s->lock);
    *out = image->backing;
    if (image->backing != NULL) {
        atomic_fetch_add(&image->backing->refs, 1);
        image->used_ns = hg_clock_now_ns();
        image->reads++;
        prepare_alpha(source, image->backing);
    } else if (image->failed) {
        status = image->err.status;
        if (err != NULL)
            *err = image->err;
    } else {
        want(s, image);
        status = hg_error_set(err, HG_E_AGAIN, source->origin->label, NULL, "is being loaded");
    }
    pthread_mutex_unlock(&s->lock);
    return status;
}

// Rebuilds a pack that turned out to be damaged.
static void lose_backing(struct hg_page_source *source, const struct hg_page_backing *b)
{
    struct hg_page_sources *s = source->sources;
    struct hg_page_backing *lost = NULL;
    pthread_mutex_lock(&s->lock);
    if (source->image->backing == b) {
        lost = source->image->backing;
        source->image->backing = NULL;
        want(s, source->image);
    }
    pthread_mutex_unlock(&s->lock);
    hg_page_backing_unref(s, lost);
}

static enum hg_status read_backing(struct hg_page_source *source, struct hg_page_backing *b,
    struct hg_page_request *read, struct hg_error *err)
{
    const struct hg_page_view view = {.layout = &source->info.layout,
        .wrap_s = source->wrap_s,
        .wrap_t = source->wrap_t,
        .texel_bytes = source->info.texel_bytes,
        .alpha = source->has_alpha ? (const uint8_t(*)[256])source->alpha : NULL};
    read->view = &view;
    read->bytes = 0;
    if (b->kind == HG_PAGES_IN_MEMORY) {
        hg_page_take(&view, &b->mips, read->mip, read->x, read->y, read->texels);
        return HG_OK;
    }
    struct hg_page_scratch *scratch = take_scratch(source->sources);
    if (scratch == NULL)
        return no_memory(err);
    enum hg_status status;
    if (b->kind == HG_PAGES_IN_PACK)
        status = hg_page_pack_read(&b->pack, read, scratch, err);
    else
        status = hg_page_make(source->sources->tiles, b, &source->image->chain, read, err);
    give_scratch(source->sources, scratch);
    return status;
}

enum hg_status hg_page_source_read(struct hg_page_source *source, uint32_t mip, uint32_t x,
    uint32_t y, void *texels, struct hg_error *err)
{
    struct hg_page_sources *s = source->sources;
    if (hg_page_number(&source->info.layout, mip, x, y) == UINT32_MAX)
        return hg_error_set(err, HG_E_INVAL, source->origin->label, NULL,
            "there is no page %u, %u of mip %u", x, y, mip);
    struct hg_page_backing *b;
    enum hg_status status = take_backing(source, &b, err);
    if (status != HG_OK)
        return status;
    const uint64_t start = hg_clock_now_ns();
    struct hg_page_request read = {.mip = mip, .x = x, .y = y, .texels = texels};
    status = read_backing(source, b, &read, err);
    pthread_mutex_lock(&s->lock);
    s->stats.pages_read += status == HG_OK;
    s->stats.bytes_read += read.bytes;
    s->stats.read_ns += hg_clock_now_ns() - start;
    pthread_mutex_unlock(&s->lock);
    if (status == HG_E_HASH && b->kind == HG_PAGES_IN_PACK) {
        lose_backing(source, b);
        status = hg_error_set(err, HG_E_AGAIN, source->origin->label, NULL, "is loaded again");
    }
    hg_page_backing_unref(s, b);
    return status;
}

// --- previews ------------------------------------------------------------------------------------

uint32_t hg_page_source_preview(struct hg_page_source *source, uint32_t *mip)
{
    struct hg_page_sources *s = source->sources;
    const struct hg_page_image *image = source->image;
    pthread_mutex_lock(&s->lock);
    const uint32_t number = image->preview.count > 0 ? image->preview_number : 0;
    pthread_mutex_unlock(&s->lock);
    *mip = hg_page_preview_mip(&source->info.layout);
    return number;
}

bool hg_page_source_preview_page(
    struct hg_page_source *source, uint32_t mip, uint32_t x, uint32_t y, void *texels)
{
    struct hg_page_sources *s = source->sources;
    const struct hg_page_image *image = source->image;
    const uint32_t first = hg_page_preview_mip(&source->info.layout);
    // The small image in its own layout: the same pages, `first` mips up.
    struct hg_page_layout layout = hg_page_layout_of(
        hg_mips_side(image->info.width, first), hg_mips_side(image->info.height, first));
    const struct hg_page_view view = {.layout = &layout,
        .wrap_s = source->wrap_s,
        .wrap_t = source->wrap_t,
        .texel_bytes = source->info.texel_bytes};
    pthread_mutex_lock(&s->lock);
    const bool there = image->preview.count > 0 && mip >= first &&
                       hg_page_number(&layout, mip - first, x, y) != UINT32_MAX;
    if (there)
        hg_page_take(&view, &image->preview, mip - first, x, y, texels);
    pthread_mutex_unlock(&s->lock);
    return there;
}

// --- waiting -------------------------------------------------------------------------------------

static enum hg_status failure_of(const struct hg_page_image *image, struct hg_error *err)
{
    if (err != NULL)
        *err = image->err;
    return image->err.status;
}

enum hg_status hg_page_source_wait(struct hg_page_source *source, struct hg_error *err)
{
    struct hg_page_sources *s = source->sources;
    struct hg_page_image *image = source->image;
    pthread_mutex_lock(&s->lock);
    while (image->backing == NULL && !image->failed) {
        want(s, image);
        pthread_cond_wait(&s->changed, &s->lock);
    }
    const enum hg_status status = image->backing != NULL ? HG_OK : failure_of(image, err);
    pthread_mutex_unlock(&s->lock);
    return status;
}

enum hg_status hg_page_source_bake(
    struct hg_page_source *source, struct hg_page_bake *out, struct hg_error *err)
{
    struct hg_page_sources *s = source->sources;
    struct hg_page_image *image = source->image;
    memset(out, 0, sizeof *out);
    pthread_mutex_lock(&s->lock);
    enum hg_status status = HG_OK;
    if (s->params.store == NULL)
        status = hg_error_set(
            err, HG_E_STATE, source->origin->label, NULL, "there is no cache folder to bake into");
    while (
        status == HG_OK && (image->backing == NULL || image->backing->kind == HG_PAGES_IN_MEMORY)) {
        if (image->failed || image->no_bake) {
            status = failure_of(image, err);
            break;
        }
        image->bake_wanted = true;
        pthread_cond_signal(&s->work);
        pthread_cond_wait(&s->changed, &s->lock);
    }
    if (status == HG_OK) {
        *out = image->bake;
        out->texels = (uint64_t)image->info.width * image->info.height;
        if (image->backing->kind == HG_PAGES_IN_PACK) {
            out->pages = image->layout.pages;
            out->pack_bytes = hg_store_entry_bytes(image->backing->pack.entry);
            status = hg_page_pack_key(&image->chain, &out->key);
            if (status != HG_OK)
                hg_error_set(err, status, source->origin->label, NULL, "no memory");
        }
    }
    pthread_mutex_unlock(&s->lock);
    return status;
}
