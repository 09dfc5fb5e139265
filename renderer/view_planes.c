// view_planes.c - the planes of a view's pictures.
#include "renderer/frame/paths/path_view.h"
#include "renderer/internal.h"

static const struct {
    const char *name;
    uint32_t channels;
} planes[HG_PLANE_COUNT] = {{"color", 4}, {"albedo", 3}, {"normal", 3}, {"geometric_normal", 3},
    {"depth", 1}, {"position", 3}, {"emission", 3}, {"direct_diffuse", 3}, {"direct_specular", 3},
    {"direct_transmission", 3}, {"indirect_diffuse", 3}, {"indirect_specular", 3},
    {"indirect_transmission", 3}, {"motion", 4}, {"object", 1}, {"material", 1}, {"samples", 1},
    {"variance", 1}, {"draws", 2 * HG_PLANE_DRAWS_LENGTH}, {"noisy", 3}, {"light_groups", 3}};

bool hg_plane_needs_light(uint32_t plane)
{
    return plane == HG_PLANE_VARIANCE || plane == HG_PLANE_NOISY ||
           plane == HG_PLANE_LIGHT_GROUPS ||
           (plane >= HG_PLANE_DIRECT_DIFFUSE && plane <= HG_PLANE_INDIRECT_TRANSMISSION);
}

uint32_t hg_plane_channels(enum hg_plane plane)
{
    return (unsigned)plane < HG_PLANE_COUNT ? planes[plane].channels : 0;
}

const char *hg_plane_name(enum hg_plane plane)
{
    return (unsigned)plane < HG_PLANE_COUNT ? planes[plane].name : "";
}

enum hg_status hg_view_read_plane(
    struct hg_view *view, enum hg_plane plane, struct hg_refbuf **out, struct hg_error *err)
{
    *out = NULL;
    if ((unsigned)plane >= HG_PLANE_COUNT || plane == HG_PLANE_LIGHT_GROUPS)
        return hg_renderer_out_of_range(err, "planes", "plane");
    const struct hg_view_state *s = &view->state;
    const bool path = s->settings.mode == HG_VIEW_MODE_PATH;
    if (!path && (plane == HG_PLANE_COLOR || hg_plane_needs_light((uint32_t)plane)))
        return hg_error_set(err, HG_E_STATE, "view", "planes", "not of a path-traced view");
    if (!path && !hg_view_state_has_planes(s))
        return hg_error_set(err, HG_E_STATE, "view", "planes", "the picture is not settled");
    struct hg_path *film;
    const enum hg_status status = hg_path_view_film(s, &film, err);
    return status == HG_OK ? hg_path_read(film, (uint32_t)plane, planes[plane].channels, out, err)
                           : status;
}

uint32_t hg_view_light_groups(const struct hg_view *view)
{
    return hg_path_group_count(view->state.path);
}

const char *hg_view_light_group_name(const struct hg_view *view, uint32_t group)
{
    return hg_path_group_name(view->state.path, group);
}

enum hg_status hg_view_read_light_group(
    struct hg_view *view, uint32_t group, struct hg_refbuf **out, struct hg_error *err)
{
    struct hg_path *film;
    *out = NULL;
    const enum hg_status status = hg_path_view_film(&view->state, &film, err);
    return status == HG_OK ? hg_path_read_group(film, group, out, err) : status;
}
