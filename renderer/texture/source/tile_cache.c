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

// What is asked for.
struct want {
    struct hg_open_file *file;
    uint32_t mip;
    const uint32_t *at, *size;
    enum hg_pixel_format format;
    uint8_t *pixels;
};

// A tile as it lies in its mip, in texels.
struct place {
    uint32_t x, y, at[2], size[2];
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

static struct tile *find(struct hg_tile_cache *c, const struct want *w, const struct place *p)
{
    struct tile *t = c->buckets[bucket_of(w->file, w->mip, p->x, p->y)];
    while (t != NULL && (t->file != w->file || t->mip != w->mip || t->x != p->x || t->y != p->y))
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

// What a tile has of the rectangle.
static void copy_part(const struct want *w, const struct place *p, const uint8_t *texels)
{
    const size_t texel = hg_pixel_bytes(w->format);
    uint32_t from[2], end[2];
    for (int i = 0; i < 2; i++) {
        const uint32_t last = p->at[i] + p->size[i], want = w->at[i] + w->size[i];
        from[i] = p->at[i] > w->at[i] ? p->at[i] : w->at[i];
        end[i] = last < want ? last : want;
    }
    for (uint32_t y = from[1]; y < end[1]; y++)
        memcpy(w->pixels + ((size_t)(y - w->at[1]) * w->size[0] + from[0] - w->at[0]) * texel,
            texels + ((size_t)(y - p->at[1]) * p->size[0] + from[0] - p->at[0]) * texel,
            (end[0] - from[0]) * texel);
}

static bool copy_found(struct hg_tile_cache *c, const struct want *w, const struct place *p)
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
    struct hg_tile_cache *c, const struct want *w, const struct place *p, struct tile *t)
{
    pthread_mutex_lock(&c->lock);
    c->stats.tiles_decoded++;
    if (find(c, w, p) != NULL) { // another thread was faster
        hg_free(t);
    } else {
        t->file = w->file;
        t->mip = w->mip;
        t->x = p->x;
        t->y = p->y;
        t->bucket = bucket_of(w->file, w->mip, p->x, p->y);
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

static enum hg_status copy_tile(struct hg_tile_cache *c, const struct want *w,
    const struct place *p, uint64_t *bytes, struct hg_error *err)
{
    if (copy_found(c, w, p))
        return HG_OK;
    const size_t size = (size_t)p->size[0] * p->size[1] * hg_pixel_bytes(w->format);
    struct tile *t = hg_calloc(1, sizeof *t + size);
    if (t == NULL)
        return hg_error_set(err, HG_E_NOMEM, "image", NULL, "no memory for a tile");
    uint64_t decoded;
    const enum hg_status status =
        hg_open_file_rect(w->file, w->mip, p->at, p->size, w->format, t->texels, &decoded, err);
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

enum hg_status hg_tile_cache_rect(struct hg_tile_cache *c, struct hg_open_file *file, uint32_t mip,
    const uint32_t at[2], const uint32_t size[2], enum hg_pixel_format format, void *pixels,
    uint64_t *bytes, struct hg_error *err)
{
    const struct hg_image_reader_info *info = hg_open_file_info(file);
    const struct want w = {file, mip, at, size, format, pixels};
    const uint32_t tile[2] = {info->tile_width, info->tile_height};
    const uint32_t side[2] = {hg_mips_side(info->width, mip), hg_mips_side(info->height, mip)};
    const uint64_t most =
        (uint64_t)tile[0] * tile[1] * hg_pixel_bytes(format) + sizeof(struct tile);
    *bytes = 0;
    if (most > c->limit_bytes / LARGE_PART)
        return hg_open_file_rect(file, mip, at, size, format, pixels, bytes, err);
    enum hg_status status = HG_OK;
    for (uint32_t y = at[1] / tile[1]; y * tile[1] < at[1] + size[1]; y++)
        for (uint32_t x = at[0] / tile[0]; x * tile[0] < at[0] + size[0] && status == HG_OK; x++) {
            struct place p = {x, y, {x * tile[0], y * tile[1]}, {tile[0], tile[1]}};
            for (int i = 0; i < 2; i++)
                if (p.size[i] > side[i] - p.at[i])
                    p.size[i] = side[i] - p.at[i];
            status = copy_tile(c, &w, &p, bytes, err);
        }
    return status;
}
