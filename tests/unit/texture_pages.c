// texture_pages.c - pages are the same in every byte whichever way they come: cut from a chain in
// memory, from a pack that was just baked, from one that was there, from tiles made on demand.
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "base/refbuf.h"
#include "renderer/texture/source/page_codec.h"
#include "renderer/texture/source/page_source.h"
#include "renderer/texture/source/tile_cache.h"
#include "tests/support/folder.h"
#include "tests/support/page_cut.h"
#include "tests/unit/image_files.h"

enum { SLOT = HG_PAGE_PITCH * HG_PAGE_PITCH };

static char folder[TEST_FOLDER_MAX];
static uint32_t random_state = 1;

static int set_up(void **state)
{
    (void)state;
    return !test_folder_make(folder, "pages");
}

static int remove_folder(void **state)
{
    (void)state;
    return !test_folder_remove(folder);
}

static int empty_folder(void)
{
    char command[128];
    snprintf(command, sizeof command, "rm -f %s/*.hgs", folder);
    return system(command);
}

static uint32_t next_random(void)
{
    random_state = random_state * 1664525u + 1013904223u;
    return random_state >> 8;
}

static struct hg_store *open_store(void)
{
    struct hg_store *store;
    assert_int_equal(hg_store_open(&(struct hg_store_params){.dir = folder}, &store, NULL), HG_OK);
    return store;
}

// image_bytes 1: nothing is decoded whole when there is a store.
static struct hg_page_sources *make_streaming(
    struct hg_store *store, unsigned threads, uint64_t image_bytes)
{
    struct hg_page_sources *s;
    const struct hg_page_sources_params params = {
        .store = store, .threads = threads, .image_bytes = image_bytes};
    assert_int_equal(hg_page_sources_create(&params, &s, NULL), HG_OK);
    return s;
}

static struct hg_page_sources *make_sources(struct hg_store *store, unsigned threads)
{
    return make_streaming(store, threads, 0);
}

// Noise on gradients, so that predictors and entropy coding both have something to do.
static struct hg_image make_image(uint32_t width, uint32_t height, enum hg_pixel_format format)
{
    struct hg_image image;
    assert_int_equal(hg_image_create(width, height, format, NULL, &image), HG_OK);
    for (uint32_t y = 0; y < height; y++)
        for (uint32_t x = 0; x < width; x++)
            for (uint32_t c = 0; c < 4; c++) {
                const size_t i = ((size_t)y * width + x) * 4 + c;
                const uint32_t v = x * (c + 1) + y * 3 + next_random() % 24;
                if (format == HG_PIXEL_RGBA8)
                    ((uint8_t *)image.pixels)[i] = (uint8_t)v;
                else if (format == HG_PIXEL_RGBA16)
                    ((uint16_t *)image.pixels)[i] = (uint16_t)(v * 131);
                else
                    ((float *)image.pixels)[i] = (float)v * 0.01f - 0.5f;
            }
    return image;
}

// What pages must be: the whole chain, cut.
struct reference {
    struct hg_mips mips;
    struct hg_page_layout layout;
};

static struct reference make_reference(
    const struct hg_image *image, bool srgb, bool half, enum hg_texture_use use, uint8_t cutoff)
{
    struct reference r;
    const struct hg_mips_params params = {
        .srgb = srgb, .half = half, .use = use, .cutoff = (float)cutoff / 255.0f};
    assert_int_equal(hg_mips_build(image, &params, &r.mips), HG_OK);
    r.layout = hg_page_layout_of(image->width, image->height);
    return r;
}

static void check_pages(struct hg_page_source *source, const struct reference *r,
    enum hg_wrap wrap_s, enum hg_wrap wrap_t)
{
    const struct hg_page_source_info *info = hg_page_source_info(source);
    assert_memory_equal(&info->layout, &r->layout, sizeof r->layout);
    assert_int_equal(info->texel_bytes, r->mips.texel_bytes);
    const size_t bytes = (size_t)SLOT * info->texel_bytes;
    uint8_t *want = malloc(bytes), *got = malloc(bytes);
    for (uint32_t page = 0; page < r->layout.pages; page++) {
        uint32_t x, y;
        const uint32_t mip = hg_page_find(&r->layout, page, &x, &y);
        assert_int_equal(hg_page_number(&r->layout, mip, x, y), page);
        page_cut(&r->layout, &r->mips, page, (const enum hg_wrap[2]){wrap_s, wrap_t}, want);
        memset(got, 0xa5, bytes);
        enum hg_status status;
        while ((status = hg_page_source_read(source, mip, x, y, got, NULL)) == HG_E_AGAIN)
            assert_int_equal(hg_page_source_wait(source, NULL), HG_OK);
        assert_int_equal(status, HG_OK);
        assert_memory_equal(got, want, bytes);
    }
    assert_int_equal(hg_page_source_read(source, r->layout.tail + 1, 0, 0, got, NULL), HG_E_INVAL);
    assert_int_equal(hg_page_source_read(source, r->layout.tail, 1, 0, got, NULL), HG_E_INVAL);
    free(want);
    free(got);
}

static void check_image(struct hg_image *image, enum hg_texture_use use, bool srgb,
    enum hg_wrap wrap_s, enum hg_wrap wrap_t)
{
    const uint8_t cutoff = use == HG_TEXTURE_MASK ? 120 : 0;
    const bool half = srgb != (use <= HG_TEXTURE_MASK) || image->format != HG_PIXEL_RGBA8;
    struct reference r = make_reference(image, srgb, half, use, cutoff);
    struct hg_image_source origin = {.label = "test", .pixels = *image, .pixels_srgb = srgb};
    const struct hg_page_source_params params = {&origin, use, cutoff, wrap_s, wrap_t};
    struct hg_store *store = open_store();
    for (int way = 0; way < 4; way++) { // memory; memory, then baked; found baked; streamed
        if (way == 3)
            assert_int_equal(empty_folder(), 0);
        struct hg_page_sources *s =
            make_streaming(way == 0 ? NULL : store, 1 + (unsigned)way % 2, way == 3);
        struct hg_page_source *source;
        assert_int_equal(hg_page_source_open(s, &params, &source, NULL), HG_OK);
        check_pages(source, &r, wrap_s, wrap_t);
        struct hg_page_bake bake;
        assert_int_equal(hg_page_source_bake(source, &bake, NULL), way == 0 ? HG_E_STATE : HG_OK);
        if (way > 0) {
            assert_int_equal(bake.pages, r.layout.pages);
            assert_true(way != 2 || bake.bake_ns == 0);
            assert_true(way != 3 || bake.bake_ns > 0);
            check_pages(source, &r, wrap_s, wrap_t);
        }
        hg_page_source_close(source);
        struct hg_page_sources_stats st;
        hg_page_sources_stats(s, &st);
        assert_int_equal(st.memory_bytes, 0);
        assert_int_equal(st.sources, 0);
        hg_page_sources_destroy(s);
    }
    hg_store_close(store);
    hg_mips_finish(&r.mips);
}

static void test_ways(void **state)
{
    (void)state;
    static const uint32_t sizes[][2] = {
        {1, 1}, {64, 64}, {65, 3}, {3, 129}, {129, 129}, {257, 130}, {259, 131}, {300, 513}};
    for (uint32_t i = 0; i < 8; i++) {
        const uint32_t w = sizes[i][0], h = sizes[i][1];
        struct hg_image image = make_image(w, h, HG_PIXEL_RGBA8);
        for (int wraps = 0; wraps < 9; wraps++)
            check_image(&image, (enum hg_texture_use)((i + (uint32_t)wraps) % 5),
                (i + (uint32_t)wraps) % 5 < 3, (enum hg_wrap)(wraps % 3),
                (enum hg_wrap)(wraps / 3));
        hg_image_finish(&image);
        image = make_image(w, h, i % 2 ? HG_PIXEL_RGBA32F : HG_PIXEL_RGBA16);
        check_image(&image, HG_TEXTURE_COLOR, i % 3 == 0, HG_WRAP_REPEAT, HG_WRAP_MIRROR);
        hg_image_finish(&image);
    }
}

// Transfers that do not fit the use become floats, and masks of two cutoffs share a pack.
// A process that ends turns what it has in memory into packs, if it is given the time for them.
static void test_linger(void **state)
{
    (void)state;
    enum { IMAGES = 12 };
    struct hg_image image[IMAGES];
    struct hg_image_source origin[IMAGES];
    struct hg_page_source *source[IMAGES];
    struct hg_store *store = open_store();
    struct hg_page_sources_stats st;
    uint8_t *texels = malloc((size_t)SLOT * 8);
    for (int pass = 0; pass < 2; pass++) { // no time at all; as much as it takes
        struct hg_page_sources *s = make_sources(store, 2);
        for (uint32_t i = 0; i < IMAGES; i++) {
            image[i] = make_image(64 + 48 * (IMAGES - i), 200, HG_PIXEL_RGBA8);
            origin[i] =
                (struct hg_image_source){.label = "test", .pixels = image[i], .pixels_srgb = true};
            const struct hg_page_source_params params = {
                &origin[i], HG_TEXTURE_COLOR, 0, HG_WRAP_CLAMP, HG_WRAP_CLAMP};
            assert_int_equal(hg_page_source_open(s, &params, &source[i], NULL), HG_OK);
        }
        if (pass == 0)
            hg_page_sources_linger(s, 0);
        for (uint32_t i = 0; pass == 1 && i < IMAGES; i++)
            while (hg_page_source_read(source[i], 0, 0, 0, texels, NULL) == HG_E_AGAIN)
                assert_int_equal(hg_page_source_wait(source[i], NULL), HG_OK);
        if (pass == 1)
            hg_page_sources_linger(s, UINT64_C(60000000000));
        hg_page_sources_stats(s, &st);
        assert_int_equal(st.packs_baked + st.packs_found, pass == 0 ? 0 : IMAGES);
        for (uint32_t i = 0; i < IMAGES; i++) {
            hg_page_source_close(source[i]);
            hg_image_finish(&image[i]);
        }
        hg_page_sources_destroy(s);
    }
    free(texels);
    hg_store_close(store);
}

static void test_uses(void **state)
{
    (void)state;
    struct hg_image image = make_image(200, 140, HG_PIXEL_RGBA8);
    for (int use = 0; use < 5; use++)
        for (int srgb = 0; srgb < 2; srgb++)
            check_image(&image, (enum hg_texture_use)use, srgb, HG_WRAP_REPEAT, HG_WRAP_REPEAT);
    hg_image_finish(&image);
}

static bool make_tiles(void *user, const struct hg_image_rect *rect, void *pixels)
{
    const uint32_t mip = rect->mip, x = rect->at[0], y = rect->at[1];
    const uint32_t width = rect->size[0], height = rect->size[1];
    const struct hg_mips *mips = user;
    const uint32_t w = hg_mips_side(mips->width, mip);
    for (uint32_t j = 0; j < height; j++)
        memcpy((uint8_t *)pixels + (size_t)j * width * 4,
            mips->levels[mip] + ((size_t)(y + j) * w + x) * 4, (size_t)width * 4);
    return true;
}

static void test_tiles(void **state)
{
    (void)state;
    static const uint32_t sizes[][2] = {{50, 20}, {129, 129}, {131, 260}, {600, 300}};
    for (int i = 0; i < 4; i++)
        for (int wraps = 0; wraps < 9; wraps++) {
            const enum hg_wrap ws = (enum hg_wrap)(wraps % 3), wt = (enum hg_wrap)(wraps / 3);
            struct hg_image image = make_image(sizes[i][0], sizes[i][1], HG_PIXEL_RGBA8);
            struct reference r = make_reference(&image, true, false, HG_TEXTURE_COLOR, 0);
            const struct hg_image_tiles tiles = {.width = image.width,
                .height = image.height,
                .format = HG_PIXEL_RGBA8,
                .make = make_tiles,
                .user = &r.mips};
            struct hg_image_source origin = {
                .label = "tiles", .tiles = &tiles, .pixels_srgb = true};
            struct hg_page_sources *s = make_sources(NULL, 1);
            struct hg_page_source *source;
            assert_int_equal(
                hg_page_source_open(s,
                    &(struct hg_page_source_params){&origin, HG_TEXTURE_COLOR, 0, ws, wt}, &source,
                    NULL),
                HG_OK);
            check_pages(source, &r, ws, wt);
            hg_page_source_close(source);
            hg_page_sources_destroy(s);
            hg_mips_finish(&r.mips);
            hg_image_finish(&image);
        }
}

// Any bytes are a page or refused; what encode made comes back.
static void test_codec(void **state)
{
    (void)state;
    struct hg_page_codec *codec = hg_page_codec_create();
    assert_non_null(codec);
    uint8_t *texels = malloc((size_t)SLOT * 8), *back = malloc((size_t)SLOT * 8);
    for (int round = 0; round < 300; round++) {
        const uint32_t texel = round % 2 ? 4 : 8;
        const uint32_t w = 1 + next_random() % HG_PAGE_PITCH, h = 1 + next_random() % HG_PAGE_PITCH;
        const struct hg_texel_layout layout = {w, h, texel, (size_t)w * texel};
        for (size_t i = 0; i < (size_t)w * h * texel; i++)
            texels[i] = (uint8_t)(round % 3 == 0   ? next_random()
                                  : round % 3 == 1 ? i % texel * 40
                                                   : i / texel % w + i % texel * next_random() % 3);
        struct hg_writer out = {0};
        assert_int_equal(hg_page_encode(codec, texels, &layout, 1, &out), HG_OK);
        assert_int_equal(hg_page_decode(codec, out.data, out.size, &layout, back), HG_OK);
        assert_memory_equal(texels, back, (size_t)w * h * texel);
        for (int flip = 0; flip < 40; flip++) {
            const size_t at = next_random() % out.size;
            const uint8_t old = out.data[at];
            out.data[at] ^= (uint8_t)(1 + next_random() % 255);
            const enum hg_status status = hg_page_decode(codec, out.data, out.size, &layout, back);
            assert_true(status == HG_OK || status == HG_E_FORMAT);
            out.data[at] = old;
        }
        for (size_t cut = 0; cut < out.size; cut += 1 + out.size / 50)
            assert_int_equal(hg_page_decode(codec, out.data, cut, &layout, back), HG_E_FORMAT);
        hg_writer_finish(&out);
    }
    free(texels);
    free(back);
    hg_page_codec_destroy(codec);
}

// --- files ---------------------------------------------------------------------------------------

static char *path_of(const char *name)
{
    static char path[4][160];
    static int next;
    char *p = path[next++ % 4];
    snprintf(p, sizeof path[0], "%s/%s", folder, name);
    return p;
}

static void write_png(const struct hg_image *image, const char *path)
{
    struct hg_writer out = {0};
    const struct hg_image_encode params = {.file = HG_IMAGE_PNG8};
    assert_int_equal(hg_image_encode(image, &params, &out, NULL), HG_OK);
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(out.data, 1, out.size, f), out.size);
    assert_int_equal(fclose(f), 0);
    hg_writer_finish(&out);
}

static struct hg_page_source *open_path(
    struct hg_page_sources *s, struct hg_image_source *origin, char *path, enum hg_texture_use use)
{
    *origin = (struct hg_image_source){.label = path, .path = path};
    struct hg_page_source *source;
    struct hg_error err = {0};
    const struct hg_page_source_params params = {
        .image = origin, .use = use, .wrap_s = HG_WRAP_REPEAT, .wrap_t = HG_WRAP_CLAMP};
    if (hg_page_source_open(s, &params, &source, &err) != HG_OK)
        fail_msg("%s: %s", path, err.reason);
    return source;
}

// Streamed from files and from bytes, against the image read whole.
static void test_streamed_files(void **state)
{
    (void)state;
    assert_true(write_large_file(path_of("a.png"), 700, 500));
    assert_true(write_large_file(path_of("a.tif"), 700, 500));
    assert_true(write_large_file(path_of("a.jpg"), 700, 500));
    static const char *const names[] = {"a.png", "a.tif", "a.jpg"};
    for (int i = 0; i < 3; i++) {
        struct hg_image image;
        assert_int_equal(
            hg_image_read_file(path_of(names[i]), HG_PIXEL_RGBA8, NULL, &image, NULL), HG_OK);
        struct reference r = make_reference(&image, false, false, HG_TEXTURE_NORMAL, 0);
        struct hg_store *store = open_store();
        struct hg_page_sources *s = make_streaming(store, 2, 1);
        struct hg_image_source origin;
        struct hg_page_source *source = open_path(s, &origin, path_of(names[i]), HG_TEXTURE_NORMAL);
        check_pages(source, &r, HG_WRAP_REPEAT, HG_WRAP_CLAMP);
        struct hg_page_sources_stats st;
        hg_page_sources_stats(s, &st);
        assert_int_equal(st.packs_baked, 1);
        assert_int_equal(st.bake_texels_done, 700 * 500);
        assert_int_equal(st.bake_texels_total, 700 * 500);
        hg_page_source_close(source);
        hg_page_sources_destroy(s);
        hg_store_close(store);
        hg_mips_finish(&r.mips);
        hg_image_finish(&image);
    }
}

static uint64_t count_tiles(uint32_t width, uint32_t height, uint32_t tile, uint32_t mips)
{
    uint64_t count = 0;
    for (uint32_t m = 0; m < mips; m++)
        count += (uint64_t)((hg_mips_side(width, m) + tile - 1) / tile) *
                 ((hg_mips_side(height, m) + tile - 1) / tile);
    return count;
}

// A small cache of tiles keeps to its limit, and what it returns is what the file has.
static void test_few_tiles(void **state)
{
    (void)state;
    const uint32_t w = 500, h = 300, tile = 32;
    struct hg_image image = make_image(w, h, HG_PIXEL_RGBA8);
    struct reference own = make_reference(&image, false, false, HG_TEXTURE_DATA, 0);
    char *path = path_of("few.tif");
    const struct tiled_layout layout = {w, h, tile, false};
    assert_true(
        write_tiled_file(path, &layout, own.mips.count, (const uint8_t *const *)own.mips.levels));
    struct hg_image_reader *reader, *second;
    struct hg_open_files *files;
    struct hg_open_file *file;
    struct hg_tile_cache *cache;
    const uint64_t limit = 10 * (tile * tile * 4 + 100);
    assert_int_equal(hg_image_reader_open(path, 4096, &reader, NULL), HG_OK);
    assert_int_equal(hg_image_reader_open(path, 4096, &second, NULL), HG_OK);
    assert_int_equal(hg_open_files_create(4, &files), HG_OK);
    assert_int_equal(hg_open_files_add(files, second, HG_PIXEL_RGBA8, &file), HG_OK);
    assert_int_equal(hg_tile_cache_create(limit, &cache), HG_OK);
    static uint8_t got[132 * 132 * 4], expected[132 * 132 * 4];
    uint32_t n = 1;
    for (int i = 0; i < 300; i++) {
        n = n * 1664525u + 1013904223u;
        const uint32_t mip = n >> 28 & 1, size[2] = {1 + (n >> 8) % 132, 1 + (n >> 16) % 132};
        const struct hg_image_rect rect = {mip,
            {(n >> 4) % (hg_mips_side(w, mip) - size[0] + 1),
                (n >> 12) % (hg_mips_side(h, mip) - size[1] + 1)},
            {size[0], size[1]}};
        uint64_t bytes, direct;
        assert_int_equal(hg_tile_cache_rect(cache, file, &rect, got, &bytes, NULL), HG_OK);
        assert_int_equal(
            hg_image_reader_rect(reader, &rect, HG_PIXEL_RGBA8, expected, &direct, NULL), HG_OK);
        assert_memory_equal(got, expected, (size_t)size[0] * size[1] * 4);
        assert_true(bytes <= direct);
    }
    struct hg_tile_cache_stats stats;
    hg_tile_cache_stats(cache, &stats);
    assert_true(stats.peak_bytes <= limit && stats.tiles_found > 0);
    hg_tile_cache_trim(cache, 0);
    hg_tile_cache_stats(cache, &stats);
    assert_int_equal(stats.bytes, 0);
    hg_tile_cache_destroy(cache);
    hg_open_file_remove(file);
    hg_open_files_destroy(files);
    hg_image_reader_close(reader);
    hg_mips_finish(&own.mips);
    hg_image_finish(&image);
}

enum { MANY = 48, MANY_SIDE = 200 };

struct many {
    struct hg_page_source *sources[MANY];
    struct reference reference;
    uint8_t brightness[MANY]; // of mip 0 of each file, all texels
    atomic_uint wrong, reads;
};

// Each file has one value in all texels, that of no other file.
static void write_many(struct many *many, uint32_t i, const char *path)
{
    struct hg_mips *m = &many->reference.mips;
    many->brightness[i] = (uint8_t)(i * 5 + 1);
    memset(m->levels[0], many->brightness[i], m->bytes);
    static const struct tiled_layout layout = {MANY_SIDE, MANY_SIDE, 64, false};
    assert_true(write_tiled_file(path, &layout, m->count, (const uint8_t *const *)m->levels));
}

static void *read_many(void *user)
{
    struct many *many = user;
    const struct hg_page_layout *l = &many->reference.layout;
    uint8_t *texels = malloc((size_t)SLOT * 4);
    for (uint32_t round = 0; round < 3; round++)
        for (uint32_t i = 0; i < MANY; i++) {
            const bool tail = round == 2;
            const enum hg_status status = hg_page_source_read(
                many->sources[i], tail ? l->tail : 0, 0, tail ? 0 : round, texels, NULL);
            many->wrong +=
                status != HG_OK || texels[(HG_PAGE_PITCH * 10 + 10) * 4] != many->brightness[i];
            many->reads++;
        }
    free(texels);
    return NULL;
}

// More tiled files than the process may have descriptors: few are open at a time, and one that was
// exchanged or overwritten while it was closed is refused.
static void test_many_tiled_files(void **state)
{
    (void)state;
    static struct many many;
    struct rlimit before, few;
    assert_int_equal(getrlimit(RLIMIT_NOFILE, &before), 0);
    few = (struct rlimit){40, before.rlim_max};
    struct hg_image image = make_image(MANY_SIDE, MANY_SIDE, HG_PIXEL_RGBA8);
    many.reference = make_reference(&image, false, false, HG_TEXTURE_DATA, 0);
    static struct hg_image_source origins[MANY];
    static char paths[MANY][TEST_FOLDER_MAX + 32];
    for (uint32_t i = 0; i < MANY; i++) {
        snprintf(paths[i], sizeof paths[i], "%s/many-%u.tif", folder, i);
        write_many(&many, i, paths[i]);
    }
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &few), 0);
    struct hg_page_sources *s;
    const struct hg_page_sources_params params = {.memory_bytes = 1 << 20, .threads = 1};
    assert_int_equal(hg_page_sources_create(&params, &s, NULL), HG_OK);
    for (uint32_t i = 0; i < MANY; i++)
        many.sources[i] = open_path(s, &origins[i], paths[i], HG_TEXTURE_DATA);
    pthread_t threads[4];
    for (int i = 0; i < 4; i++)
        assert_int_equal(pthread_create(&threads[i], NULL, read_many, &many), 0);
    for (int i = 0; i < 4; i++)
        pthread_join(threads[i], NULL);
    struct hg_page_sources_stats st;
    hg_page_sources_stats(s, &st);
    assert_int_equal(many.reads, 4 * 3 * MANY);
    assert_int_equal(many.wrong, 0);
    assert_in_range(st.files_open, 1, 10);
    assert_true(st.files_reopened >= MANY - 10);
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &before), 0);
    // The first two were read longest ago: they are closed.
    char other[TEST_FOLDER_MAX + 32];
    uint8_t *texels = malloc((size_t)SLOT * 4);
    snprintf(other, sizeof other, "%s/other.tif", folder);
    write_many(&many, 0, other);
    assert_int_equal(rename(other, paths[0]), 0);
    write_many(&many, 1, paths[1]);
    for (uint32_t i = 0; i < 2; i++)
        assert_int_equal(hg_page_source_read(many.sources[i], 0, 1, 1, texels, NULL), HG_E_HASH);
    assert_int_equal(hg_page_source_read(many.sources[2], 0, 1, 1, texels, NULL), HG_OK);
    free(texels);
    for (uint32_t i = 0; i < MANY; i++)
        hg_page_source_close(many.sources[i]);
    hg_page_sources_stats(s, &st);
    assert_int_equal(st.files_open, 0);
    hg_page_sources_destroy(s);
    hg_mips_finish(&many.reference.mips);
    hg_image_finish(&image);
}

// A tiled file's own mips are what is shown; for uses that need other mips they are made.
static void test_tiled_files(void **state)
{
    (void)state;
    static const uint32_t sizes[][3] = {{300, 200, 64}, {257, 515, 128}, {128, 64, 16}};
    for (int i = 0; i < 6; i++) {
        const uint32_t w = sizes[i / 2][0], h = sizes[i / 2][1];
        const bool exr = i % 2;
        struct hg_image image = make_image(w, h, HG_PIXEL_RGBA8);
        for (size_t t = 3; t < image.size_bytes; t += 4)
            ((uint8_t *)image.pixels)[t] = 255;
        struct reference own = make_reference(&image, false, false, HG_TEXTURE_DATA, 0);
        for (uint32_t m = 1; m < own.mips.count; m++) // no filter makes these
            for (size_t t = 0; t < (size_t)hg_mips_side(w, m) * hg_mips_side(h, m) * 4; t++)
                if (t % 4 < 3)
                    own.mips.levels[m][t] ^= 0x55;
        char *path = path_of(exr ? "t.exr" : "t.tif");
        const struct tiled_layout layout = {w, h, sizes[i / 2][2], exr};
        assert_true(write_tiled_file(
            path, &layout, own.mips.count, (const uint8_t *const *)own.mips.levels));
        struct hg_store *store = open_store();
        struct hg_page_sources *s = make_sources(store, 1);
        struct hg_image_source origin;
        struct hg_page_source *source = open_path(s, &origin, path, HG_TEXTURE_DATA);
        struct hg_page_bake bake;
        assert_int_equal(hg_page_source_bake(source, &bake, NULL), HG_OK);
        assert_int_equal(bake.pack_bytes, 0);
        if (exr) { // as linear half floats
            struct hg_mips half = {.width = w,
                .height = h,
                .count = own.mips.count,
                .texel_bytes = 8,
                .bytes = own.mips.bytes * 2};
            uint8_t *levels = calloc(half.bytes, 1);
            for (uint32_t m = 0; m < half.count; m++) {
                half.levels[m] = levels;
                const size_t count = (size_t)hg_mips_side(w, m) * hg_mips_side(h, m);
                hg_mips_to_half(
                    HG_PIXEL_RGBA8, false, own.mips.levels[m], count, (uint16_t *)(void *)levels);
                levels += count * 8;
            }
            struct reference r = {half, own.layout};
            check_pages(source, &r, HG_WRAP_REPEAT, HG_WRAP_CLAMP);
            free(half.levels[0]);
        } else {
            check_pages(source, &own, HG_WRAP_REPEAT, HG_WRAP_CLAMP);
        }
        struct hg_page_sources_stats st;
        hg_page_sources_stats(s, &st);
        assert_int_equal(st.tiles_decoded, count_tiles(w, h, sizes[i / 2][2], own.mips.count));
        assert_true(st.tiles_found > 0 || w <= HG_PAGE_TEXELS); // one page has no neighbours
        assert_true(st.tile_bytes > 0);
        hg_page_source_close(source);
        hg_page_sources_stats(s, &st);
        assert_int_equal(st.tile_bytes, 0); // with their file
        source = open_path(s, &origin, path, HG_TEXTURE_NORMAL);
        if (!exr) {
            struct reference r = make_reference(&image, false, false, HG_TEXTURE_NORMAL, 0);
            check_pages(source, &r, HG_WRAP_REPEAT, HG_WRAP_CLAMP);
            hg_mips_finish(&r.mips);
        }
        assert_int_equal(hg_page_source_bake(source, &bake, NULL), HG_OK);
        assert_true(bake.pack_bytes > 0);
        hg_page_source_close(source);
        hg_page_sources_destroy(s);
        hg_store_close(store);
        hg_mips_finish(&own.mips);
        hg_image_finish(&image);
    }
}

// Tiles 1001, 1002 (half as large) and 1012: a grid of 2 x 2 cells with one missing.
static void test_udim(void **state)
{
    (void)state;
    struct hg_image a = make_image(150, 130, HG_PIXEL_RGBA8),
                    c = make_image(150, 130, HG_PIXEL_RGBA8);
    struct hg_image b = make_image(75, 65, HG_PIXEL_RGBA8),
                    all = make_image(300, 260, HG_PIXEL_RGBA8);
    memset(all.pixels, 0, all.size_bytes);
    for (uint32_t y = 0; y < 130; y++)
        for (uint32_t x = 0; x < 150; x++) {
            uint32_t *dst = all.pixels, *ta = a.pixels, *tb = b.pixels, *tc = c.pixels;
            dst[(130 + y) * 300 + x] = ta[y * 150 + x];
            dst[(130 + y) * 300 + 150 + x] = tb[y / 2 * 75 + x / 2];
            dst[y * 300 + 150 + x] = tc[y * 150 + x];
        }
    write_png(&a, path_of("u.1001.png"));
    write_png(&b, path_of("u.1002.png"));
    write_png(&c, path_of("u.1012.png"));
    struct reference r = make_reference(&all, true, false, HG_TEXTURE_COLOR, 0);
    for (uint64_t image_bytes = 0; image_bytes < 2; image_bytes++) {
        struct hg_store *store = open_store();
        struct hg_page_sources *s = make_streaming(store, 1, image_bytes);
        struct hg_image_source origin;
        struct hg_page_source *source =
            open_path(s, &origin, path_of("u.<UDIM>.png"), HG_TEXTURE_COLOR);
        assert_int_equal(hg_page_source_info(source)->udim_columns, 2);
        assert_int_equal(hg_page_source_info(source)->udim_rows, 2);
        check_pages(source, &r, HG_WRAP_REPEAT, HG_WRAP_CLAMP);
        hg_page_source_close(source);
        hg_page_sources_destroy(s);
        assert_int_equal(empty_folder(), 0);
        hg_store_close(store);
    }
    hg_mips_finish(&r.mips);
    hg_image_finish(&a);
    hg_image_finish(&b);
    hg_image_finish(&c);
    hg_image_finish(&all);
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, set_up, remove_folder)
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_codec), TEST(test_ways),
        TEST(test_linger), TEST(test_uses), TEST(test_tiles), TEST(test_streamed_files),
        TEST(test_few_tiles), TEST(test_tiled_files), TEST(test_many_tiled_files), TEST(test_udim)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
