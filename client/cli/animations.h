// animations.h - which animations of a file are posed: --animation of `helio render`, `at ...
// animation NAME` in scripts. Thread: the command's.
#ifndef HG_CLIENT_CLI_ANIMATIONS_H
#define HG_CLIENT_CLI_ANIMATIONS_H

#include "client/cli/cli.h"

struct hg_cli_animations { // none: all that have no conflicts (animation -1)
    int32_t items[HG_CLI_TEXTS_MAX];
    uint32_t count;
};

// Index of an animation of the scene's asset at place `asset` from 0, by its name, or its number
// from 0. `what` is the option's or the line's name in errors. HG_E_NOTFOUND lists what there is.
enum hg_status hg_cli_animation_find(struct hg_cli *cli, uint32_t asset, const char *what,
    const char *name, int32_t *index, struct hg_error *err) HG_MUST_CHECK;
// Names of the first asset's animations that are left out of all together, as they move what
// earlier ones do: "Walk, Run", cut to `size` with an ellipsis; "" without any.
enum hg_status hg_cli_animations_left_out(
    struct hg_cli *cli, char *names, size_t size, struct hg_error *err) HG_MUST_CHECK;
// Poses an asset, given by its number, at a time.
enum hg_status hg_cli_animations_pose(struct hg_cli *cli, uint32_t asset,
    const struct hg_cli_animations *chosen, double time_s, struct hg_error *err) HG_MUST_CHECK;

#endif
