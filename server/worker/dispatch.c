#include "server/worker/dispatch.h"

#include "base/clock.h"
#include "base/log.h"
#include "server/worker/bake.h"
#include "server/worker/checkpoint.h"
#include "server/worker/edit/edit_load.h"
#include "server/worker/edit/edit_mesh.h"
#include "server/worker/edit/edit_object.h"
#include "server/worker/encode/encode_queue.h"
#include "server/worker/query/query.h"
#include "server/worker/session_messages.h"
#include "server/worker/query/surface_query.h"
#include "server/worker/view/view_fit.h"
#include "server/worker/view/view_look.h"
#include "server/worker/view/view_messages.h"
#include "server/worker/view/view_schedule.h"

// For how long messages are taken from the inbox between turns, and handled in one turn.
static const uint64_t take_ns = 5000000u, messages_ns = 2000000u;

static struct reply_to reply_to(const struct render_state *s, const struct command *c)
{
    return (struct reply_to){s->w, c->header.channel, c->header.request};
}

// ---- messages -----------------------------------------------------------------------------------

static const struct {
    enum hgp_type type;
    void (*handle)(const struct request *r);
} handlers[] = {
    {HGP_T_asset_load, hg_handle_asset_load},
    {HGP_T_asset_unload, hg_handle_asset_unload},
    {HGP_T_environment_set, hg_handle_environment_set},
    {HGP_T_animation_set, hg_handle_animation_set},
    {HGP_T_variant_set, hg_handle_variant_set},
    {HGP_T_mesh_set, hg_handle_mesh_set},
    {HGP_T_texture_set, hg_handle_texture_set},
    {HGP_T_material_set, hg_handle_material_set},
    {HGP_T_node_set, hg_handle_node_set},
    {HGP_T_light_set, hg_handle_light_set},
    {HGP_T_camera_set, hg_handle_camera_set},
    {HGP_T_object_remove, hg_handle_object_remove},
    {HGP_T_batch_begin, hg_handle_batch_begin},
    {HGP_T_batch_end, hg_handle_batch_end},
    {HGP_T_view_set, hg_handle_view_set},
    {HGP_T_view_close, hg_handle_view_close},
    {HGP_T_view_camera, hg_handle_view_camera},
    {HGP_T_view_fit, hg_handle_view_fit},
    {HGP_T_frame_request, hg_handle_frame_request},
    {HGP_T_exposure_query, hg_handle_exposure_query},
    {HGP_T_frame_cancel, hg_handle_frame_cancel},
    {HGP_T_subscribe, hg_handle_subscribe},
    {HGP_T_credit, hg_handle_credit},
    {HGP_T_taken, hg_handle_taken},
    {HGP_T_delivered, hg_handle_delivered},
    {HGP_T_key_frame, hg_handle_key_frame},
    {HGP_T_job_query, hg_handle_job_query},
    {HGP_T_checkpoint_query, hg_handle_checkpoint_query},
    {HGP_T_checkpoint_set, hg_handle_checkpoint_set},
    {HGP_T_view_clip, hg_handle_view_clip},
    {HGP_T_view_overrides, hg_handle_view_overrides},
    {HGP_T_view_variant, hg_handle_view_variant},
    {HGP_T_box_select, hg_handle_box_select},
    {HGP_T_surface_query, hg_handle_surface_query},
    {HGP_T_measure, hg_handle_measure},
    {HGP_T_pick, hg_handle_pick},
    {HGP_T_bounds_query, hg_handle_bounds_query},
    {HGP_T_nodes_query, hg_handle_nodes_query},
    {HGP_T_stats_query, hg_handle_stats_query},
    {HGP_T_info_query, hg_handle_info_query},
    {HGP_T_compare, hg_handle_compare},
    {HGP_T_image_query, hg_handle_image_query},
    {HGP_T_bake, hg_handle_bake},
};

static void handle_message(const struct request *r, uint16_t type)
{
    struct hg_error err = {0};
    if (hg_worker_session_message_handle(r, type))
        return;
    if (!r->session) {
        hg_error_set(&err, HG_E_STATE, "message", NULL, "no session is attached to channel %u",
            r->to.channel);
        hg_reply_error(r->to, &err);
        return;
    }
    for (size_t i = 0; i < sizeof handlers / sizeof *handlers; i++)
        if (handlers[i].type == type) {
            handlers[i].handle(r);
            return;
        }
    const struct hgp_message_info *info = hgp_find(type);
    hg_error_set(
        &err, HG_E_UNSUPPORTED, info ? info->name : "message", NULL, "is not served by a worker");
    hg_reply_error(r->to, &err);
}

static void decode_and_handle(struct render_state *s, struct command *c)
{
    struct hg_arena arena = {0};
    union hgp_any message;
    struct hgp_fault fault = {0};
    struct request r = {
        .s = s,
        .session = hg_worker_session_find(s, c->header.channel),
        .to = reply_to(s, c),
        .payload = c->payload,
        .received_ns = c->received_ns,
        .message = &message,
    };
    enum hg_status status = hgp_decode(HGP_VERSION_MAX, c->header.type,
        hg_reader_make(c->payload->data, c->payload->size), &arena, &message, &fault);
    if (status == HG_OK) {
        handle_message(&r, c->header.type);
    } else if (!(c->header.flags & HGP_FLAG_OPTIONAL) || hgp_find(c->header.type)) {
        const struct hgp_message_info *info = hgp_find(c->header.type);
        struct hg_error err = {0};
        hg_error_set(&err, status, info ? info->name : "message", fault.field, "byte %llu: %s",
            (unsigned long long)fault.offset,
            fault.reason[0] ? fault.reason : hg_status_text(status));
        hg_reply_error(r.to, &err);
    }
    hg_arena_finish(&arena);
}

// Messages about sessions, and pings behind a session's task. What waits when a session ends is
// dropped: the broker has answered it.
static bool is_immediate(const struct session *session, uint16_t type)
{
    return !session || type == HGP_T_session_attach || type == HGP_T_session_tenant ||
           type == HGP_T_session_detach || (session->task && type == HGP_T_ping);
}

// A replay that ends has been answered, all but its end.
static void finish_replay(struct render_state *s, struct session *session)
{
    const uint32_t channel = session->channel;
    struct command *c;
    while (session && session->restoring && (c = hg_worker_session_resume(session))) {
        decode_and_handle(s, c);
        hg_worker_free_command(s->w, c);
        session = hg_worker_session_find(s, channel);
    }
}

static bool out_of_room(struct render_state *s, struct session *session, struct command *c)
{
    struct hg_error err = {0};
    if (!hg_worker_session_hold(session, c, &err))
        return false;
    if (!session->task) { // there will be room soon
        s->blocked = c;
        return true;
    }
    hg_reply_error(reply_to(s, c), &err);
    hg_worker_free_command(s->w, c);
    return false;
}

// ---- finished tasks -----------------------------------------------------------------------------

static void finish_task(const struct request *r, struct task *task)
{
    static void (*const finishers[])(const struct request *r, struct task *task) = {
        [TASK_ASSET] = hg_edit_asset_loaded,
        [TASK_ENVIRONMENT] = hg_edit_environment_loaded,
        [TASK_COMPARE] = hg_query_compared,
        [TASK_IMAGE] = hg_query_image_examined,
    };
    finishers[task->kind](r, task);
}

static void handle_finished_task(struct render_state *s, struct task *task)
{
    const struct reply_to to = task->to;
    struct session *session = hg_worker_session_find(s, to.channel);
    s->tasks--;
    if (session && session->task == task) {
        const struct request r = {.s = s,
            .session = session,
            .to = to,
            .payload = task->payload,
            .message = &task->message};
        session->task = NULL;
        finish_task(&r, task);
    }
    hg_task_destroy(task);
}

// What came out of the inbox: most wait for their session's turn. False: nothing more is taken now.
static bool take(struct render_state *s, struct watch *watch, struct command *c)
{
    struct session *session = c->payload ? hg_worker_session_find(s, c->header.channel) : NULL;
    s->blocked = NULL;
    if (c->payload && !is_immediate(session, c->header.type))
        return !out_of_room(s, session, c);
    hg_watch_begin(watch, c->task ? (struct watch_work){c->task->to.channel, c->task->to.request, 0}
                                  : (struct watch_work){c->header.channel, c->header.request, 0});
    if (session && c->header.type == HGP_T_session_detach)
        finish_replay(s, session);
    if (c->payload)
        decode_and_handle(s, c);
    else if (c->task)
        handle_finished_task(s, c->task);
    hg_watch_end(watch);
    hg_worker_free_command(s->w, c);
    return true;
}

// ---- the thread ---------------------------------------------------------------------------------

// What has been read is worth keeping: a tenth of the time that the worker has run may go to that.
static void linger(struct render_state *s)
{
    const uint64_t most_ns = 1000000000, ran_ns = hg_clock_now_ns() - s->started_ns;
    hg_renderer_linger(s->renderer, ran_ns / 10 < most_ns ? ran_ns / 10 : most_ns);
}

// Messages that are still in the inbox take no effect: the link that asked is closed.
static void shut_down(struct render_state *s)
{
    linger(s);
    if (s->blocked)
        hg_worker_free_command(s->w, s->blocked);
    while (s->sessions)
        hg_worker_session_message_detach(s, s->sessions);
    while (s->tasks) { // cancelled; each comes back once
        struct command *c = hg_queue_pop(&s->w->inbox, UINT64_MAX);
        if (c && c->task)
            handle_finished_task(s, c->task);
        if (c)
            hg_worker_free_command(s->w, c);
    }
    hg_encode_queue_destroy(s->w->encoders); // they read pixels of the renderer
    s->w->encoders = NULL;
    hg_render_state_finish(s);
}

static bool ends(const struct render_state *s)
{
    return atomic_load(&s->w->stop) || atomic_load(&s->w->device_lost);
}

static void take_messages(struct render_state *s, struct watch *watch, struct command *first)
{
    const uint64_t start_ns = hg_clock_now_ns();
    for (struct command *c = first; c && take(s, watch, c); c = hg_queue_try_pop(&s->w->inbox))
        if (ends(s) || hg_clock_now_ns() - start_ns > take_ns)
            return;
}

// Messages of the session whose turn it is, until one of them starts a task or ends the session.
static void run_messages(struct render_state *s, struct watch *watch, uint32_t channel)
{
    const uint64_t start_ns = hg_clock_now_ns();
    struct session *session;
    struct command *c;
    uint64_t ns = 0;
    while (ns < messages_ns && !ends(s) && (session = hg_worker_session_find(s, channel)) &&
           (c = hg_worker_session_resume(session))) {
        hg_watch_begin(watch, (struct watch_work){channel, c->header.request, 0});
        decode_and_handle(s, c);
        hg_worker_free_command(s->w, c);
        ns = hg_clock_now_ns() - start_ns;
    }
    hg_watch_end(watch);
    session = hg_worker_session_find(s, channel);
    if (session)
        hg_schedule_charge_messages(s, session, ns);
}

// A turn of whoever is next. Returns how long there is nothing to do.
static uint64_t run_next(struct render_state *s, struct watch *watch)
{
    struct hg_schedule_choice choice;
    uint64_t wait_ns;
    if (!hg_schedule_choose(s, &choice, &wait_ns))
        return wait_ns;
    if (!choice.view) {
        run_messages(s, watch, choice.session->channel);
        return 0;
    }
    const struct frame_wait *wait = choice.view->waits;
    hg_watch_begin(watch, (struct watch_work){choice.session->channel, wait ? wait->request : 0,
                              choice.view->number});
    hg_schedule_work(s, &choice);
    hg_watch_end(watch);
    return 0;
}

static void warm_up(struct render_state *s)
{
    struct hg_error err = {0};
    enum hg_status status = hg_render_state_need_renderer(s, &err);
    if (!status)
        status = hg_renderer_warm_up(s->renderer, NULL, NULL, &err);
    if (status)
        hg_fault(WORKER, status, "warm-up: %s", err.reason);
}

void *hg_dispatch_main(void *arg)
{
    struct render_state s = {.w = arg, .started_ns = hg_clock_now_ns()};
    struct watch watch = {0};
    uint64_t wait_ns = UINT64_MAX;
    hg_watch_add(&s.w->watch, &watch);
    if (s.w->options.warm_up)
        warm_up(&s);
    while (!atomic_load(&s.w->stop)) {
        struct command *c = s.blocked ? s.blocked : hg_queue_pop(&s.w->inbox, wait_ns);
        take_messages(&s, &watch, c);
        if (!ends(&s))
            wait_ns = run_next(&s, &watch);
        if (atomic_load(&s.w->device_lost))
            break;
    }
    if (!atomic_load(&s.w->device_lost)) // else the process ends, and nothing of the driver is
        shut_down(&s);                   // touched any more
    hg_watch_remove(&s.w->watch, &watch);
    return NULL;
}
