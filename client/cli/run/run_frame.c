// run_frame.c - helio run: frames and their files.
#include "base/clock.h"
#include "client/cli/render/render.h"
#include "client/cli/run/run.h"

// Unless the script chose an exposure it is automatic, and 0 in files for compositing, as helio
// render has it.
static enum hg_status set_exposure(
    struct hg_cli_run *r, enum hgp_encoding encoding, struct hg_error *err)
{
    const bool linear = hg_cli_is_linear(encoding);
    const struct hg_cli_exposure exposure = {.automatic = !linear};
    struct hgp_view_set view = {.view = r->cli.view};
    if (hg_cli_run_now(r)->has_exposure || hg_cli_run_now(r)->is_linear == linear)
        return HG_OK;
    hg_cli_set_exposure(&exposure, &view);
    enum hg_status status = helio_call_for(r->cli.h, HGP_T_view_set, &view, HGP_T_ok, NULL, err);
    hg_cli_run_now(r)->is_linear = status ? hg_cli_run_now(r)->is_linear : linear;
    return status;
}

enum hg_status hg_cli_run_take(
    struct hg_cli_run *r, const struct hg_cli_format *format, bool now, struct hg_error *err)
{
    struct hgp_frame_request request = {
        .view = r->cli.view,
        .settled = !now,
        .has_encoding = true,
        .encoding = format->encoding,
        .has_quality = true,
        .quality = format->quality,
    };
    helio_message_free(hg_cli_run_now(r)->frame);
    hg_cli_run_now(r)->frame = NULL;
    r->doing = HG_CLI_DOING_RENDER;
    hg_cli_progress_stage(&r->cli.progress, "rendering");
    hg_cli_run_now(r)->dirty = true;
    enum hg_status status = hg_cli_run_complete(r, err);
    if (!status)
        status = set_exposure(r, format->encoding, err);
    if (status)
        return status;
    const uint64_t begin_ns = hg_clock_now_ns();
    status = helio_frame(r->cli.h, &request, &hg_cli_run_now(r)->frame, err);
    while (status) {
        status = hg_cli_wait_for_pixels(&r->cli, status, err);
        if (status)
            return status;
        status = helio_frame(r->cli.h, &request, &hg_cli_run_now(r)->frame, err);
    }
    const uint64_t end_ns = hg_clock_now_ns();
    hg_cli_run_now(r)->frame_ns = end_ns - begin_ns;
    if (r->first_frame_ns == 0)
        r->first_frame_ns = end_ns - r->cli.begin_ns;
    status = hg_cli_drain_queue(&r->cli, err);
    hg_cli_run_now(r)->dirty = status != HG_OK;
    return status;
}

const struct hg_cli_format hg_cli_run_png = {HGP_encoding_PNG8, 90, NULL};

enum hg_status hg_cli_run_frame(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct hg_error *err)
{
    struct hg_cli_format format = hg_cli_run_png;
    if (!s->path)
        return hg_cli_run_take(r, &hg_cli_run_png, s->now, err);
    r->doing = HG_CLI_DOING_ARGUMENTS;
    enum hg_status status = hg_cli_format_of(s->path, NULL, &format, err);
    if (status)
        return status;
    status = hg_cli_check_output(format.path, err);
    if (status)
        return status;
    const uint64_t begin_ns = hg_clock_now_ns();
    status = hg_cli_run_take(r, &format, s->now, err);
    if (status)
        return status;
    const struct hgp_frame *frame = &hg_cli_run_now(r)->frame->body->frame;
    r->doing = HG_CLI_DOING_OUTPUT;
    status = hg_cli_write_output(format.path, frame->data.data, frame->data.size, err);
    if (status)
        return status;
    const uint64_t took_ns = hg_clock_now_ns() - begin_ns;
    hg_cli_progress_frame(&r->cli.progress, took_ns);
    hg_cli_progress_output(&r->cli.progress, format.path, took_ns);
    return HG_OK;
}
