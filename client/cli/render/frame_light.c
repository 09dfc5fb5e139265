// frame_light.c - helio render: what is said of the light of a picture.
#include <stdio.h>
#include <string.h>

#include "client/cli/render/frames.h"

static const double most_share = 0.95; // of a picture that is black or clipped

void hg_cli_frame_note_light(
    struct hg_cli_render *r, const struct hgp_frame *frame, const char *name)
{
    struct hg_cli_light *poor = &r->light;
    const bool black = frame->has_black && (double)frame->black > most_share;
    const bool clipped = frame->has_clipped && (double)frame->clipped > most_share;
    if (!black && !clipped)
        return;
    if (poor->poor_frames++ > 0)
        return;
    poor->black = black;
    poor->share = black ? frame->black : frame->clipped;
    snprintf(poor->name, sizeof poor->name, "%s", name);
}

// What may help against it; the view's exposure and environment are known, why it is dark is not.
static const char *advice_of(const struct hg_cli_render *r)
{
    const bool meters = hg_cli_meters_exposure(r);
    const bool none = r->o->has_env && strcmp(r->o->env, "none") == 0;
    if (!r->light.black)
        return meters
                   ? "try a lower exposure (--exposure auto-2), or --background none where it is "
                     "the background"
                   : "try --exposure auto, or a lower one";
    if (none)
        return "no light reaches what the camera sees: try --env sky, or another camera";
    return meters ? "the camera sees nothing, or nothing that light reaches: try another camera "
                    "(--orbit, --eye), --env sky or --exposure auto+2"
                  : "try --exposure auto, --env sky or another camera (--orbit, --eye)";
}

void hg_cli_render_warn_of_light(struct hg_cli_render *r)
{
    const struct hg_cli_light *poor = &r->light;
    char what[256], reason[400], others[48] = "";
    if (poor->poor_frames == 0)
        return;
    hg_cli_clean(what, sizeof what, poor->name, strlen(poor->name));
    if (poor->poor_frames > 1)
        snprintf(others, sizeof others, " (so are %u other frames)", poor->poor_frames - 1);
    snprintf(reason, sizeof reason, "%.0f %% of the picture is %s%s: %s", (double)poor->share * 100,
        poor->black ? "black" : "clipped to white", others, advice_of(r));
    const struct hgp_notice notice = {.what = hgp_str_make(what), .reason = hgp_str_make(reason)};
    hg_cli_on_notice(&r->cli.progress, &notice);
}

void hg_cli_render_say_fill(struct hg_cli_render *r)
{
    const struct hg_cli_options *o = r->o;
    const bool chosen = o->has_env || o->has_sun || strcmp(o->args[0], "demo:") == 0;
    if (chosen || r->loaded.lights == 0 || o->progress)
        return;
    hg_cli_progress_say(&r->cli.progress,
        "the scene has %u light%s and no environment: the built-in sky fills in, two stops under "
        "%s; --env none leaves it out",
        r->loaded.lights, r->loaded.lights == 1 ? "" : "s", r->loaded.lights == 1 ? "it" : "them");
}
