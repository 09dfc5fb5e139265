// texture_store.c - page packs under every fault: never a wrong texel, never a crash, the next run
// heals.
#include <dirent.h>
#include <fcntl.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "renderer/texture/source/page_source.h"
#include "tests/support/folder.h"
#include "tests/support/page_cut.h"

enum { WIDTH = 900, HEIGHT = 700, PAGE_BYTES = HG_PAGE_PITCH * HG_PAGE_PITCH * 4 };

static char folder[TEST_FOLDER_MAX];
static uint32_t random_state = 1;

static uint32_t next_random(void)
{
    random_state = random_state * 1664525u + 1013904223u;
    return random_state >> 8;
}

static int set_up(void **state)
{
    (void)state;
    return !test_folder_make(folder, "texture-store");
}

static int tear_down(void **state)
{
    (void)state;
    return !test_folder_remove(folder);
}

static const char *store_dir(void)
{
    static char dir[96];
    snprintf(dir, sizeof dir, "%s/store", folder);
    return dir;
}

static struct hg_image make_image(uint32_t seed)
{
    struct hg_image image;
    assert_int_equal(hg_image_create(WIDTH, HEIGHT, HG_PIXEL_RGBA8, NULL, &image), HG_OK);
    uint8_t *t = image.pixels;
    for (uint32_t y = 0; y < HEIGHT; y++)
        for (uint32_t x = 0; x < WIDTH; x++, t += 4) {
            t[0] = (uint8_t)(x + seed);
            t[1] = (uint8_t)(x * y >> 6);
            t[2] = (uint8_t)((x ^ y) * 5 + seed);
            t[3] = (uint8_t)(x * 3 + y);
        }
    return image;
}

// An image, all its pages as they must be, and what is needed to open it.
struct scene {
    struct hg_image image;
    struct hg_page_layout layout;
    uint8_t *pages;
    struct hg_image_source origin;
    struct hg_page_source_params params;
};

static void make_scene(struct scene *s, uint32_t seed)
{
    *s = (struct scene){.image = make_image(seed)};
    s->layout = hg_page_layout_of(WIDTH, HEIGHT);
    struct hg_mips mips;
    const struct hg_mips_params params = {
        .srgb = true, .use = HG_TEXTURE_MASK, .cutoff = 128.0f / 255.0f};
    assert_int_equal(hg_mips_build(&s->image, &params, &mips), HG_OK);
    s->pages = calloc(s->layout.pages, PAGE_BYTES);
    assert_non_null(s->pages);
    for (uint32_t i = 0; i < s->layout.pages; i++)
        page_cut(&s->layout, &mips, i, (const enum hg_wrap[2]){HG_WRAP_REPEAT, HG_WRAP_MIRROR},
            s->pages + (size_t)i * PAGE_BYTES);
    hg_mips_finish(&mips);
    s->origin = (struct hg_image_source){.label = "test", .pixels = s->image, .pixels_srgb = true};
    s->params = (struct hg_page_source_params){.image = &s->origin,
        .use = HG_TEXTURE_MASK,
        .cutoff = 128,
        .wrap_s = HG_WRAP_REPEAT,
        .wrap_t = HG_WRAP_MIRROR};
}

static void finish_scene(struct scene *s)
{
    hg_image_finish(&s->image);
    free(s->pages);
}

struct run {
    struct hg_store *store;
    struct hg_page_sources *sources;
    struct hg_page_source *source;
};

static void start(struct run *r, const struct scene *s, uint64_t image_bytes)
{
    assert_int_equal(
        hg_store_open(&(struct hg_store_params){.dir = store_dir()}, &r->store, NULL), HG_OK);
    const struct hg_page_sources_params params = {
        .store = r->store, .threads = 2, .image_bytes = image_bytes};
    assert_int_equal(hg_page_sources_create(&params, &r->sources, NULL), HG_OK);
    assert_int_equal(hg_page_source_open(r->sources, &s->params, &r->source, NULL), HG_OK);
}

static void end(struct run *r)
{
    hg_page_source_close(r->source);
    hg_page_sources_destroy(r->sources);
    hg_store_close(r->store);
}

// Number of pages that are wrong or can never be had.
static uint32_t count_wrong(const struct run *r, const struct scene *s)
{
    uint8_t *texels = malloc(PAGE_BYTES);
    uint32_t wrong = 0;
    for (uint32_t i = 0; i < s->layout.pages; i++) {
        uint32_t x, y;
        const uint32_t mip = hg_page_find(&s->layout, i, &x, &y);
        enum hg_status status;
        int tries = 0;
        while ((status = hg_page_source_read(r->source, mip, x, y, texels, NULL)) == HG_E_AGAIN &&
               hg_page_source_wait(r->source, NULL) == HG_OK && tries < 100)
            tries++;
        wrong += status != HG_OK || memcmp(texels, s->pages + (size_t)i * PAGE_BYTES, PAGE_BYTES);
    }
    free(texels);
    return wrong;
}

static size_t find_files(const char *suffix, char *path, size_t size)
{
    DIR *d = opendir(store_dir());
    size_t count = 0;
    for (struct dirent *e; d != NULL && (e = readdir(d)) != NULL;)
        if (strlen(e->d_name) > 4 && strcmp(e->d_name + strlen(e->d_name) - 4, suffix) == 0) {
            snprintf(path, size, "%s/%s", store_dir(), e->d_name);
            count++;
        }
    if (d != NULL)
        closedir(d);
    return count;
}

static void damage_pack(bool shorten)
{
    char path[512];
    assert_int_equal(find_files(".hgs", path, sizeof path), 1);
    const int fd = open(path, O_RDWR);
    assert_true(fd >= 0);
    struct stat st;
    assert_int_equal(fstat(fd, &st), 0);
    if (shorten) {
        assert_int_equal(ftruncate(fd, next_random() % st.st_size), 0);
    } else {
        uint8_t byte;
        const off_t at = next_random() % st.st_size;
        assert_int_equal(pread(fd, &byte, 1, at), 1);
        byte ^= (uint8_t)(1u << next_random() % 8);
        assert_int_equal(pwrite(fd, &byte, 1, at), 1);
    }
    close(fd);
}

// Flipped bits and lost ends, while the pack is open and before it is opened.
static void test_damage(void **state)
{
    (void)state;
    struct scene s;
    make_scene(&s, 1);
    for (int round = 0; round < 60; round++) {
        struct run r;
        struct hg_page_bake bake;
        start(&r, &s, round % 3 == 0);
        assert_int_equal(hg_page_source_bake(r.source, &bake, NULL), HG_OK);
        damage_pack(round % 4 == 0);
        if (round % 2) {
            end(&r);
            start(&r, &s, round % 3 == 0);
        }
        assert_int_equal(count_wrong(&r, &s), 0);
        assert_int_equal(hg_page_source_bake(r.source, &bake, NULL), HG_OK);
        assert_int_equal(count_wrong(&r, &s), 0);
        end(&r);
    }
    finish_scene(&s);
}

// The folder goes away before, while and after the pack is baked.
static void test_folder_deleted(void **state)
{
    (void)state;
    struct scene s;
    make_scene(&s, 2);
    char command[160];
    snprintf(command, sizeof command, "rm -rf %s", store_dir());
    for (int round = 0; round < 40; round++) {
        struct run r;
        start(&r, &s, round % 2);
        hg_page_source_wait(r.source, NULL) == HG_OK ? (void)0 : fail();
        const struct timespec pause = {0, (long)(next_random() % 40) * 1000000};
        nanosleep(&pause, NULL);
        assert_int_equal(system(command), 0);
        assert_int_equal(count_wrong(&r, &s), 0);
        end(&r);
    }
    struct run r;
    struct hg_page_bake bake;
    start(&r, &s, 0);
    assert_int_equal(hg_page_source_bake(r.source, &bake, NULL), HG_OK);
    assert_int_equal(count_wrong(&r, &s), 0);
    end(&r);
    finish_scene(&s);
}

// No room for the pack: pages come from memory, and the bake says why there is none.
static void test_full_disk(void **state)
{
    (void)state;
    struct scene s;
    make_scene(&s, 3);
    signal(SIGXFSZ, SIG_IGN);
    struct rlimit old;
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &old), 0);
    for (rlim_t room = 0; room < 200000; room = room * 3 + 1) {
        const struct rlimit tight = {room, old.rlim_max};
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &tight), 0);
        struct run r;
        struct hg_page_bake bake;
        start(&r, &s, 0);
        const enum hg_status status = hg_page_source_bake(r.source, &bake, NULL);
        const uint32_t wrong = count_wrong(&r, &s);
        end(&r);
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &old), 0);
        assert_int_equal(status, HG_E_NOSPACE);
        assert_int_equal(wrong, 0);
        char path[512];
        assert_int_equal(find_files(".tmp", path, sizeof path), 0);
        assert_int_equal(find_files(".hgs", path, sizeof path), 0);
    }
    finish_scene(&s);
}

static void save_png(const struct hg_image *image, const char *path)
{
    struct hg_writer out = {0};
    assert_int_equal(
        hg_image_encode(image, &(struct hg_image_encode){.file = HG_IMAGE_PNG8}, &out, NULL),
        HG_OK);
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(out.data, 1, out.size, f), out.size);
    assert_int_equal(fclose(f), 0);
    hg_writer_finish(&out);
}

// The file is replaced between opening and reading: refused, and right when it is opened again.
static void test_replaced(void **state)
{
    (void)state;
    struct scene scenes[2];
    char path[96], other[96];
    snprintf(path, sizeof path, "%s/image.png", folder);
    snprintf(other, sizeof other, "%s/other.png", folder);
    make_scene(&scenes[0], 4);
    make_scene(&scenes[1], 5);
    const struct hg_image_source origin = {.label = path, .path = path};
    scenes[0].params.image = scenes[1].params.image = &origin;
    save_png(&scenes[0].image, path);
    for (int round = 1; round < 9; round++) {
        const struct scene *now = &scenes[round % 2], *before = &scenes[1 - round % 2];
        const bool streamed = round & 2, overwritten = round & 4;
        char command[128];
        snprintf(command, sizeof command, "rm -rf %s", store_dir());
        assert_int_equal(system(command), 0);
        struct run r;
        start(&r, before, streamed);
        save_png(&now->image, overwritten ? path : other);
        if (!overwritten)
            assert_int_equal(rename(other, path), 0);
        assert_int_equal(hg_page_source_wait(r.source, NULL), HG_E_HASH);
        uint8_t *texels = malloc(PAGE_BYTES);
        assert_int_equal(hg_page_source_read(r.source, 0, 0, 0, texels, NULL), HG_E_HASH);
        free(texels);
        end(&r);
        start(&r, now, streamed);
        assert_int_equal(count_wrong(&r, now), 0);
        end(&r);
    }
    finish_scene(&scenes[0]);
    finish_scene(&scenes[1]);
}

// Killed 100 times while it bakes; what is left never disturbs, and the next run completes.
static void test_kill(void **state)
{
    (void)state;
    struct scene s;
    make_scene(&s, 6);
    unsigned finished = 0;
    for (int round = 0; round < 100; round++) {
        const pid_t child = fork();
        assert_true(child >= 0);
        if (child == 0) {
            struct run r;
            struct hg_page_bake bake;
            start(&r, &s, round % 2);
            _exit(hg_page_source_bake(r.source, &bake, NULL) != HG_OK || count_wrong(&r, &s) != 0);
        }
        const struct timespec pause = {0, (long)(next_random() % 100) * 1000000};
        nanosleep(&pause, NULL);
        kill(child, SIGKILL);
        int status;
        assert_int_equal(waitpid(child, &status, 0), child);
        assert_true(WIFSIGNALED(status) || WEXITSTATUS(status) == 0);
        char path[512];
        if (find_files(".hgs", path, sizeof path) > 0) {
            finished++;
            unlink(path); // the next one bakes again
        }
    }
    assert_true(finished < 100);
    struct run r;
    struct hg_page_bake bake;
    char path[512];
    start(&r, &s, 0);
    assert_int_equal(find_files(".tmp", path, sizeof path), 0);
    assert_int_equal(hg_page_source_bake(r.source, &bake, NULL), HG_OK);
    assert_int_equal(count_wrong(&r, &s), 0);
    end(&r);
    finish_scene(&s);
}

// Several processes bake and read the same image: one pack, right pages everywhere.
static void test_processes(void **state)
{
    (void)state;
    struct scene s;
    make_scene(&s, 7);
    for (int round = 0; round < 5; round++) {
        pid_t children[4];
        for (int i = 0; i < 4; i++) {
            children[i] = fork();
            assert_true(children[i] >= 0);
            if (children[i] != 0)
                continue;
            struct run r;
            struct hg_page_bake bake;
            start(&r, &s, i % 2);
            const bool good = count_wrong(&r, &s) == 0 &&
                              hg_page_source_bake(r.source, &bake, NULL) == HG_OK &&
                              count_wrong(&r, &s) == 0;
            end(&r);
            _exit(!good);
        }
        for (int i = 0; i < 4; i++) {
            int status;
            assert_int_equal(waitpid(children[i], &status, 0), children[i]);
            assert_int_equal(status, 0);
        }
        char path[512];
        assert_int_equal(find_files(".tmp", path, sizeof path), 0);
        assert_int_equal(find_files(".hgs", path, sizeof path), 1);
        unlink(path);
    }
    finish_scene(&s);
}

// Every allocation fails once: a status or right pages.
static void test_no_memory(void **state)
{
    (void)state;
    struct scene s;
    make_scene(&s, 8);
    uint8_t *texels = malloc(PAGE_BYTES);
    for (uint64_t n = 1; n < 400; n++) {
        struct hg_store *store;
        assert_int_equal(
            hg_store_open(&(struct hg_store_params){.dir = store_dir()}, &store, NULL), HG_OK);
        hg_alloc_fail_at(n);
        struct hg_page_sources *sources;
        struct hg_page_source *source = NULL;
        const struct hg_page_sources_params params = {
            .store = store, .threads = 1, .image_bytes = n % 2};
        enum hg_status status = hg_page_sources_create(&params, &sources, NULL);
        if (status == HG_OK)
            status = hg_page_source_open(sources, &s.params, &source, NULL);
        if (status == HG_OK)
            status = hg_page_source_wait(source, NULL);
        if (status == HG_OK)
            status = hg_page_source_read(source, 0, 1, 1, texels, NULL);
        hg_alloc_fail_at(0);
        assert_true(status == HG_OK || status == HG_E_NOMEM || status == HG_E_AGAIN ||
                    status == HG_E_LIMIT);
        if (status == HG_OK) {
            const uint32_t page = hg_page_number(&s.layout, 0, 1, 1);
            assert_memory_equal(texels, s.pages + (size_t)page * PAGE_BYTES, PAGE_BYTES);
        }
        hg_page_source_close(source);
        hg_page_sources_destroy(sources);
        hg_store_close(store);
        char path[512];
        if (find_files(".hgs", path, sizeof path) > 0)
            unlink(path);
    }
    free(texels);
    finish_scene(&s);
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, set_up, tear_down)
    const struct CMUnitTest tests[] = {TEST(test_damage), TEST(test_folder_deleted),
        TEST(test_full_disk), TEST(test_replaced), TEST(test_kill), TEST(test_processes),
        TEST(test_no_memory)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
