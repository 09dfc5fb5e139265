// frame_claims.c - helio render --claim: the frames of a series, shared with other commands of the
// same line. Those that others have claimed are looked at again until they are there.
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "client/cli/render/claim.h"
#include "client/cli/render/frames.h"

#define AGAIN_NS UINT64_C(1000000000) // between looks at frames of others

struct place {
    struct hg_cli_claim_seen seen;
    bool is_done;
};

struct sharing {
    struct hg_cli_claims claims;
    struct place *places; // of all frames
    uint32_t done;
    int32_t other; // the first frame that another command has, and
    char owner[HG_CLI_CLAIM_OWNER_BYTES];
    bool has_said; // that it is waited for
};

static enum hg_status try_frame(
    struct hg_cli_render *r, struct sharing *s, uint32_t i, struct hg_error *err)
{
    char name[4096], owner[HG_CLI_CLAIM_OWNER_BYTES];
    bool held;
    hg_cli_frame_file(r, hg_cli_frame_at(r, i), name, sizeof name);
    enum hg_status status =
        hg_cli_claim_take(&s->claims, name, &s->places[i].seen, &held, owner, err);
    r->doing = status == HG_E_INVAL ? HG_CLI_DOING_ARGUMENTS : HG_CLI_DOING_OUTPUT;
    if (status)
        return status;
    if (!held && !s->owner[0]) {
        s->other = hg_cli_frame_at(r, i);
        snprintf(s->owner, sizeof s->owner, "%s", owner);
    }
    if (!held)
        return HG_OK;
    hg_cli_progress_begin_frame(&r->cli.progress, hg_cli_frame_at(r, i), i + 1);
    status = hg_cli_frame_render(r, i, err);
    hg_cli_claim_release(&s->claims);
    s->places[i].is_done = !status;
    s->done += !status;
    return status;
}

// All frames that are neither there nor claimed.
static enum hg_status try_all(struct hg_cli_render *r, struct sharing *s, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    s->owner[0] = 0;
    for (uint32_t i = 0; i < hg_cli_frame_count(r) && !status; i++)
        if (!s->places[i].is_done)
            status = try_frame(r, s, i, err);
    r->next = s->done;
    return status;
}

static enum hg_status wait_for_others(
    struct hg_cli_render *r, struct sharing *s, struct hg_error *err)
{
    const uint32_t left = hg_cli_frame_count(r) - s->done;
    char owner[HG_CLI_CLAIM_OWNER_BYTES];
    hg_cli_clean(owner, sizeof owner, s->owner, strlen(s->owner));
    if (!s->has_said)
        hg_cli_progress_say(&r->cli.progress,
            "waiting for %u frame%s that other commands have claimed (frame %d: %s)", left,
            left == 1 ? "" : "s", s->other, owner);
    s->has_said = true;
    hg_cli_progress_stage(&r->cli.progress, "waiting for frames of other commands");
    enum hg_status status = helio_wait(r->cli.h, AGAIN_NS, err);
    if (status && status != HG_E_TIMEOUT)
        return status;
    return hg_cli_drain_queue(&r->cli, err);
}

enum hg_status hg_cli_frames_share(struct hg_cli_render *r, struct hg_error *err)
{
    struct sharing s = {0};
    s.places = hg_calloc(hg_cli_frame_count(r), sizeof *s.places);
    if (!s.places)
        return hg_error_set(err, HG_E_NOMEM, "--frames", NULL, "no memory for so many");
    enum hg_status status = hg_cli_claims_init(&s.claims, err);
    hg_cli_progress_frames(&r->cli.progress, hg_cli_frame_count(r));
    while (!status) {
        const uint32_t before = s.done;
        status = try_all(r, &s, err);
        if (status || s.done == hg_cli_frame_count(r))
            break;
        if (s.done == before)
            status = wait_for_others(r, &s, err);
    }
    hg_cli_claims_finish(&s.claims);
    hg_free(s.places);
    return status;
}
