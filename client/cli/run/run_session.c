// run_session.c - helio run: connections and scenes.
#include <stdio.h>
#include <string.h>

#include "client/cli/run/run.h"

void hg_cli_run_forget(struct hg_cli_run *r)
{
    for (uint32_t i = 0; i < HG_CLI_VIEWS_MAX; i++)
        helio_message_free(r->scene.views[i].frame);
    r->scene = (struct hg_cli_run_scene){0};
    r->cli.view = HG_CLI_VIEW;
}

void hg_cli_run_changed(struct hg_cli_run *r)
{
    for (uint32_t i = 0; i < HG_CLI_VIEWS_MAX; i++)
        r->scene.views[i].dirty = true;
}

static enum hg_status open_view(struct hg_cli_run *r, uint32_t number, struct hg_error *err)
{
    const struct hgp_view_set view = {.view = number};
    enum hg_status status = helio_call_for(r->cli.h, HGP_T_view_set, &view, HGP_T_ok, NULL, err);
    if (!status)
        r->scene.views[number - 1] = (struct hg_cli_run_view){.is_open = true, .dirty = true};
    return status;
}

enum hg_status hg_cli_run_switch(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct hg_error *err)
{
    struct hg_cli_run_view *view = &r->scene.views[s->x - 1];
    const struct hgp_view_close leave = {.view = s->x};
    char number[16];
    if (!s->now) {
        r->cli.view = s->x;
        return view->is_open ? HG_OK : open_view(r, s->x, err);
    }
    snprintf(number, sizeof number, "%u", s->x);
    if (!view->is_open)
        return hg_error_set(err, HG_E_NOTFOUND, "view", number, "there is no view of that number");
    helio_message_free(view->frame);
    *view = (struct hg_cli_run_view){0};
    r->cli.view = HG_CLI_VIEW;
    return helio_call_for(r->cli.h, HGP_T_view_close, &leave, HGP_T_ok, NULL, err);
}

enum hg_status hg_cli_run_connect(
    struct hg_cli_run *r, const char *url, const char *scene, struct hg_error *err)
{
    hg_cli_run_forget(r);
    r->doing = HG_CLI_DOING_CONNECT;
    hg_cli_progress_warnings(&r->cli.progress);
    hg_cli_disconnect(&r->cli);
    r->cli.scene_name = scene;
    return hg_cli_connect(&r->cli, url, &r->files, false, err);
}

static enum hg_status open_scene(struct hg_cli_run *r, const char *name, struct hg_error *err)
{
    enum hg_status status = helio_scene_open(r->cli.h, name, &r->cli.scene, err);
    if (status)
        return status;
    r->scene.is_open = true;
    if (r->recorder)
        status = hg_cli_recorder_attach(r->recorder, r->cli.h, &r->cli.scene, name, err);
    return status ? status : open_view(r, HG_CLI_VIEW, err);
}

enum hg_status hg_cli_run_need_scene(struct hg_cli_run *r, struct hg_error *err)
{
    enum hg_status status = r->cli.h ? HG_OK : hg_cli_run_connect(r, r->o->connect, NULL, err);
    if (status || r->scene.is_open)
        return status;
    r->doing = HG_CLI_DOING_CONNECT;
    return open_scene(r, "", err);
}

enum hg_status hg_cli_run_join(struct hg_cli_run *r, const char *name, struct hg_error *err)
{
    struct helio_info info;
    const struct hgp_scene_close leave = {0};
    enum hg_status status = r->cli.h ? HG_OK : hg_cli_run_connect(r, r->o->connect, name, err);
    if (status)
        return status;
    r->doing = HG_CLI_DOING_ARGUMENTS;
    if (r->scene.is_open)
        status = helio_call_for(r->cli.h, HGP_T_scene_close, &leave, HGP_T_ok, NULL, err);
    if (status)
        return status;
    hg_cli_run_forget(r);
    status = open_scene(r, name, err);
    if (status)
        return status;
    helio_get_info(r->cli.h, &info);
    r->scene.is_joined = r->cli.scene.existed;
    return r->scene.is_joined || info.role >= HGP_role_EDIT
               ? HG_OK
               : hg_error_set(err, HG_E_NOTFOUND, "scene", name,
                     "no session holds a scene of that name, and the role view cannot fill one");
}
