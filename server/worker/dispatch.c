// dispatch.c - the render thread: takes messages in order, then lets views work in turn.
#include "server/worker/serve.h"

#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/log.h"

// What may wait behind a session's running task.
enum { WAITING_LIMIT = 65536, WAITING_LIMIT_BYTES = 512 * 1024 * 1024 };
// Messages are taken for this long before views get a turn, whatever still waits.
static const uint64_t message_slice_ns = 20000000u;

// ---- answers ------------------------------------------------------------------------------------

void serve_answer(const struct request *r, enum hgp_type type, const void *message)
{
    link_send(r->s->w, r->channel, r->id, type, message);
}

void serve_ok(const struct request *r)
{
    if (r->id)
        serve_answer(r, HGP_T_ok, &(struct hgp_ok){.revision = r->session->scene->scene->revision});
}

void serve_fail(const struct request *r, const struct hg_error *err)
{
    link_send_error(r->s->w, r->channel, r->id, err);
}

void serve_edited(const struct request *r)
{
    struct scene_slot *slot = r->session->scene;
    if (r->session->batch_depth)
        slot->dirty = true;
    else
        hg_scene_publish(slot->scene);
    serve_ok(r);
}

static struct hg_renderer_params renderer_params(const struct worker_options *o)
{
    return (struct hg_renderer_params){
        .device = o->device,
        .cache_dir = o->cache_dir,
        .shader_dir = o->shader_dir,
        .texture_budget_bytes = o->texture_budget_bytes,
        .geometry_budget_bytes = o->geometry_budget_bytes,
        .host_budget_bytes = o->host_budget_bytes,
        .cache_limit_bytes = o->cache_limit_bytes,
        .validation = o->validation,
    };
}

void serve_expect_renderer(struct serve *s)
{
    const struct hg_renderer_params params = renderer_params(&s->w->options);
    if (!s->renderer)
        opener_start(&s->opener, &params);
}

enum hg_status serve_need_renderer(struct serve *s, struct hg_error *err)
{
    if (!s->renderer)
        s->renderer = opener_take(&s->opener);
    if (s->renderer)
        return HG_OK;
    const struct hg_renderer_params params = renderer_params(&s->w->options);
    return hg_renderer_create(&params, &s->renderer, err);
}

// Decodes the message once more into the task, so that it outlives this request.
static enum hg_status fill_task(const struct request *r, struct task *task, enum hgp_type type)
{
    task->payload = hg_refbuf_ref(r->payload);
    if (type == HGP_T_image_query) {
        task->file = r->session->file;
        r->session->file = (struct hg_writer){0};
    }
    return hgp_decode(HGP_VERSION_MAX, (uint16_t)type, r->payload->data, r->payload->size,
        &task->arena, &task->message, NULL);
}

void serve_start_task(const struct request *r, enum task_kind kind, enum hgp_type type)
{
    struct serve *s = r->s;
    if (!s->jobs)
        s->jobs = hg_jobs_create(0);
    struct task *task = s->jobs ? hg_calloc(1, sizeof *task) : NULL;
    enum hg_status status = task ? fill_task(r, task, type) : HG_E_NOMEM;
    if (!status) {
        task->kind = kind;
        task->w = s->w;
        task->channel = r->channel;
        task->request = r->id;
        task->session = r->session->number;
        task->jobs = s->jobs;
        r->session->task = task;
        status = task_start(task);
    }
    if (!status) {
        s->tasks++;
        return;
    }
    r->session->task = NULL;
    task_destroy(task);
    struct hg_error err = {0};
    hg_error_set(&err, status, "task", NULL, "cannot start a thread for the request");
    serve_fail(r, &err);
}

// ---- dispatch -----------------------------------------------------------------------------------

static const struct {
    enum hgp_type type;
    void (*handle)(const struct request *r);
} handlers[] = {
    {HGP_T_asset_load, edit_asset_load},
    {HGP_T_asset_unload, edit_asset_unload},
    {HGP_T_environment_set, edit_environment_set},
    {HGP_T_animation_set, edit_animation_set},
    {HGP_T_variant_set, edit_variant_set},
    {HGP_T_mesh_set, edit_mesh_set},
    {HGP_T_texture_set, edit_texture_set},
    {HGP_T_material_set, edit_material_set},
    {HGP_T_node_set, edit_node_set},
    {HGP_T_light_set, edit_light_set},
    {HGP_T_camera_set, edit_camera_set},
    {HGP_T_object_remove, edit_object_remove},
    {HGP_T_batch_begin, edit_batch_begin},
    {HGP_T_batch_end, edit_batch_end},
    {HGP_T_view_set, view_set},
    {HGP_T_view_close, view_close},
    {HGP_T_view_camera, view_camera},
    {HGP_T_frame_request, view_frame_request},
    {HGP_T_subscribe, view_subscribe},
    {HGP_T_credit, view_credit},
    {HGP_T_job_query, view_job_query},
    {HGP_T_checkpoint_query, view_checkpoint_query},
    {HGP_T_checkpoint_set, view_checkpoint_set},
    {HGP_T_pick, query_pick},
    {HGP_T_bounds_query, query_bounds},
    {HGP_T_nodes_query, query_nodes},
    {HGP_T_stats_query, query_stats},
    {HGP_T_info_query, query_info},
    {HGP_T_compare, query_compare},
    {HGP_T_image_query, query_image},
    {HGP_T_bench, query_bench},
    {HGP_T_bake, query_bake},
};

// Messages about the link or a session as a whole.
static bool handle_link(const struct request *r, uint16_t type)
{
    struct serve *s = r->s;
    switch (type) {
    case HGP_T_session_attach:
        session_attach(s, r->channel, r->id, &r->message->session_attach);
        return true;
    case HGP_T_session_detach:
        if (r->session)
            session_detach(s, r->session);
        return true;
    case HGP_T_replay_end:
        if (r->session)
            r->session->restoring = false;
        if (r->session && r->session->scene->scene->revision < r->message->replay_end.revision)
            r->session->scene->scene->revision = r->message->replay_end.revision;
        return true;
    case HGP_T_ping:
        serve_answer(r, HGP_T_pong, &(struct hgp_pong){.nonce = r->message->ping.nonce});
        return true;
    case HGP_T_pong:
        return true;
    case HGP_T_scene_open: // the broker opens scenes; on a private link the session has its own
        if (r->session)
            serve_answer(r, HGP_T_scene_opened,
                &(struct hgp_scene_opened){.revision = r->session->scene->scene->revision,
                    .first_id = r->session->first_id,
                    .id_count = r->session->id_count});
        return r->session != NULL;
    default:
        return false;
    }
}

static void handle_message(const struct request *r, uint16_t type)
{
    struct hg_error err = {0};
    if (handle_link(r, type))
        return;
    if (!r->session) {
        hg_error_set(
            &err, HG_E_STATE, "message", NULL, "no session is attached to channel %u", r->channel);
        serve_fail(r, &err);
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
    serve_fail(r, &err);
}

static void decode_and_handle(struct serve *s, struct command *c)
{
    struct hg_arena arena = {0};
    union hgp_any message;
    struct hgp_fault fault = {0};
    struct request r = {
        .s = s,
        .session = session_find(s, c->header.channel),
        .channel = c->header.channel,
        .id = c->header.request,
        .payload = c->payload,
        .message = &message,
    };
    enum hg_status status = hgp_decode(HGP_VERSION_MAX, c->header.type, c->payload->data,
        c->payload->size, &arena, &message, &fault);
    if (status == HG_OK) {
        handle_message(&r, c->header.type);
    } else if (!(c->header.flags & HGP_FLAG_OPTIONAL) || hgp_find(c->header.type)) {
        const struct hgp_message_info *info = hgp_find(c->header.type);
        struct hg_error err = {0};
        hg_error_set(&err, status, info ? info->name : "message", fault.field, "byte %llu: %s",
            (unsigned long long)fault.offset, fault.reason ? fault.reason : hg_status_text(status));
        serve_fail(&r, &err);
    }
    hg_arena_finish(&arena);
}

static void free_command(struct command *c)
{
    hg_refbuf_unref(c->payload);
    hg_free(c);
}

// While a session's task runs, its messages wait; the broker's own messages do not.
static bool must_wait(const struct session *session, uint16_t type)
{
    return session && session->task && type != HGP_T_session_detach && type != HGP_T_ping;
}

static void handle_command(struct serve *s, struct command *c)
{
    struct session *session = session_find(s, c->header.channel);
    if (!must_wait(session, c->header.type)) {
        decode_and_handle(s, c);
        free_command(c);
        return;
    }
    uint64_t bytes = session->waiting_bytes + c->header.length;
    if (session->waiting_count >= WAITING_LIMIT || bytes > WAITING_LIMIT_BYTES) {
        struct hg_error err = {0};
        hg_error_set(&err, HG_E_BUSY, "session", NULL,
            "%u messages of %llu bytes wait for a load to finish", session->waiting_count,
            (unsigned long long)session->waiting_bytes);
        link_send_error(s->w, c->header.channel, c->header.request, &err);
        free_command(c);
        return;
    }
    session->waiting_count++;
    session->waiting_bytes = bytes;
    c->next = NULL;
    *session->waiting_end = c;
    session->waiting_end = &c->next;
}

// Messages that waited run until one of them starts the next task.
static void run_waiting(struct serve *s, uint32_t channel)
{
    struct session *session;
    while ((session = session_find(s, channel)) && !session->task && session->waiting) {
        struct command *c = session->waiting;
        session->waiting = c->next;
        session->waiting_count--;
        session->waiting_bytes -= c->header.length;
        if (!session->waiting)
            session->waiting_end = &session->waiting;
        decode_and_handle(s, c);
        free_command(c);
    }
}

static void handle_finished_task(struct serve *s, struct command *c)
{
    struct task *task = c->task;
    struct session *session = session_find(s, task->channel);
    s->tasks--;
    if (session && session->task == task) {
        session->task = NULL;
        task_finish(&(struct request){.s = s,
                        .session = session,
                        .channel = task->channel,
                        .id = task->request,
                        .payload = task->payload,
                        .message = &task->message},
            task);
        run_waiting(s, task->channel);
    }
    task_destroy(task);
    hg_free(c);
}

static void handle(struct serve *s, struct command *c)
{
    atomic_store(&s->w->step_started_ns, hg_clock_now_ns());
    if (c->task)
        handle_finished_task(s, c);
    else if (c->payload)
        handle_command(s, c);
    else
        free_command(c); // only there to wake the thread
    atomic_store(&s->w->step_started_ns, 0);
}

// ---- the thread ---------------------------------------------------------------------------------

// What has been read is worth keeping: a tenth of the time that the worker has run may go to that.
static void linger(struct serve *s)
{
    const uint64_t most_ns = 1000000000, ran_ns = hg_clock_now_ns() - s->started_ns;
    hg_renderer_linger(s->renderer, ran_ns / 10 < most_ns ? ran_ns / 10 : most_ns);
}

// Messages that are still in the inbox take no effect: nobody is there to be answered.
static void shut_down(struct serve *s)
{
    linger(s);
    while (s->sessions)
        session_detach(s, s->sessions);
    while (s->tasks) { // cancelled; each comes back once
        struct command *c = hg_queue_pop(&s->w->inbox, UINT64_MAX);
        if (c && c->task)
            handle_finished_task(s, c);
        else if (c)
            free_command(c);
    }
    opener_finish(&s->opener);
    hg_renderer_destroy(s->renderer);
    hg_jobs_destroy(s->jobs);
}

static void take_messages(struct serve *s, struct command *first)
{
    uint64_t start = hg_clock_now_ns();
    for (struct command *c = first; c; c = hg_queue_try_pop(&s->w->inbox)) {
        handle(s, c);
        if (atomic_load(&s->w->stop) || atomic_load(&s->w->device_lost) ||
            hg_clock_now_ns() - start > message_slice_ns)
            return;
    }
}

void *render_main(void *arg)
{
    struct serve s = {.w = arg, .started_ns = hg_clock_now_ns()};
    uint64_t wait_ns = UINT64_MAX;
    if (s.w->options.warm_up) {
        struct hg_error err = {0};
        enum hg_status status = serve_need_renderer(&s, &err);
        if (!status)
            status = hg_renderer_warm_up(s.renderer, NULL, NULL, &err);
        if (status)
            hg_fault(WORKER, status, "warm-up: %s", err.reason);
    }
    while (!atomic_load(&s.w->stop)) {
        struct command *c = hg_queue_pop(&s.w->inbox, wait_ns);
        take_messages(&s, c);
        if (atomic_load(&s.w->device_lost))
            return NULL; // the process ends; nothing of the driver is touched any more
        atomic_store(&s.w->step_started_ns, hg_clock_now_ns());
        bool more = view_step_next(&s, &wait_ns);
        atomic_store(&s.w->step_started_ns, 0);
        if (more)
            wait_ns = 0;
    }
    shut_down(&s);
    return NULL;
}
