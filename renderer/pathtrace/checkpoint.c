// checkpoint.c - checkpoints: the film between two waves.
//
// A wave under way is not kept, nor samples that wait for those of their neighbours: their paths
// are traced again, and bring the same. Layout: struct header, samples of tiles (u32), done (u8),
// film (f32); little endian, as all hosts we run on.
#include <string.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "base/sha256.h"
#include "renderer/pathtrace/path_state.h"

#define MAGIC   "HGPATH01"
#define VERSION 7u

struct header {
    char magic[8];
    uint32_t version, header_bytes;
    uint32_t width, height, channels, tile_count;
    uint32_t pass, next_row, finished;
    float noise;
    uint64_t spent_ns;
    uint64_t triangles, draws, materials; // of the scene
    uint8_t state[HG_SHA256_BYTES];       // of camera and settings
    uint8_t body[HG_SHA256_BYTES];        // of what follows
};

// What the samples depend on, without what only says how many there will be.
static enum hg_status hash_state(const struct hg_view_state *view, uint8_t out[HG_SHA256_BYTES])
{
    struct {
        struct hg_view_settings settings;
        struct hg_view_camera_state camera;
    } state;
    memset(&state, 0, sizeof state);
    memcpy(&state.settings, &view->settings, sizeof state.settings);
    memcpy(&state.camera, &view->camera, sizeof state.camera);
    state.camera.input_seq = 0;
    state.settings.exposure = state.settings.target_ms = 0.0f;
    state.settings.tonemap = 0;
    state.settings.path.time_s = 0.0f;
    return hg_sha256(&state, sizeof state, out);
}

static void note_scene(const struct hg_view_state *view, struct header *h)
{
    struct hg_geometry_stats stats;
    hg_geometry_stats(view->scene_gpu->geometry, &stats);
    h->triangles = stats.triangles_total;
    h->draws = stats.draws;
    h->materials = stats.materials;
}

static size_t body_bytes(const struct header *h)
{
    return (size_t)h->tile_count * 5 + (size_t)h->channels * h->width * h->height * sizeof(float);
}

static enum hg_status write(
    struct hg_path *p, struct header *h, const float *film, uint8_t *to, struct hg_error *err)
{
    uint8_t *at = to + sizeof *h;
    memcpy(at, p->samples.mapped, (size_t)p->tile_count * 4);
    at += (size_t)p->tile_count * 4;
    memcpy(at, p->done, p->tile_count);
    at += p->tile_count;
    memcpy(at, film, (size_t)h->channels * h->width * h->height * sizeof(float));
    enum hg_status status = hg_sha256(to + sizeof *h, body_bytes(h), h->body);
    memcpy(to, h, sizeof *h);
    return status == HG_OK ? status
                           : hg_error_set(err, status, "checkpoint", NULL, "cannot be hashed");
}

enum hg_status hg_path_save(
    struct hg_view_state *view, struct hg_refbuf **out, struct hg_error *err)
{
    struct hg_path *p = view->path;
    const float *film;
    *out = NULL;
    if (view->settings.mode != HG_VIEW_MODE_PATH || p == NULL || p->film.handle == VK_NULL_HANDLE ||
        view->path_begins)
        return hg_error_set(err, HG_E_STATE, "view", NULL, "nothing was path-traced yet");
    struct header h = {.version = VERSION,
        .header_bytes = sizeof h,
        .width = p->width,
        .height = p->height,
        .channels = p->channels,
        .tile_count = p->tile_count,
        .pass = p->pass,
        .next_row = p->next_row,
        .finished = p->finished,
        .noise = p->noise,
        .spent_ns = p->spent_ns};
    memcpy(h.magic, MAGIC, sizeof h.magic);
    note_scene(view, &h);
    enum hg_status status = hash_state(view, h.state);
    if (status == HG_OK)
        status = hg_path_film_fetch(p, p->channels, &film, err);
    if (status != HG_OK)
        return status;
    *out = hg_refbuf_create(sizeof h + body_bytes(&h));
    if (*out == NULL)
        return hg_error_set(err, HG_E_NOMEM, "checkpoint", NULL, "out of host memory");
    status = write(p, &h, film, (*out)->data, err);
    if (status != HG_OK) {
        hg_refbuf_unref(*out);
        *out = NULL;
    }
    return status;
}

// --- loading -------------------------------------------------------------------------------------

// Baked levels may come between loading and the first wave.
static struct hg_view_key key_of(const struct hg_view_state *view)
{
    return (struct hg_view_key){.scene = view->scene_gpu->scene->revision,
        .environment = view->scene_gpu->scene->environment.revision,
        .settings = view->settings_revision,
        .camera = view->camera_revision};
}

static bool is_for_now(const struct hg_view_state *view)
{
    const struct hg_view_key now = key_of(view);
    return memcmp(&now, &view->path_checkpoint_key, sizeof now) == 0;
}

static enum hg_status bad(struct hg_error *err, const char *why)
{
    return hg_error_set(err, HG_E_INVAL, "checkpoint", NULL, "%s", why);
}

static enum hg_status check(const struct hg_view_state *view, const struct header *h,
    const uint8_t *data, uint64_t size, struct hg_error *err)
{
    uint8_t hash[HG_SHA256_BYTES];
    const uint32_t columns = (h->width + HG_PATH_TILE_SIDE - 1) / HG_PATH_TILE_SIDE;
    const uint32_t rows = (h->height + HG_PATH_TILE_SIDE - 1) / HG_PATH_TILE_SIDE;
    if (memcmp(h->magic, MAGIC, sizeof h->magic) != 0 || h->version != VERSION ||
        h->header_bytes != sizeof *h)
        return bad(err, "is none, or of another version");
    if (h->width != view->settings.width || h->height != view->settings.height ||
        h->tile_count != columns * rows || h->channels < HG_PATH_FILM_WORDS || h->channels > 256)
        return bad(err, "is of another size");
    if (size != sizeof *h + body_bytes(h))
        return bad(err, "is cut off");
    enum hg_status status = hg_sha256(data + sizeof *h, body_bytes(h), hash);
    if (status != HG_OK)
        return status;
    if (memcmp(hash, h->body, sizeof hash) != 0)
        return bad(err, "is damaged");
    status = hash_state(view, hash);
    if (status != HG_OK)
        return status;
    return memcmp(hash, h->state, sizeof hash) == 0
               ? HG_OK
               : bad(err, "is of another camera or other parameters");
}

enum hg_status hg_path_load(
    struct hg_view_state *view, const void *data, uint64_t size_bytes, struct hg_error *err)
{
    struct header h;
    if (view->settings.mode != HG_VIEW_MODE_PATH)
        return bad(err, "is for path-traced views");
    if (data == NULL || size_bytes < sizeof h)
        return bad(err, "is cut off");
    memcpy(&h, data, sizeof h);
    enum hg_status status = check(view, &h, data, size_bytes, err);
    if (status != HG_OK)
        return status;
    uint8_t *kept = hg_calloc(1, (size_t)size_bytes);
    if (kept == NULL)
        return hg_error_set(err, HG_E_NOMEM, "checkpoint", NULL, "out of host memory");
    memcpy(kept, data, (size_t)size_bytes);
    hg_free(view->path_checkpoint);
    view->path_checkpoint = kept;
    view->path_checkpoint_key = key_of(view);
    view->path_begins = true; // in the place of what is there
    return HG_OK;
}

enum hg_status hg_path_resume(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    struct header h, scene = {0};
    uint8_t *kept = view->path_checkpoint;
    if (kept == NULL)
        return HG_OK;
    view->path_checkpoint = NULL; // counts once
    if (!is_for_now(view)) {      // what came after it begins anew, as all else does
        hg_free(kept);
        return HG_OK;
    }
    memcpy(&h, kept, sizeof h);
    note_scene(view, &scene);
    enum hg_status status = check(view, &h, kept, sizeof h + body_bytes(&h), err);
    if (status == HG_OK && (h.triangles != scene.triangles || h.draws != scene.draws ||
                               h.materials != scene.materials || h.channels != p->channels))
        status = bad(err, "is of another scene");
    if (status == HG_OK) {
        const uint8_t *at = kept + sizeof h;
        memcpy(p->samples.mapped, at, (size_t)p->tile_count * 4);
        at += (size_t)p->tile_count * 4;
        memcpy(p->done, at, p->tile_count);
        at += p->tile_count;
        status = hg_gpu_buffer_upload(p->context->gpu, &p->film, 0, at,
            (uint64_t)h.channels * h.width * h.height * sizeof(float), err);
        p->pass = h.pass;
        // Samples of the row in front are traced again for those behind, and not added again.
        p->next_row = h.next_row;
        p->next_tile = (h.next_row > 0 ? h.next_row - 1 : 0) * p->columns;
        p->finished = h.finished != 0;
        p->noise = h.noise;
        p->spent_ns = h.spent_ns;
        p->stale = true;
        view->samples = h.pass;
        view->number++;
    }
    hg_free(kept);
    return status;
}
