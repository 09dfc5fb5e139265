// store.c - the cache on disk: round trips, every kind of damage, limits, folders that go away.
#include <dirent.h>
#include <fcntl.h>
#include <pthread.h>
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
#include "base/store/checksum.h"
#include "base/store/store.h"
#include "tests/support/folder.h"

static char folder[TEST_FOLDER_MAX];

static int set_up(void **state)
{
    (void)state;
    return !test_folder_make(folder, "store");
}

static int remove_folder(void **state)
{
    (void)state;
    return !test_folder_remove(folder);
}

static struct hg_store *open_store(uint64_t limit_bytes)
{
    char dir[96];
    snprintf(dir, sizeof dir, "%s/a/store", folder);
    struct hg_store *store;
    assert_int_equal(
        hg_store_open(&(struct hg_store_params){dir, limit_bytes}, &store, NULL), HG_OK);
    return store;
}

static struct hg_store_key key_of(uint32_t number)
{
    struct hg_store_key key;
    assert_int_equal(hg_store_key("test", 1, &number, sizeof number, &key), HG_OK);
    return key;
}

static size_t block_size(uint32_t number, uint32_t block)
{
    return 1 + (number * 7919 + block * 104729) % 3000;
}

static uint8_t block_byte(uint32_t number, uint32_t block, size_t i)
{
    return (uint8_t)((number + block * 31 + i) * 2654435761u >> 13);
}

static void fill_block(uint8_t *data, uint32_t number, uint32_t block)
{
    for (size_t i = 0; i < block_size(number, block); i++)
        data[i] = block_byte(number, block, i);
}

// Writes blocks 0, 2, 4, ... last first.
static enum hg_status write_entry(struct hg_store *store, uint32_t number, uint32_t blocks)
{
    const struct hg_store_key key = key_of(number);
    struct hg_store_writer *w;
    enum hg_status status = hg_store_begin(store, &key, &w, NULL);
    if (status != HG_OK)
        return status;
    uint8_t data[3000];
    hg_store_label(w, "entry %u", number);
    for (uint32_t i = blocks; status == HG_OK && i-- > 0;) {
        fill_block(data, number, i * 2);
        status = hg_store_write(w, i * 2, data, block_size(number, i * 2), NULL);
    }
    if (status != HG_OK) {
        hg_store_abort(w);
        return status;
    }
    return hg_store_commit(w, NULL);
}

// HG_OK: every block was there and right. Fails the test when a wrong byte is handed out.
static enum hg_status read_entry(struct hg_store *store, uint32_t number, uint32_t blocks)
{
    const struct hg_store_key key = key_of(number);
    struct hg_store_entry *e;
    enum hg_status status = hg_store_find(store, &key, &e, NULL);
    if (status != HG_OK)
        return status;
    uint8_t data[3000], right[3000];
    for (uint32_t i = 0; i < blocks && status == HG_OK; i++) {
        assert_int_equal(hg_store_entry_size(e, i * 2), block_size(number, i * 2));
        status = hg_store_entry_read(e, i * 2, data, block_size(number, i * 2), NULL);
        fill_block(right, number, i * 2);
        if (status == HG_OK)
            assert_memory_equal(data, right, block_size(number, i * 2));
        else
            assert_int_equal(status, HG_E_HASH);
    }
    hg_store_entry_close(e);
    return status;
}

static char *entry_path(uint32_t number)
{
    static char path[256];
    char hex[HG_SHA256_HEX];
    const struct hg_store_key key = key_of(number);
    hg_sha256_hex(key.hash, hex);
    snprintf(path, sizeof path, "%s/a/store/%s.hgs", folder, hex);
    return path;
}

static size_t count_files(const char *suffix)
{
    char dir[96];
    snprintf(dir, sizeof dir, "%s/a/store", folder);
    DIR *d = opendir(dir);
    size_t count = 0;
    for (struct dirent *e; d != NULL && (e = readdir(d)) != NULL;)
        count += strlen(e->d_name) > 4 && strcmp(e->d_name + strlen(e->d_name) - 4, suffix) == 0;
    if (d != NULL)
        closedir(d);
    return count;
}

static void test_checksum(void **state)
{
    (void)state;
    assert_true(hg_store_checksum("", 0, 0) == 0xef46db3751d8e999u);
    assert_true(hg_store_checksum("abc", 3, 0) == 0x44bc2cf5ad770999u);
    const char *text = "Nobody inspects the spammish repetition";
    assert_true(hg_store_checksum(text, strlen(text), 0) == 0xfbcea83c8a378bf1u);
}

static void test_round_trip(void **state)
{
    (void)state;
    struct hg_store *store = open_store(0);
    const struct hg_store_key key = key_of(1);
    assert_int_equal(read_entry(store, 1, 5), HG_E_NOTFOUND);
    assert_false(hg_store_has(store, &key));
    assert_int_equal(write_entry(store, 1, 5), HG_OK);
    assert_true(hg_store_has(store, &key));
    assert_int_equal(read_entry(store, 1, 5), HG_OK);
    struct hg_store_entry *e;
    assert_int_equal(hg_store_find(store, &key, &e, NULL), HG_OK);
    assert_int_equal(hg_store_entry_blocks(e), 9);
    assert_int_equal(hg_store_entry_size(e, 1), 0);
    assert_int_equal(hg_store_entry_size(e, 99), 0);
    uint8_t data[3000];
    assert_int_equal(hg_store_entry_read(e, 1, data, 10, NULL), HG_E_INVAL);
    assert_int_equal(hg_store_entry_read(e, 0, data, 10 + block_size(1, 0), NULL), HG_E_INVAL);
    hg_store_entry_close(e);
    struct hg_store_stats st;
    hg_store_stats(store, &st);
    assert_int_equal(st.found, 2);
    assert_int_equal(st.absent, 1);
    assert_int_equal(st.written, 1);
    hg_store_close(store);
    assert_int_equal(count_files(".tmp"), 0);
}

static void test_writer_rules(void **state)
{
    (void)state;
    struct hg_store *store = open_store(100000);
    const struct hg_store_key key = key_of(7);
    struct hg_store_writer *w, *other;
    assert_int_equal(hg_store_begin(store, &key, &w, NULL), HG_OK);
    assert_int_equal(hg_store_begin(store, &key, &other, NULL), HG_E_BUSY);
    assert_null(other);
    assert_int_equal(hg_store_write(w, 3, "abc", 3, NULL), HG_OK);
    assert_int_equal(hg_store_write(w, 3, "abc", 3, NULL), HG_E_INVAL);
    assert_int_equal(hg_store_write(w, 4, "", 0, NULL), HG_E_INVAL);
    assert_int_equal(hg_store_write(w, HG_STORE_BLOCKS_MAX, "a", 1, NULL), HG_E_INVAL);
    uint8_t *large = hg_calloc(100000, 1);
    assert_int_equal(hg_store_write(w, 5, large, 100000, NULL), HG_E_LIMIT);
    hg_free(large);
    hg_store_abort(w);
    assert_false(hg_store_has(store, &key));
    assert_int_equal(count_files(".tmp"), 0);
    assert_int_equal(hg_store_begin(store, &key, &w, NULL), HG_OK);
    assert_int_equal(hg_store_commit(w, NULL), HG_OK); // an entry may be empty
    assert_true(hg_store_has(store, &key));
    hg_store_close(store);
}

static uint8_t *load_file(const char *path, size_t *size)
{
    FILE *f = fopen(path, "rb");
    assert_non_null(f);
    uint8_t *data = calloc(1, 65536);
    assert_non_null(data);
    *size = fread(data, 1, 65536, f);
    fclose(f);
    return data;
}

static void save_file(const char *path, const uint8_t *data, size_t size)
{
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(data, 1, size, f), size);
    assert_int_equal(fclose(f), 0);
}

// Every byte flipped, every length: absent, or refused, or right; and gone afterwards.
static void test_damage(void **state)
{
    (void)state;
    struct hg_store *store = open_store(0);
    assert_int_equal(write_entry(store, 2, 2), HG_OK);
    size_t size;
    uint8_t *data = load_file(entry_path(2), &size);
    for (size_t i = 0; i < size; i++) {
        data[i] ^= (uint8_t)(1u << i % 8);
        save_file(entry_path(2), data, size);
        data[i] ^= (uint8_t)(1u << i % 8);
        const enum hg_status status = read_entry(store, 2, 2);
        assert_true(status == HG_E_NOTFOUND || status == HG_E_HASH);
        assert_int_not_equal(access(entry_path(2), F_OK), 0);
    }
    for (size_t length = 0; length < size; length++) {
        save_file(entry_path(2), data, length);
        assert_int_equal(read_entry(store, 2, 2), HG_E_NOTFOUND);
        assert_int_not_equal(access(entry_path(2), F_OK), 0);
    }
    assert_int_equal(write_entry(store, 2, 2), HG_OK);
    assert_int_equal(read_entry(store, 2, 2), HG_OK);
    free(data);
    hg_store_close(store);
}

// Damage and shortening while the entry is open.
static void test_damage_while_open(void **state)
{
    (void)state;
    struct hg_store *store = open_store(0);
    assert_int_equal(write_entry(store, 3, 3), HG_OK);
    const struct hg_store_key key = key_of(3);
    struct hg_store_entry *e;
    assert_int_equal(hg_store_find(store, &key, &e, NULL), HG_OK);
    assert_int_equal(truncate(entry_path(3), 70), 0);
    uint8_t data[3000];
    assert_int_equal(hg_store_entry_read(e, 0, data, block_size(3, 0), NULL), HG_E_HASH);
    assert_false(hg_store_has(store, &key));
    assert_int_equal(write_entry(store, 3, 3), HG_OK); // a new one must not suffer from the old
    assert_int_equal(hg_store_entry_read(e, 0, data, block_size(3, 0), NULL), HG_E_HASH);
    hg_store_entry_close(e);
    assert_int_equal(read_entry(store, 3, 3), HG_OK);
    hg_store_close(store);
}

// An entry under the wrong name is not that name's content.
static void test_wrong_name(void **state)
{
    (void)state;
    struct hg_store *store = open_store(0);
    assert_int_equal(write_entry(store, 4, 2), HG_OK);
    char from[256];
    snprintf(from, sizeof from, "%s", entry_path(4));
    assert_int_equal(rename(from, entry_path(5)), 0);
    assert_int_equal(read_entry(store, 5, 2), HG_E_NOTFOUND);
    assert_int_not_equal(access(entry_path(5), F_OK), 0);
    hg_store_close(store);
}

static void age_entry(uint32_t number, time_t seconds)
{
    const struct timespec times[2] = {{1000000 + seconds, 0}, {1000000 + seconds, 0}};
    assert_int_equal(utimensat(AT_FDCWD, entry_path(number), times, 0), 0);
}

static void test_eviction(void **state)
{
    (void)state;
    struct hg_store *store = open_store(0);
    uint64_t sizes[6];
    for (uint32_t i = 0; i < 6; i++) {
        assert_int_equal(write_entry(store, 10 + i, 10), HG_OK);
        struct stat st;
        assert_int_equal(stat(entry_path(10 + i), &st), 0);
        sizes[i] = (uint64_t)st.st_size;
        age_entry(10 + i, i);
    }
    assert_int_equal(read_entry(store, 10, 10), HG_OK); // used now: the newest
    const struct hg_store_key open_key = key_of(11);
    struct hg_store_entry *open_entry;
    assert_int_equal(hg_store_find(store, &open_key, &open_entry, NULL), HG_OK);
    age_entry(11, 0); // the oldest, but open
    const uint64_t limit = sizes[0] + sizes[1] + sizes[5] + 3000;
    struct hg_store *const first = store;
    store = open_store(limit); // beside the first, as another process would
    struct hg_store_stats st;
    hg_store_stats(store, &st);
    assert_true(st.bytes <= limit);
    assert_int_equal(st.evicted, 3);
    for (uint32_t i = 0; i < 6; i++)
        assert_int_equal(access(entry_path(10 + i), F_OK) == 0, i < 2 || i == 5);
    uint8_t data[3000];
    assert_int_equal(hg_store_entry_read(open_entry, 0, data, block_size(11, 0), NULL), HG_OK);
    hg_store_entry_close(open_entry);
    hg_store_close(first);
    for (uint32_t i = 0; i < 40; i++) {
        assert_int_equal(write_entry(store, 100 + i, 10), HG_OK);
        hg_store_stats(store, &st);
        assert_true(st.bytes <= limit);
        assert_int_equal(read_entry(store, 100 + i, 10), HG_OK);
    }
    hg_store_close(store);
}

static void test_folder_goes_away(void **state)
{
    (void)state;
    struct hg_store *store = open_store(0);
    assert_int_equal(write_entry(store, 20, 4), HG_OK);
    const struct hg_store_key key = key_of(20), other = key_of(21);
    struct hg_store_entry *e;
    struct hg_store_writer *w;
    assert_int_equal(hg_store_find(store, &key, &e, NULL), HG_OK);
    assert_int_equal(hg_store_begin(store, &other, &w, NULL), HG_OK);
    assert_int_equal(remove_folder(NULL), 0);
    uint8_t data[3000];
    assert_int_equal(hg_store_entry_read(e, 0, data, block_size(20, 0), NULL), HG_OK);
    assert_int_equal(hg_store_write(w, 0, "abc", 3, NULL), HG_OK);
    assert_int_equal(hg_store_commit(w, NULL), HG_E_IO);
    hg_store_entry_close(e);
    assert_int_equal(read_entry(store, 20, 4), HG_E_NOTFOUND);
    assert_int_equal(mkdir(folder, 0700), 0); // the two above it are made again
    assert_int_equal(write_entry(store, 20, 4), HG_OK);
    assert_int_equal(read_entry(store, 20, 4), HG_OK);
    hg_store_close(store);
}

static void test_no_folder(void **state)
{
    (void)state;
    struct hg_store *store;
    assert_int_equal(hg_store_open(&(struct hg_store_params){.dir = ""}, &store, NULL), HG_E_INVAL);
    char dir[96];
    snprintf(dir, sizeof dir, "%s/file", folder);
    save_file(dir, (const uint8_t *)"x", 1);
    snprintf(dir, sizeof dir, "%s/file/store", folder);
    assert_int_equal(hg_store_open(&(struct hg_store_params){dir, 0}, &store, NULL), HG_OK);
    assert_int_equal(read_entry(store, 1, 1), HG_E_NOTFOUND);
    assert_int_not_equal(write_entry(store, 1, 1), HG_OK);
    hg_store_close(store);
}

// The disk is full for writes beyond a size: the entry is absent, older ones stay.
static void test_full_disk(void **state)
{
    (void)state;
    struct hg_store *store = open_store(0);
    assert_int_equal(write_entry(store, 30, 3), HG_OK);
    signal(SIGXFSZ, SIG_IGN);
    struct rlimit old;
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &old), 0);
    for (rlim_t room = 0; room < 12000; room += 97) {
        const struct rlimit tight = {room, old.rlim_max};
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &tight), 0);
        const enum hg_status status = write_entry(store, 31, 3);
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &old), 0);
        assert_true(status == HG_OK || status == HG_E_NOSPACE);
        assert_int_equal(read_entry(store, 31, 3), status == HG_OK ? HG_OK : HG_E_NOTFOUND);
        assert_int_equal(count_files(".tmp"), 0);
    }
    assert_int_equal(read_entry(store, 31, 3), HG_OK);
    assert_int_equal(read_entry(store, 30, 3), HG_OK);
    hg_store_close(store);
}

static void test_no_memory(void **state)
{
    (void)state;
    struct hg_store *store = open_store(0);
    for (uint64_t n = 1;; n++) {
        hg_alloc_fail_at(n);
        const enum hg_status status = write_entry(store, 40, 3);
        const bool fired = hg_alloc_count() >= n;
        hg_alloc_fail_at(0);
        assert_int_equal(count_files(".tmp"), 0);
        if (!fired) {
            assert_int_equal(status, HG_OK);
            break;
        }
    }
    for (uint64_t n = 1;; n++) {
        hg_alloc_fail_at(n);
        const enum hg_status status = read_entry(store, 40, 3);
        const bool fired = hg_alloc_count() >= n;
        hg_alloc_fail_at(0);
        assert_int_equal(status, fired ? HG_E_NOMEM : HG_OK);
        if (!fired)
            break;
    }
    hg_store_close(store);
}

// Eight processes write, read, damage and evict the same few entries.
static void work_beside_others(unsigned seed)
{
    struct hg_store *store = open_store(60000);
    for (int i = 0; i < 300; i++) {
        seed = seed * 1664525u + 1013904223u;
        const uint32_t number = 50 + (seed >> 16) % 6;
        if (read_entry(store, number, 10) != HG_OK) {
            const enum hg_status status = write_entry(store, number, 10);
            if (status != HG_OK && status != HG_E_BUSY && status != HG_E_IO)
                _exit(1);
        } else if (i % 50 == 49) {
            const int fd = open(entry_path(number), O_RDWR);
            if (fd >= 0 && pwrite(fd, &seed, 1, 100 + seed % 900) != 1)
                _exit(2);
            if (fd >= 0)
                close(fd);
        }
    }
    hg_store_close(store);
    _exit(0);
}

static void test_processes(void **state)
{
    (void)state;
    pid_t children[8];
    for (unsigned i = 0; i < 8; i++) {
        children[i] = fork();
        assert_true(children[i] >= 0);
        if (children[i] == 0)
            work_beside_others(i + 1);
    }
    for (int i = 0; i < 8; i++) {
        int status;
        assert_int_equal(waitpid(children[i], &status, 0), children[i]);
        assert_int_equal(status, 0);
    }
    assert_int_equal(count_files(".tmp"), 0);
}

// A writer killed at a random moment leaves nothing that matters.
static void test_kill(void **state)
{
    (void)state;
    for (unsigned round = 0; round < 100; round++) {
        const pid_t child = fork();
        assert_true(child >= 0);
        if (child == 0) {
            struct hg_store *store = open_store(0);
            for (uint32_t i = 0;; i++)
                if (write_entry(store, i % 4, 40) != HG_OK)
                    _exit(1);
        }
        const struct timespec pause = {0, 200000 + (long)(round * 7919u % 100u) * 50000};
        nanosleep(&pause, NULL);
        kill(child, SIGKILL);
        assert_int_equal(waitpid(child, NULL, 0), child);
        struct hg_store *store = open_store(0); // reaps
        assert_int_equal(count_files(".tmp"), 0);
        for (uint32_t i = 0; i < 4; i++) {
            const enum hg_status status = read_entry(store, i, 40);
            assert_true(status == HG_OK || status == HG_E_NOTFOUND);
        }
        struct hg_store_stats st;
        hg_store_stats(store, &st);
        assert_int_equal(st.damaged, 0);
        hg_store_close(store);
    }
}

// The folder from outside: what lies there, while an entry is open.
struct reading {
    struct hg_store_entry **entries;
    uint32_t count, first;
    bool good;
};

static void *read_all(void *user)
{
    struct reading *r = user;
    uint8_t data[4096], expected[4096];
    r->good = true;
    for (uint32_t i = 0; i < 4 * r->count; i++) {
        const uint32_t n = (r->first + i * 37) % r->count;
        fill_block(expected, n, 0);
        r->good &= hg_store_entry_read(r->entries[n], 0, data, block_size(n, 0), NULL) == HG_OK &&
                   memcmp(data, expected, block_size(n, 0)) == 0;
    }
    return NULL;
}

// Many more entries than the process may have descriptors, read by four threads in any order.
static void test_few_descriptors(void **state)
{
    (void)state;
    enum { COUNT = 300, LIMIT = 48, THREADS = 4 };
    struct hg_store_entry *entries[COUNT];
    struct rlimit before, few;
    uint8_t data[4096];
    assert_int_equal(getrlimit(RLIMIT_NOFILE, &before), 0);
    few = before;
    few.rlim_cur = LIMIT;
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &few), 0);
    struct hg_store *store = open_store(0);
    for (uint32_t n = 0; n < COUNT; n++) {
        struct hg_store_writer *w;
        const struct hg_store_key key = key_of(n);
        fill_block(data, n, 0);
        assert_int_equal(hg_store_begin(store, &key, &w, NULL), HG_OK);
        assert_int_equal(hg_store_write(w, 0, data, block_size(n, 0), NULL), HG_OK);
        assert_int_equal(hg_store_commit(w, NULL), HG_OK);
        assert_int_equal(hg_store_find(store, &key, &entries[n], NULL), HG_OK);
    }
    struct reading readings[THREADS];
    pthread_t threads[THREADS];
    for (uint32_t i = 0; i < THREADS; i++) {
        readings[i] = (struct reading){entries, COUNT, i * 71, false};
        assert_int_equal(pthread_create(&threads[i], NULL, read_all, &readings[i]), 0);
    }
    for (uint32_t i = 0; i < THREADS; i++) {
        pthread_join(threads[i], NULL);
        assert_true(readings[i].good);
    }
    struct hg_store_stats stats;
    hg_store_stats(store, &stats);
    assert_true(stats.files_open <= LIMIT / 4);
    assert_true(stats.files_reopened > COUNT);
    assert_int_equal(stats.damaged, 0);
    // Gone while it was closed: damaged for its reader, and absent afterwards.
    char dir[96], command[160];
    snprintf(dir, sizeof dir, "%s/a/store", folder);
    snprintf(command, sizeof command, "rm -f '%s'/*.hgs", dir);
    assert_int_equal(system(command), 0);
    uint32_t gone = 0;
    for (uint32_t n = 0; n < COUNT; n++)
        gone += hg_store_entry_read(entries[n], 0, data, block_size(n, 0), NULL) == HG_E_HASH;
    assert_true(gone >= COUNT - LIMIT / 4 && gone < COUNT);
    for (uint32_t n = 0; n < COUNT; n++)
        hg_store_entry_close(entries[n]);
    hg_store_close(store);
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &before), 0);
}

static void test_list(void **state)
{
    (void)state;
    struct hg_store_info *infos;
    size_t count;
    char dir[96];
    snprintf(dir, sizeof dir, "%s/a/store", folder);
    struct hg_store *store = open_store(0);
    struct hg_store_entry *e;
    const struct hg_store_key key = key_of(1);
    for (uint32_t i = 0; i < 3; i++)
        assert_int_equal(write_entry(store, i, 4 + i), HG_OK);
    assert_int_equal(hg_store_find(store, &key, &e, NULL), HG_OK);
    assert_int_equal(hg_store_list(dir, &infos, &count, NULL), HG_OK);
    assert_int_equal(count, 3);
    for (size_t i = 0; i < count; i++) {
        unsigned number = 9;
        assert_int_equal(sscanf(infos[i].label, "entry %u", &number), 1);
        const struct hg_store_key right = key_of(number);
        assert_memory_equal(&infos[i].key, &right, sizeof right);
        assert_int_equal(infos[i].blocks, (4 + number) * 2 - 1);
        assert_int_equal(infos[i].is_open, number == 1);
        assert_false(infos[i].is_damaged);
        assert_true(i == 0 || infos[i].used_s >= infos[i - 1].used_s);
        assert_int_equal(hg_store_verify(dir, &infos[i].key, NULL), HG_OK);
    }
    hg_free(infos);
    uint32_t removed;
    uint64_t bytes;
    assert_int_equal(hg_store_clear(dir, &removed, &bytes, NULL), HG_OK);
    assert_int_equal(removed, 2);
    assert_true(bytes > 0);
    assert_int_equal(read_entry(store, 1, 5), HG_OK);
    hg_store_entry_close(e);
    hg_store_close(store);
    assert_int_equal(hg_store_list("/nowhere/at/all", &infos, &count, NULL), HG_E_NOTFOUND);
    assert_null(infos);
}

static void flip_byte(const char *path, long at)
{
    FILE *f = fopen(path, "r+b");
    assert_non_null(f);
    assert_int_equal(fseek(f, at, at < 0 ? SEEK_END : SEEK_SET), 0);
    const int byte = fgetc(f);
    assert_int_equal(fseek(f, -1, SEEK_CUR), 0);
    assert_int_equal(fputc(byte ^ 1, f), byte ^ 1);
    assert_int_equal(fclose(f), 0);
}

// Listing says that a table is damaged and deletes nothing; verifying finds blocks too.
static void test_verify(void **state)
{
    (void)state;
    struct hg_store *store = open_store(0);
    char hex[HG_SHA256_HEX], dir[96], path[4096];
    snprintf(dir, sizeof dir, "%s/a/store", folder);
    for (uint32_t i = 0; i < 2; i++) { // in a block; in the label
        struct hg_store_info *infos;
        size_t count;
        const struct hg_store_key key = key_of(i);
        assert_int_equal(write_entry(store, i, 4), HG_OK);
        hg_sha256_hex(key.hash, hex);
        snprintf(path, sizeof path, "%s/%s.hgs", dir, hex);
        flip_byte(path, i == 0 ? 70 : -42);
        assert_int_equal(hg_store_list(dir, &infos, &count, NULL), HG_OK);
        assert_int_equal(count, 1);
        assert_int_equal(infos[0].is_damaged, i == 1);
        assert_int_equal(infos[0].label[0] == 0, i == 1);
        hg_free(infos);
        assert_int_equal(hg_store_verify(dir, &key, NULL), HG_E_HASH);
        assert_int_equal(count_files(".hgs"), 0);
        assert_int_equal(hg_store_verify(dir, &key, NULL), HG_E_NOTFOUND);
    }
    hg_store_close(store);
}

// The tables of the hierarchy of 100 million points are a block of about 100 MiB.
static void test_large_block(void **state)
{
    (void)state;
    const size_t size = (size_t)100 << 20;
    struct hg_store *store = open_store(0);
    const struct hg_store_key key = key_of(1);
    struct hg_store_writer *w;
    struct hg_store_entry *e;
    uint8_t *data = hg_calloc(size, 1);
    assert_non_null(data);
    data[size - 1] = 7;
    assert_int_equal(hg_store_begin(store, &key, &w, NULL), HG_OK);
    assert_int_equal(hg_store_write(w, 0, data, size, NULL), HG_OK);
    assert_int_equal(hg_store_commit(w, NULL), HG_OK);
    data[size - 1] = 0;
    assert_int_equal(hg_store_find(store, &key, &e, NULL), HG_OK);
    assert_int_equal(hg_store_entry_read(e, 0, data, size, NULL), HG_OK);
    assert_int_equal(data[size - 1], 7);
    hg_store_entry_close(e);
    hg_free(data);
    hg_store_close(store);
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, set_up, remove_folder)
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_checksum), TEST(test_round_trip),
        TEST(test_large_block), TEST(test_writer_rules), TEST(test_damage),
        TEST(test_damage_while_open), TEST(test_wrong_name), TEST(test_eviction),
        TEST(test_folder_goes_away), TEST(test_no_folder), TEST(test_full_disk),
        TEST(test_no_memory), TEST(test_processes), TEST(test_kill), TEST(test_few_descriptors),
        TEST(test_list), TEST(test_verify)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
