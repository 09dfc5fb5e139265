// foreign.c - damaged files of the formats that foreign libraries parse, each in a loader: whatever
// the library does, the file is read or refused with its name and a reason, in time.
//
//   fuzz_foreign FOLDER COUNT [STATE [FIRST]]
//
// Mutants FIRST (0) to COUNT - 1 of each file of FOLDER and of foreign_seeds.h. STATE is a file in
// which it is noted how far they are: a run that is ended goes on.
// Mutants follow from file, number and $HELIO_FUZZ_SEED alone. $HELIO_LOADER is the loader.
#include <ctype.h>
#include <dirent.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <time.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/file.h"
#include "renderer/scene/load.h"
#include "server/loader/loader_client.h"
#include "tests/fuzz/foreign_seeds.h"
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/mutate.h"

enum { ROOM = 4096, MOST_FILES = 64, CPU_S = 2, MEMORY_MIB = 512, TIMEOUT_S = 30 };
enum { MOST_S = 4 * (CPU_S + 1) }; // of processor time, for one mutant

enum outcome { READ, REFUSED, CRASHED, OUT_OF_CPU, OUT_OF_TIME, OUT_OF_MEMORY, OUTCOMES };
static const char *const outcome_names[] = {
    "read", "refused", "crashed", "out of processor time", "out of time", "out of memory"};

struct seed {
    char name[256];
    uint8_t *data;
    size_t size, fixed; // bytes that stay: JSON in front of what a library parses
};

struct mutant {
    const char *name;
    const uint8_t *data;
    size_t size;
};

// ---- processor time ----------------------------------------------------------------------------

static pid_t spawner; // the parent of the loaders

// Seconds that a process and its children that have ended took; its parent. False: it is not there.
static bool read_process(int pid, double *seconds, int *parent)
{
    char path[64], line[1024] = "";
    unsigned long own[2], children[2];
    snprintf(path, sizeof path, "/proc/%d/stat", pid);
    FILE *file = fopen(path, "re");
    const char *rest = file && fgets(line, sizeof line, file) ? strrchr(line, ')') : NULL;
    if (file)
        fclose(file);
    if (!rest || sscanf(rest, ") %*c %d %*d %*d %*d %*d %*u %*u %*u %*u %*u %lu %lu %lu %lu",
                     parent, &own[0], &own[1], &children[0], &children[1]) != 5)
        return false;
    *seconds = (double)(own[0] + own[1] + children[0] + children[1]) / (double)sysconf(_SC_CLK_TCK);
    return true;
}

// The only child of this process.
static pid_t find_spawner(void)
{
    pid_t found = 0;
    double seconds;
    DIR *dir = opendir("/proc");
    for (struct dirent *entry; dir && !found && (entry = readdir(dir));) {
        const int pid = isdigit((unsigned char)*entry->d_name) ? atoi(entry->d_name) : 0;
        int parent;
        if (pid && read_process(pid, &seconds, &parent) && parent == getpid())
            found = pid;
    }
    if (dir)
        closedir(dir);
    return found;
}

// Of this process and of loaders that have ended.
static double seconds_taken(void)
{
    double own, loaders;
    int parent;
    FUZZ_CHECK(read_process(getpid(), &own, &parent));
    FUZZ_CHECK(read_process(spawner, &loaders, &parent));
    return own + loaders;
}

// ---- one mutant --------------------------------------------------------------------------------

static enum hg_status give(
    void *user, const char *uri, uint64_t limit_bytes, struct hg_refbuf **out, struct hg_error *err)
{
    const struct mutant *m = user;
    *out = NULL;
    if (strcmp(uri, m->name) != 0 || m->size > limit_bytes)
        return hg_error_set(err, HG_E_NOTFOUND, uri, NULL, "there is no other file");
    *out = hg_refbuf_create(m->size);
    if (!*out)
        return HG_E_NOMEM;
    memcpy((*out)->data, m->data, m->size);
    return HG_OK;
}

static bool is_model(const char *name)
{
    const char *dot = strrchr(name, '.');
    return dot && (!strcmp(dot, ".fbx") || !strcmp(dot, ".dae") || !strcmp(dot, ".glb"));
}

static enum hg_status read_mutant(const struct mutant *m, struct hg_error *err)
{
    struct hg_asset *asset = NULL;
    struct hg_image image;
    enum hg_status status;
    if (is_model(m->name)) {
        status = hg_load_asset(&(struct hg_load_params){.path = m->name,
                                   .asset_number = 1,
                                   .scene_index = -1,
                                   .memory_limit_bytes = 1 << 30,
                                   .fetch = give,
                                   .fetch_user = (void *)m},
            &asset, err);
        hg_asset_destroy(asset);
        return status;
    }
    status = hg_image_read_memory(&(struct hg_image_bytes){m->data, m->size, m->name},
        HG_PIXEL_RGBA8, &(struct hg_image_limits){.max_pixels = 1 << 24}, &image, err);
    hg_image_finish(&image);
    return status;
}

static enum outcome judge(enum hg_status status, const struct mutant *m, const struct hg_error *err)
{
    if (!status)
        return READ;
    FUZZ_CHECK(err->status == status && err->reason[0] && strstr(err->what, m->name));
    return strstr(err->reason, "crashed")         ? CRASHED
           : strstr(err->reason, "loader-memory") ? OUT_OF_MEMORY
           : strstr(err->reason, "loader-cpu")    ? OUT_OF_CPU
           : strstr(err->reason, "loader-")       ? OUT_OF_TIME
                                                  : REFUSED;
}

static enum outcome try_mutant(const struct seed *seed, uint64_t number)
{
    static uint8_t room[1 << 20];
    struct fuzz_random random = fuzz_random_start();
    for (const char *c = seed->name; *c; c++)
        random.state = (random.state ^ (uint8_t)*c) * 0x100000001b3u;
    random.state ^= (number + 1) * 0xbf58476d1ce4e5b9u;
    random.state += random.state == 0;
    memcpy(room, seed->data, seed->size);
    const struct fuzz_piece piece = {seed->data, seed->size};
    const size_t size =
        seed->fixed + fuzz_mutate(&random, room + seed->fixed, seed->size - seed->fixed,
                          seed->size - seed->fixed + ROOM, &piece);
    const struct mutant m = {seed->name, room, size};
    struct hg_error err = {0};
    const double before_s = seconds_taken();
    const enum hg_status status = read_mutant(&m, &err);
    // Not by the clock, which goes on while other programs have the processors. What the loader of
    // the mutant before took may count here.
    FUZZ_CHECK(seconds_taken() - before_s < MOST_S);
    return judge(status, &m, &err);
}

// ---- all of them -------------------------------------------------------------------------------

// Of a glTF file: header and JSON.
static size_t fixed_bytes(const uint8_t *data, size_t size)
{
    if (size < 28 || memcmp(data, "glTF", 4) != 0)
        return 0;
    struct hg_reader r = hg_reader_make(data + 12, 4);
    const size_t json = hg_read_u32(&r);
    return json < size - 28 ? 28 + json : 0;
}

static size_t read_seeds(const char *folder, struct seed *seeds)
{
    size_t count = 0;
    DIR *dir = opendir(folder);
    for (struct dirent *entry; dir && count < MOST_FILES && (entry = readdir(dir));) {
        struct seed *s = &seeds[count];
        char path[1024];
        struct hg_error err = {0};
        snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        snprintf(s->name, sizeof s->name, "%.255s", entry->d_name);
        if (entry->d_name[0] == '.' ||
            hg_file_read(path, (1 << 20) - ROOM, &s->data, &s->size, &err) != HG_OK)
            continue;
        s->fixed = fixed_bytes(s->data, s->size);
        count++;
    }
    if (dir)
        closedir(dir);
    return count;
}

static size_t make_seeds(struct seed *seeds, size_t room)
{
    size_t count = 0;
    for (; count < FOREIGN_SEEDS && count < room; count++) {
        const struct foreign_seed *from = &foreign_seeds[count];
        struct hg_writer w = {0};
        struct hg_error err = {0};
        from->write(&w);
        struct seed *s = &seeds[count];
        *s = (struct seed){.data = w.data, .size = w.size};
        snprintf(s->name, sizeof s->name, "%s", from->name);
        if (read_mutant(&(struct mutant){s->name, s->data, s->size}, &err)) {
            fprintf(stderr, "%s: %s\n", s->name, err.reason);
            FUZZ_CHECK(!"a seed is not read as it is");
        }
    }
    return count;
}

// The number to go on with, `first` at the beginning; the last line of a name counts.
static uint64_t find_progress(const char *state, const char *name, uint64_t first)
{
    uint64_t next = first;
    char line[400], found[256];
    unsigned long long number;
    FILE *file = state ? fopen(state, "r") : NULL;
    while (file && fgets(line, sizeof line, file))
        if (sscanf(line, "%255s %llu", found, &number) == 2 && strcmp(found, name) == 0)
            next = number;
    if (file)
        fclose(file);
    return next;
}

static void note_progress(const char *state, const char *name, uint64_t next)
{
    FILE *file = state ? fopen(state, "a") : NULL;
    if (!file)
        return;
    fprintf(file, "%s %llu\n", name, (unsigned long long)next);
    fclose(file);
}

static void run_seed(const struct seed *seed, uint64_t start, uint64_t count, const char *state)
{
    unsigned outcomes[OUTCOMES] = {0};
    const uint64_t first = find_progress(state, seed->name, start);
    for (uint64_t i = first; i < count; i++) {
        outcomes[try_mutant(seed, i)]++;
        if ((i + 1) % 100 == 0 || i + 1 == count)
            note_progress(state, seed->name, i + 1);
    }
    printf(
        "%-12s %llu mutants:", seed->name, (unsigned long long)(count > first ? count - first : 0));
    for (int i = 0; i < OUTCOMES; i++)
        printf(" %u %s%s", outcomes[i], outcome_names[i], i + 1 < OUTCOMES ? "," : "\n");
    fflush(stdout);
}

int main(int argc, char **argv)
{
    static struct seed seeds[MOST_FILES];
    struct hg_error err = {0};
    const struct loader_options options = {.cpu_s = CPU_S,
        .memory_mib = MEMORY_MIB,
        .timeout_s = TIMEOUT_S,
        .sandbox = "require",
        .log = "off"};
    size_t count = argc >= 3 ? read_seeds(argv[1], seeds) : 0;
    if (count == 0 || hg_loader_start(&options, &err) != HG_OK) {
        fprintf(stderr, "fuzz_foreign FOLDER COUNT [STATE [FIRST]]: no files, or no loader: %s\n",
            err.reason);
        return 2;
    }
    spawner = find_spawner();
    count += make_seeds(seeds + count, MOST_FILES - count);
    for (size_t i = 0; i < count; i++) {
        run_seed(&seeds[i], argc > 4 ? strtoull(argv[4], NULL, 10) : 0, strtoull(argv[2], NULL, 10),
            argc > 3 ? argv[3] : NULL);
        hg_free(seeds[i].data);
    }
    printf("%.1f s of processor time\n", seconds_taken());
    return 0;
}
