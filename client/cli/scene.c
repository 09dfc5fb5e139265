// scene.c - questions about the scene and its statistics that several commands ask.
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "client/cli/cli.h"
#include "client/cli/suggest.h"

enum { NODES_PER_QUERY = 4096 };

static const double pi = 3.14159265358979323846;

// Calls `visit` for every node until it returns true.
static enum hg_status walk_nodes(struct hg_cli *cli,
    bool (*visit)(void *user, const struct hgp_node_entry *node), void *user, struct hg_error *err)
{
    uint32_t first = 0, total = 1;
    while (first < total) {
        struct hgp_nodes_query query = {.first = first, .count = NODES_PER_QUERY};
        struct helio_message *answer;
        enum hg_status status =
            helio_call_for(cli->h, HGP_T_nodes_query, &query, HGP_T_nodes, &answer, err);
        if (status)
            return status;
        const struct hgp_nodes *nodes = &answer->body->nodes;
        bool done = nodes->nodes.count == 0;
        total = nodes->total;
        for (uint32_t i = 0; !done && i < nodes->nodes.count; i++)
            done = visit(user, &nodes->nodes.items[i]);
        first += nodes->nodes.count;
        helio_message_free(answer);
        if (done)
            break;
    }
    return HG_OK;
}

struct node_search {
    const char *name;
    long number;      // of the camera, -1 = by name only
    long seen;        // cameras so far
    uint64_t by_name, by_number;
    char known[160]; // names of cameras, for messages
    struct hg_suggestion near;
};

static bool is_named(const struct hgp_node_entry *node, const char *name)
{
    return node->name.size == strlen(name) &&
           memcmp(node->name.data ? node->name.data : "", name, node->name.size) == 0;
}

static bool visit_camera(void *user, const struct hgp_node_entry *node)
{
    struct node_search *s = user;
    if (!node->camera)
        return false;
    if (is_named(node, s->name) && !s->by_name)
        s->by_name = node->node;
    if (s->seen == s->number)
        s->by_number = node->node;
    size_t used = strlen(s->known);
    char name[64];
    hg_cli_clean(name, sizeof name, node->name.data, node->name.size);
    snprintf(
        s->known + used, sizeof s->known - used, "%s%ld '%s'", s->seen ? ", " : "", s->seen, name);
    s->seen++;
    return s->by_name != 0;
}

enum hg_status hg_cli_find_camera(
    struct hg_cli *cli, const char *option, const char *name, uint64_t *node, struct hg_error *err)
{
    struct node_search search = {.name = name, .number = -1};
    *node = 0;
    if (*name && strspn(name, "0123456789") == strlen(name) && strlen(name) < 9)
        search.number = strtol(name, NULL, 10);
    enum hg_status status = walk_nodes(cli, visit_camera, &search, err);
    if (status)
        return status;
    *node = search.by_name ? search.by_name : search.by_number;
    if (!*node)
        return hg_error_set(err, HG_E_NOTFOUND, option, NULL, "no camera '%s'; the scene has %s",
            name, search.seen ? search.known : "none");
    return HG_OK;
}

static bool visit_node(void *user, const struct hgp_node_entry *node)
{
    struct node_search *s = user;
    char name[HG_SUGGEST_BYTES];
    if (is_named(node, s->name))
        s->by_name = node->node;
    hg_cli_clean(name, sizeof name, node->name.data, node->name.size);
    hg_suggest_offer(&s->near, name, strlen(name));
    return s->by_name != 0;
}

enum hg_status hg_cli_find_node(
    struct hg_cli *cli, const char *name, uint64_t *node, struct hg_error *err)
{
    struct node_search search = {
        .name = name, .number = -1, .near = hg_suggest_begin(name, strlen(name))};
    *node = 0;
    enum hg_status status = walk_nodes(cli, visit_node, &search, err);
    if (status)
        return status;
    *node = search.by_name ? search.by_name : hg_cli_parse_object(cli, name);
    return *node ? HG_OK
                 : hg_error_set(err, HG_E_NOTFOUND, "node", name, "no node of that name%s",
                       hg_suggest_text(&search.near).text);
}

uint64_t hg_cli_parse_object(const struct hg_cli *cli, const char *name)
{
    uint32_t asset, index;
    char tail;
    if (strspn(name, "0123456789:") != strlen(name) ||
        sscanf(name, "%9u:%9u%c", &asset, &index, &tail) != 2 || asset == 0)
        return 0;
    return helio_object_id(cli->scene.first_id + asset - 1, index);
}

static const char *const up_names[] = {"auto", "+X", "+Y", "+Z", "-X", "-Y", "-Z"};

const char *hg_cli_up_name(enum hgp_up_axis up)
{
    return up_names[up];
}

enum hg_status hg_cli_parse_up(
    const char *option, const char *text, enum hgp_up_axis *up, struct hg_error *err)
{
    for (size_t i = 0; i < sizeof up_names / sizeof *up_names; i++)
        if (strcasecmp(text, up_names[i] + (up_names[i][0] == '+' && text[0] != '+')) == 0) {
            *up = (enum hgp_up_axis)i;
            return HG_OK;
        }
    return hg_error_set(
        err, HG_E_INVAL, option, NULL, "'%s' is none of auto +X +Y +Z -X -Y -Z", text);
}

enum hg_status hg_cli_parse_view(
    const char *option, const char *text, struct hgp_view_fit *fit, struct hg_error *err)
{
    char azimuth[32];
    double degrees[2];
    const char *comma = strchr(text, ',');
    if (!helio_view_angles(text, &degrees[0], &degrees[1])) {
        if (!comma || (size_t)(comma - text) >= sizeof azimuth)
            return hg_error_set(err, HG_E_INVAL, option, NULL,
                "'%s' is none of front back left right top bottom iso, nor AZIMUTH,ELEVATION in "
                "degrees",
                text);
        snprintf(azimuth, sizeof azimuth, "%.*s", (int)(comma - text), text);
        if (hg_cli_parse_number(option, azimuth, -36000, 36000, &degrees[0], err) ||
            hg_cli_parse_number(option, comma + 1, -90, 90, &degrees[1], err))
            return HG_E_INVAL;
    }
    fit->has_azimuth_rad = fit->has_elevation_rad = true;
    fit->azimuth_rad = (float)(degrees[0] * pi / 180);
    fit->elevation_rad = (float)(degrees[1] * pi / 180);
    return HG_OK;
}

enum hg_status hg_cli_send(struct hg_cli *cli, enum hgp_type type, const void *message,
    uint32_t *request, struct hg_error *err)
{
    enum hg_status status = helio_send(cli->h, type, message, request, err);
    while (status == HG_E_AGAIN) {
        status = helio_wait(cli->h, HELIO_NO_TIMEOUT, err);
        if (!status)
            status = helio_send(cli->h, type, message, request, err);
    }
    return status;
}

enum hg_status hg_cli_send_camera(
    struct hg_cli *cli, const struct hgp_view_camera *camera, struct hg_error *err)
{
    // With a request id, so that an error names this message instead of ending the connection.
    uint32_t request;
    return hg_cli_send(cli, HGP_T_view_camera, camera, &request, err);
}

enum hg_status hg_cli_compare(struct hg_cli *cli, struct hg_cli_comparison *c, struct hg_error *err)
{
    struct helio_message *answer;
    struct hgp_compare compare = {
        .metric = c->metric,
        .a = {c->a.data, (uint32_t)c->a.size},
        .b = {c->b.data, (uint32_t)c->b.size},
        .want_diff = c->want_diff,
        .has_mask = c->mask.size > 0,
        .mask = {c->mask.data, (uint32_t)c->mask.size},
    };
    c->value = 0;
    c->diff = (struct hg_cli_bytes){0};
    enum hg_status status =
        helio_call_for(cli->h, HGP_T_compare, &compare, HGP_T_compared, &answer, err);
    if (status)
        return status;
    const struct hgp_compared *got = &answer->body->compared;
    c->value = got->value;
    if (c->want_diff) {
        c->diff.data = hg_calloc(got->diff.size, 1);
        if (!c->diff.data)
            status = hg_error_set(err, HG_E_NOMEM, "compared", "diff", "no memory");
        else if (got->diff.size)
            memcpy(c->diff.data, got->diff.data, got->diff.size);
        c->diff.size = status ? 0 : got->diff.size;
    }
    helio_message_free(answer);
    return status;
}

enum hg_status hg_cli_stats(struct hg_cli *cli, json_t **out, struct hg_error *err)
{
    char *text;
    json_error_t wrong;
    *out = NULL;
    enum hg_status status = helio_query_json(cli->h, HGP_T_stats_query, cli->view, &text, err);
    if (status)
        return status;
    *out = json_loads(text, 0, &wrong);
    helio_text_free(text);
    if (json_is_object(*out))
        return HG_OK;
    json_decref(*out);
    *out = NULL;
    return hg_error_set(err, HG_E_FORMAT, "statistics", NULL, "the server's JSON is not an object");
}
