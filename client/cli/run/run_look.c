// run_look.c - helio run: how the view shows the scene, and what is seen at its pixels.
#include <stdio.h>

#include "client/cli/run/run.h"

enum hg_status hg_cli_run_look(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    struct helio *h = r->cli.h;
    hg_cli_run_now(r)->dirty = true;
    if (s->kind == HG_CLI_STEP_CLIP) {
        struct hgp_view_clip clip = s->clip;
        clip.view = r->cli.view;
        return helio_call_for(h, HGP_T_view_clip, &clip, HGP_T_ok, NULL, err);
    }
    if (s->kind == HG_CLI_STEP_VIEW_VARIANT) {
        const struct hgp_view_variant variant = {.view = r->cli.view,
            .asset = r->cli.scene.first_id + (s->asset ? s->asset : 1) - 1,
            .has_variant = true,
            .variant = hgp_str_make(s->name)};
        return helio_call_for(h, HGP_T_view_variant, &variant, HGP_T_ok, NULL, err);
    }
    struct hgp_node_override one = s->override;
    struct hgp_view_overrides m = {
        .view = r->cli.view, .has_clear = s->name == NULL, .clear = s->name == NULL};
    if (s->name)
        status = hg_cli_find_node(&r->cli, s->name, &one.node, err);
    m.overrides.items = &one;
    m.overrides.count = s->name != NULL;
    return status ? status : helio_call_for(h, HGP_T_view_overrides, &m, HGP_T_ok, NULL, err);
}

enum hg_status hg_cli_run_seen(
    struct hg_cli_run *r, const struct hg_cli_step *s, uint32_t *pixels, struct hg_error *err)
{
    uint64_t node;
    struct helio_message *answer;
    struct hgp_pixel_rect rect = {s->x, s->y, s->width, s->height};
    struct hgp_box_select m = {.view = r->cli.view};
    m.rects.items = &rect;
    m.rects.count = 1;
    *pixels = 0;
    enum hg_status status = hg_cli_find_node(&r->cli, s->name, &node, err);
    if (!status)
        status = helio_call_for(r->cli.h, HGP_T_box_select, &m, HGP_T_box_selected, &answer, err);
    if (status)
        return status;
    const struct hgp_box_selected *got = &answer->body->box_selected;
    for (uint32_t i = 0; i < got->nodes.count; i++)
        if (got->nodes.items[i].node == node)
            *pixels = got->nodes.items[i].pixels;
    helio_message_free(answer);
    return HG_OK;
}

enum hg_status hg_cli_run_distance(struct hg_cli_run *r, const struct hg_cli_step *s, bool *hit,
    double *distance, struct hg_error *err)
{
    struct helio_message *answer;
    const struct hgp_measure m = {
        .view = r->cli.view, .x0 = s->x, .y0 = s->y, .x1 = s->width, .y1 = s->height};
    *hit = false;
    const enum hg_status status =
        helio_call_for(r->cli.h, HGP_T_measure, &m, HGP_T_measured, &answer, err);
    if (status)
        return status;
    *hit = answer->body->measured.hit;
    *distance = (double)answer->body->measured.distance;
    helio_message_free(answer);
    return HG_OK;
}
