#include "server/worker/view/view_schedule.h"

#include "base/clock.h"
#include "base/log.h"
#include "server/worker/view/view_fit.h"
#include "server/worker/view/view_output.h"
#include "server/worker/view/view_rate.h"

#define ADAPTATION_NS 16000000u // between steps
// How long a step takes about: of a session that is alone, and where others wait.
#define STEP_NS        50000000u
#define SHARED_STEP_NS 16000000u
#define MOVING_NS      500000000u // after its newest step a view counts as moving
#define REFINE_NS      100000000u // and is refined: the next camera must not wait for that
#define MESSAGES_NS    20000000u  // of a session before its views have a turn

// ---- steps --------------------------------------------------------------------------------------

// All waiting requests are for the settled frame, and there is no subscriber.
static bool is_final(const struct view_slot *view)
{
    bool final = view->waits != NULL && !hg_view_slot_is_watched(view);
    for (const struct frame_wait *it = view->waits; it; it = it->next)
        final &= it->settled;
    return final;
}

// The time limit of realtime views; path-traced ones keep to it themselves. A picture with
// something missing is not settled, nor is one whose planes are yet to come.
static void keep_to_time(struct view_slot *view)
{
    const struct hg_view_params *p = &view->settings.params;
    struct hg_frame_info *info = &view->progress.info;
    const bool metered = p->exposure_mode != HG_EXPOSURE_AUTO || info->metered;
    if (p->mode == HG_MODE_REALTIME && !p->planes && metered && p->time_limit_s > 0 &&
        info->samples > 0 && !info->missing_pages && !info->missing_clusters &&
        (double)view->progress.spent_ns * 1e-9 >= (double)p->time_limit_s)
        info->settled = true;
}

// What it has its turn for: weights of the shares of those that want more than there is.
enum purpose {
    MOVES,   // is watched while it changes
    SETTLES, // towards its settled picture
    FILMS,   // likewise, in path mode: takes minutes, and what the others leave
};

static enum purpose purpose_of(const struct session *session, const struct view_slot *view)
{
    if (hg_view_slot_is_stale(session, view) && !is_final(view))
        return MOVES;
    return view->settings.params.mode == HG_MODE_PATH ? FILMS : SETTLES;
}

static enum hg_status step(
    struct session *session, struct view_slot *view, uint32_t samples, struct hg_error *err)
{
    struct view_progress *progress = &view->progress;
    enum hg_status status = hg_view_fit_follow(session, view, err);
    // A failed step leaves no info behind: what comes after it is a new state, too.
    const bool restarted = hg_view_slot_is_stale(session, view);
    view->subscription.fresh |= restarted;
    uint64_t start = hg_clock_now_ns();
    const bool moves = purpose_of(session, view) == MOVES;
    hg_view_set_final(view->view, is_final(view));
    if (!status)
        status = hg_view_step(view->view, samples, &progress->info, err);
    view->settings.changed = false;
    if (status)
        return status;
    progress->began_ns = start;
    progress->stepped_ns = hg_clock_now_ns();
    progress->input = view->settings.input;
    progress->moved_ns = moves ? progress->stepped_ns : progress->moved_ns;
    if (restarted)
        progress->first_number = progress->info.number;
    uint64_t took_ns = progress->stepped_ns - start;
    progress->spent_ns = restarted ? took_ns : progress->spent_ns + took_ns;
    progress->sample_ns = took_ns / samples;
    progress->stepped = true;
    keep_to_time(view);
    return HG_OK;
}

enum hg_status hg_schedule_refresh(
    struct session *session, struct view_slot *view, struct hg_error *err)
{
    hg_scene_slot_publish(session->scene);
    return hg_view_slot_is_stale(session, view) ? step(session, view, 1, err) : HG_OK;
}

// ---- turns --------------------------------------------------------------------------------------

// A step that failed would fail again: it waits for another state or another request.
static bool rests(const struct session *session, const struct view_slot *view)
{
    return view->progress.failed && !view->settings.changed &&
           view->progress.failed_revision == session->scene->scene->revision;
}

// How long a watched view that has just moved is still left as it is, unless it moves again.
static uint64_t unrefined_ns(const struct view_slot *view)
{
    const uint64_t now_ns = hg_clock_now_ns(), until_ns = view->progress.moved_ns + REFINE_NS;
    const bool moved = view->progress.moved_ns && hg_view_slot_is_watched(view) && !view->waits;
    return moved && now_ns < until_ns ? until_ns - now_ns : 0;
}

// Whether there is more to draw, for an encoder with room or for the settled frame.
static bool wants_step(const struct session *session, const struct view_slot *view)
{
    if (!hg_view_slot_is_stale(session, view) &&
        (view->progress.info.settled || unrefined_ns(view)))
        return false;
    bool wanted = hg_encode_stream_has_room(view->encoder);
    for (const struct frame_wait *it = view->waits; it && !wanted; it = it->next)
        wanted = it->settled;
    return wanted;
}

// A picture that has all but its exposure, which adapts with time, or that waits for other views:
// no need to step all the while.
static bool may_wait(const struct session *session, const struct view_slot *view, uint64_t *wait_ns)
{
    const struct hg_frame_info *info = &view->progress.info;
    if (!(info->adapts || info->waits) || hg_view_slot_is_stale(session, view) || is_final(view))
        return false;
    const uint64_t now = hg_clock_now_ns(), due = view->progress.stepped_ns + ADAPTATION_NS;
    if (now < due && due - now < *wait_ns)
        *wait_ns = due - now;
    return now < due;
}

// Until when what the client says is known.
static uint64_t heard_ns(const struct session *session, const struct view_slot *view)
{
    return hg_worker_session_is_waiting(session) ? view->progress.began_ns : hg_clock_now_ns();
}

// Whether a picture in motion may begin: it is drawn when it can be sent, of what is newest then.
static bool is_due(const struct session *session, struct view_slot *view, uint64_t *wait_ns)
{
    const uint64_t now = hg_clock_now_ns(), due = hg_rate_begin_ns(view, heard_ns(session, view));
    const uint64_t left = due > now ? due - now : 0;
    if (left && left < *wait_ns)
        *wait_ns = left;
    return !left;
}

// Must the view work now? One that only waits for its frame to be due says until when; one whose
// encoder is full is woken for.
static bool has_work(const struct session *session, struct view_slot *view, uint64_t *wait_ns)
{
    const bool watched = hg_view_slot_is_watched(view);
    if (rests(session, view) || (!view->waits && !watched))
        return false;
    if (hg_scene_slot_in_batch(session->scene, wait_ns))
        return false;
    if (may_wait(session, view, wait_ns))
        return false;
    if (watched && !view->waits && hg_view_slot_is_stale(session, view) &&
        !is_due(session, view, wait_ns))
        return false;
    if (wants_step(session, view))
        return true;
    const uint64_t unrefined = view->progress.info.settled ? 0 : unrefined_ns(view);
    if (unrefined && *wait_ns > unrefined)
        *wait_ns = unrefined;
    if (!hg_encode_stream_has_room(view->encoder))
        return false;
    if (view->waits)
        return true;
    if (!hg_rate_wants(view))
        return false;
    uint64_t now = hg_clock_now_ns(), due = hg_rate_due_ns(view, heard_ns(session, view));
    if (now >= due)
        return true;
    *wait_ns = *wait_ns < due - now ? *wait_ns : due - now;
    return false;
}

static void charge(struct render_state *s, struct session *session, uint64_t ns)
{
    struct tenant *tenant = session->tenant;
    hg_turn_serve(&s->clock, &tenant->turn, hg_turn_cost(ns, tenant->weight));
    hg_turn_serve(&tenant->clock, &session->turn, ns);
}

// Areas are finished one after the other: one that has to end at a time is not drawn so.
static bool may_be_cut(const struct render_state *s, const struct view_slot *view)
{
    return s->sessions->next && !(view->settings.params.time_limit_s > 0);
}

// Views that are watched and have moved of late, this one included.
struct moving {
    uint32_t all, of_scene;
};

static struct moving count_moving(
    const struct render_state *s, const struct session *own, const struct view_slot *view)
{
    const uint64_t now_ns = hg_clock_now_ns();
    struct moving count = {1, 1};
    for (const struct session *session = s->sessions; session; session = session->next)
        for (const struct view_slot *it = session->views; it; it = it->next) {
            if (it == view || !hg_view_slot_is_watched(it) || !it->progress.moved_ns ||
                now_ns - it->progress.moved_ns >= MOVING_NS)
                continue;
            count.all++;
            count.of_scene += session->scene == own->scene;
        }
    return count;
}

// What the next picture may take.
static void set_budget(
    const struct render_state *s, const struct session *session, struct view_slot *view)
{
    if (!hg_view_slot_is_watched(view))
        return;
    const struct moving moving = count_moving(s, session, view);
    hg_view_set_budget(view->view, hg_rate_choose(view, moving.all).target_ms);
    hg_view_set_sharing(view->view, moving.of_scene);
}

// Renders, then reads: what is delivered is what the step left.
static void work(
    struct render_state *s, struct session *session, struct view_slot *view, uint64_t step_ns)
{
    const uint64_t known_ns = heard_ns(session, view); // nothing is heard before the end
    struct hg_error err = {0};
    enum hg_status status = HG_OK;
    view->progress.failed = false;
    hg_scene_slot_publish(session->scene); // a batch may be open for too long
    hg_view_set_formats(view->view, hg_output_formats(s, view));
    set_budget(s, session, view);
    hg_view_set_slice(view->view, may_be_cut(s, view) ? SHARED_STEP_NS : 0);
    const bool moves = hg_view_slot_is_watched(view) && purpose_of(session, view) == MOVES;
    if (wants_step(session, view)) // one sample alone is a picture in motion
        status = step(session, view, moves ? 1 : hg_rate_samples(view, step_ns), &err);
    if (status == HG_E_DEVICE_LOST) {
        // Only a new process gets a clean device; the broker replays the journal into it.
        hg_worker_lose_device(s->w, &err);
        return;
    }
    if (status) {
        hg_fault(FRAME, status, "%s: %s", err.what, err.reason);
        hg_output_fail(s, session, view, &err);
        return;
    }
    hg_output_deliver(s, session, view, known_ns);
}

// A step that takes much longer than those of its tenant usually do makes something for all
// (pipelines, geometry), or the machine was busy with other things: it costs no more than they do.
static uint64_t fair_cost(struct tenant *tenant, uint64_t took_ns)
{
    const uint64_t most_ns = 2 * tenant->usual_ns + SHARED_STEP_NS;
    tenant->usual_ns = (7 * tenant->usual_ns + took_ns) / 8;
    return took_ns < most_ns ? took_ns : most_ns;
}

void hg_schedule_work(struct render_state *s, const struct hg_schedule_choice *choice)
{
    static const uint64_t in_session[] = {[MOVES] = 1, [SETTLES] = 4, [FILMS] = 16},
                          among_sessions[] = {[MOVES] = 1, [SETTLES] = 1, [FILMS] = 4};
    struct session *session = choice->session;
    const enum purpose purpose = purpose_of(session, choice->view);
    const uint64_t begin_ns = hg_clock_now_ns();
    work(s, session, choice->view, choice->contended ? SHARED_STEP_NS : STEP_NS);
    const uint64_t ns = fair_cost(session->tenant, hg_clock_now_ns() - begin_ns);
    session->messages_ns = 0;
    hg_turn_serve(&session->clock, &choice->view->turn, ns * in_session[purpose]);
    charge(s, session, ns * among_sessions[purpose]);
}

void hg_schedule_charge_messages(struct render_state *s, struct session *session, uint64_t ns)
{
    session->messages_ns += ns;
    charge(s, session, ns);
}

// The view of the session whose turn it is. NULL: none has work.
static struct view_slot *choose_view(struct session *session, uint64_t *wait_ns)
{
    struct view_slot *best = NULL;
    for (struct view_slot *it = session->views; it; it = it->next)
        if (has_work(session, it, wait_ns) &&
            (!best || hg_turn_start(&session->clock, &it->turn) <
                          hg_turn_start(&session->clock, &best->turn)))
            best = it;
    return best;
}

// Messages come before views, so that what is rendered is the newest state, but not for ever.
static bool takes_message(const struct session *session, const struct view_slot *view)
{
    return hg_worker_session_is_waiting(session) && (!view || session->messages_ns < MESSAGES_NS);
}

// Tenants first, then their sessions; at equal times what moves, or messages.
static bool is_before(const struct render_state *s, const struct hg_schedule_choice *a,
    const struct hg_schedule_choice *b)
{
    struct tenant *ta = a->session->tenant, *tb = b->session->tenant;
    const uint64_t tenant_a = hg_turn_start(&s->clock, &ta->turn),
                   tenant_b = hg_turn_start(&s->clock, &tb->turn);
    if (tenant_a != tenant_b)
        return tenant_a < tenant_b;
    const uint64_t start_a = hg_turn_start(&ta->clock, &a->session->turn),
                   start_b = hg_turn_start(&tb->clock, &b->session->turn);
    if (ta == tb && start_a != start_b)
        return start_a < start_b;
    const bool moves_a = !a->view || purpose_of(a->session, a->view) == MOVES,
               moves_b = !b->view || purpose_of(b->session, b->view) == MOVES;
    return moves_a && !moves_b;
}

bool hg_schedule_choose(
    struct render_state *s, struct hg_schedule_choice *choice, uint64_t *wait_ns)
{
    *choice = (struct hg_schedule_choice){0};
    *wait_ns = UINT64_MAX;
    for (struct session *it = s->sessions; it; it = it->next) {
        struct hg_schedule_choice next = {.session = it, .view = choose_view(it, wait_ns)};
        if (takes_message(it, next.view))
            next.view = NULL;
        else if (!next.view)
            continue;
        next.contended = choice->session != NULL;
        if (!choice->session || is_before(s, &next, choice))
            *choice = next;
        choice->contended = next.contended;
    }
    return choice->session != NULL;
}
