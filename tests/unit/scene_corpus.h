// scene_corpus.h - walking folders of the test data.
#ifndef HG_TESTS_SCENE_CORPUS_H
#define HG_TESTS_SCENE_CORPUS_H

#include <ftw.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "renderer/scene/load.h"
#include "tests/support/test_data.h"

enum { CORPUS_MAX = 4096 };

struct corpus {
    char *files[CORPUS_MAX];
    size_t count;
};

static struct corpus *corpus_now;

static inline int corpus_visit(
    const char *path, const struct stat *info, int kind, struct FTW *walk)
{
    (void)info;
    (void)walk;
    size_t n = strlen(path);
    bool wanted = (n > 5 && strcmp(path + n - 5, ".gltf") == 0) ||
                  (n > 4 && strcmp(path + n - 4, ".glb") == 0);
    if (kind == FTW_F && wanted && corpus_now->count < CORPUS_MAX)
        corpus_now->files[corpus_now->count++] = strdup(path);
    return 0;
}

static inline int corpus_compare(const void *a, const void *b)
{
    return strcmp(*(char *const *)a, *(char *const *)b);
}

// All glTF files below a folder of the test data, sorted; ends the test when it is missing.
static inline void corpus_collect(struct corpus *corpus, const char *relative)
{
    corpus->count = 0;
    corpus_now = corpus;
    nftw(test_data(relative), corpus_visit, 16, FTW_PHYS);
    qsort(corpus->files, corpus->count, sizeof *corpus->files, corpus_compare);
}

static inline void corpus_finish(struct corpus *corpus)
{
    for (size_t i = 0; i < corpus->count; i++)
        free(corpus->files[i]);
    corpus->count = 0;
}

static inline enum hg_status corpus_load(
    const char *path, struct hg_asset **out, struct hg_error *err)
{
    memset(err, 0, sizeof *err);
    struct hg_load_params params = {
        .path = path, .asset_number = 1, .scene_index = -1, .memory_limit_bytes = 2ull << 30};
    return hg_load_asset(&params, out, err);
}

#endif
