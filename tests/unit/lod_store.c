// Cluster files in the store: what is written is read, and damage is absence.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <dirent.h>
#include <stdio.h>
#include <unistd.h>

#include "renderer/lod/store.h"
#include "tests/support/folder.h"
#include "tests/unit/lod_meshes.h"

struct fixture {
    char dir[TEST_FOLDER_MAX];
    struct hg_store *store;
    struct hg_mesh_part part;
    struct hg_store_key key;
    uint8_t *data;
    size_t size;
    struct hg_error err;
};

static int setup(void **state)
{
    static struct fixture f;
    f = (struct fixture){.part = lod_terrain(120)};
    assert_true(test_folder_make(f.dir, "lod-store"));
    const struct hg_store_params params = {.dir = f.dir};
    assert_int_equal(hg_store_open(&params, &f.store, &f.err), HG_OK);
    const struct hg_lod_params lod = {0};
    assert_int_equal(hg_lod_stored_key(&f.part, &lod, &f.key), HG_OK);
    assert_int_equal(hg_lod_bake(&f.part, &lod, &f.data, &f.size, NULL, &f.err), HG_OK);
    *state = &f;
    return 0;
}

static int teardown(void **state)
{
    struct fixture *f = *state;
    hg_store_close(f->store);
    hg_free(f->data);
    lod_part_finish(&f->part);
    return !test_folder_remove(f->dir);
}

static void test_same_bytes(void **state)
{
    struct fixture *f = *state;
    struct hg_lod_stored s;
    struct hg_lod *whole;
    assert_int_equal(hg_lod_stored_find(f->store, &f->key, &s, &f->err), HG_E_NOTFOUND);
    assert_int_equal(
        hg_lod_stored_write(f->store, &f->key, "part", f->data, f->size, &f->err), HG_OK);
    assert_int_equal(hg_lod_stored_find(f->store, &f->key, &s, &f->err), HG_OK);
    assert_int_equal(hg_lod_open(f->data, f->size, &whole, &f->err), HG_OK);
    assert_int_equal(s.lod->cluster_count, whole->cluster_count);
    assert_true(whole->chunk_count > 1);
    assert_memory_equal(
        s.lod->clusters, whole->clusters, whole->cluster_count * sizeof *whole->clusters);
    assert_memory_equal(s.lod->nodes, whole->nodes, whole->node_count * sizeof *whole->nodes);
    for (uint32_t i = 0; i < whole->chunk_count; i++) {
        const struct hg_lod_chunk *c = &whole->chunks[i];
        uint8_t *bytes = hg_calloc(c->bytes, 1);
        assert_int_equal(hg_lod_stored_read(&s, i, bytes, &f->err), HG_OK);
        assert_memory_equal(bytes, f->data + c->offset, c->bytes);
        hg_free(bytes);
    }
    hg_lod_close(whole);
    hg_lod_stored_close(&s);
}

static void flip(const char *path, long at)
{
    FILE *file = fopen(path, "r+b");
    assert_non_null(file);
    assert_int_equal(fseek(file, at, SEEK_SET), 0);
    const int byte = fgetc(file);
    assert_int_equal(fseek(file, at, SEEK_SET), 0);
    assert_int_equal(fputc(byte ^ 0x10, file), byte ^ 0x10);
    assert_int_equal(fclose(file), 0);
}

static long find_entry(const char *dir, char *path, size_t size)
{
    char command[128];
    snprintf(command, sizeof command, "find '%s' -type f -size +4k", dir);
    FILE *list = popen(command, "r");
    assert_non_null(list);
    assert_non_null(fgets(path, (int)size, list));
    pclose(list);
    path[strcspn(path, "\n")] = 0;
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    fseek(file, 0, SEEK_END);
    const long bytes = ftell(file);
    fclose(file);
    return bytes;
}

// Wherever a bit flips, either the entry is absent or reading the chunk says so.
static void test_damage(void **state)
{
    struct fixture *f = *state;
    for (int i = 0; i < 24; i++) {
        struct hg_lod_stored s;
        char path[256];
        enum hg_status status =
            hg_lod_stored_write(f->store, &f->key, "part", f->data, f->size, &f->err);
        assert_int_equal(status, HG_OK);
        const long size = find_entry(f->dir, path, sizeof path);
        flip(path, size * i / 24);
        status = hg_lod_stored_find(f->store, &f->key, &s, &f->err);
        bool told = status == HG_E_NOTFOUND;
        for (uint32_t c = 0; status == HG_OK && c < s.lod->chunk_count; c++) {
            uint8_t *bytes = hg_calloc(s.lod->chunks[c].bytes, 1);
            const enum hg_status read = hg_lod_stored_read(&s, c, bytes, &f->err);
            told |= read == HG_E_HASH;
            if (read == HG_OK)
                assert_memory_equal(
                    bytes, f->data + s.lod->chunks[c].offset, s.lod->chunks[c].bytes);
            hg_free(bytes);
        }
        hg_lod_stored_close(&s);
        if (!told) { // padding: the content is whole
            assert_int_equal(status, HG_OK);
            continue;
        }
        assert_int_equal(hg_lod_stored_find(f->store, &f->key, &s, &f->err), HG_E_NOTFOUND);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_same_bytes, setup, teardown),
        cmocka_unit_test_setup_teardown(test_damage, setup, teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
