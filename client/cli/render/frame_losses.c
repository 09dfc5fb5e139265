// frame_losses.c - helio render: what a view loses with its worker or its connection.
#include "client/cli/render/frames.h"

uint32_t hg_cli_frame_connection(const struct hg_cli_render *r)
{
    struct helio_info info;
    helio_get_info(r->cli.h, &info);
    return info.reconnects;
}

uint32_t hg_cli_frame_losses(const struct hg_cli_render *r)
{
    return r->cli.progress.replaced + hg_cli_frame_connection(r);
}

enum hg_status hg_cli_frame_camera(
    struct hg_cli_render *r, const struct hgp_view_camera *camera, struct hg_error *err)
{
    r->turntable.sent = *camera;
    r->turntable.connection = hg_cli_frame_connection(r);
    return hg_cli_send_camera(&r->cli, camera, err);
}

enum hg_status hg_cli_frame_keep_camera(struct hg_cli_render *r, struct hg_error *err)
{
    const struct hgp_view_camera camera = r->turntable.sent;
    return r->turntable.connection == hg_cli_frame_connection(r)
               ? HG_OK
               : hg_cli_frame_camera(r, &camera, err);
}
