// view_cryptomatte.c - Cryptomattes of path-traced views from the lists of names that pixels show,
// each known by a draw that has it.
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/image/cryptomatte.h"
#include "renderer/frame/paths/path_view.h"
#include "renderer/internal.h"

_Static_assert(HG_MATTE_RANKS == HG_CRYPTOMATTE_RANKS, "one number of ranks");

// The draws of a geometry by the names of what they belong to.
struct names {
    enum hg_matte_kind kind;
    const struct hg_geometry *geometry;
    uint32_t *ids; // [draws] bits of the name's id; 0 = not met yet
    uint32_t draws;
    char **met; // names that were met
    size_t capacity;
    uint32_t count;
};

static void finish(struct names *n)
{
    for (uint32_t i = 0; i < n->count; i++)
        hg_free(n->met[i]);
    hg_free(n->met);
    hg_free(n->ids);
}

// Bits of the id of a draw; 0 for one that is not there.
static enum hg_status find_id(struct names *n, uint32_t draw, uint32_t *out)
{
    struct hg_draw_info info;
    char name[HG_PATH_NAME];
    *out = 0;
    if (draw >= n->draws || !hg_geometry_draw_info(n->geometry, draw, &info))
        return HG_OK;
    if (n->ids[draw] == 0) {
        hg_path_name_draw((uint32_t)n->kind, &info, name);
        if (hg_grow(&n->met, &n->capacity, n->count + 1, sizeof *n->met) != HG_OK)
            return HG_E_NOMEM;
        n->met[n->count] = hg_strdup(name);
        if (n->met[n->count] == NULL)
            return HG_E_NOMEM;
        n->count++;
        n->ids[draw] = hg_cryptomatte_id(name);
    }
    *out = n->ids[draw];
    return HG_OK;
}

static enum hg_status rank_pixel(
    struct names *n, const float *list, float samples, float out[2 * HG_MATTE_RANKS])
{
    struct hg_cryptomatte_sample seen[HG_PLANE_DRAWS_LENGTH];
    uint32_t count = 0;
    for (uint32_t i = 0; i < HG_PLANE_DRAWS_LENGTH && list[2 * i] > 0; i++) {
        enum hg_status status = find_id(n, (uint32_t)list[2 * i] - 1, &seen[count].id);
        if (status != HG_OK)
            return status;
        seen[count++].weight = list[2 * i + 1];
    }
    hg_cryptomatte_rank(seen, count, samples, HG_MATTE_RANKS, out);
    return HG_OK;
}

static enum hg_status rank_all(struct names *n, const struct hg_refbuf *lists,
    const struct hg_refbuf *samples, struct hg_refbuf **out)
{
    const float *list = (const float *)(const void *)lists->data;
    const float *count = (const float *)(const void *)samples->data;
    const size_t pixels = samples->size / sizeof *count;
    *out = hg_refbuf_create(pixels * 2 * HG_MATTE_RANKS * sizeof(float));
    if (*out == NULL)
        return HG_E_NOMEM;
    float *to = (float *)(void *)(*out)->data;
    enum hg_status status = HG_OK;
    for (size_t i = 0; i < pixels && status == HG_OK; i++)
        status = rank_pixel(
            n, list + i * 2 * HG_PLANE_DRAWS_LENGTH, count[i], to + i * 2 * HG_MATTE_RANKS);
    return status;
}

static enum hg_status make(struct names *n, const struct hg_refbuf *lists,
    const struct hg_refbuf *samples, struct hg_matte *out)
{
    struct hg_geometry_stats stats;
    hg_geometry_stats(n->geometry, &stats);
    n->draws = (uint32_t)stats.draws;
    n->ids = hg_calloc(n->draws > 0 ? n->draws : 1, sizeof *n->ids);
    enum hg_status status = n->ids != NULL ? HG_OK : HG_E_NOMEM;
    if (status == HG_OK)
        status = rank_all(n, lists, samples, &out->ranks);
    if (status == HG_OK)
        status = hg_cryptomatte_manifest((const char *const *)n->met, n->count, &out->manifest);
    return status == HG_E_LIMIT ? HG_OK : status; // a matte goes without a manifest of that size
}

enum hg_status hg_view_read_matte(
    struct hg_view *view, enum hg_matte_kind kind, struct hg_matte *out, struct hg_error *err)
{
    struct hg_refbuf *lists = NULL, *samples = NULL;
    struct names names = {.kind = kind};
    struct hg_path *film;
    *out = (struct hg_matte){0};
    enum hg_status status = hg_view_read_plane(view, HG_PLANE_SAMPLES, &samples, err);
    if (status == HG_OK)
        status = hg_path_view_film(&view->state, &film, err);
    if (status == HG_OK)
        status = hg_path_read_names(film, (uint32_t)kind, &lists, err);
    if (status == HG_OK) {
        names.geometry =
            view->state.scene_gpu->geometry; // there is one, since something was traced
        status = make(&names, lists, samples, out);
        if (status != HG_OK)
            hg_error_set(err, status, "matte", NULL, "no memory for the names of a picture");
    }
    finish(&names);
    hg_refbuf_unref(lists);
    hg_refbuf_unref(samples);
    if (status != HG_OK)
        hg_cryptomatte_view_finish(out);
    return status;
}

void hg_cryptomatte_view_finish(struct hg_matte *matte)
{
    hg_refbuf_unref(matte->ranks);
    hg_free(matte->manifest);
    *matte = (struct hg_matte){0};
}
