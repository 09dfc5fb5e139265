#include "server/worker/dispatch.h"

#include "base/clock.h"
#include "base/log.h"
#include "server/worker/bake.h"
#include "server/worker/checkpoint.h"
#include "server/worker/edit_load.h"
#include "server/worker/edit_mesh.h"
#include "server/worker/edit_object.h"
#include "server/worker/query.h"
#include "server/worker/session_messages.h"
#include "server/worker/view_fit.h"
#include "server/worker/view_messages.h"
#include "server/worker/view_schedule.h"

// Messages are taken for this long before views get a turn, whatever still waits.
static const uint64_t message_slice_ns = 20000000u;

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
    {HGP_T_subscribe, hg_handle_subscribe},
    {HGP_T_credit, hg_handle_credit},
    {HGP_T_job_query, hg_handle_job_query},
    {HGP_T_checkpoint_query, hg_handle_checkpoint_query},
    {HGP_T_checkpoint_set, hg_handle_checkpoint_set},
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
    if (hg_session_message_handle(r, type))
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
        .session = hg_session_find(s, c->header.channel),
        .to = reply_to(s, c),
        .payload = c->payload,
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
            (unsigned long long)fault.offset, fault.reason ? fault.reason : hg_status_text(status));
        hg_reply_error(r.to, &err);
    }
    hg_arena_finish(&arena);
}

// While a session's task runs, its messages wait; the broker's own messages do not.
static bool must_wait(const struct session *session, uint16_t type)
{
    return session && session->task && type != HGP_T_session_detach && type != HGP_T_ping;
}

static void handle_command(struct render_state *s, struct command *c)
{
    struct session *session = hg_session_find(s, c->header.channel);
    struct hg_error err = {0};
    if (!must_wait(session, c->header.type))
        decode_and_handle(s, c);
    else if (hg_session_hold(session, c, &err))
        hg_reply_error(reply_to(s, c), &err);
    else
        return; // the session's now
    hg_worker_free_command(s->w, c);
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

// Messages that waited run until one of them starts the next task, or ends the session.
static void run_waiting(struct render_state *s, uint32_t channel)
{
    struct session *session;
    struct command *c;
    while ((session = hg_session_find(s, channel)) && (c = hg_session_resume(session))) {
        decode_and_handle(s, c);
        hg_worker_free_command(s->w, c);
    }
}

static void handle_finished_task(struct render_state *s, struct task *task)
{
    const struct reply_to to = task->to;
    struct session *session = hg_session_find(s, to.channel);
    s->tasks--;
    if (session && session->task == task) {
        const struct request r = {.s = s,
            .session = session,
            .to = to,
            .payload = task->payload,
            .message = &task->message};
        session->task = NULL;
        finish_task(&r, task);
        run_waiting(s, to.channel);
    }
    hg_task_destroy(task);
}

static void handle(struct render_state *s, struct command *c)
{
    atomic_store(&s->w->step_started_ns, hg_clock_now_ns());
    if (c->payload) {
        handle_command(s, c);
    } else {
        if (c->task)
            handle_finished_task(s, c->task);
        hg_worker_free_command(s->w, c);
    }
    atomic_store(&s->w->step_started_ns, 0);
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
    while (s->sessions)
        hg_session_message_detach(s, s->sessions);
    while (s->tasks) { // cancelled; each comes back once
        struct command *c = hg_queue_pop(&s->w->inbox, UINT64_MAX);
        if (c && c->task)
            handle_finished_task(s, c->task);
        if (c)
            hg_worker_free_command(s->w, c);
    }
    hg_render_state_finish(s);
}

static void take_messages(struct render_state *s, struct command *first)
{
    uint64_t start = hg_clock_now_ns();
    for (struct command *c = first; c; c = hg_queue_try_pop(&s->w->inbox)) {
        handle(s, c);
        if (atomic_load(&s->w->stop) || atomic_load(&s->w->device_lost) ||
            hg_clock_now_ns() - start > message_slice_ns)
            return;
    }
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
    uint64_t wait_ns = UINT64_MAX;
    if (s.w->options.warm_up)
        warm_up(&s);
    while (!atomic_load(&s.w->stop)) {
        struct command *c = hg_queue_pop(&s.w->inbox, wait_ns);
        take_messages(&s, c);
        if (atomic_load(&s.w->device_lost))
            return NULL; // the process ends; nothing of the driver is touched any more
        atomic_store(&s.w->step_started_ns, hg_clock_now_ns());
        bool more = hg_schedule_step_next(&s, &wait_ns);
        atomic_store(&s.w->step_started_ns, 0);
        if (more)
            wait_ns = 0;
    }
    shut_down(&s);
    return NULL;
}
