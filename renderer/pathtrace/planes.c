// planes.c - reads planes from the film: means, ids, Cryptomatte lists.
#include "renderer/pathtrace/path_state.h"

#define PLANE_COLOR    0u  // enum hg_plane of renderer.h
#define PLANE_SAMPLES  16u // stored by tile; its place in the film is taken by HG_PATH_PLANE_HITS
#define PLANE_VARIANCE 17u
#define PLANE_NOISY    19u // the colour

static bool is_id(uint32_t plane)
{
    return plane == HG_PATH_PLANE_OBJECT || plane == HG_PATH_PLANE_MATERIAL ||
           plane == HG_PATH_PLANE_DRAWS;
}

static bool is_of_hits(uint32_t plane)
{
    return plane == HG_PATH_PLANE_DEPTH || plane == HG_PATH_PLANE_POSITION;
}

static void color_pixel(const struct hg_path_film *f, const float *sums, uint64_t at, float scale,
    uint32_t channels, float *out)
{
    const uint64_t pixels = (uint64_t)f->width * f->height;
    float sum[4];
    for (uint32_t c = 0; c < 4; c++)
        sum[c] = sums[(HG_PATH_FILM_COLOR + c) * pixels + at];
    hg_path_film_catch(f, sums, at, sum);
    for (uint32_t c = 0; c < channels; c++)
        out[c] = sum[c] * scale;
}

// Channels of a plane, from `skip` on.
struct selection {
    uint32_t plane, skip, channels;
};

// One pixel of a plane from the film.
static void plane_pixel(const struct hg_path_film *f, const float *sums, const struct selection *of,
    uint64_t at, float *out)
{
    const uint64_t pixels = (uint64_t)f->width * f->height;
    const uint32_t plane = of->plane, channels = of->channels;
    const uint32_t n =
        hg_path_film_samples_at(f, (uint32_t)(at % f->width), (uint32_t)(at / f->width));
    const float scale = n > 0 ? 1.0f / (float)n : 0.0f;
    double mean;
    if (plane == PLANE_SAMPLES) {
        out[0] = (float)n;
        return;
    }
    if (plane == PLANE_VARIANCE) {
        out[0] = n > 1 ? (float)hg_path_film_variance(f, sums, at, n, &mean) : 0.0f;
        return;
    }
    if (plane == PLANE_COLOR || plane == PLANE_NOISY) {
        color_pixel(f, sums, at, scale, channels, out);
        return;
    }
    const uint32_t first = (plane == HG_PATH_PLANE_DRAWS ? f->lists : f->planes[plane]) + of->skip;
    float share = is_id(plane) ? (n > 0 ? 1.0f : 0.0f) : scale;
    if (is_of_hits(plane)) {
        const float hits = sums[f->planes[HG_PATH_PLANE_HITS] * pixels + at];
        share = n > 0 && hits > 0.0f ? 1.0f / hits : 0.0f;
    }
    const bool moved = plane == HG_PATH_PLANE_POSITION && share > 0.0f;
    for (uint32_t c = 0; c < channels; c++) {
        const float value = sums[(first + c) * pixels + at] * share;
        out[c] = moved ? (float)((double)value + f->origin[c]) : value;
    }
}

static enum hg_status read(
    struct hg_path *p, const struct selection *of, struct hg_refbuf **out, struct hg_error *err)
{
    const uint32_t plane = of->plane;
    const float *sums;
    *out = NULL;
    if (!hg_path_has_film(p))
        return hg_error_set(err, HG_E_STATE, "view", NULL, "nothing was path-traced yet");
    const bool made = plane == PLANE_COLOR || plane == PLANE_NOISY || plane == PLANE_SAMPLES ||
                      plane == PLANE_VARIANCE;
    struct hg_path_film *f = &p->film;
    if (!made && f->planes[plane] == HG_PATH_NO_PLANE)
        return hg_error_set(err, HG_E_STATE, "view", "planes", "was not asked for");
    const struct hg_picture_region r = f->region;
    const uint64_t pixels = (uint64_t)r.width * r.height;
    enum hg_status status = hg_path_film_fetch(p->context->gpu, f, f->channels, &sums, err);
    if (status != HG_OK)
        return status;
    *out = hg_refbuf_create(pixels * of->channels * sizeof(float));
    if (*out == NULL)
        return hg_error_set(err, HG_E_NOMEM, "planes", NULL, "out of host memory");
    float *to = (float *)(void *)(*out)->data;
    for (uint64_t i = 0; i < pixels; i++)
        plane_pixel(
            f, sums, of, (r.y + i / r.width) * f->width + r.x + i % r.width, to + i * of->channels);
    return HG_OK;
}

enum hg_status hg_path_read(struct hg_path *p, uint32_t plane, uint32_t channels,
    struct hg_refbuf **out, struct hg_error *err)
{
    return read(p, &(struct selection){plane, 0, channels}, out, err);
}

enum hg_status hg_path_read_group(
    struct hg_path *p, uint32_t group, struct hg_refbuf **out, struct hg_error *err)
{
    *out = NULL;
    if (group >= hg_path_group_count(p))
        return hg_error_set(err, HG_E_STATE, "view", "planes", "there is no such group of lights");
    return read(p, &(struct selection){HG_PATH_PLANE_GROUPS, 3 * group, 3}, out, err);
}

enum hg_status hg_path_read_names(
    struct hg_path *p, uint32_t kind, struct hg_refbuf **out, struct hg_error *err)
{
    const uint32_t channels = 2 * HG_PATH_DRAWS_LENGTH;
    uint32_t list;
    *out = NULL;
    if (p == NULL || !hg_cryptomatte_ids_list(&p->request.settings, kind, &list))
        return hg_error_set(err, HG_E_STATE, "view", "mattes", "was not asked for");
    const struct selection names = {HG_PATH_PLANE_DRAWS, list * channels, channels};
    return read(p, &names, out, err);
}

uint32_t hg_path_group_count(const struct hg_path *p)
{
    return p != NULL ? p->scene.groups.count : 0;
}

const char *hg_path_group_name(const struct hg_path *p, uint32_t group)
{
    return group < hg_path_group_count(p) ? p->scene.groups.names[group] : "";
}
