// texture_system.c - what page packs cost and what they save. Prints one JSON object.
//
//     bench_texture_system set MEMORY_MIB IMAGE...   bake all images; then one trace of trilinear
//                          samples through pages and through OpenImageIO's texture system (tiled,
//                          mipmapped TIFF with the same mips), both within MEMORY_MIB, one thread
//     bench_texture_system large SIDE                write a TIFF of SIDE x SIDE and bake it
//
// The trace: for each of 300 moments, 24 of the textures, drifting; 64 x 64 samples of each over a
// patch whose scale goes from the whole texture to its texels and back. Both halves are run twice:
// the caches are empty at first. Files are in the page cache of the system for both. Bytes are
// those that calls of the system read (file_bytes), and those of texels that came of them
// (texel_bytes).
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/texture/page_source.h"
#include "tests/bench/texture/oiio_texture.h"
#include "tests/support/folder.h"

enum { MOMENTS = 300, SHOWN = 24, GRID = 64, PAGE_BYTES = HG_PAGE_PITCH * HG_PAGE_PITCH * 4 };

static char folder[TEST_FOLDER_MAX];

static _Noreturn void die(const char *what, const struct hg_error *err)
{
    fprintf(stderr, "bench_texture_system: %s: %s\n", what, err != NULL ? err->reason : "");
    exit(1);
}

static double seconds_since(uint64_t start)
{
    return (double)(hg_clock_now_ns() - start) * 1e-9;
}

static double peak_rss_mib(void)
{
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    return (double)usage.ru_maxrss / 1024.0;
}

// Bytes that this process has read by calls of the system.
static uint64_t bytes_read_by_calls(void)
{
    unsigned long long bytes = 0;
    FILE *f = fopen("/proc/self/io", "r");
    if (f == NULL || fscanf(f, "rchar: %llu", &bytes) != 1)
        die("/proc/self/io", NULL);
    fclose(f);
    return bytes;
}

// --- pages: a cache of decoded pages; those used longest ago leave
// ---------------------------------

struct texture {
    struct hg_image_source origin;
    struct hg_page_source *source;
    const struct hg_page_source_info *info;
    int32_t *slots; // [pages], -1: not in memory
    uint32_t levels[HG_MIPS_MAX];
};

struct slot {
    struct texture *texture;
    uint32_t page, newer, older; // a ring
};

struct cache {
    uint8_t *texels;
    struct slot *slots;
    uint32_t count, used, newest;
    uint64_t misses;
    float decode[256];
};

static void unlink_slot(struct cache *c, uint32_t i)
{
    c->slots[c->slots[i].newer].older = c->slots[i].older;
    c->slots[c->slots[i].older].newer = c->slots[i].newer;
}

static void make_newest(struct cache *c, uint32_t i)
{
    if (i == c->newest)
        return;
    unlink_slot(c, i);
    const uint32_t oldest = c->slots[c->newest].newer;
    c->slots[i].older = c->newest;
    c->slots[i].newer = oldest;
    c->slots[c->newest].newer = i;
    c->slots[oldest].older = i;
    c->newest = i;
}

static uint32_t take_slot(struct cache *c)
{
    if (c->used == c->count) {
        const uint32_t oldest = c->slots[c->newest].newer;
        c->slots[oldest].texture->slots[c->slots[oldest].page] = -1;
        return oldest;
    }
    const uint32_t i = c->used++;
    if (i == 0) {
        c->slots[0].newer = c->slots[0].older = 0;
        return 0;
    }
    const uint32_t oldest = c->slots[c->newest].newer;
    c->slots[i].older = c->newest;
    c->slots[i].newer = oldest;
    c->slots[c->newest].newer = i;
    c->slots[oldest].older = i;
    c->newest = i;
    return i;
}

static const uint8_t *find_page(
    struct cache *c, struct texture *t, uint32_t mip, uint32_t x, uint32_t y)
{
    const struct hg_page_layout *l = &t->info->layout;
    const uint32_t page =
        mip >= l->tail ? l->pages - 1 : t->levels[mip] + y * hg_pages_across(l->width, mip) + x;
    if (t->slots[page] >= 0) {
        make_newest(c, (uint32_t)t->slots[page]);
        return c->texels + (size_t)t->slots[page] * PAGE_BYTES;
    }
    const uint32_t i = take_slot(c);
    uint8_t *texels = c->texels + (size_t)i * PAGE_BYTES;
    const bool tail = mip >= l->tail;
    struct hg_error err = {0};
    if (hg_page_source_read(
            t->source, tail ? l->tail : mip, tail ? 0 : x, tail ? 0 : y, texels, &err) != HG_OK)
        die(t->origin.path, &err);
    c->slots[i].texture = t;
    c->slots[i].page = page;
    t->slots[page] = (int32_t)i;
    make_newest(c, i);
    c->misses++;
    return texels;
}

static void sample_mip(
    struct cache *c, struct texture *t, uint32_t mip, float u, float v, float weight, float rgba[4])
{
    const struct hg_page_layout *l = &t->info->layout;
    const uint32_t w = hg_mips_side(l->width, mip), h = hg_mips_side(l->height, mip);
    const float fx = u * (float)w, fy = v * (float)h;
    const uint32_t ix = (uint32_t)fx < w ? (uint32_t)fx : w - 1;
    const uint32_t iy = (uint32_t)fy < h ? (uint32_t)fy : h - 1;
    const uint32_t px = mip < l->tail ? ix / HG_PAGE_TEXELS : 0;
    const uint32_t py = mip < l->tail ? iy / HG_PAGE_TEXELS : 0;
    const uint8_t *page = find_page(c, t, mip, px, py);
    const int j = (int)mip - (int)l->tail;
    const float x = fx - (float)(px * HG_PAGE_TEXELS) + HG_PAGE_BORDER - 0.5f +
                    (float)(j >= 0 ? HG_TAIL_X(j) : 0);
    const float y = fy - (float)(py * HG_PAGE_TEXELS) + HG_PAGE_BORDER - 0.5f +
                    (float)(j >= 0 ? HG_TAIL_Y(j) : 0);
    const float bx = x - floorf(x), by = y - floorf(y);
    const uint8_t *p = page + ((size_t)y * HG_PAGE_PITCH + (size_t)x) * 4;
    const float weights[4] = {(1 - bx) * (1 - by), bx * (1 - by), (1 - bx) * by, bx * by};
    static const size_t offsets[4] = {0, 4, HG_PAGE_PITCH * 4, HG_PAGE_PITCH * 4 + 4};
    for (int k = 0; k < 4; k++)
        for (int i = 0; i < 4; i++)
            rgba[i] += weight * weights[k] * c->decode[p[offsets[k] + (size_t)i]];
}

static void sample_pages(
    struct cache *c, struct texture *t, float u, float v, float footprint, float rgba[4])
{
    const struct hg_page_layout *l = &t->info->layout;
    const float side = (float)(l->width > l->height ? l->width : l->height);
    const float last = (float)(l->mips - 1);
    float lod = log2f(footprint * side);
    lod = lod < 0 ? 0 : lod > last ? last : lod;
    const uint32_t mip = (uint32_t)lod;
    const float blend = lod - (float)mip;
    memset(rgba, 0, 4 * sizeof *rgba);
    sample_mip(c, t, mip, u, v, 1 - blend, rgba);
    if (blend > 0)
        sample_mip(c, t, mip + 1, u, v, blend, rgba);
}

// --- the trace -----------------------------------------------------------------------------------

typedef void sample_fn(
    void *user, uint32_t texture, float u, float v, float footprint, float rgba[4]);

// Calls `sample` for every sample; returns a sum that keeps compilers honest.
static double run_trace(uint32_t textures, sample_fn *sample, void *user, uint64_t *count)
{
    double sum = 0;
    *count = 0;
    for (uint32_t moment = 0; moment < MOMENTS; moment++) {
        for (uint32_t k = 0; k < SHOWN; k++) {
            const uint32_t texture = (moment / 12 + k * 5) % textures;
            const float phase = (float)moment * 0.03f + (float)k * 0.7f;
            const float scale = exp2f(-4.5f + 4.5f * cosf(phase)); // 1 .. 1/512 of the texture
            const float cu = 0.5f + 0.4f * sinf((float)moment * 0.011f + (float)k);
            const float cv = 0.5f + 0.4f * cosf((float)moment * 0.013f + (float)k * 2);
            for (uint32_t i = 0; i < GRID * GRID; i++) {
                float u = cu + scale * ((float)(i % GRID) / GRID - 0.5f);
                float v = cv + scale * ((float)(i / GRID) / GRID - 0.5f);
                float rgba[4];
                sample(user, texture, u - floorf(u), v - floorf(v), scale / GRID, rgba);
                sum += (double)rgba[1];
            }
            *count += GRID * GRID;
        }
    }
    return sum;
}

struct ours {
    struct cache cache;
    struct texture *textures;
};

static void sample_ours(
    void *user, uint32_t texture, float u, float v, float footprint, float rgba[4])
{
    struct ours *o = user;
    sample_pages(&o->cache, &o->textures[texture], u, v, footprint, rgba);
}

struct theirs {
    struct oiio_textures *system;
    char **paths;
};

static void sample_theirs(
    void *user, uint32_t texture, float u, float v, float footprint, float rgba[4])
{
    struct theirs *t = user;
    if (!oiio_textures_sample(
            t->system, (const char *const *)t->paths, texture, u, v, footprint, rgba))
        die(t->paths[texture], NULL);
}

// --- a set of images -----------------------------------------------------------------------------

struct bake_sum {
    uint64_t texels, pages, pack_bytes, image_bytes, png_bytes, png_pack_bytes;
    double seconds;
};

static bool is_png(const char *path)
{
    const char *dot = strrchr(path, '.');
    return dot != NULL && strcmp(dot, ".png") == 0;
}

static void open_textures(struct hg_page_sources *sources, struct texture *textures,
    char *const *paths, uint32_t count, struct bake_sum *sum)
{
    const uint64_t start = hg_clock_now_ns();
    struct hg_error err = {0};
    for (uint32_t i = 0; i < count; i++) {
        struct texture *t = &textures[i];
        t->origin = (struct hg_image_source){.label = paths[i], .path = paths[i]};
        const struct hg_page_source_params params = {.image = &t->origin};
        struct hg_page_bake bake;
        struct stat st;
        if (hg_page_source_open(sources, &params, &t->source, &err) != HG_OK ||
            hg_page_source_bake(t->source, &bake, &err) != HG_OK || stat(paths[i], &st) != 0)
            die(paths[i], &err);
        t->info = hg_page_source_info(t->source);
        t->slots = malloc(t->info->layout.pages * sizeof *t->slots);
        memset(t->slots, 0xff, t->info->layout.pages * sizeof *t->slots);
        for (uint32_t m = 0; m < t->info->layout.tail; m++)
            t->levels[m] = hg_page_number(&t->info->layout, m, 0, 0);
        sum->texels += bake.texels;
        sum->pages += bake.pages;
        sum->pack_bytes += bake.pack_bytes;
        sum->image_bytes += (uint64_t)st.st_size;
        sum->png_bytes += is_png(paths[i]) ? (uint64_t)st.st_size : 0;
        sum->png_pack_bytes += is_png(paths[i]) ? bake.pack_bytes : 0;
    }
    sum->seconds = seconds_since(start);
}

static char **write_tx_files(char *const *paths, uint32_t count)
{
    char **out = calloc(count, sizeof *out);
    for (uint32_t i = 0; i < count; i++) {
        struct hg_image image;
        struct hg_mips mips;
        struct hg_error err = {0};
        out[i] = calloc(1, 96);
        snprintf(out[i], 96, "%s/%u.tx", folder, i);
        if (hg_image_read_file(paths[i], HG_PIXEL_RGBA8, NULL, &image, &err) != HG_OK ||
            hg_mips_build(&image, &(struct hg_mips_params){.srgb = true}, &mips) != HG_OK ||
            !oiio_write_tx(
                out[i], mips.width, mips.height, mips.count, (const uint8_t *const *)mips.levels))
            die(paths[i], &err);
        hg_mips_finish(&mips);
        hg_image_finish(&image);
    }
    return out;
}

static void bench_ours(struct hg_page_sources *sources, struct texture *textures, uint32_t count,
    uint64_t memory, bool last)
{
    struct ours o = {.textures = textures};
    o.cache.count = (uint32_t)(memory / PAGE_BYTES);
    o.cache.texels = malloc((size_t)o.cache.count * PAGE_BYTES);
    o.cache.slots = calloc(o.cache.count, sizeof *o.cache.slots);
    for (int i = 0; i < 256; i++)
        o.cache.decode[i] = (float)i / 255.0f;
    for (uint32_t i = 0; i < count; i++)
        memset(textures[i].slots, 0xff, textures[i].info->layout.pages * sizeof(int32_t));
    struct hg_page_sources_stats before, after;
    hg_page_sources_stats(sources, &before);
    const uint64_t read_before = bytes_read_by_calls();
    const uint64_t start = hg_clock_now_ns();
    uint64_t samples;
    const double sum = run_trace(count, sample_ours, &o, &samples);
    const double seconds = seconds_since(start);
    hg_page_sources_stats(sources, &after);
    const double read = (double)(after.read_ns - before.read_ns) * 1e-9;
    printf("    {\"samples\": %llu, \"seconds\": %.3f, \"samples_per_s\": %.0f, \"file_bytes\": "
           "%llu, \"texel_bytes\": %llu, \"pages\": %llu, \"pages_per_s\": %.0f, "
           "\"mean\": %.6f}%s\n",
        (unsigned long long)samples, seconds, (double)samples / seconds,
        (unsigned long long)(bytes_read_by_calls() - read_before),
        (unsigned long long)o.cache.misses * PAGE_BYTES, (unsigned long long)o.cache.misses,
        (double)o.cache.misses / read, sum / (double)samples, last ? "" : ",");
    free(o.cache.texels);
    free(o.cache.slots);
}

static void bench_theirs(char **paths, uint32_t count, uint64_t memory, bool last)
{
    struct theirs t = {oiio_textures_create((float)((double)memory / 1048576.0)), paths};
    const uint64_t read_before = bytes_read_by_calls();
    const uint64_t start = hg_clock_now_ns();
    uint64_t samples, bytes, peak;
    const double sum = run_trace(count, sample_theirs, &t, &samples);
    const double seconds = seconds_since(start);
    const uint64_t read = bytes_read_by_calls() - read_before;
    oiio_textures_destroy(t.system, &bytes, &peak);
    printf("    {\"samples\": %llu, \"seconds\": %.3f, \"samples_per_s\": %.0f, \"file_bytes\": "
           "%llu, \"texel_bytes\": %llu, \"cache_bytes\": %llu, \"mean\": %.6f}%s\n",
        (unsigned long long)samples, seconds, (double)samples / seconds, (unsigned long long)read,
        (unsigned long long)bytes, (unsigned long long)peak, sum / (double)samples,
        last ? "" : ",");
}

static void print_bake(const struct bake_sum *b, uint32_t images)
{
    printf("  \"bake\": {\"images\": %u, \"texels\": %llu, \"pages\": %llu, \"seconds\": %.2f, "
           "\"mb_per_s\": %.1f,\n    \"pack_bytes\": %llu, \"image_bytes\": %llu, "
           "\"bytes_per_texel\": %.3f, \"packs_per_png\": %.3f}",
        images, (unsigned long long)b->texels, (unsigned long long)b->pages, b->seconds,
        (double)b->texels * 4e-6 / b->seconds, (unsigned long long)b->pack_bytes,
        (unsigned long long)b->image_bytes, (double)b->pack_bytes / (double)b->texels,
        b->png_bytes > 0 ? (double)b->png_pack_bytes / (double)b->png_bytes : 0.0);
}

static void bench_set(uint64_t memory, char *const *paths, uint32_t count)
{
    struct hg_store *store;
    struct hg_page_sources *sources;
    struct hg_error err = {0};
    char dir[96];
    snprintf(dir, sizeof dir, "%s/store", folder);
    if (hg_store_open(&(struct hg_store_params){.dir = dir}, &store, &err) != HG_OK ||
        hg_page_sources_create(&(struct hg_page_sources_params){.store = store, .threads = 1},
            &sources, &err) != HG_OK)
        die(dir, &err);
    struct texture *textures = calloc(count, sizeof *textures);
    struct bake_sum sum = {0};
    open_textures(sources, textures, paths, count, &sum);
    char **tx = write_tx_files(paths, count);
    printf("{\n");
    print_bake(&sum, count);
    printf(",\n  \"memory_bytes\": %llu,\n  \"pages\": [\n", (unsigned long long)memory);
    for (int i = 0; i < 2; i++)
        bench_ours(sources, textures, count, memory, i == 1);
    printf("  ],\n  \"openimageio\": [\n");
    for (int i = 0; i < 2; i++)
        bench_theirs(tx, count, memory, i == 1);
    printf("  ]\n}\n");
    for (uint32_t i = 0; i < count; i++) {
        hg_page_source_close(textures[i].source);
        free(textures[i].slots);
        free(tx[i]);
    }
    free(tx);
    free(textures);
    hg_page_sources_destroy(sources);
    hg_store_close(store);
}

// --- one large image -----------------------------------------------------------------------------

static void bench_large(uint32_t side)
{
    char dir[96], path[96];
    snprintf(dir, sizeof dir, "%s/store", folder);
    snprintf(path, sizeof path, "%s/large.tif", folder);
    if (!oiio_write_large(path, side, side))
        die(path, NULL);
    const double before = peak_rss_mib();
    struct hg_store *store;
    struct hg_page_sources *sources;
    struct hg_page_source *source;
    struct hg_error err = {0};
    struct hg_page_bake bake;
    const struct hg_image_source origin = {.label = path, .path = path};
    if (hg_store_open(&(struct hg_store_params){.dir = dir}, &store, &err) != HG_OK ||
        hg_page_sources_create(&(struct hg_page_sources_params){.store = store, .threads = 2},
            &sources, &err) != HG_OK ||
        hg_page_source_open(
            sources, &(struct hg_page_source_params){.image = &origin}, &source, &err) != HG_OK ||
        hg_page_source_bake(source, &bake, &err) != HG_OK)
        die(path, &err);
    struct hg_page_sources_stats st;
    hg_page_sources_stats(sources, &st);
    printf(
        "{\"side\": %u, \"seconds\": %.2f, \"mb_per_s\": %.1f, \"pages\": %llu, \"pack_bytes\": "
        "%llu, \"accounted_peak_mib\": %.1f, \"rss_before_mib\": %.1f, \"rss_peak_mib\": %.1f}\n",
        side, (double)bake.bake_ns * 1e-9, (double)bake.texels * 4e3 / (double)bake.bake_ns,
        (unsigned long long)bake.pages, (unsigned long long)bake.pack_bytes,
        (double)st.memory_peak_bytes / 1048576.0, before, peak_rss_mib());
    hg_page_source_close(source);
    hg_page_sources_destroy(sources);
    hg_store_close(store);
}

int main(int argc, char **argv)
{
    if (argc < 3 || !test_folder_make(folder, "bench")) {
        fprintf(stderr, "usage: bench_texture_system set MEMORY_MIB IMAGE... | large SIDE\n");
        return 2;
    }
    if (strcmp(argv[1], "large") == 0)
        bench_large((uint32_t)atoi(argv[2]));
    else
        bench_set((uint64_t)atoi(argv[2]) << 20, argv + 3, (uint32_t)argc - 3);
    return !test_folder_remove(folder);
}
