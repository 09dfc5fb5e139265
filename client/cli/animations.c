// animations.c - see animations.h.
#include "client/cli/animations.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// What the scene says of the animations of an asset; *info owns it.
static enum hg_status query(
    struct hg_cli *cli, uint32_t asset, json_t **info, json_t **list, struct hg_error *err)
{
    char *text;
    json_error_t wrong;
    *info = *list = NULL;
    enum hg_status status = helio_query_json(cli->h, HGP_T_info_query, 0, &text, err);
    if (status)
        return status;
    *info = json_loads(text, 0, &wrong);
    helio_text_free(text);
    *list = json_object_get(json_array_get(json_object_get(*info, "assets"), asset), "animations");
    return HG_OK;
}

static const char *name_of(const json_t *animation)
{
    const char *name = json_string_value(json_object_get(animation, "name"));
    return name ? name : "";
}

// Adds ", NAME" as far as there is room for it and for the ellipsis behind the last one.
static void add_name(char *names, size_t size, const char *name, size_t number)
{
    enum { ELLIPSIS = 5 };
    char clean[200];
    const size_t length = strlen(names);
    hg_cli_clean(clean, sizeof clean, name, strlen(name));
    if (!clean[0])
        snprintf(clean, sizeof clean, "%zu", number);
    if (length + strlen(clean) + 2 + ELLIPSIS < size)
        snprintf(names + length, size - length, "%s%s", length ? ", " : "", clean);
    else if (length >= 3 && strcmp(names + length - 3, "...") != 0)
        snprintf(names + length, size - length, ", ...");
}

enum hg_status hg_cli_animation_find(struct hg_cli *cli, uint32_t asset, const char *what,
    const char *name, int32_t *index, struct hg_error *err)
{
    json_t *info, *list, *animation;
    char known[160] = "";
    size_t i;
    const bool numeric = *name && strspn(name, "0123456789") == strlen(name) && strlen(name) < 9;
    enum hg_status status = query(cli, asset, &info, &list, err);
    *index = -1;
    if (status)
        return status;
    json_array_foreach(list, i, animation)
    {
        if (*index < 0 && strcmp(name_of(animation), name) == 0)
            *index = (int32_t)i;
        add_name(known, sizeof known, name_of(animation), i);
    }
    const long number = numeric ? strtol(name, NULL, 10) : -1;
    if (*index < 0 && number >= 0 && (size_t)number < json_array_size(list))
        *index = (int32_t)number;
    json_decref(info);
    if (*index >= 0)
        return HG_OK;
    return hg_error_set(err, HG_E_NOTFOUND, what, NULL, "no animation '%s'; the file has %s", name,
        known[0] ? known : "none");
}

enum hg_status hg_cli_animations_left_out(
    struct hg_cli *cli, char *names, size_t size, struct hg_error *err)
{
    json_t *info, *list, *animation;
    size_t i;
    enum hg_status status = query(cli, 0, &info, &list, err);
    names[0] = '\0';
    if (status)
        return status;
    json_array_foreach(list, i, animation)
    {
        if (json_is_true(json_object_get(animation, "conflicts")))
            add_name(names, size, name_of(animation), i);
    }
    json_decref(info);
    return HG_OK;
}

enum hg_status hg_cli_animations_pose(struct hg_cli *cli, uint32_t asset,
    const struct hg_cli_animations *chosen, double time_s, struct hg_error *err)
{
    struct hgp_animation_set pose = {.asset = asset, .animation = -1, .time_s = time_s};
    if (chosen->count == 0)
        return helio_call_for(cli->h, HGP_T_animation_set, &pose, HGP_T_ok, NULL, err);
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < chosen->count && !status; i++) {
        pose.animation = chosen->items[i];
        status = helio_call_for(cli->h, HGP_T_animation_set, &pose, HGP_T_ok, NULL, err);
    }
    return status;
}
