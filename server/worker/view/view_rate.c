#include "server/worker/view/view_rate.h"

#include <math.h>

#include "base/clock.h"

#define EXPOSURE_STEP (1.0f / 16.0f) // stops, between frames of an exposure that adapts

enum { MAX_SAMPLES_PER_STEP = 16, PROGRESS_NS = 200 * 1000 * 1000 };

// ---- subscriptions ------------------------------------------------------------------------------

void hg_rate_subscribe(struct view_slot *view, uint32_t credit)
{
    view->subscription.credit = credit;
    view->subscription.sent_number = 0;
    view->subscription.still_due_ns = 0;
    view->subscription.fresh = true;
    view->subscription.key_frame = true; // what the client has is not known
    view->progress.failed = false;
    hg_control_begin(&view->control, view->subscription.names);
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
    if (!hg_view_slot_is_watched(view) || !view->progress.stepped)
        return false;
    if (sub->sent_number == info->number)
        return sub->still_due_ns > 0;
    return sub->fresh || info->samples <= sub->sent_samples ||
           info->samples >= 2 * sub->sent_samples || info->settled ||
           fabsf(info->exposure_ev - sub->sent_ev) >= EXPOSURE_STEP;
}

void hg_rate_note_sent(struct view_slot *view)
{
    struct hg_control_sent sent;
    while (hg_encode_stream_next_sent(view->encoder, &sent))
        hg_control_sent(&view->control, &sent);
}

static uint64_t later(uint64_t a_ns, uint64_t b_ns)
{
    return a_ns > b_ns ? a_ns : b_ns;
}

static uint64_t frame_due_ns(const struct view_slot *view)
{
    return view->subscription.sent_ns + (uint64_t)(1e9 / (double)view->subscription.max_fps);
}

uint64_t hg_rate_due_ns(struct view_slot *view, uint64_t heard_ns)
{
    const struct view_subscription *sub = &view->subscription;
    const bool is_sent = sub->sent_number == view->progress.info.number;
    return later(later(frame_due_ns(view), hg_rate_begin_ns(view, heard_ns)),
        is_sent ? sub->still_due_ns : 0);
}

uint64_t hg_rate_begin_ns(struct view_slot *view, uint64_t heard_ns)
{
    hg_rate_note_sent(view);
    const uint64_t due_ns = frame_due_ns(view), work_ns = (uint64_t)view->control.work_ns;
    return later(
        hg_control_due_ns(&view->control, heard_ns), due_ns > work_ns ? due_ns - work_ns : 0);
}

uint64_t hg_rate_encoded_ns(const struct view_slot *view)
{
    const struct view_subscription *sub = &view->subscription;
    const bool gives_way = sub->target_fps > 0 && sub->target_fps < sub->max_fps;
    const float fps = gives_way ? sub->target_fps : sub->max_fps;
    return view->progress.info.settled || !(fps > 0)
               ? 0
               : view->progress.began_ns + (uint64_t)(1e9 / (double)fps);
}

struct hg_control_choice hg_rate_choose(struct view_slot *view, uint32_t sharing)
{
    const struct view_subscription *sub = &view->subscription;
    hg_rate_note_sent(view);
    return hg_control_choose(&view->control, &(struct hg_control_goal){.fps = sub->target_fps,
                                                 .quality = sub->quality,
                                                 .bitrate = sub->bitrate,
                                                 .sharing = sharing});
}

void hg_rate_delivered(struct view_slot *view, const struct hg_control_delivery *delivery)
{
    hg_rate_note_sent(view);
    hg_control_delivered(&view->control, delivery);
}

void hg_rate_sent(struct view_slot *view, uint64_t read_ns)
{
    hg_control_queued(&view->control, view->progress.info.number, view->progress.began_ns, read_ns);
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

// What a picture without samples waits for.
static const char *preparation(const struct view_slot *view)
{
    const bool is_metered =
        view->settings.params.exposure_mode != HG_EXPOSURE_AUTO || view->progress.info.metered;
    return is_metered ? "preparing" : "metering the exposure";
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
    else if (!info->samples)
        hg_reply_progress(to, preparation(view), 0, 0);
    else
        hg_reply_progress(to, "samples", info->samples, expected_samples(view));
}
