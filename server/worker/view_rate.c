#include "server/worker/view_rate.h"

#include <math.h>

#include "base/clock.h"

#define EXPOSURE_STEP (1.0f / 16.0f) // stops, between frames of an exposure that adapts

enum { MAX_SAMPLES_PER_STEP = 16, PROGRESS_NS = 200 * 1000 * 1000 };

// ---- subscriptions ------------------------------------------------------------------------------

void hg_rate_subscribe(struct view_slot *view, uint32_t credit)
{
    view->subscription.credit = credit;
    view->subscription.sent_number = 0;
    view->subscription.fresh = true;
    view->subscription.key_frame = true; // what the client has is not known
    view->progress.failed = false;
}

void hg_rate_add_credit(struct view_slot *view, uint32_t frames)
{
    if (view->subscription.credit < UINT32_MAX - 1024)
        view->subscription.credit += frames;
}

bool hg_rate_wants(const struct view_slot *view)
{
    const struct view_subscription *sub = &view->subscription;
    const struct hg_frame_info *info = &view->progress.info;
    if (!sub->credit || !view->progress.stepped || sub->sent_number == info->number)
        return false;
    return sub->fresh || info->samples <= sub->sent_samples ||
           info->samples >= 2 * sub->sent_samples || info->settled ||
           fabsf(info->exposure_ev - sub->sent_ev) >= EXPOSURE_STEP;
}

uint64_t hg_rate_due_ns(const struct view_slot *view)
{
    return view->subscription.sent_ns + (uint64_t)(1e9 / (double)view->subscription.max_fps);
}

void hg_rate_sent(struct view_slot *view)
{
    struct view_subscription *sub = &view->subscription;
    sub->credit--;
    sub->sent_ns = hg_clock_now_ns();
    sub->sent_number = view->progress.info.number;
    sub->sent_samples = view->progress.info.samples;
    sub->sent_ev = view->progress.info.exposure_ev;
    sub->fresh = false;
}

uint32_t hg_rate_samples(const struct view_slot *view, uint64_t step_ns)
{
    const uint64_t sample_ns = view->progress.sample_ns;
    const uint64_t n = sample_ns ? step_ns / sample_ns : 1;
    return n < 1 ? 1 : n > MAX_SAMPLES_PER_STEP ? MAX_SAMPLES_PER_STEP : (uint32_t)n;
}

// ---- progress -----------------------------------------------------------------------------------

// Background bakes while they run, counted since the frame was requested.
static void send_baking(struct view_slot *view, struct frame_wait *wait, struct reply_to to)
{
    struct hg_baking b;
    hg_view_baking(view->view, &b);
    // A bake that is given up counts no more.
    if (!wait->began || wait->baked_before > b.texels_done)
        wait->baked_before = b.texels_done;
    wait->began = true;
    wait->most_baking = b.mesh_parts > wait->most_baking ? b.mesh_parts : wait->most_baking;
    if (b.texels_done < b.texels_total)
        hg_reply_progress(to, "baking textures", b.texels_done - wait->baked_before,
            b.texels_total - wait->baked_before);
    if (b.mesh_parts > 0)
        hg_reply_progress(to, "baking meshes", wait->most_baking - b.mesh_parts, wait->most_baking);
}

// How many samples a settled frame will have, as far as can be told: what the parameters allow, or
// what fits into the time limit, or what brings the error down to the one asked for. Samples of a
// path-traced picture that goes on from a checkpoint are compared with the time of all its runs.
static uint32_t expected_samples(const struct view_slot *view)
{
    const struct hg_view_params *p = &view->settings.params;
    const struct hg_frame_info *info = &view->progress.info;
    double total = hg_view_params_filled(p).samples, n = info->samples;
    double spent_s = (double)(info->spent_ns > 0 ? info->spent_ns : view->progress.spent_ns) * 1e-9;
    if (p->time_limit_s > 0 && n > 0 && spent_s > 0)
        total = fmin(total, n * (double)p->time_limit_s / spent_s);
    if (p->noise > 0 && info->noise > 0) // falls with the square root
        total = fmin(total,
            n * (double)info->noise * (double)info->noise / ((double)p->noise * (double)p->noise));
    return (uint32_t)fmax(ceil(total), n);
}

void hg_rate_send_progress(struct view_slot *view, struct frame_wait *wait, struct reply_to to)
{
    const struct hg_frame_info *info = &view->progress.info;
    const uint64_t now = hg_clock_now_ns();
    const uint32_t missing = info->missing_pages + info->missing_clusters;
    wait->most_missing = missing > wait->most_missing ? missing : wait->most_missing;
    if (now - wait->progress_sent_ns < PROGRESS_NS)
        return;
    wait->progress_sent_ns = now;
    send_baking(view, wait, to);
    if (missing)
        hg_reply_progress(to, "streaming", wait->most_missing - missing, wait->most_missing);
    else
        hg_reply_progress(to, "samples", info->samples, expected_samples(view));
}
