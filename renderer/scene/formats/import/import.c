#include "renderer/scene/formats/import/import.h"

#include <assimp/cfileio.h>
#include <assimp/cimport.h>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <zlib.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "base/log.h"
#include "base/spill.h"
#include "renderer/scene/formats/import/collada_text.h"
#include "renderer/scene/formats/text_scan.h"

static const struct {
    const char *ending, *format;
} formats[] = {{".fbx", "fbx"}, {".dae", "collada"}};

static const char *format_of(const char *path)
{
    size_t n = strlen(path);
    if (n > 3 && strcasecmp(path + n - 3, ".gz") == 0)
        n -= 3;
    for (size_t i = 0; i < sizeof formats / sizeof *formats; i++)
        if (n >= 4 && strncasecmp(path + n - 4, formats[i].ending, 4) == 0)
            return formats[i].format;
    return NULL;
}

bool hg_import_knows(const char *path)
{
    return format_of(path) != NULL;
}

void *hg_import_alloc(struct hg_import *im, uint64_t count, size_t size)
{
    uint64_t bytes, total;
    void *memory = NULL;
    if (!hg_mul_u64(count, size, &bytes) || !hg_add_u64(im->memory_used, bytes, &total) ||
        total > im->memory_limit)
        (void)hg_import_fail(im, HG_E_LIMIT, NULL, "the asset passes the memory limit");
    else if (!(memory = hg_spill_calloc((size_t)count, size)))
        (void)hg_import_fail(im, HG_E_NOMEM, NULL, "no memory");
    else
        im->memory_used = total;
    return memory;
}

enum hg_status hg_import_fail(
    struct hg_import *im, enum hg_status status, const char *where, const char *reason)
{
    return hg_error_set(im->err, status, im->file, where, "%s", reason);
}

// ---- files -------------------------------------------------------------------------------------

// An open file: bytes in memory and a position.
struct open_file {
    struct aiFile api;
    struct hg_refbuf *data;
    size_t pos;
};

struct file_system {
    struct aiFileIO api;
    struct hg_import *im;
    const struct hg_refbuf *main;
};

static size_t file_read(struct aiFile *file, char *out, size_t size, size_t count)
{
    struct open_file *f = (struct open_file *)file->UserData;
    size_t left = size ? (f->data->size - f->pos) / size : 0, n = count < left ? count : left;
    memcpy(out, f->data->data + f->pos, n * size);
    f->pos += n * size;
    return n;
}

static size_t file_write(struct aiFile *file, const char *data, size_t size, size_t count)
{
    (void)file;
    (void)data;
    (void)size;
    (void)count;
    return 0;
}

static size_t file_tell(struct aiFile *file)
{
    return ((struct open_file *)file->UserData)->pos;
}

static size_t file_size(struct aiFile *file)
{
    return ((struct open_file *)file->UserData)->data->size;
}

static enum aiReturn file_seek(struct aiFile *file, size_t offset, enum aiOrigin origin)
{
    struct open_file *f = (struct open_file *)file->UserData;
    size_t base = origin == aiOrigin_SET ? 0 : origin == aiOrigin_CUR ? f->pos : f->data->size;
    size_t target;
    if (origin == aiOrigin_END && offset <= base)
        target = base - offset; // assimp counts backwards from the end
    else if (!hg_add_size(base, offset, &target) || target > f->data->size)
        return aiReturn_FAILURE;
    f->pos = target;
    return aiReturn_SUCCESS;
}

static void file_flush(struct aiFile *file)
{
    (void)file;
}

static struct aiFile *open_file(struct aiFileIO *io, const char *name, const char *mode)
{
    struct file_system *fs = (struct file_system *)io->UserData;
    while (strncmp(name, "./", 2) == 0)
        name += 2;
    if (!strchr(mode, 'r'))
        return NULL;
    // FBX and Collada keep their geometry in one file; images are fetched later, and not by assimp.
    struct open_file *f = strcmp(name, fs->im->file) == 0 ? hg_calloc(1, sizeof *f) : NULL;
    if (!f)
        return NULL;
    f->data = hg_refbuf_ref((struct hg_refbuf *)fs->main);
    f->api = (struct aiFile){.ReadProc = file_read,
        .WriteProc = file_write,
        .TellProc = file_tell,
        .FileSizeProc = file_size,
        .SeekProc = file_seek,
        .FlushProc = file_flush,
        .UserData = (char *)f};
    return &f->api;
}

static void close_file(struct aiFileIO *io, struct aiFile *file)
{
    (void)io;
    struct open_file *f = (struct open_file *)file->UserData;
    hg_refbuf_unref(f->data);
    hg_free(f);
}

// ---- gzip --------------------------------------------------------------------------------------

// The size a gzip file says it holds, modulo 2^32 (RFC 1952).
static uint64_t gzip_size(const struct hg_refbuf *in)
{
    const uint8_t *p = in->data + in->size - 4;
    return (uint64_t)p[0] | (uint64_t)p[1] << 8 | (uint64_t)p[2] << 16 | (uint64_t)p[3] << 24;
}

enum hg_status hg_import_gunzip(const struct hg_refbuf *in, uint64_t limit_bytes, const char *label,
    struct hg_refbuf **out, struct hg_error *err)
{
    *out = NULL;
    if (in->size < 18 || in->size > UINT32_MAX)
        return hg_error_set(err, HG_E_FORMAT, label, "byte 0", "not a gzip file");
    uint64_t size = gzip_size(in);
    if (size > limit_bytes)
        return hg_error_set(err, HG_E_LIMIT, label, NULL, "%llu bytes unpacked pass the limit",
            (unsigned long long)size);
    struct hg_refbuf *buf = hg_refbuf_create_spilled((size_t)size);
    if (!buf)
        return hg_error_set(err, HG_E_NOMEM, label, NULL, "no memory");
    z_stream z = {.next_in = (Bytef *)in->data,
        .avail_in = (uInt)in->size,
        .next_out = buf->data,
        .avail_out = (uInt)size};
    int rc = inflateInit2(&z, 15 + 16);
    if (rc == Z_OK) {
        rc = inflate(&z, Z_FINISH);
        inflateEnd(&z);
    }
    if (rc != Z_STREAM_END || z.total_out != size) {
        hg_refbuf_unref(buf);
        return hg_error_set(err, HG_E_FORMAT, label, NULL, "the gzip data is damaged");
    }
    *out = buf;
    return HG_OK;
}

// ---- loading -----------------------------------------------------------------------------------

static const unsigned process_flags = aiProcess_Triangulate | aiProcess_SortByPType |
                                      aiProcess_JoinIdenticalVertices | aiProcess_LimitBoneWeights |
                                      aiProcess_FlipUVs | aiProcess_FindInvalidData |
                                      aiProcess_GlobalScale;

// FBX files state centimetres and which axis is up; assimp scales, the axis is ours to turn.
static void turn_up_axis(struct hg_import *im)
{
    int up = 1;
    const struct aiMetadata *meta = im->scene->mMetaData;
    for (unsigned i = 0; meta && i < meta->mNumProperties; i++)
        if (strcmp(meta->mKeys[i].data, "UpAxis") == 0 && meta->mValues[i].mType == AI_INT32)
            memcpy(&up, meta->mValues[i].mData, sizeof up);
    if (up != 2 || strcmp(im->asset->file.format, "fbx") != 0 || im->asset->root_count == 0)
        return;
    struct hg_node *root = im->asset->roots[0];
    const float z_up[16] = {1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1};
    float turned[16];
    for (int c = 0; c < 4; c++)
        for (int r = 0; r < 4; r++) {
            turned[c * 4 + r] = 0;
            for (int k = 0; k < 4; k++)
                turned[c * 4 + r] += z_up[k * 4 + r] * root->matrix[c * 4 + k];
        }
    memcpy(root->matrix, turned, sizeof turned);
}

static enum hg_status convert(struct hg_import *im)
{
    static enum hg_status (*const steps[])(struct hg_import *) = {
        hg_import_materials, hg_import_nodes, hg_import_meshes, hg_import_animations};
    static const char *const names[] = {"materials", "nodes", "meshes", "animations"};
    for (size_t i = 0; i < sizeof steps / sizeof *steps; i++) {
        if (im->params->progress &&
            !im->params->progress(im->params->progress_user, names[i], i, 4))
            return hg_import_fail(im, HG_E_CANCELLED, NULL, "cancelled");
        enum hg_status status = steps[i](im);
        if (status)
            return status;
    }
    hg_import_light_units(im);
    turn_up_axis(im);
    return hg_asset_make_names_utf8(im->asset) ? HG_OK
                                               : hg_import_fail(im, HG_E_NOMEM, NULL, "no memory");
}

static const struct aiScene *run_assimp(struct hg_import *im, const struct hg_refbuf *main)
{
    struct file_system fs = {.im = im, .main = main};
    fs.api =
        (struct aiFileIO){.OpenProc = open_file, .CloseProc = close_file, .UserData = (char *)&fs};
    struct aiPropertyStore *properties = aiCreatePropertyStore();
    aiSetImportPropertyInteger(properties, AI_CONFIG_PP_LBW_MAX_WEIGHTS, 4);
    aiSetImportPropertyInteger(properties, AI_CONFIG_IMPORT_FBX_PRESERVE_PIVOTS, 0);
    const struct aiScene *scene =
        aiImportFileExWithProperties(im->file, process_flags, &fs.api, properties);
    aiReleasePropertyStore(properties);
    return scene;
}

// ---- what cannot be read -----------------------------------------------------------------------

static bool contains(const struct hg_refbuf *data, size_t within, const char *text)
{
    return memmem(data->data, data->size < within ? data->size : within, text, strlen(text)) !=
           NULL;
}

// The version of an FBX file times 1000; 0: it is none.
static unsigned fbx_version(const struct hg_refbuf *data)
{
    static const char magic[] = "Kaydara FBX Binary  ", key[] = "FBXVersion:";
    const uint8_t *p = data->data, *end = p + data->size;
    if (data->size >= 27 && memcmp(p, magic, sizeof magic - 1) == 0)
        return (unsigned)p[23] | (unsigned)p[24] << 8 | (unsigned)p[25] << 16;
    p = memmem(p, data->size, key, sizeof key - 1);
    if (!p)
        return 0;
    struct hg_text text = {(const char *)p + sizeof key - 1, (const char *)end};
    double version = 0;
    return hg_text_number(&text, &version) && version > 0 && version < 1e6 ? (unsigned)version : 0;
}

// Why assimp gave up, in words for the author of the file; its own go to the log.
static enum hg_status refuse(struct hg_import *im, const struct hg_refbuf *main)
{
    const bool collada = strcmp(im->asset->file.format, "collada") == 0;
    const unsigned fbx = collada ? 0 : fbx_version(main);
    const char *words = aiGetErrorString();
    hg_info(SCENE, "%s: assimp: %s", im->file, words);
    if (collada && !contains(main, 4096, "<COLLADA"))
        return hg_import_fail(im, HG_E_FORMAT, NULL, "not a Collada file: there is no <COLLADA>");
    if (collada && (main->size < 10 || memcmp(main->data + main->size - 10, "</COLLADA>", 10) != 0))
        return hg_import_fail(
            im, HG_E_FORMAT, NULL, "the file is cut off: it does not end with </COLLADA>");
    if (!collada && fbx == 0)
        return hg_import_fail(im, HG_E_FORMAT, NULL, "not an FBX file: it has no version");
    if (!collada && fbx < 7100)
        return hg_error_set(im->err, HG_E_UNSUPPORTED, im->file, NULL,
            "FBX of version %u.%u: 7.1 (2011) and later are read", fbx / 1000, fbx / 100 % 10);
    if (strcasestr(words, "no mesh") || strcasestr(words, "no faces") ||
        strcasestr(words, "meshes remaining"))
        return hg_import_fail(im, HG_E_FORMAT, NULL, "the file has no geometry");
    return hg_import_fail(im, HG_E_FORMAT, NULL,
        collada ? "the Collada file is damaged, or has elements where they do not belong"
                : "the FBX file is damaged");
}

static enum hg_status check_content(struct hg_import *im)
{
    const struct hg_asset *a = im->asset;
    for (uint32_t m = 0; m < a->mesh_count; m++)
        if (a->meshes[m]->parts->index_count)
            return HG_OK;
    if (a->light_count || a->camera_count || a->animation_count)
        return HG_OK; // of use together with other files
    return hg_import_fail(
        im, HG_E_FORMAT, NULL, "the file has no geometry, no lights, no cameras and no animations");
}

static enum hg_status import_text(struct hg_import *im, const struct hg_refbuf *main)
{
    const struct hg_text text = {(const char *)main->data, (const char *)main->data + main->size};
    if (strcmp(im->asset->file.format, "collada") == 0 &&
        !hg_collada_read_cameras(text, &im->cameras))
        return hg_import_fail(im, HG_E_NOMEM, NULL, "no memory for its cameras");
    im->scene = run_assimp(im, main);
    im->states_sides = contains(main, main->size, "<double_sided>0</double_sided>");
    enum hg_status status = im->scene ? convert(im) : refuse(im, main);
    if (!status)
        status = check_content(im);
    if (im->scene)
        aiReleaseImport(im->scene);
    hg_collada_cameras_finish(&im->cameras);
    return status;
}

enum hg_status hg_import_parse(const struct hg_load_params *params, const struct hg_refbuf *main,
    const char *label, struct hg_asset **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_import im = {.params = params, .err = err, .file = label};
    im.memory_limit = params->memory_limit_bytes;
    im.memory_used = main->size;
    im.asset = hg_asset_create(params->asset_number, label);
    if (!im.asset)
        return hg_import_fail(&im, HG_E_NOMEM, NULL, "no memory");
    snprintf(im.asset->file.format, sizeof im.asset->file.format, "%s", format_of(label));
    struct hg_refbuf *clean = NULL;
    enum hg_status status = HG_OK;
    if (strcmp(im.asset->file.format, "collada") == 0)
        status = hg_collada_clean(main, im.memory_limit - im.memory_used, label, &clean, err);
    if (!status)
        status = import_text(&im, clean ? clean : main);
    hg_refbuf_unref(clean);
    if (status)
        hg_asset_destroy(im.asset);
    else
        *out = im.asset;
    return status;
}
