// replay - runs a fuzz harness without libFuzzer.
//
//   fuzz_NAME CORPUS_FOLDER [SECONDS]   every file, then mutations of the files for so long
//   fuzz_NAME FILE                      one input
//
// The mutations follow from the corpus alone, so a failure comes back at the same number. The
// failing input is left in the file fuzz-failure.bin of the working folder.
#include <dirent.h>
#include <fcntl.h>
#include <signal.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/alloc.h"
#include "tests/fuzz/fuzz.h"

enum { MAX_INPUTS = 4096, MAX_INPUT_BYTES = 1 << 20, MAX_MUTATIONS = 400000, SLOW_SECONDS = 10 };

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
static char running_text[400];

void __sanitizer_set_death_callback(void (*callback)(void)) __attribute__((weak));

static void report(void)
{
    ssize_t n = write(2, running_text, strlen(running_text));
    int fd = open("fuzz-failure.bin", O_WRONLY | O_CREAT | O_TRUNC, 0644);
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

static void watch_crashes(void)
{
    static const int signals[] = {SIGABRT, SIGSEGV, SIGBUS, SIGFPE, SIGILL};
    if (__sanitizer_set_death_callback)
        __sanitizer_set_death_callback(report);
    for (size_t i = 0; i < sizeof signals / sizeof *signals; i++)
        if (i == 0 || !__sanitizer_set_death_callback)
            signal(signals[i], on_signal);
}

// Runs a copy in a block of exactly its size.
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
    uint64_t begin = hg_clock_now_ns();
    LLVMFuzzerTestOneInput(copy, size);
    FUZZ_CHECK(hg_clock_now_ns() - begin < SLOW_SECONDS * UINT64_C(1000000000));
    free(copy);
}

// ---- mutations ---------------------------------------------------------------------------------

// xorshift64* (Vigna 2016): small, and the same everywhere.
static uint64_t random_state = 0x9e3779b97f4a7c15u;

static uint64_t random_u64(void)
{
    random_state ^= random_state >> 12;
    random_state ^= random_state << 25;
    random_state ^= random_state >> 27;
    return random_state * 0x2545f4914f6cdd1du;
}

static size_t random_below(size_t n)
{
    return n ? (size_t)(random_u64() % n) : 0;
}

static void put_number(uint8_t *data, size_t size)
{
    static const uint64_t numbers[] = {0, 1, 2, 0x7f, 0x80, 0xff, 0x100, 0x7fff, 0x8000, 0xffff,
        0x10000, 0x7fffffff, 0x80000000, 0xffffffff, 0x7fc00000, 0x7f800000, UINT64_MAX};
    static const size_t widths[] = {1, 2, 4, 8};
    uint64_t value = numbers[random_below(sizeof numbers / sizeof *numbers)];
    size_t width = widths[random_below(4)];
    size_t at = random_below(size);
    for (size_t i = 0; i < width && at + i < size; i++)
        data[at + i] = (uint8_t)(value >> (8 * i));
}

// Takes a piece of another input in between.
static size_t insert_piece(uint8_t *data, size_t size)
{
    const struct input *other = &inputs[random_below(input_count)];
    size_t from = random_below(other->size), count = 1 + random_below(other->size - from);
    size_t at = random_below(size + 1);
    if (!other->size || count > MAX_INPUT_BYTES - size)
        return size;
    memmove(data + at + count, data + at, size - at);
    memcpy(data + at, other->data + from, count);
    return size + count;
}

static size_t cut(uint8_t *data, size_t size)
{
    size_t at = random_below(size), count = 1 + random_below(size - at < 64 ? size - at : 64);
    if (at + count > size)
        return at;
    memmove(data + at, data + at + count, size - at - count);
    return size - count;
}

static size_t mutate(uint8_t *data, size_t size)
{
    for (size_t steps = 1 + random_below(4); steps && size; steps--) {
        switch (random_below(6)) {
        case 0:
            data[random_below(size)] ^= (uint8_t)(1u << random_below(8));
            break;
        case 1:
            data[random_below(size)] = (uint8_t)random_u64();
            break;
        case 2:
        case 3:
            put_number(data, size);
            break;
        case 4:
            size = insert_piece(data, size);
            break;
        default:
            size = cut(data, size);
        }
    }
    return size;
}

static unsigned long run_mutations(double seconds)
{
    static uint8_t buffer[MAX_INPUT_BYTES];
    uint64_t end = hg_clock_now_ns() + (uint64_t)(seconds * 1e9);
    unsigned long n = 0;
    for (; n < MAX_MUTATIONS && hg_clock_now_ns() < end; n++) {
        const struct input *in = &inputs[n % input_count];
        if (in->size)
            memcpy(buffer, in->data, in->size);
        run(in->name, n + 1, buffer, mutate(buffer, in->size));
    }
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
    watch_crashes();
    run("an empty input", 0, NULL, 0);
    for (size_t i = 0; i < input_count; i++)
        run(inputs[i].name, 0, inputs[i].data, inputs[i].size);
    unsigned long mutations = folder ? run_mutations(argc == 3 ? strtod(argv[2], NULL) : 3) : 0;
    printf("%zu inputs, %lu mutations\n", input_count, mutations);
    for (size_t i = 0; i < input_count; i++)
        hg_free(inputs[i].data);
    return 0;
}
