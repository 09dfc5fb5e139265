// oiio_module.c - loads the module and passes calls on to it: see oiio_module.h.
#include "renderer/image/oiio_module.h"

#include <dlfcn.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>

#include "base/program.h"

static pthread_once_t once = PTHREAD_ONCE_INIT;
static const struct hg_oiio_functions *functions; // NULL: the module cannot be loaded
static char reason[512];

static pthread_once_t path_once = PTHREAD_ONCE_INIT;
static char module_path[4096];

static void find_path(void)
{
    hg_program_prefix_path("libexec/helio-openimageio.so", module_path, sizeof module_path);
}

const char *hg_image_module_path(void)
{
    pthread_once(&path_once, find_path);
    return module_path;
}

static const struct hg_oiio_functions *attach(void *module)
{
    static const struct hg_oiio_host host = {hg_error_set, hg_write_bytes};
    void *symbol = dlsym(module, HG_OIIO_ATTACH);
    hg_oiio_attach_fn *fn;
    if (!symbol)
        return NULL;
    memcpy(&fn, &symbol, sizeof fn); // C has no conversion from objects to functions
    return fn(&host, sizeof *functions);
}

static void load(void)
{
    void *module = dlopen(hg_image_module_path(), RTLD_LAZY | RTLD_LOCAL);
    if (module)
        functions = attach(module);
    if (!functions)
        snprintf(reason, sizeof reason, "%s", module ? "it is of another build" : dlerror());
}

static const struct hg_oiio_functions *loaded(const char *what, struct hg_error *err)
{
    pthread_once(&once, load);
    if (!functions)
        hg_error_set(err, HG_E_UNSUPPORTED, what, NULL,
            "the module that reads and writes images cannot be loaded: %s", reason);
    return functions;
}

enum hg_status hg_image_load_module(struct hg_error *err)
{
    return loaded("helio-openimageio.so", err) ? HG_OK : HG_E_UNSUPPORTED;
}

// ---- oiio.h: objects there are made by the module, so it is loaded ------------------------------

enum hg_status hg_oiio_open(FILE *file, const struct hg_image_bytes *bytes, const char *format,
    bool large, struct hg_oiio_input **out, struct hg_error *err)
{
    *out = NULL;
    const struct hg_oiio_functions *f = loaded(bytes->name, err);
    return f ? f->open(file, bytes, format, large, out, err) : HG_E_UNSUPPORTED;
}

void hg_oiio_close(struct hg_oiio_input *input)
{
    if (input)
        functions->close(input);
}

const char *hg_oiio_name(const struct hg_oiio_input *input)
{
    return functions->name(input);
}

const struct hg_oiio_header *hg_oiio_get_header(const struct hg_oiio_input *input)
{
    return functions->get_header(input);
}

enum hg_status hg_oiio_part_header(
    struct hg_oiio_input *input, int part, struct hg_oiio_header *out, struct hg_error *err)
{
    return functions->part_header(input, part, out, err);
}

bool hg_oiio_mip_size(struct hg_oiio_input *input, uint32_t mip, uint32_t size_px[2])
{
    return functions->mip_size(input, mip, size_px);
}

enum hg_status hg_oiio_read_text(struct hg_oiio_input *input, const char *key, char *text,
    size_t size_bytes, struct hg_error *err)
{
    return functions->read_text(input, key, text, size_bytes, err);
}

enum hg_status hg_oiio_read_image(struct hg_oiio_input *input, int part,
    const struct hg_oiio_target *target, struct hg_error *err)
{
    return functions->read_image(input, part, target, err);
}

enum hg_status hg_oiio_read_rows(struct hg_oiio_input *input, int part, uint32_t y, uint32_t count,
    const struct hg_oiio_target *target, struct hg_error *err)
{
    return functions->read_rows(input, part, y, count, target, err);
}

enum hg_status hg_oiio_read_tiles(struct hg_oiio_input *input, const struct hg_image_rect *area,
    const struct hg_oiio_target *target, struct hg_error *err)
{
    return functions->read_tiles(input, area, target, err);
}

enum hg_status hg_oiio_encode_image(
    const struct hg_oiio_encode *image, struct hg_writer *out, struct hg_error *err)
{
    const struct hg_oiio_functions *f = loaded(image->name, err);
    return f ? f->encode_image(image, out, err) : HG_E_UNSUPPORTED;
}

// ---- writer.h ----------------------------------------------------------------------------------

enum hg_status hg_image_writer_begin(
    const struct hg_image_writer_params *params, struct hg_image_writer **out, struct hg_error *err)
{
    *out = NULL;
    const struct hg_oiio_functions *f = loaded(params->path, err);
    return f ? f->writer_begin(params, out, err) : HG_E_UNSUPPORTED;
}

enum hg_status hg_image_writer_rows(
    struct hg_image_writer *writer, uint32_t count, const void *pixels, struct hg_error *err)
{
    return functions->writer_rows(writer, count, pixels, err);
}

enum hg_status hg_image_writer_tile(struct hg_image_writer *writer, uint32_t x, uint32_t y,
    const void *pixels, struct hg_error *err)
{
    return functions->writer_tile(writer, x, y, pixels, err);
}

enum hg_status hg_image_writer_next_mip(struct hg_image_writer *writer, struct hg_error *err)
{
    return functions->writer_next_mip(writer, err);
}

enum hg_status hg_image_writer_end(struct hg_image_writer *writer, struct hg_error *err)
{
    return functions->writer_end(writer, err);
}

void hg_image_writer_abort(struct hg_image_writer *writer)
{
    if (writer)
        functions->writer_abort(writer);
}

// ---- texture_system.h --------------------------------------------------------------------------

enum hg_status hg_texture_system_create(
    uint64_t memory_bytes, struct hg_texture_system **out, struct hg_error *err)
{
    *out = NULL;
    const struct hg_oiio_functions *f = loaded("textures", err);
    return f ? f->textures_create(memory_bytes, out, err) : HG_E_UNSUPPORTED;
}

void hg_texture_system_destroy(struct hg_texture_system *system)
{
    if (system)
        functions->textures_destroy(system);
}

enum hg_status hg_texture_system_add(
    struct hg_texture_system *system, const char *path, struct hg_error *err)
{
    return functions->textures_add(system, path, err);
}

bool hg_texture_system_sample(struct hg_texture_system *system, uint32_t texture, float u, float v,
    float footprint, float rgba[4])
{
    return functions->textures_sample(system, texture, u, v, footprint, rgba);
}

uint64_t hg_texture_system_decoded_bytes(const struct hg_texture_system *system)
{
    return functions->textures_decoded_bytes(system);
}

const char *hg_texture_system_version(void)
{
    const struct hg_oiio_functions *f = loaded("textures", NULL);
    return f ? f->textures_version() : "no OpenImageIO";
}
