// run_session.c - helio run: connections and scenes.
#include <string.h>

#include "client/cli/run.h"

void hg_cli_run_forget(struct hg_cli_run *r)
{
    helio_message_free(r->scene.frame);
    r->scene = (struct hg_cli_run_scene){.dirty = true};
}

enum hg_status hg_cli_run_connect(struct hg_cli_run *r, const char *url, struct hg_error *err)
{
    hg_cli_run_forget(r);
    r->doing = HG_CLI_DOING_CONNECT;
    hg_cli_progress_warnings(&r->cli.progress);
    hg_cli_disconnect(&r->cli);
    return hg_cli_connect(&r->cli, url, &r->files, false, err);
}

static enum hg_status open_scene(struct hg_cli_run *r, const char *name, struct hg_error *err)
{
    struct hgp_view_set view = {.view = HG_CLI_VIEW};
    enum hg_status status = helio_scene_open(r->cli.h, name, &r->cli.scene, err);
    if (status)
        return status;
    r->scene.is_open = true;
    return helio_call_for(r->cli.h, HGP_T_view_set, &view, HGP_T_ok, NULL, err);
}

enum hg_status hg_cli_run_need_scene(struct hg_cli_run *r, struct hg_error *err)
{
    enum hg_status status = r->cli.h ? HG_OK : hg_cli_run_connect(r, r->o->connect, err);
    if (status || r->scene.is_open)
        return status;
    r->doing = HG_CLI_DOING_CONNECT;
    return open_scene(r, "", err);
}

enum hg_status hg_cli_run_join(struct hg_cli_run *r, const char *name, struct hg_error *err)
{
    struct helio_info info;
    const struct hgp_scene_close leave = {0};
    enum hg_status status = r->cli.h ? HG_OK : hg_cli_run_connect(r, r->o->connect, err);
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
