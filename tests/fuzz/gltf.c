// The glTF 2.0 loader, with a file system that holds one buffer and nothing else.
#include <string.h>

#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/scene.h"

struct files {
    const uint8_t *data;
    size_t size;
    const char *path;
};

static enum hg_status fetch(
    void *user, const char *uri, uint64_t limit_bytes, struct hg_refbuf **out, struct hg_error *err)
{
    const struct files *files = user;
    bool main_file = strcmp(uri, files->path) == 0;
    size_t size = main_file ? files->size : 64;
    *out = NULL;
    if (!main_file && strcmp(uri, "a b.bin") != 0)
        return hg_error_set(err, HG_E_NOTFOUND, uri, NULL, "no such file");
    if (size > limit_bytes)
        return hg_error_set(err, HG_E_LIMIT, uri, NULL, "too large");
    *out = hg_refbuf_create(size);
    if (!*out)
        return hg_error_set(err, HG_E_NOMEM, uri, NULL, "no memory");
    if (main_file && size)
        memcpy((*out)->data, files->data, size);
    return HG_OK;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct files files = {data, size, "fuzz.gltf"};
    fuzz_load(&(struct hg_load_params){.path = files.path,
        .fetch = fetch,
        .fetch_user = &files,
        .asset_number = 1,
        .scene_index = -1,
        .memory_limit_bytes = 64 << 20});
    return 0;
}
