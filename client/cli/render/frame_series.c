// frame_series.c - helio render: pictures that depend on those before.
#include <stdio.h>

#include "client/cli/render/frames.h"

bool hg_cli_series_is_lost(const struct hg_cli_render *r)
{
    return r->series && r->series->held > 0 && r->series->losses != hg_cli_frame_losses(r);
}

bool hg_cli_is_series(const struct hg_cli_render *r)
{
    return hg_cli_is_path(r->o) && r->o->denoise && hg_cli_frame_count(r) > 1;
}

static enum hg_status ask_series_job(struct hg_cli_render *r, uint32_t i, struct hg_error *err)
{
    uint8_t(*job)[32] = r->series->job;
    enum hg_status status = hg_cli_frame_go_to(r, i, err);
    return status ? status : hg_cli_frame_ask_job(r, i > 0 ? job[i - 1] : NULL, job[i], err);
}

// The newest history in a file that is of use for picture i.
static enum hg_status load_history(struct hg_cli_render *r, uint32_t i, struct hg_error *err)
{
    struct hg_cli_series *s = r->series;
    char name[4096];
    uint32_t samples = 0;
    for (uint32_t j = i; j > s->held; j--) {
        hg_cli_frame_file(r, hg_cli_frame_at(r, j - 1), name, sizeof name);
        const struct hg_cli_kept kept = {
            &r->cli, HGP_checkpoint_kind_HISTORY, name, s->job[j - 1], 0, 0};
        enum hg_status status = hg_cli_checkpoint_load(&kept, &samples, err);
        if (status)
            return status;
        if (samples) {
            s->held = j;
            return HG_OK;
        }
    }
    return HG_OK;
}

void hg_cli_series_drop_history(const struct hg_cli_render *r, uint32_t i)
{
    char name[4096];
    hg_cli_frame_file(r, hg_cli_frame_at(r, i), name, sizeof name);
    hg_cli_checkpoint_remove(HGP_checkpoint_kind_HISTORY, name);
}

static enum hg_status make_series_frame(
    struct hg_cli_render *r, uint32_t i, bool wanted, bool *again, struct hg_error *err)
{
    char name[4096];
    hg_cli_frame_file(r, hg_cli_frame_at(r, i), name, sizeof name);
    enum hg_status status = hg_cli_frame_make(r, name, r->series->job[i], wanted, again, err);
    if (status || *again)
        return status;
    r->series->held = i + 1;
    if (!wanted)
        hg_cli_frame_drop_film(r, name);
    if (i > 0 && r->series->kept)
        hg_cli_series_drop_history(r, i - 1);
    return HG_OK;
}

// A view that has lost its history may show picture i without: it looks
// elsewhere, gets what was kept, and comes back.
static enum hg_status restore(struct hg_cli_render *r, uint32_t i, struct hg_error *err)
{
    struct hg_cli_series *s = r->series;
    while (hg_cli_series_is_lost(r)) {
        s->held = 0;
        s->losses = hg_cli_frame_losses(r);
        enum hg_status status = hg_cli_frame_go_to(r, i > 0 ? i - 1 : i, err);
        if (status)
            return status;
        status = load_history(r, i, err);
        if (status)
            return status;
        if (s->held == 0 && i > 0) // what it has may be of the wrong picture
            return hg_error_set(err, HG_E_WORKER, "history", NULL,
                "the worker or the connection was lost, and what the next frame depends on was not "
                "kept");
        status = ask_series_job(r, i, err);
        if (status)
            return status;
    }
    return HG_OK;
}

// The picture behind those whose history the view has, unwritten.
static enum hg_status make_again(struct hg_cli_render *r, uint32_t i, struct hg_error *err)
{
    const uint32_t held = r->series->held;
    bool again;
    enum hg_status status = ask_series_job(r, held, err);
    if (status)
        return status;
    status = make_series_frame(r, held, false, &again, err);
    return status ? status : restore(r, i, err);
}

// The view gets the history that picture i is averaged with.
static enum hg_status reach(struct hg_cli_render *r, uint32_t i, struct hg_error *err)
{
    struct hg_cli_series *s = r->series;
    enum hg_status status = restore(r, i, err);
    if (status || s->held == i)
        return status;
    status = load_history(r, i, err);
    if (status || s->held == i)
        return status;
    hg_cli_progress_say(&r->cli.progress,
        "frames %d to %d are made again, unwritten: the next one depends on them",
        hg_cli_frame_at(r, s->held), hg_cli_frame_at(r, i - 1));
    while (s->held < i) {
        status = make_again(r, i, err);
        if (status)
            return status;
    }
    return ask_series_job(r, i, err);
}

enum hg_status hg_cli_series_render_frame(struct hg_cli_render *r, uint32_t i, struct hg_error *err)
{
    char name[4096];
    bool there = false;
    hg_cli_frame_file(r, hg_cli_frame_at(r, i), name, sizeof name);
    enum hg_status status = ask_series_job(r, i, err);
    if (status)
        return status;
    status = hg_cli_frame_check(r, name, r->series->job[i], &there, err);
    if (status || there)
        return status;
    for (bool again = true; again;) {
        status = reach(r, i, err);
        if (status)
            return status;
        status = make_series_frame(r, i, true, &again, err);
        if (status)
            return status;
    }
    return HG_OK;
}
