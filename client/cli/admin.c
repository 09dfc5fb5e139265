// admin.c - helio ping, stats, sessions, quarantine.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "client/cli/cli.h"

// Connects to the daemon that --connect names.
static enum hg_status connect_daemon(
    struct hg_cli *cli, enum hg_cli_doing *doing, struct hg_error *err)
{
    *doing = HG_CLI_DOING_ARGUMENTS;
    if (!cli->options->connect)
        return hg_error_set(err, HG_E_INVAL, "--connect", NULL, "is needed: the daemon's URL");
    *doing = HG_CLI_DOING_CONNECT;
    return hg_cli_connect(cli, cli->options->connect, NULL, false, err);
}

enum hg_cli_exit hg_cli_end(
    struct hg_cli *cli, enum hg_cli_doing doing, enum hg_status status, const struct hg_error *err)
{
    enum hg_cli_exit code = status ? hg_cli_report(cli, doing, err) : HG_CLI_EXIT_OK;
    hg_cli_finish(cli, code);
    return code;
}

enum hg_cli_exit hg_cli_at_daemon(const struct hg_cli_options *options,
    enum hg_status (*act)(struct hg_cli *cli, struct hg_error *err))
{
    struct hg_cli cli;
    struct hg_error err = {0};
    enum hg_cli_doing doing;
    hg_cli_init(&cli, options);
    enum hg_status status = connect_daemon(&cli, &doing, &err);
    if (!status)
        status = act(&cli, &err);
    return hg_cli_end(&cli, doing, status, &err);
}

// ---- ping --------------------------------------------------------------------------------------

static enum hg_status ping_all(struct hg_cli *cli, struct hg_error *err)
{
    uint32_t count = cli->options->has_count ? cli->options->count : 4;
    uint64_t least = UINT64_MAX, most = 0, sum = 0;
    struct helio_info info;
    helio_get_info(cli->h, &info);
    char server[136];
    hg_cli_clean(server, sizeof server, info.server, strlen(info.server));
    printf("%s: %s, protocol %u, connected in %.2f ms\n", cli->options->connect, server,
        info.version, (double)cli->connect_ns / 1e6);
    for (uint32_t i = 0; i < count; i++) {
        uint64_t rtt;
        enum hg_status status = helio_ping(cli->h, &rtt, err);
        if (status)
            return status;
        least = rtt < least ? rtt : least;
        most = rtt > most ? rtt : most;
        sum += rtt;
        if (i + 1 < count)
            hg_clock_sleep_ns(50 * 1000 * 1000);
    }
    printf("%u pings: least %.3f ms, mean %.3f ms, most %.3f ms\n", count, (double)least / 1e6,
        (double)sum / count / 1e6, (double)most / 1e6);
    return HG_OK;
}

enum hg_cli_exit hg_cli_ping(const struct hg_cli_options *options)
{
    return hg_cli_at_daemon(options, ping_all);
}

// ---- stats, sessions ---------------------------------------------------------------------------

enum hg_status hg_cli_query(
    struct hg_cli *cli, enum hgp_type type, json_t **out, struct hg_error *err)
{
    char *text;
    json_error_t wrong;
    *out = NULL;
    enum hg_status status = helio_query_json(cli->h, type, 0, &text, err);
    if (status)
        return status;
    *out = json_loads(text, JSON_DECODE_ANY, &wrong);
    helio_text_free(text);
    if (!*out)
        return hg_error_set(err, HG_E_FORMAT, "answer", NULL, "the server's JSON is malformed");
    return HG_OK;
}

void hg_cli_print_json(const json_t *value)
{
    json_dumpf(value, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
    putchar('\n');
}

static enum hg_status print_stats(struct hg_cli *cli, struct hg_error *err)
{
    json_t *stats = NULL;
    // The worker of a session answers; a session without a scene has none.
    enum hg_status status = helio_scene_open(cli->h, "", &cli->scene, err);
    if (!status)
        status = hg_cli_query(cli, HGP_T_stats_query, &stats, err);
    if (!status)
        hg_cli_print_json(stats);
    json_decref(stats);
    return status;
}

enum hg_cli_exit hg_cli_stats_command(const struct hg_cli_options *options)
{
    return hg_cli_at_daemon(options, print_stats);
}

static void cell_text(const json_t *value, char *dst, size_t size)
{
    if (json_is_string(value))
        hg_cli_clean(dst, size, json_string_value(value), json_string_length(value));
    else if (json_is_integer(value))
        snprintf(dst, size, "%lld", (long long)json_integer_value(value));
    else if (json_is_real(value))
        snprintf(dst, size, "%.6g", json_real_value(value));
    else
        snprintf(dst, size, "%s", json_is_true(value) ? "yes" : json_is_false(value) ? "no" : "-");
}

// A list of objects as columns named by the first one's keys.
void hg_cli_print_table(json_t *list)
{
    const char *key;
    json_t *value;
    char text[256];
    json_t *first = json_array_get(list, 0);
    int widths[32] = {0}, columns = 0;
    json_object_foreach(first, key, value)
    {
        if (columns == 32)
            break;
        widths[columns] = (int)strlen(key);
        for (size_t i = 0; i < json_array_size(list); i++) {
            cell_text(json_object_get(json_array_get(list, i), key), text, sizeof text);
            int n = (int)strlen(text);
            widths[columns] = n > widths[columns] ? n : widths[columns];
        }
        printf("%-*s  ", widths[columns++], key);
    }
    putchar('\n');
    for (size_t i = 0; i < json_array_size(list); i++) {
        int column = 0;
        json_object_foreach(first, key, value)
        {
            if (column == 32)
                break;
            cell_text(json_object_get(json_array_get(list, i), key), text, sizeof text);
            printf("%-*s  ", widths[column++], text);
        }
        putchar('\n');
    }
}

static void print_sessions(json_t *answer)
{
    json_t *list = json_is_array(answer) ? answer : json_object_get(answer, "sessions");
    if (json_is_object(json_array_get(list, 0)))
        hg_cli_print_table(list);
    else if (json_is_array(list))
        printf("no sessions\n");
    else
        hg_cli_print_json(answer);
}

static enum hg_status list_sessions(struct hg_cli *cli, struct hg_error *err)
{
    json_t *answer = NULL;
    if (cli->options->has_interval)
        return hg_cli_follow_sessions(cli, err);
    enum hg_status status = hg_cli_query(cli, HGP_T_sessions_query, &answer, err);
    if (!status && cli->options->json)
        hg_cli_print_json(answer);
    else if (!status)
        print_sessions(answer);
    json_decref(answer);
    return status;
}

enum hg_cli_exit hg_cli_sessions(const struct hg_cli_options *options)
{
    return hg_cli_at_daemon(options, list_sessions);
}

static void print_quarantine(json_t *answer)
{
    json_t *list = json_object_get(answer, "quarantine");
    if (json_array_size(list) > 0)
        hg_cli_print_table(list);
    else
        printf("no file is in quarantine\n");
}

static enum hg_status list_quarantine(struct hg_cli *cli, struct hg_error *err)
{
    json_t *answer = NULL;
    enum hg_status status = hg_cli_query(cli, HGP_T_quarantine_query, &answer, err);
    if (!status && cli->options->json)
        hg_cli_print_json(answer);
    else if (!status)
        print_quarantine(answer);
    json_decref(answer);
    return status;
}

static enum hg_status clear_quarantine(struct hg_cli *cli, const char *key, struct hg_error *err)
{
    struct helio_message *answer = NULL;
    const struct hgp_quarantine_clear message = {.key = hgp_str_make(key)};
    enum hg_status status =
        helio_call_for(cli->h, HGP_T_quarantine_clear, &message, HGP_T_ok, &answer, err);
    helio_message_free(answer);
    return status;
}

enum hg_cli_exit hg_cli_quarantine(const struct hg_cli_options *options)
{
    struct hg_cli cli;
    struct hg_error err = {0};
    enum hg_cli_doing doing = HG_CLI_DOING_ARGUMENTS;
    const char *verb = options->args[0];
    hg_cli_init(&cli, options);
    enum hg_status status = HG_OK;
    const bool clear = strcmp(verb, "clear") == 0;
    if (!clear && strcmp(verb, "list") != 0)
        status = hg_error_set(&err, HG_E_INVAL, "quarantine", NULL, "takes list or clear");
    if (!status)
        status = connect_daemon(&cli, &doing, &err);
    if (!status && !clear)
        status = list_quarantine(&cli, &err);
    else if (!status && options->arg_count < 2)
        status = clear_quarantine(&cli, "", &err);
    for (uint32_t i = 1; clear && i < options->arg_count && !status; i++)
        status = clear_quarantine(&cli, options->args[i], &err);
    return hg_cli_end(&cli, doing, status, &err);
}
