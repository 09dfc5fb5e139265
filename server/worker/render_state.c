#include "server/worker/render_state.h"

#include <jansson.h>
#include <stdio.h>

#include "base/alloc.h"

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
        .overrides = o->overrides,
    };
}

void hg_render_state_expect_renderer(struct render_state *s)
{
    const struct hg_renderer_params params = renderer_params(&s->w->options);
    if (!s->renderer)
        hg_lazy_device_start(&s->lazy, &params);
}

enum hg_status hg_render_state_need_renderer(struct render_state *s, struct hg_error *err)
{
    if (!s->renderer)
        s->renderer = hg_lazy_device_take(&s->lazy);
    if (s->renderer)
        return HG_OK;
    const struct hg_renderer_params params = renderer_params(&s->w->options);
    return hg_renderer_create(&params, &s->renderer, err);
}

struct hg_jobs *hg_render_state_need_jobs(struct render_state *s)
{
    if (!s->jobs)
        s->jobs = hg_jobs_create(0);
    return s->jobs;
}

const char *hg_render_state_device_name(struct render_state *s)
{
    char *text = NULL;
    if (s->device[0] || !s->renderer || hg_renderer_device_json(s->renderer, &text))
        return s->device;
    json_t *root = json_loads(text, 0, NULL);
    const char *name = json_string_value(json_object_get(root, "name"));
    if (!name)
        name = json_string_value(json_object_get(json_object_get(root, "device"), "name"));
    snprintf(s->device, sizeof s->device, "%s", name ? name : "unknown");
    json_decref(root);
    hg_free(text);
    return s->device;
}

void hg_render_state_finish(struct render_state *s)
{
    hg_lazy_device_finish(&s->lazy);
    hg_renderer_destroy(s->renderer);
    hg_jobs_destroy(s->jobs);
}
