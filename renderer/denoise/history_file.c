// history_file.c - the memory of a history, saving and loading it. See denoise.h.
#include <string.h>

#include "base/alloc.h"
#include "renderer/denoise/history_state.h"

#define MOST_SIDE 65536u // px

// --- life ----------------------------------------------------------------------------------------

struct hg_denoise *hg_denoise_create(void)
{
    return hg_calloc(1, sizeof(struct hg_denoise));
}

void hg_dn_past_finish(struct hg_dn_past *past)
{
    hg_free(past->memory);
    *past = (struct hg_dn_past){0};
}

void hg_denoise_destroy(struct hg_denoise *d)
{
    if (d == NULL)
        return;
    hg_dn_past_finish(&d->before);
    hg_dn_past_finish(&d->now);
    hg_free(d->own);
    hg_free(d);
}

void hg_denoise_next(struct hg_denoise *d)
{
    if (d->now.width == 0)
        return;
    hg_dn_past_finish(&d->before);
    d->before = d->now;
    d->now = (struct hg_dn_past){0};
}

enum hg_status hg_dn_past_init(struct hg_dn_past *past, uint32_t width, uint32_t height)
{
    const size_t pixels = (size_t)width * height;
    hg_dn_past_finish(past);
    past->memory = hg_calloc(HG_DN_KEPT * pixels, sizeof(float));
    if (past->memory == NULL)
        return HG_E_NOMEM;
    float *at = past->memory;
    float **single[] = {&past->normal[0], &past->normal[1], &past->normal[2], &past->disparity,
        &past->seen, &past->id, &past->image};
    for (size_t i = 0; i < sizeof single / sizeof *single; i++, at += pixels)
        *single[i] = at;
    for (int i = 0; i < HG_DN_LOBES * 3; i++, at += pixels)
        past->albedo[i / 3][i % 3] = at;
    for (int k = 0; k < HG_DN_KINDS; k++) {
        float **each[] = {&past->variance[k], &past->length[k], &past->rgb[k][0], &past->rgb[k][1],
            &past->rgb[k][2]};
        for (size_t i = 0; i < sizeof each / sizeof *each; i++, at += pixels)
            *each[i] = at;
    }
    past->width = width;
    past->height = height;
    return HG_OK;
}

// --- files ---------------------------------------------------------------------------------------

// Then the planes, split into bytes 0, 1, ... of all floats: this compresses better.
struct saved {
    char magic[8];
    uint32_t width, height, planes, orthographic;
    double camera[5][3];
};

#define MAGIC "HGHIST02"

static const double *axis_of(const struct hg_denoise_camera *c, int i)
{
    const double *const all[] = {c->eye, c->forward, c->across, c->x, c->y};
    return all[i];
}

enum hg_status hg_denoise_save(
    const struct hg_denoise *d, struct hg_refbuf **out, struct hg_error *err)
{
    const struct hg_dn_past *now = &d->now;
    const size_t count = HG_DN_KEPT * (size_t)now->width * now->height;
    struct saved head = {.width = now->width,
        .height = now->height,
        .planes = HG_DN_KEPT,
        .orthographic = now->camera.orthographic};
    *out = NULL;
    if (now->width == 0)
        return hg_error_set(err, HG_E_STATE, "history", NULL, "there is no picture");
    memcpy(head.magic, MAGIC, sizeof head.magic);
    for (int i = 0; i < 5; i++)
        memcpy(head.camera[i], axis_of(&now->camera, i), sizeof head.camera[i]);
    *out = hg_refbuf_create(sizeof head + count * sizeof(float));
    if (*out == NULL)
        return hg_error_set(err, HG_E_NOMEM, "history", NULL, "out of host memory");
    memcpy((*out)->data, &head, sizeof head);
    uint8_t *to = (*out)->data + sizeof head;
    for (size_t i = 0; i < count; i++) {
        uint32_t bits;
        memcpy(&bits, &now->memory[i], sizeof bits);
        for (size_t b = 0; b < 4; b++)
            to[b * count + i] = (uint8_t)(bits >> (8 * b));
    }
    return HG_OK;
}

static enum hg_status load(struct hg_dn_past *now, const struct saved *head, const uint8_t *from)
{
    enum hg_status status = hg_dn_past_init(now, head->width, head->height);
    const size_t count = HG_DN_KEPT * (size_t)head->width * head->height;
    struct hg_denoise_camera *c = &now->camera;
    double *const axes[] = {c->eye, c->forward, c->across, c->x, c->y};
    for (int i = 0; i < 5; i++)
        memcpy(axes[i], head->camera[i], sizeof head->camera[i]);
    c->orthographic = head->orthographic != 0;
    for (size_t i = 0; i < count && status == HG_OK; i++) {
        uint32_t bits = 0;
        for (size_t b = 0; b < 4; b++)
            bits |= (uint32_t)from[b * count + i] << (8 * b);
        memcpy(&now->memory[i], &bits, sizeof bits);
    }
    return status;
}

enum hg_status hg_denoise_load(
    const void *data, uint64_t size_bytes, struct hg_denoise **out, struct hg_error *err)
{
    struct saved head = {0};
    *out = NULL;
    if (data != NULL && size_bytes >= sizeof head)
        memcpy(&head, data, sizeof head);
    if (memcmp(head.magic, MAGIC, sizeof head.magic) != 0 || head.planes != HG_DN_KEPT ||
        head.width < 1 || head.width > MOST_SIDE || head.height < 1 || head.height > MOST_SIDE ||
        size_bytes - sizeof head != HG_DN_KEPT * sizeof(float) * (uint64_t)head.width * head.height)
        return hg_error_set(
            err, HG_E_INVAL, "history", NULL, "is none, cut off, or of another version");
    *out = hg_denoise_create();
    enum hg_status status =
        *out != NULL ? load(&(*out)->now, &head, (const uint8_t *)data + sizeof head) : HG_E_NOMEM;
    if (status == HG_OK)
        return HG_OK;
    hg_denoise_destroy(*out);
    *out = NULL;
    return hg_error_set(err, status, "history", NULL, "out of host memory");
}
