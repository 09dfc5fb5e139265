#include "server/worker/bake.h"

#include <jansson.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/bake/bake.h"

enum { PROGRESS_NS = 100 * 1000 * 1000 };

struct bake {
    const struct request *r;
    uint64_t sent_ns;
};

static bool tell(void *user, const char *stage, uint64_t done, uint64_t total)
{
    struct bake *b = user;
    uint64_t now = hg_clock_now_ns();
    if (now - b->sent_ns >= PROGRESS_NS) {
        b->sent_ns = now;
        hg_reply_progress(b->r->to, stage, done, total);
    }
    return !atomic_load(&b->r->s->w->stop);
}

// Both members may be left out; anything but true and false is refused.
static enum hg_status take_flag(
    const json_t *options, const char *name, bool *off, struct hg_error *err)
{
    const json_t *value = json_object_get(options, name);
    *off = json_is_false(value);
    if (value && !json_is_boolean(value))
        return hg_error_set(err, HG_E_INVAL, "bake", name, "is neither true nor false");
    return HG_OK;
}

static enum hg_status run(const struct request *r, char **text, struct hg_error *err)
{
    const struct hgp_bake *m = &r->message->bake;
    const struct worker_options *o = &r->s->w->options;
    struct bake user = {.r = r};
    json_error_t fault;
    json_t *options =
        json_loadb(m->options.data ? m->options.data : "", m->options.size, 0, &fault);
    struct hg_bake bake = {.scene = r->session->scene->scene,
        .cache_dir = o->cache_dir,
        .cache_limit_bytes = o->cache_limit_bytes,
        .host_budget_bytes = o->host_budget_bytes,
        .jobs = r->s->jobs,
        .progress = tell,
        .progress_user = &user};
    *text = NULL;
    enum hg_status st = HG_OK;
    if (!json_is_object(options))
        st = hg_error_set(err, HG_E_INVAL, "bake", "options", "not a JSON object: %s", fault.text);
    else if (!o->cache_dir)
        st = hg_error_set(err, HG_E_STATE, "bake", NULL, "this worker has no cache folder");
    st = st ? st : take_flag(options, "textures", &bake.no_textures, err);
    st = st ? st : take_flag(options, "geometry", &bake.no_geometry, err);
    json_decref(options);
    return st ? st : hg_bake_run(&bake, text, err);
}

void hg_handle_bake(const struct request *r)
{
    struct hg_error err = {0};
    char *text = NULL;
    enum hg_status st = hg_render_state_need_jobs(r->s)
                            ? run(r, &text, &err)
                            : hg_error_set(&err, HG_E_NOMEM, "bake", NULL, "no threads");
    if (st)
        hg_reply_error(r->to, &err);
    else
        hg_reply_send(r->to, HGP_T_json, &(struct hgp_json){.text = hgp_str_make(text)});
    hg_free(text);
}
