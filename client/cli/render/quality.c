// quality.c - helio render: the presets of --quality.
#include <stdio.h>
#include <string.h>

#include "client/cli/render/render.h"

struct preset {
    uint32_t samples;
    double error_px, noise; // noise 0: not set
    uint32_t max_bounces;   // 0: not set
};

static struct preset preset_of(bool final, bool path)
{
    if (path)
        return final ? (struct preset){1024, 1, 0.01, 0} : (struct preset){4, 2, 0, 4};
    return final ? (struct preset){128, 0.5, 0, 0} : (struct preset){2, 4, 0, 0};
}

void hg_cli_apply_quality(struct hg_cli_options *o, char *line, size_t size)
{
    size_t n = 0;
    line[0] = 0;
    if (!o->has_quality)
        return;
    const struct preset p = preset_of(strcmp(o->quality, "final") == 0, hg_cli_is_path(o));
    n += (size_t)snprintf(line, size, "--quality %s:", o->quality);
    if (!o->has_samples && !o->has_spp) {
        o->has_samples = true;
        o->samples = p.samples;
        n += (size_t)snprintf(line + n, size - n, " --samples %u", p.samples);
    }
    if (!o->has_error_px) {
        o->has_error_px = true;
        o->error_px = p.error_px;
        n += (size_t)snprintf(line + n, size - n, " --error-px %g", p.error_px);
    }
    if (!o->has_noise && p.noise > 0) {
        o->has_noise = true;
        o->noise = p.noise;
        n += (size_t)snprintf(line + n, size - n, " --noise %g", p.noise);
    }
    if (!o->has_max_bounces && p.max_bounces) {
        o->has_max_bounces = true;
        o->max_bounces = p.max_bounces;
        snprintf(line + n, size - n, " --max-bounces %u", p.max_bounces);
    }
}
