// image_corpora.c - every file of the image corpora ends in a picture or in an error that names
// the file and the reason: no crash, no hang, no runaway memory.
//   image_corpora ROOT...         all regular files below each folder
//   image_corpora --data NAME...  the same, of folders of the test data
//   image_corpora --dump BITS     decodes the files named on stdin (8 or 16 bit), for pngsuite.py
#include <dirent.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <unistd.h>

#include "renderer/image/image.h"
#include "tests/support/test_data.h"

// Of the processor, not of the clock: a busy machine makes no file slow.
enum { seconds_per_file = 60 };
enum { peak_rss_limit_mib = 1024 };

// 64 Mpx is far above the corpora's honest pictures; what asks for more must be refused by size.
static const struct hg_image_limits limits = {.max_pixels = 1u << 26, .max_bytes = 1u << 28};

static char current[4096];
static unsigned decoded, refused, bad;

static void on_signal(int number)
{
    const char *what = number == SIGPROF ? "too slow: " : "crashed on: ";
    if (write(2, what, strlen(what)) < 0 || write(2, current, strlen(current)) < 0 ||
        write(2, "\n", 1) < 0)
        _exit(3);
    _exit(2);
}

static void complain(const char *what)
{
    fprintf(stderr, "%s: %s\n", current, what);
    bad++;
}

static void try_format(enum hg_pixel_format format)
{
    struct hg_image image;
    struct hg_error err = {0};
    enum hg_status st = hg_image_read_file(current, format, &limits, &image, &err);
    if (st == HG_OK) {
        decoded++;
        size_t want = (size_t)image.width * image.height * hg_pixel_bytes(format);
        if (!image.pixels || image.size_bytes != want || image.format != format)
            complain("decoded, but the picture contradicts itself");
    } else {
        refused++;
        if (image.pixels || image.width)
            complain("refused, but the output is not empty");
        if (!strstr(err.what, current) && strncmp(err.what, current, sizeof err.what - 1) != 0)
            complain("the error does not name the file");
        if (!err.reason[0] || err.status != st)
            complain("the error gives no reason");
        if (st != HG_E_FORMAT && st != HG_E_LIMIT && st != HG_E_UNSUPPORTED)
            complain(hg_status_name(st));
    }
    hg_image_finish(&image);
}

static void check_file(void)
{
    setitimer(ITIMER_PROF, &(struct itimerval){.it_value = {.tv_sec = seconds_per_file}}, NULL);
    try_format(HG_PIXEL_RGBA8);
    try_format(HG_PIXEL_RGBA32F);
    setitimer(ITIMER_PROF, &(struct itimerval){0}, NULL);
}

static void check_tree(const char *path)
{
    struct stat info;
    if (stat(path, &info) != 0)
        return;
    if (S_ISREG(info.st_mode)) {
        snprintf(current, sizeof current, "%s", path);
        check_file();
    }
    DIR *dir = S_ISDIR(info.st_mode) ? opendir(path) : NULL;
    for (struct dirent *e; dir && (e = readdir(dir));) {
        char *below;
        if (e->d_name[0] == '.' || asprintf(&below, "%s/%s", path, e->d_name) < 0)
            continue;
        check_tree(below);
        free(below);
    }
    if (dir)
        closedir(dir);
}

// One record per line of stdin: "ok WIDTH HEIGHT BYTES\n" and the pixels, or "error REASON\n".
static int dump(enum hg_pixel_format format)
{
    while (fgets(current, sizeof current, stdin)) {
        struct hg_image image;
        struct hg_error err = {0};
        current[strcspn(current, "\n")] = 0;
        if (hg_image_read_file(current, format, &limits, &image, &err)) {
            printf("error %s\n", err.reason);
        } else {
            printf("ok %" PRIu32 " %" PRIu32 " %zu\n", image.width, image.height, image.size_bytes);
            fwrite(image.pixels, 1, image.size_bytes, stdout);
        }
        hg_image_finish(&image);
    }
    return ferror(stdout) ? 1 : 0;
}

static void check_root(const char *root)
{
    const unsigned before = decoded + refused;
    check_tree(root);
    printf("%s: %u readings\n", root, decoded + refused - before);
    if (decoded + refused == before) {
        fprintf(stderr, "%s: no files there\n", root);
        bad++;
    }
}

static void check_data(char **names, int count)
{
    for (int i = 0; i < count; i++) {
        const char *root = test_data_find(names[i]);
        if (root)
            check_root(root);
        else if (test_data_is_required())
            bad++;
    }
}

int main(int argc, char **argv)
{
    if (argc == 3 && strcmp(argv[1], "--dump") == 0)
        return dump(strcmp(argv[2], "16") == 0 ? HG_PIXEL_RGBA16 : HG_PIXEL_RGBA8);
    signal(SIGPROF, on_signal);
#ifndef __SANITIZE_ADDRESS__
    signal(SIGSEGV, on_signal);
    signal(SIGABRT, on_signal);
#endif
    if (argc > 1 && strcmp(argv[1], "--data") == 0) {
        check_data(argv + 2, argc - 2);
        if (!bad && !decoded && !refused)
            return TEST_SKIPPED;
    } else {
        for (int i = 1; i < argc; i++)
            check_root(argv[i]);
    }
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    long peak_mib = usage.ru_maxrss / 1024;
    printf("%u decoded, %u refused, %u wrong, peak %ld MiB\n", decoded, refused, bad, peak_mib);
    if (peak_mib > peak_rss_limit_mib) {
        fprintf(stderr, "peak memory is above %d MiB\n", peak_rss_limit_mib);
        bad++;
    }
    return bad || argc < 2 ? 1 : 0;
}
