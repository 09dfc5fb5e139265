// test_upload_store.c - contents that clients send: who has them, which go, and a disk that is
// late.
#include <semaphore.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/sha256.h"
#include "server/broker/storage/upload.h"
#include "tests/support/folder.h"

static char folder[TEST_FOLDER_MAX];

static int make_folder(void **state)
{
    (void)state;
    return !test_folder_make(folder, "uploads");
}

static int remove_folder(void **state)
{
    (void)state;
    return !test_folder_remove(folder);
}

static const char *path_of(const char *name)
{
    static char path[TEST_FOLDER_MAX + 128];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

enum { BLOCK = 4096 };

// A content takes its blocks on the disk, and one for the file.
static struct hg_upload_owner *owner_of(struct hg_upload_store *store, uint8_t number)
{
    uint8_t key[32] = {number};
    struct hg_upload_owner *owner = hg_upload_store_owner(store, key);
    assert_non_null(owner);
    assert_ptr_equal(hg_upload_store_owner(store, key), owner);
    hg_upload_owner_set_quota(owner, &(struct hg_upload_usage){.bytes = 1 << 20, .files = 5000});
    return owner;
}

static void settle(struct hg_upload_store *store)
{
    hg_disk_queue_wait(hg_upload_store_queue(store));
}

static enum hg_status append(
    struct hg_upload *upload, const void *data, size_t size, struct hg_error *err)
{
    return hg_upload_append(upload, &(struct hg_upload_piece){.data = data, .size = size}, err);
}

static void note_end(void *user, struct hg_upload *upload, const struct hg_error *err)
{
    (void)upload;
    *(enum hg_status *)user = err->status;
}

static void put(struct hg_upload_store *store, struct hg_upload_owner *owner, uint32_t fill,
    size_t size, uint8_t hash[32])
{
    struct hg_upload *upload;
    struct hg_error err;
    static uint32_t data[2 * BLOCK];
    assert_true(size <= sizeof data);
    for (size_t i = 0; i < 2 * BLOCK; i++)
        data[i] = fill;
    const uint8_t *bytes = (const uint8_t *)data;
    assert_int_equal(hg_sha256(data, size, hash), HG_OK);
    assert_int_equal(hg_upload_begin(store, owner, hash, size, &upload, &err), HG_OK);
    assert_int_equal(append(upload, bytes, size / 2, &err), HG_OK);
    assert_int_equal(append(upload, bytes + size / 2, size - size / 2, &err), HG_OK);
    assert_int_equal(append(upload, bytes, 1, &err), HG_E_LIMIT);
    enum hg_status ended = HG_E_STATE;
    hg_upload_store_listen(store, &(struct hg_upload_news){.user = &ended, .ended = note_end});
    assert_int_equal(hg_upload_commit(upload, 0, false, &err), HG_OK);
    assert_true(hg_upload_is_committed(upload));
    settle(store);
    assert_int_equal(ended, HG_OK);
}

static void store_evicts_what_nobody_uses(void **state)
{
    (void)state;
    struct hg_upload_store *store;
    struct hg_error err;
    struct hg_upload *upload;
    uint8_t a[32], b[32], c[32], d[32];
    static const uint8_t data[3 * BLOCK];
    char uploads[200];
    snprintf(uploads, sizeof uploads, "%s", path_of("cache/deep/uploads"));
    assert_int_equal(hg_upload_store_create(uploads, 6 * BLOCK, &store, &err), HG_OK);
    struct hg_upload_owner *owner = owner_of(store, 1);
    put(store, owner, 1, 1000, a); // two blocks each
    put(store, owner, 2, 1000, b);
    assert_true(hg_upload_store_has(store, NULL, a)); // used: b is the oldest now
    put(store, owner, 3, BLOCK + 1, c);               // three
    assert_true(hg_upload_store_has(store, NULL, a) && !hg_upload_store_has(store, NULL, b) &&
                hg_upload_store_has(store, NULL, c));
    assert_int_equal(hg_upload_store_pin(store, a), HG_OK);
    assert_int_equal(hg_upload_store_pin(store, c), HG_OK);
    // An announcement takes a block; what does not fit beside what is in use is refused.
    assert_int_equal(hg_upload_begin(store, owner, b, 2 * BLOCK, &upload, &err), HG_OK);
    assert_int_equal(hg_upload_store_bytes(store), 6 * BLOCK);
    assert_int_equal(append(upload, data, 1, &err), HG_E_LIMIT);
    hg_upload_abort(upload);
    settle(store);
    assert_int_equal(hg_upload_store_bytes(store), 5 * BLOCK);
    hg_upload_store_unpin(store, a);
    put(store, owner, 4, 500, d);
    assert_true(!hg_upload_store_has(store, NULL, a) && hg_upload_store_has(store, NULL, c) &&
                hg_upload_store_has(store, NULL, d));
    assert_int_equal(hg_upload_store_bytes(store), 5 * BLOCK);
    // An announcement of everything evicts nothing; given up it leaves no file.
    assert_int_equal(hg_upload_begin(store, owner, b, 6 * BLOCK, &upload, &err), HG_OK);
    assert_true(hg_upload_store_has(store, NULL, c) && hg_upload_store_has(store, NULL, d));
    hg_upload_abort(upload);
    settle(store);
    assert_int_equal(hg_upload_store_bytes(store), 5 * BLOCK);
    assert_int_equal(hg_upload_begin(store, owner, b, 6 * BLOCK + 1, &upload, &err), HG_E_LIMIT);
    hg_upload_store_destroy(store);
    // A later run finds what is there, and clears away what was under way.
    test_text_write(folder, "cache/deep/uploads/.incoming.7", "rest");
    assert_int_equal(hg_upload_store_create(uploads, 6 * BLOCK, &store, &err), HG_OK);
    assert_true(hg_upload_store_has(store, NULL, c) && hg_upload_store_has(store, NULL, d));
    assert_int_equal(hg_upload_store_bytes(store), 5 * BLOCK);
    assert_true(access(path_of("cache/deep/uploads/.incoming.7"), F_OK) != 0);
    hg_upload_store_forget(store, c);
    assert_false(hg_upload_store_has(store, NULL, c));
    hg_upload_store_destroy(store);
}

// What two have sent is stored once, and each sees it only when it has sent all of it.
static void contents_have_owners(void **state)
{
    (void)state;
    struct hg_upload_store *store;
    struct hg_error err;
    uint8_t hash[32], again[32];
    assert_int_equal(hg_upload_store_create(path_of("owners"), 1 << 20, &store, &err), HG_OK);
    struct hg_upload_owner *anna = owner_of(store, 1), *bert = owner_of(store, 2);
    put(store, anna, 1, 100, hash);
    assert_true(hg_upload_store_has(store, anna, hash));
    assert_false(hg_upload_store_has(store, bert, hash));
    put(store, bert, 1, 100, again);
    assert_memory_equal(hash, again, 32);
    assert_true(hg_upload_store_has(store, bert, hash));
    assert_int_equal(hg_upload_store_bytes(store), 2 * BLOCK);
    assert_int_equal(hg_upload_owner_usage(bert).files, 1);
    // One's quota takes it from that one only.
    hg_upload_owner_set_quota(anna, &(struct hg_upload_usage){.bytes = 1 << 20, .files = 1});
    put(store, anna, 2, 100, again);
    assert_false(hg_upload_store_has(store, anna, hash));
    assert_true(hg_upload_store_has(store, bert, hash));
    hg_upload_store_destroy(store);
    // A later run knows whose they are.
    assert_int_equal(hg_upload_store_create(path_of("owners"), 1 << 20, &store, &err), HG_OK);
    anna = owner_of(store, 1);
    bert = owner_of(store, 2);
    assert_true(hg_upload_store_has(store, bert, hash) && hg_upload_store_has(store, anna, again));
    assert_false(hg_upload_store_has(store, anna, hash) || hg_upload_store_has(store, bert, again));
    assert_int_equal(hg_upload_owner_usage(anna).bytes, 2 * BLOCK);
    hg_upload_store_forget(store, hash);
    assert_false(hg_upload_store_has(store, bert, hash));
    assert_int_equal(hg_upload_owner_usage(bert).files, 0);
    hg_upload_store_destroy(store);
}

// Whoever fills a quota loses contents of its own, not those of others.
static void owners_have_quotas(void **state)
{
    (void)state;
    struct hg_upload_store *store;
    struct hg_error err;
    struct hg_upload *upload;
    uint8_t other[32], first[32], hash[32];
    assert_int_equal(hg_upload_store_create(path_of("quotas"), 64 << 20, &store, &err), HG_OK);
    struct hg_upload_owner *quiet = owner_of(store, 1), *greedy = owner_of(store, 2);
    hg_upload_owner_set_quota(greedy, &(struct hg_upload_usage){.bytes = 1 << 20, .files = 100});
    put(store, quiet, 1, 100, other);
    put(store, greedy, 2, 100, first);
    for (uint32_t i = 0; i < 300; i++)
        put(store, greedy, 1000 + i, 4, hash);
    assert_int_equal(hg_upload_owner_usage(greedy).files, 100);
    assert_false(hg_upload_store_has(store, NULL, first));
    assert_true(hg_upload_store_has(store, NULL, other) && hg_upload_store_has(store, NULL, hash));
    for (uint32_t i = 0; i < 100; i++)
        put(store, greedy, 5000 + i, 6 * BLOCK, hash);
    assert_true(hg_upload_owner_usage(greedy).bytes <= 1 << 20);
    assert_int_equal(hg_upload_owner_usage(quiet).files, 1);
    // What is in use stays, and what would need its place is refused.
    hg_upload_owner_set_quota(quiet, &(struct hg_upload_usage){.bytes = 1 << 20, .files = 1});
    assert_int_equal(hg_upload_store_pin(store, other), HG_OK);
    assert_int_equal(hg_upload_begin(store, quiet, first, 5, &upload, &err), HG_E_LIMIT);
    hg_upload_store_unpin(store, other);
    assert_int_equal(hg_upload_begin(store, quiet, first, 5, &upload, &err), HG_OK);
    hg_upload_abort(upload);
    hg_upload_store_destroy(store);
}

// The disk stands still until the semaphore is raised.
struct hold {
    struct hg_disk_job job;
    sem_t over;
};

static void run_hold(struct hg_disk_job *job)
{
    while (sem_wait(&((struct hold *)job)->over) != 0)
        continue;
}

static void end_hold(struct hg_disk_job *job)
{
    sem_destroy(&((struct hold *)job)->over);
}

static void hold_disk(struct hg_upload_store *store, struct hold *hold)
{
    *hold = (struct hold){.job = {.run = run_hold, .done = end_hold}};
    assert_int_equal(sem_init(&hold->over, 0, 0), 0);
    hg_disk_queue_push(hg_upload_store_queue(store), &hold->job);
}

static void release_disk(struct hg_upload_store *store, struct hold *hold)
{
    assert_false(hg_disk_queue_is_idle(hg_upload_store_queue(store)));
    sem_post(&hold->over);
    settle(store);
    assert_true(hg_disk_queue_is_idle(hg_upload_store_queue(store)));
}

static void begin_put(
    struct hg_upload_store *store, struct hg_upload_owner *owner, const uint8_t hash[32])
{
    struct hg_upload *upload;
    struct hg_error err;
    assert_int_equal(hg_upload_begin(store, owner, hash, 7, &upload, &err), HG_OK);
    assert_int_equal(append(upload, "content", 7, &err), HG_OK);
    assert_int_equal(hg_upload_unwritten(upload), 7);
    assert_int_equal(hg_upload_commit(upload, 0, false, &err), HG_OK);
}

struct ends {
    uint32_t count;
    enum hg_status status[4];
};

static void add_end(void *user, struct hg_upload *upload, const struct hg_error *err)
{
    struct ends *ends = user;
    (void)upload;
    assert_true(ends->count < 4);
    ends->status[ends->count++] = err->status;
}

// What is decided while the disk stands still is done in that order, and counts once it is.
static void the_disk_may_be_late(void **state)
{
    (void)state;
    struct hg_upload_store *store;
    struct hg_error err;
    struct hold hold;
    struct ends ends = {0};
    struct stat st;
    uint8_t hash[32];
    char hex[HG_SHA256_HEX], name[100];
    assert_int_equal(hg_sha256("content", 7, hash), HG_OK);
    hg_sha256_hex(hash, hex);
    snprintf(name, sizeof name, "late/%s", hex);
    assert_int_equal(hg_upload_store_create(path_of("late"), 1 << 20, &store, &err), HG_OK);
    hg_upload_store_listen(store, &(struct hg_upload_news){.user = &ends, .ended = add_end});
    struct hg_upload_owner *anna = owner_of(store, 1), *bert = owner_of(store, 2);
    // Two send the same: neither has it before it is there, and there is one file.
    hold_disk(store, &hold);
    begin_put(store, anna, hash);
    begin_put(store, bert, hash);
    assert_false(hg_upload_store_has(store, NULL, hash));
    release_disk(store, &hold);
    assert_int_equal(ends.count, 2);
    assert_int_equal(ends.status[0] | ends.status[1], HG_OK);
    assert_true(hg_upload_store_has(store, anna, hash) && hg_upload_store_has(store, bert, hash));
    assert_int_equal(hg_upload_store_bytes(store), 2 * BLOCK);
    assert_int_equal(stat(path_of(name), &st), 0);
    assert_int_equal(st.st_nlink, 3); // and a link of each
    // Removed and sent again: the new one stays.
    hold_disk(store, &hold);
    hg_upload_store_forget(store, hash);
    begin_put(store, anna, hash);
    release_disk(store, &hold);
    assert_int_equal(ends.status[2], HG_OK);
    assert_true(hg_upload_store_has(store, anna, hash) && !hg_upload_store_has(store, bert, hash));
    assert_int_equal(stat(path_of(name), &st), 0);
    assert_int_equal(st.st_nlink, 2);
    // Sent by another one, which takes what is there, and then removed as damaged: nothing stays.
    hold_disk(store, &hold);
    begin_put(store, bert, hash);
    hg_upload_store_forget(store, hash);
    release_disk(store, &hold);
    assert_int_equal(ends.status[3], HG_E_IO);
    assert_false(hg_upload_store_has(store, NULL, hash));
    assert_int_equal(hg_upload_store_bytes(store), 0);
    assert_int_equal(hg_upload_owner_usage(bert).files + hg_upload_owner_usage(bert).bytes, 0);
    assert_int_equal(stat(path_of(name), &st), -1);
    hg_upload_store_destroy(store);
    // No link was left behind, by which a later run would take it for a content of that owner.
    assert_int_equal(hg_upload_store_create(path_of("late"), 1 << 20, &store, &err), HG_OK);
    assert_false(hg_upload_store_has(store, NULL, hash));
    assert_int_equal(hg_upload_owner_usage(owner_of(store, 2)).files, 0);
    hg_upload_store_destroy(store);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(store_evicts_what_nobody_uses),
        cmocka_unit_test(contents_have_owners),
        cmocka_unit_test(owners_have_quotas),
        cmocka_unit_test(the_disk_may_be_late),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
