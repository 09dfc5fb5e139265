#include "base/isolate.h"

static const struct hg_isolate_ops *current;
static _Thread_local const _Atomic bool *watched;

void hg_isolate_set(const struct hg_isolate_ops *ops)
{
    current = ops;
}

const struct hg_isolate_ops *hg_isolate_get(void)
{
    return current;
}

void hg_isolate_watch(const _Atomic bool *stop)
{
    watched = stop;
}

bool hg_isolate_is_stopped(void)
{
    return watched && atomic_load(watched);
}

enum hg_status hg_isolate_once(const char *name, const struct hg_isolate_call *call,
    struct hg_isolate_result *out, struct hg_error *err)
{
    struct hg_isolated *process;
    *out = (struct hg_isolate_result){0};
    enum hg_status status = current->open(current->user, name, &process, err);
    if (status)
        return status;
    status = current->call(process, call, out, err);
    current->close(process);
    return status;
}
