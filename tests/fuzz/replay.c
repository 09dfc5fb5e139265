// replay - runs a fuzz harness without libFuzzer.
//
//   fuzz_NAME CORPUS_FOLDER [SECONDS]   every file, then mutations of the files for so long
//   fuzz_NAME FILE                      one input
//
// The mutations follow from the corpus and $HELIO_FUZZ_SEED (a number, 0 if absent) alone, so a
// failure comes back at the same number. The failing input is left in the file NAME-failure.bin of
// the working folder.
#include <dirent.h>
#include <fcntl.h>
#include <signal.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "base/file.h"
#include "base/alloc.h"
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/mutate.h"

enum { MAX_INPUTS = 4096, MAX_INPUT_BYTES = 1 << 20, MAX_MUTATIONS = 400000, SLOW_SECONDS = 60 };

struct input {
    char name[256];
    uint8_t *data;
    size_t size;
};

static struct input inputs[MAX_INPUTS];
static size_t input_count;

// What is running now, for the report of a crash.
static const uint8_t *volatile running_data;
static volatile size_t running_size;
static char running_text[400], failure_file[300];

void __sanitizer_set_death_callback(void (*callback)(void)) __attribute__((weak));

static void report(void)
{
    ssize_t n = write(2, running_text, strlen(running_text));
    int fd = open(failure_file, O_WRONLY | O_CREAT | O_TRUNC, 0644);
    if (fd >= 0)
        n = write(fd, running_data, running_size);
    (void)n; // nothing more can be done while crashing
}

static void on_signal(int number)
{
    report();
    signal(number, SIG_DFL);
    raise(number);
}

static void watch_crashes(const char *program)
{
    const char *slash = strrchr(program, '/');
    snprintf(failure_file, sizeof failure_file, "%.200s-failure.bin", slash ? slash + 1 : program);
    static const int signals[] = {SIGABRT, SIGSEGV, SIGBUS, SIGFPE, SIGILL};
    if (__sanitizer_set_death_callback)
        __sanitizer_set_death_callback(report);
    for (size_t i = 0; i < sizeof signals / sizeof *signals; i++)
        if (i == 0 || !__sanitizer_set_death_callback)
            signal(signals[i], on_signal);
}

static double seconds_of(clockid_t clock)
{
    struct timespec t;
    FUZZ_CHECK(clock_gettime(clock, &t) == 0);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

// Runs a copy in a block of exactly its size. The time it may take is processor time: a machine
// that is busy with other things makes no input slow.
static void run(const char *name, unsigned long number, const uint8_t *data, size_t size)
{
    uint8_t *copy = malloc(size ? size : 1);
    FUZZ_CHECK(copy);
    if (size)
        memcpy(copy, data, size);
    running_data = copy;
    running_size = size;
    snprintf(
        running_text, sizeof running_text, "replay: failed on %s, mutation %lu\n", name, number);
    double begin = seconds_of(CLOCK_PROCESS_CPUTIME_ID);
    LLVMFuzzerTestOneInput(copy, size);
    FUZZ_CHECK(seconds_of(CLOCK_PROCESS_CPUTIME_ID) - begin < SLOW_SECONDS);
    free(copy);
}

// ---- mutations ---------------------------------------------------------------------------------

static bool is_same(const struct input *in, const uint8_t *buffer, size_t size)
{
    return size == in->size && (size == 0 || memcmp(buffer, in->data, size) == 0);
}

// Edits a copy of the n-th input, sometimes with a piece of another.
static size_t edit(struct fuzz_random *random, size_t n, uint8_t *buffer)
{
    const struct input *in = &inputs[n], *other = &inputs[fuzz_below(random, input_count)];
    if (in->size)
        memcpy(buffer, in->data, in->size);
    struct fuzz_piece piece = {other->data, other->size};
    return fuzz_mutate(random, buffer, in->size, MAX_INPUT_BYTES, &piece);
}

// An input that nothing changed would be run again for nothing: another try, unless it is empty.
static size_t mutate(struct fuzz_random *random, size_t n, uint8_t *buffer)
{
    size_t size;
    do {
        size = edit(random, n, buffer);
    } while (inputs[n].size && is_same(&inputs[n], buffer, size));
    return size;
}

static unsigned long run_mutations(double seconds)
{
    static uint8_t buffer[MAX_INPUT_BYTES];
    double end = seconds_of(CLOCK_MONOTONIC) + seconds;
    struct fuzz_random random = fuzz_random_start();
    unsigned long n = 0;
    for (; n < MAX_MUTATIONS && seconds_of(CLOCK_MONOTONIC) < end; n++)
        run(inputs[n % input_count].name, n + 1, buffer, mutate(&random, n % input_count, buffer));
    return n;
}

// ---- corpus ------------------------------------------------------------------------------------

static void load(const char *path)
{
    struct hg_error err = {0};
    struct input *in = &inputs[input_count];
    if (input_count == MAX_INPUTS ||
        hg_file_read(path, MAX_INPUT_BYTES, &in->data, &in->size, &err)) {
        fprintf(stderr, "replay: %s: %s\n", path, err.reason);
        exit(1);
    }
    snprintf(in->name, sizeof in->name, "%s", path);
    input_count++;
}

static void load_folder(const char *folder)
{
    struct dirent **entries;
    int count = scandir(folder, &entries, NULL, alphasort);
    for (int i = 0; i < count; i++) {
        char path[1024];
        snprintf(path, sizeof path, "%s/%s", folder, entries[i]->d_name);
        if (entries[i]->d_name[0] != '.')
            load(path);
        free(entries[i]);
    }
    if (count >= 0)
        free(entries);
    if (!input_count) {
        fprintf(stderr, "replay: %s: no corpus\n", folder);
        exit(1);
    }
}

int main(int argc, char **argv)
{
    struct stat st;
    if (argc < 2 || argc > 3 || stat(argv[1], &st) != 0) {
        fprintf(stderr, "usage: %s CORPUS_FOLDER [SECONDS] | FILE\n", argv[0]);
        return 2;
    }
    bool folder = S_ISDIR(st.st_mode);
    (folder ? load_folder : load)(argv[1]);
    watch_crashes(argv[0]);
    run("an empty input", 0, NULL, 0);
    for (size_t i = 0; i < input_count; i++)
        run(inputs[i].name, 0, inputs[i].data, inputs[i].size);
    unsigned long mutations = folder ? run_mutations(argc == 3 ? strtod(argv[2], NULL) : 3) : 0;
    printf("%zu inputs, %lu mutations\n", input_count, mutations);
    for (size_t i = 0; i < input_count; i++)
        hg_free(inputs[i].data);
    return 0;
}
