// checkpoint.c - checkpoints: the film between two waves.
//
// Neither an unfinished wave nor samples in the splat ring are saved: their paths are traced again
// with the same result. Layout: struct header, samples of tiles (u32), done (u8), film (f32);
// little endian, as all supported hosts.
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
    uint8_t body[HG_SHA256_BYTES];        // of the data after the header
};

static void note_scene(const struct hg_path *p, struct header *h)
{
    struct hg_geometry_stats stats;
    hg_geometry_stats(p->scene_gpu->geometry, &stats);
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
    memcpy(at, p->film.samples.mapped, (size_t)p->film.tile_count * 4);
    at += (size_t)p->film.tile_count * 4;
    memcpy(at, p->progress.done, p->film.tile_count);
    at += p->film.tile_count;
    memcpy(at, film, (size_t)h->channels * h->width * h->height * sizeof(float));
    enum hg_status status = hg_sha256(to + sizeof *h, body_bytes(h), h->body);
    memcpy(to, h, sizeof *h);
    return status == HG_OK ? status
                           : hg_error_set(err, status, "checkpoint", NULL, "cannot be hashed");
}

enum hg_status hg_path_save(struct hg_path *p, const struct hg_path_identity *identity,
    struct hg_refbuf **out, struct hg_error *err)
{
    const float *film;
    *out = NULL;
    if (!hg_path_has_film(p))
        return hg_error_set(err, HG_E_STATE, "view", NULL, "nothing was path-traced yet");
    struct header h = {.version = VERSION,
        .header_bytes = sizeof h,
        .width = p->film.width,
        .height = p->film.height,
        .channels = p->film.channels,
        .tile_count = p->film.tile_count,
        .pass = p->progress.pass,
        .next_row = p->progress.next_row,
        .finished = p->progress.finished,
        .noise = p->progress.noise,
        .spent_ns = p->progress.spent_ns};
    memcpy(h.magic, MAGIC, sizeof h.magic);
    note_scene(p, &h);
    memcpy(h.state, identity->state, sizeof h.state);
    enum hg_status status =
        hg_path_film_fetch(p->context->gpu, &p->film, p->film.channels, &film, err);
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

static enum hg_status bad(struct hg_error *err, const char *why)
{
    return hg_error_set(err, HG_E_INVAL, "checkpoint", NULL, "%s", why);
}

static enum hg_status check(const struct hg_path_identity *identity,
    const struct hg_path_checkpoint *c, const struct header *h, struct hg_error *err)
{
    uint8_t hash[HG_SHA256_BYTES];
    const uint8_t *data = c->data;
    const uint32_t columns = (h->width + HG_PATH_TILE_SIDE - 1) / HG_PATH_TILE_SIDE;
    const uint32_t rows = (h->height + HG_PATH_TILE_SIDE - 1) / HG_PATH_TILE_SIDE;
    if (memcmp(h->magic, MAGIC, sizeof h->magic) != 0 || h->version != VERSION ||
        h->header_bytes != sizeof *h)
        return bad(err, "is none, or of another version");
    if (h->width != c->width || h->height != c->height || h->tile_count != columns * rows ||
        h->channels < HG_PATH_FILM_WORDS || h->channels > 256)
        return bad(err, "is of another size");
    if (c->size_bytes != sizeof *h + body_bytes(h))
        return bad(err, "is cut off");
    enum hg_status status = hg_sha256(data + sizeof *h, body_bytes(h), hash);
    if (status != HG_OK)
        return status;
    if (memcmp(hash, h->body, sizeof hash) != 0)
        return bad(err, "is damaged");
    return memcmp(identity->state, h->state, sizeof h->state) == 0
               ? HG_OK
               : bad(err, "is of another camera or other parameters");
}

enum hg_status hg_path_load(struct hg_path *p, const struct hg_path_identity *identity,
    const struct hg_path_checkpoint *checkpoint, struct hg_error *err)
{
    const size_t size = (size_t)checkpoint->size_bytes;
    struct header h;
    if (checkpoint->data == NULL || size < sizeof h)
        return bad(err, "is cut off");
    memcpy(&h, checkpoint->data, sizeof h);
    enum hg_status status = check(identity, checkpoint, &h, err);
    if (status != HG_OK)
        return status;
    uint8_t *kept = hg_calloc(1, size);
    if (kept == NULL)
        return hg_error_set(err, HG_E_NOMEM, "checkpoint", NULL, "out of host memory");
    memcpy(kept, checkpoint->data, size);
    hg_free(p->resume.data);
    p->resume.data = kept;
    p->resume.identity = *identity;
    return HG_OK;
}

void hg_path_expect(struct hg_path *p, const struct hg_path_identity *identity)
{
    p->resume.expected = *identity;
}

static enum hg_status restore(
    struct hg_path *p, const struct header *h, const uint8_t *at, struct hg_error *err)
{
    const struct hg_path_film *f = &p->film;
    memcpy(f->samples.mapped, at, (size_t)f->tile_count * 4);
    at += (size_t)f->tile_count * 4;
    memcpy(p->progress.done, at, f->tile_count);
    at += f->tile_count;
    p->progress.pass = h->pass;
    // Samples of the row in front are traced again for those behind, and not added again.
    p->progress.next_row = h->next_row;
    p->progress.next_tile = (h->next_row > 0 ? h->next_row - 1 : 0) * f->columns;
    p->progress.finished = h->finished != 0;
    p->progress.noise = h->noise;
    p->progress.spent_ns = h->spent_ns;
    p->progress.unshown = true;
    p->progress.changes++;
    return hg_gpu_buffer_upload(p->context->gpu, &p->film.sums, 0, at,
        (uint64_t)h->channels * h->width * h->height * sizeof(float), err);
}

enum hg_status hg_path_resume(struct hg_path *p, struct hg_error *err)
{
    struct header h, scene = {0};
    uint8_t *kept = p->resume.data;
    if (kept == NULL)
        return HG_OK;
    p->resume.data = NULL; // is used once
    if (memcmp(&p->resume.expected, &p->resume.identity, sizeof p->resume.identity) != 0) {
        hg_free(kept); // later state is rebuilt from the film
        return HG_OK;
    }
    memcpy(&h, kept, sizeof h);
    note_scene(p, &scene);
    enum hg_status status = HG_OK;
    if (h.triangles != scene.triangles || h.draws != scene.draws ||
        h.materials != scene.materials || h.channels != p->film.channels)
        status = bad(err, "is of another scene");
    if (status == HG_OK)
        status = restore(p, &h, kept + sizeof h, err);
    hg_free(kept);
    return status;
}
