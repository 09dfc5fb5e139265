#include "renderer/texture/source/tile_cache.h"

#include <pthread.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/texture/source/mip_stream.h"

#define BUCKETS    4096u // a power of two
#define LARGE_PART 8     // a tile of more than this part of the limit is not kept

struct tile {
    struct tile *newer, *older, *next; // next: of the bucket
    const struct hg_open_file *file;
    uint32_t mip, x, y; // in tiles
    uint32_t bucket;
    uint64_t bytes;
    uint8_t texels[]; // rows tight
};

struct hg_tile_cache {
    pthread_mutex_t lock;
    uint64_t limit_bytes;
    struct tile *newest, *oldest;
    struct hg_tile_cache_stats stats;
    struct tile *buckets[BUCKETS];
};

struct request {
    struct hg_open_file *file;
    const struct hg_image_rect *rect;
    uint8_t *pixels;
    size_t texel_bytes;
};

struct place {
    uint32_t x, y;             // in tiles
    struct hg_image_rect rect; // of the tile, in texels
};

enum hg_status hg_tile_cache_create(uint64_t limit_bytes, struct hg_tile_cache **out)
{
    struct hg_tile_cache *c = hg_calloc(1, sizeof *c);
    *out = c;
    if (c == NULL)
        return HG_E_NOMEM;
    c->limit_bytes = limit_bytes;
    pthread_mutex_init(&c->lock, NULL);
    return HG_OK;
}

// --- tiles that are here (the lock is held) ------------------------------------------------------

static uint32_t bucket_of(const struct hg_open_file *file, uint32_t mip, uint32_t x, uint32_t y)
{
    uint64_t h = (uint64_t)(uintptr_t)file / 16;
    h = (h ^ (uint64_t)mip << 40 ^ (uint64_t)y << 20 ^ x) * UINT64_C(0x9e3779b97f4a7c15);
    return (uint32_t)(h >> 32) & (BUCKETS - 1);
}

static void link_newest(struct hg_tile_cache *c, struct tile *t)
{
    t->newer = NULL;
    t->older = c->newest;
    *(c->newest != NULL ? &c->newest->newer : &c->oldest) = t;
    c->newest = t;
}

static void unlink_order(struct hg_tile_cache *c, struct tile *t)
{
    *(t->newer != NULL ? &t->newer->older : &c->newest) = t->older;
    *(t->older != NULL ? &t->older->newer : &c->oldest) = t->newer;
}

static void remove_tile(struct hg_tile_cache *c, struct tile *t)
{
    struct tile **at = &c->buckets[t->bucket];
    while (*at != t)
        at = &(*at)->next;
    *at = t->next;
    unlink_order(c, t);
    c->stats.bytes -= t->bytes;
    hg_free(t);
}

static void trim(struct hg_tile_cache *c, uint64_t bytes)
{
    while (c->stats.bytes > bytes)
        remove_tile(c, c->oldest);
}

static struct tile *find(struct hg_tile_cache *c, const struct request *w, const struct place *p)
{
    struct tile *t = c->buckets[bucket_of(w->file, w->rect->mip, p->x, p->y)];
    while (
        t != NULL && (t->file != w->file || t->mip != w->rect->mip || t->x != p->x || t->y != p->y))
        t = t->next;
    return t;
}

void hg_tile_cache_destroy(struct hg_tile_cache *c)
{
    if (c == NULL)
        return;
    trim(c, 0);
    pthread_mutex_destroy(&c->lock);
    hg_free(c);
}

void hg_tile_cache_trim(struct hg_tile_cache *c, uint64_t bytes)
{
    pthread_mutex_lock(&c->lock);
    trim(c, bytes);
    pthread_mutex_unlock(&c->lock);
}

void hg_tile_cache_forget(struct hg_tile_cache *c, const struct hg_open_file *file)
{
    struct tile *next;
    pthread_mutex_lock(&c->lock);
    for (struct tile *t = c->newest; t != NULL; t = next) {
        next = t->older;
        if (t->file == file)
            remove_tile(c, t);
    }
    pthread_mutex_unlock(&c->lock);
}

void hg_tile_cache_stats(struct hg_tile_cache *c, struct hg_tile_cache_stats *out)
{
    pthread_mutex_lock(&c->lock);
    *out = c->stats;
    pthread_mutex_unlock(&c->lock);
}

// --- rectangles ----------------------------------------------------------------------------------

// Copies the part of the rectangle that lies in a tile.
static void copy_part(const struct request *w, const struct place *p, const uint8_t *texels)
{
    const struct hg_image_rect *to = w->rect, *tile = &p->rect;
    uint32_t from[2], end[2];
    for (int i = 0; i < 2; i++) {
        const uint32_t last = tile->at[i] + tile->size[i], want = to->at[i] + to->size[i];
        from[i] = tile->at[i] > to->at[i] ? tile->at[i] : to->at[i];
        end[i] = last < want ? last : want;
    }
    for (uint32_t y = from[1]; y < end[1]; y++)
        memcpy(w->pixels +
                   ((size_t)(y - to->at[1]) * to->size[0] + from[0] - to->at[0]) * w->texel_bytes,
            texels + ((size_t)(y - tile->at[1]) * tile->size[0] + from[0] - tile->at[0]) *
                         w->texel_bytes,
            (end[0] - from[0]) * w->texel_bytes);
}

static bool copy_found(struct hg_tile_cache *c, const struct request *w, const struct place *p)
{
    pthread_mutex_lock(&c->lock);
    struct tile *t = find(c, w, p);
    if (t != NULL) {
        unlink_order(c, t);
        link_newest(c, t);
        copy_part(w, p, t->texels);
        c->stats.tiles_found++;
    }
    pthread_mutex_unlock(&c->lock);
    return t != NULL;
}

// Takes the tile.
static void keep(
    struct hg_tile_cache *c, const struct request *w, const struct place *p, struct tile *t)
{
    pthread_mutex_lock(&c->lock);
    c->stats.tiles_decoded++;
    if (find(c, w, p) != NULL) { // another thread was faster
        hg_free(t);
    } else {
        t->file = w->file;
        t->mip = w->rect->mip;
        t->x = p->x;
        t->y = p->y;
        t->bucket = bucket_of(w->file, w->rect->mip, p->x, p->y);
        t->next = c->buckets[t->bucket];
        c->buckets[t->bucket] = t;
        trim(c, c->limit_bytes - t->bytes);
        link_newest(c, t);
        c->stats.bytes += t->bytes;
        if (c->stats.bytes > c->stats.peak_bytes)
            c->stats.peak_bytes = c->stats.bytes;
    }
    pthread_mutex_unlock(&c->lock);
}

static enum hg_status copy_tile(struct hg_tile_cache *c, const struct request *w,
    const struct place *p, uint64_t *bytes, struct hg_error *err)
{
    if (copy_found(c, w, p))
        return HG_OK;
    const size_t size = (size_t)p->rect.size[0] * p->rect.size[1] * w->texel_bytes;
    struct tile *t = hg_calloc(1, sizeof *t + size);
    if (t == NULL)
        return hg_error_set(err, HG_E_NOMEM, "image", NULL, "no memory for a tile");
    uint64_t decoded;
    const enum hg_status status = hg_open_file_rect(w->file, &p->rect, t->texels, &decoded, err);
    if (status != HG_OK) {
        hg_free(t);
        return status;
    }
    *bytes += decoded;
    t->bytes = sizeof *t + size;
    copy_part(w, p, t->texels);
    keep(c, w, p, t);
    return HG_OK;
}

enum hg_status hg_tile_cache_rect(struct hg_tile_cache *c, struct hg_open_file *file,
    const struct hg_image_rect *rect, void *pixels, uint64_t *bytes, struct hg_error *err)
{
    const struct hg_image_reader_info *info = hg_open_file_info(file);
    const struct request w = {file, rect, pixels, hg_pixel_bytes(hg_open_file_format(file))};
    const uint32_t tile[2] = {info->tile_width, info->tile_height}, mip = rect->mip;
    const uint32_t side[2] = {hg_mips_side(info->width, mip), hg_mips_side(info->height, mip)};
    const uint32_t *at = rect->at, *size = rect->size;
    const uint64_t most = (uint64_t)tile[0] * tile[1] * w.texel_bytes + sizeof(struct tile);
    *bytes = 0;
    if (most > c->limit_bytes / LARGE_PART)
        return hg_open_file_rect(file, rect, pixels, bytes, err);
    for (uint32_t y = at[1] / tile[1]; y * tile[1] < at[1] + size[1]; y++)
        for (uint32_t x = at[0] / tile[0]; x * tile[0] < at[0] + size[0]; x++) {
            struct place p = {x, y, {mip, {x * tile[0], y * tile[1]}, {tile[0], tile[1]}}};
            for (int i = 0; i < 2; i++)
                if (p.rect.size[i] > side[i] - p.rect.at[i])
                    p.rect.size[i] = side[i] - p.rect.at[i];
            const enum hg_status status = copy_tile(c, &w, &p, bytes, err);
            if (status != HG_OK)
                return status;
        }
    return HG_OK;
}
