#include "server/worker/request.h"

#include "base/alloc.h"
#include "server/worker/edit/load_memory.h"

void hg_request_ok(const struct request *r)
{
    hg_reply_ok(r->to, r->session->scene->scene->revision);
}

void hg_request_edited(const struct request *r)
{
    hg_worker_session_edited(r->session);
    hg_request_ok(r);
}

struct view_slot *hg_request_view(const struct request *r, uint32_t number)
{
    struct view_slot *view = hg_view_slot_find(r->session, number);
    if (!view) {
        struct hg_error err = {0};
        hg_error_set(&err, HG_E_NOTFOUND, "view", NULL, "this session has no view %u", number);
        hg_reply_error(r->to, &err);
    }
    return view;
}

static enum hg_status fill_task(const struct request *r, struct task *task, enum hgp_type type)
{
    task->to = r->to;
    task->session = r->session->number;
    task->jobs = r->s->jobs;
    task->payload = hg_refbuf_ref(r->payload);
    task->roots = r->session->roots ? hg_refbuf_ref(r->session->roots) : NULL;
    if (type == HGP_T_image_query) {
        task->file = r->session->file;
        r->session->file = (struct hg_writer){0};
    }
    return hgp_decode(HGP_VERSION_MAX, (uint16_t)type,
        hg_reader_make(r->payload->data, r->payload->size), &task->arena, &task->message, NULL);
}

static enum hg_status start_task(
    const struct request *r, enum task_kind kind, enum hgp_type type, struct hg_error *err)
{
    struct task *task = hg_render_state_need_jobs(r->s) ? hg_calloc(1, sizeof *task) : NULL;
    if (!task)
        return HG_E_NOMEM;
    task->kind = kind;
    enum hg_status status = fill_task(r, task, type);
    if (!status && kind == TASK_ASSET)
        status = hg_load_memory_left(r->s, r->session, &task->memory_bytes, err);
    if (!status)
        status = hg_task_start(task);
    if (status) {
        hg_task_destroy(task);
        return status;
    }
    r->session->task = task;
    r->s->tasks++;
    return HG_OK;
}

void hg_request_start_task(const struct request *r, enum task_kind kind, enum hgp_type type)
{
    struct hg_error err = {0};
    const enum hg_status status = start_task(r, kind, type, &err);
    if (!status)
        return;
    if (!err.status)
        hg_error_set(&err, status, "task", NULL, "cannot start a thread for the request");
    hg_reply_error(r->to, &err);
}
