#include "server/worker/encode/frame_metadata.h"

#include <stdio.h>
#include <string.h>

#include "base/sha256.h"
#include "server/worker/encode/frame_key.h"

// ---- planes -------------------------------------------------------------------------------------

static enum hg_status read_light_groups(
    struct view_slot *view, struct encode_request *request, struct hg_error *err)
{
    const uint32_t count = hg_view_light_groups(view->view);
    for (uint32_t i = 0; i < count && request->plane_count < ENCODE_MAX_PLANES; i++) {
        struct encode_plane *p = &request->planes[request->plane_count];
        p->plane = HG_PLANE_LIGHT_GROUPS;
        snprintf(p->name, sizeof p->name, "light_%s", hg_view_light_group_name(view->view, i));
        enum hg_status status = hg_view_read_light_group(view->view, i, &p->values, err);
        if (status)
            return status;
        request->plane_count++;
    }
    return HG_OK;
}

static enum hg_status read_plane(struct view_slot *view, enum hg_plane plane,
    struct encode_request *request, struct hg_error *err)
{
    if (plane == HG_PLANE_LIGHT_GROUPS)
        return read_light_groups(view, request, err);
    struct encode_plane *p = &request->planes[request->plane_count];
    p->plane = plane;
    enum hg_status status = hg_view_read_plane(view->view, plane, &p->values, err);
    request->plane_count += !status;
    return status;
}

static enum hg_status read_planes(
    struct view_slot *view, struct encode_request *request, struct hg_error *err)
{
    const struct view_settings *set = &view->settings;
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; !status && i < HG_PLANE_COUNT; i++)
        if ((set->params.planes >> i & 1) && i != HG_PLANE_COLOR && i != HG_PLANE_DRAWS)
            status = read_plane(view, (enum hg_plane)i, request, err);
    for (uint32_t i = 0; !status && i < ENCODE_MATTES; i++)
        if (set->params.mattes >> i & 1)
            status =
                hg_view_read_matte(view->view, (enum hg_matte_kind)i, &request->mattes[i], err);
    return status;
}

// Path-traced films have planes after every step, real-time pictures when they are settled.
static bool has_planes(const struct view_slot *view, const struct hgp_frame *frame)
{
    const struct hg_view_params *p = &view->settings.params;
    const bool traced = p->mode == HG_MODE_PATH && frame->samples > 0;
    return p->planes && p->debug_view == HG_DEBUG_OFF && (traced || frame->settled);
}

// ---- metadata -----------------------------------------------------------------------------------

static enum hg_status attach_key(struct render_state *s, struct session *session,
    struct view_slot *view, struct encode_request *request, struct hg_error *err)
{
    struct hgp_frame *frame = &request->frame;
    enum hg_status status = hg_frame_key_make(s, session, view,
        (struct frame_format){frame->encoding, request->quality}, frame->job, err);
    if (status)
        return status;
    frame->has_job = true;
    hg_sha256_hex(frame->job, request->metadata.frame_key);
    hg_sha256_hex(session->scene->hash, request->metadata.scene_hash);
    return HG_OK;
}

static void describe(struct render_state *s, const struct session *session,
    const struct view_slot *view, struct frame_metadata *metadata)
{
    struct hg_view_matrices matrices;
    hg_view_matrices(view->view, &matrices);
    memcpy(metadata->world_to_camera, matrices.world_to_camera, sizeof metadata->world_to_camera);
    memcpy(metadata->world_to_ndc, matrices.world_to_ndc, sizeof metadata->world_to_ndc);
    snprintf(metadata->device, sizeof metadata->device, "%s", hg_render_state_device_name(s));
    metadata->params = view->settings.params;
    metadata->params.exposure_ev = view->progress.info.exposure_ev; // metered, perhaps
    metadata->time_s = session->scene->time_s;
    struct hg_view_lens lens;
    hg_view_lens(view->view, &lens);
    metadata->lens_radius = lens.radius_m;
    metadata->focus_distance = lens.focus_m;
}

static bool is_exr(enum hgp_encoding encoding)
{
    return encoding == HGP_encoding_EXR_HALF || encoding == HGP_encoding_EXR_FLOAT;
}

enum hg_status hg_frame_metadata_attach(struct render_state *s, struct session *session,
    struct view_slot *view, struct encode_request *request, struct hg_error *err)
{
    const struct hgp_frame *frame = &request->frame;
    enum hg_status status = frame->settled && view->frame_key.asked
                                ? attach_key(s, session, view, request, err)
                                : HG_OK;
    if (status || !is_exr(frame->encoding))
        return status;
    describe(s, session, view, &request->metadata);
    return has_planes(view, frame) ? read_planes(view, request, err) : HG_OK;
}
