#include "server/worker/encode/frame_depth.h"

#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "renderer/view_look.h"

// Column-major world_to_camera has right, up and backward in its rows.
static void describe_camera(const struct view_slot *view, struct hgp_frame *frame)
{
    struct hg_view_matrices m;
    hg_view_matrices(view->view, &m);
    const float *to = m.world_to_camera;
    double scale = 0; // of y, from camera space to NDC
    for (int i = 0; i < 3; i++) {
        frame->up[i] = to[4 * i + 1];
        frame->forward[i] = -to[4 * i + 2];
        frame->eye[i] = 0;
        for (int row = 0; row < 3; row++)
            frame->eye[i] -= to[4 * i + row] * to[12 + row];
        scale = hypot(scale, (double)m.world_to_ndc[4 * i + 1]);
    }
    // w of NDC is the depth with perspective, else it is 1.
    const bool flat = m.world_to_ndc[15] == 1 && m.world_to_ndc[3] == 0 && m.world_to_ndc[7] == 0 &&
                      m.world_to_ndc[11] == 0;
    frame->has_eye = frame->has_forward = frame->has_up = frame->has_kind = true;
    frame->kind = flat ? HGP_camera_kind_ORTHOGRAPHIC : HGP_camera_kind_PERSPECTIVE;
    frame->has_half_height = flat;
    frame->half_height = (float)(1 / scale);
    frame->has_vfov_rad = !flat;
    frame->vfov_rad = (float)(2 * atan(1 / scale));
}

static void take_row(void *user, uint32_t y, const struct hg_surface_point *points)
{
    struct hg_depth_grid *grid = user;
    for (uint32_t x = 0; x < grid->columns; x++)
        grid->depths[(size_t)y * grid->columns + x] = points[x].depth;
}

static bool is_wanted(const struct session *session, const struct view_slot *view,
    const struct encode_request *request)
{
    const float *region = view->settings.params.region;
    return view->subscription.depth && view->subscription.fresh && !request->to.request &&
           !(region[2] > 0) && !hg_view_slot_is_stale(session, view);
}

void hg_frame_depth_attach(
    const struct session *session, struct view_slot *view, struct encode_request *request)
{
    struct hgp_frame frame = request->frame;
    struct hg_error err = {0};
    struct hg_depth_grid *grid;
    if (!is_wanted(session, view, request))
        return;
    const uint64_t start = hg_clock_now_ns();
    describe_camera(view, &frame);
    enum hg_status status = hg_depth_grid_create(
        frame.width, frame.height, frame.kind == HGP_camera_kind_ORTHOGRAPHIC, &grid, &err);
    if (!status) {
        const struct hg_surface_grid cells = {
            .columns = grid->columns, .rows = grid->rows, .row = take_row, .user = grid};
        status = hg_view_surface_grid(view->view, &cells, &err);
    }
    if (status) {
        hg_warn(WORKER, "view %u: a frame goes without its depth: %s", view->number, err.reason);
        hg_depth_grid_destroy(grid);
        return;
    }
    grid->read_ns = hg_clock_now_ns() - start;
    request->depth = grid;
    request->frame = frame;
}
