// clipping.c - clipping planes along the axes. Pure.
#include "client/view/clipping.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const struct {
    enum hgp_cap_style style;
    const char *name;
} caps[] = {{HGP_cap_style_MATERIAL, "material"}, {HGP_cap_style_HATCH, "hatched"},
    {HGP_cap_style_COLOR, "colour"}, {HGP_cap_style_NONE, "none"}};

enum { CAPS_COUNT = sizeof caps / sizeof *caps };

void hg_clipping_reset(struct hg_clipping *c, bool has_box, const float min[3], const float max[3])
{
    const enum hgp_cap_style style = c->caps;
    *c = (struct hg_clipping){.caps = style, .has_box = has_box};
    for (int i = 0; i < HG_CLIPPING_AXES; i++) {
        c->axes[i].share = 0.5;
        c->has_box &= isfinite(min[i]) && isfinite(max[i]) && min[i] <= max[i];
    }
    if (!c->has_box)
        return;
    memcpy(c->min, min, sizeof c->min);
    memcpy(c->max, max, sizeof c->max);
}

double hg_clipping_position(const struct hg_clipping *c, int axis)
{
    return c->min[axis] + ((double)c->max[axis] - c->min[axis]) * c->axes[axis].share;
}

void hg_clipping_set_share(struct hg_clipping *c, int axis, double share)
{
    c->axes[axis].is_on = true;
    c->axes[axis].share = !(share > 0) ? 0 : share > 1 ? 1 : share;
}

static int find_caps(const struct hg_clipping *c)
{
    for (int i = 0; i < CAPS_COUNT; i++)
        if (caps[i].style == c->caps)
            return i;
    return 0;
}

void hg_clipping_next_caps(struct hg_clipping *c, bool back)
{
    c->caps = caps[(find_caps(c) + (back ? CAPS_COUNT - 1 : 1)) % CAPS_COUNT].style;
}

const char *hg_clipping_caps_name(const struct hg_clipping *c)
{
    return caps[find_caps(c)].name;
}

void hg_clipping_planes(const struct hg_clipping *c, struct hg_clipping_list *out)
{
    *out = (struct hg_clipping_list){.caps = c->caps};
    for (int i = 0; i < HG_CLIPPING_AXES && c->has_box; i++) {
        if (!c->axes[i].is_on)
            continue;
        const float sign = c->axes[i].is_flipped ? 1 : -1;
        struct hgp_clip_plane *plane = &out->items[out->count++];
        plane->normal[i] = sign;
        plane->distance = (float)(sign * hg_clipping_position(c, i));
    }
}

void hg_clipping_text(const struct hg_clipping *c, char *text, size_t size)
{
    size_t n = 0;
    text[0] = 0;
    for (int i = 0; i < HG_CLIPPING_AXES && c->has_box && n < size; i++)
        if (c->axes[i].is_on)
            n += (size_t)snprintf(text + n, size - n, "%s%c", n ? ", " : "", "xyz"[i]);
}
