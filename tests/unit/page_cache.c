// page_cache.c - pages of an exact picture that fill the budget to the last slot all come, although
// coarser ones of the same texture are there. Feedback is written here in place of a shader.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "renderer/texture/cache/cache_internal.h"
#include "renderer/scene/asset.h"
#include "renderer/texture/textures.h"
#include "tests/support/check.h"

#define SIDE_PX     2048
#define BUDGET      (8ull << 20) // holds far fewer pages than a mip has
#define MOST_FRAMES 200

struct fixture {
    struct hg_gpu *gpu;
    struct hg_page_cache *cache;
    struct hg_page_set *set;
    struct hg_error err;
};

static struct hg_image_source *make_image(void)
{
    struct hg_image_source *image = hg_calloc(1, sizeof *image);
    assert_non_null(image);
    image->refs = 1;
    image->label = hg_strdup("noise");
    assert_int_equal(
        hg_image_create(SIDE_PX, SIDE_PX, HG_PIXEL_RGBA8, NULL, &image->pixels), HG_OK);
    uint32_t *texels = image->pixels.pixels;
    for (uint32_t i = 0; i < SIDE_PX * SIDE_PX; i++)
        texels[i] = i * 2654435761u;
    return image;
}

static void open_cache(struct fixture *f)
{
    const struct hg_gpu_params gpu = {.validation = true};
    const struct hg_page_cache_params params = {.budget_bytes = BUDGET};
    struct hg_image_source *image = make_image();
    const struct hg_page_source_params from = {.image = image};
    struct hg_page_source *source;
    test_ok(hg_gpu_create(&gpu, &f->gpu, &f->err), &f->err);
    test_ok(hg_page_cache_create(f->gpu, &params, &f->cache, &f->err), &f->err);
    test_ok(hg_page_source_open(hg_page_cache_sources(f->cache), &from, &source, &f->err), &f->err);
    test_ok(hg_page_cache_acquire(f->cache, source, image, HG_TEXTURE_COLOR, &f->set, &f->err),
        &f->err);
    test_ok(hg_page_cache_fit(f->cache, &f->err), &f->err);
    hg_image_source_unref(image);
}

static void close_cache(struct fixture *f)
{
    hg_page_cache_release(f->cache, f->set);
    hg_page_cache_destroy(f->cache);
    assert_int_equal(hg_gpu_validation_messages(f->gpu), 0);
    hg_gpu_destroy(f->gpu);
}

// As if unfinished pixels had asked for the first `count` pages of a mip, row by row.
static void ask(struct fixture *f, uint32_t mip, uint32_t count)
{
    const bool mapped = f->cache->feedback.mapped != NULL;
    uint32_t *words = mapped ? f->cache->feedback.mapped : f->cache->readback.mapped;
    const uint32_t side = (SIDE_PX >> mip) / HG_PAGE_TEXELS;
    for (uint32_t i = 0; i < count; i++) {
        const struct page_place place = {mip, i % side, i / side};
        words[2 * hg_page_table_entry(f->set, &place)] = 1;
    }
}

// Frames of an exact picture that needs those pages, until it has them. False: it never does.
static bool load(struct fixture *f, uint32_t mip, uint32_t count)
{
    for (int i = 0; i < MOST_FRAMES; i++) {
        struct hg_page_demand demand;
        ask(f, mip, count);
        hg_page_cache_collect(f->cache, HG_PAGES_EXACT, &demand);
        assert_true(demand.fits);
        if (demand.missing == 0)
            return true;
        do {
            test_ok(hg_page_cache_update(f->cache, HG_PAGES_EXACT, UINT64_MAX, &f->err), &f->err);
            hg_page_cache_wait(f->cache, 20000000);
        } while (hg_page_cache_under_way(f->cache) > 0);
    }
    return false;
}

static void test_last_slot(void **state)
{
    struct fixture f = {0};
    struct hg_residency_stats slots;
    (void)state;
    open_cache(&f);
    hg_residency_stats(f.cache->residency[f.set->pool], &slots);
    const uint32_t room = slots.slots - slots.pinned;
    assert_true(room > 20);
    assert_true(load(&f, 2, 4)); // coarser pages of what comes next
    assert_true(load(&f, 1, room));
    assert_true(load(&f, 0, room));
    ask(&f, 0, room + 1);
    struct hg_page_demand demand;
    hg_page_cache_collect(f.cache, HG_PAGES_EXACT, &demand);
    assert_false(demand.fits);
    close_cache(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_last_slot)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
