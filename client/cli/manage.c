// manage.c - helio message, kick, drain, tickets: administration of a daemon, join tickets.
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/cli/cli.h"

static enum hg_status call(struct hg_cli *cli, enum hgp_type type, const void *message,
    enum hgp_type answer_type, struct helio_message **answer, struct hg_error *err)
{
    struct helio_message *got = NULL;
    enum hg_status status = helio_call_for(cli->h, type, message, answer_type, &got, err);
    if (answer)
        *answer = got;
    else
        helio_message_free(got);
    return status;
}

// All of them are looked at before the first one has an effect.
static enum hg_status check_numbers(
    const struct hg_cli_options *o, uint32_t first, struct hg_error *err)
{
    for (uint32_t i = first; i < o->arg_count; i++) {
        const char *text = o->args[i];
        char *end;
        errno = 0;
        const unsigned long long value = strtoull(text, &end, 10);
        if (text[0] < '0' || text[0] > '9' || *end || !value || errno)
            return hg_error_set(err, HG_E_INVAL, text, NULL, "is no number of a session or ticket");
    }
    return HG_OK;
}

// ---- message, kick, drain -----------------------------------------------------------------------

static enum hg_status do_message(struct hg_cli *cli, struct hg_error *err)
{
    const struct hg_cli_options *o = cli->options;
    const struct hgp_message_send m = {.text = hgp_str_make(o->args[0]),
        .has_session = o->has_to_session,
        .session = o->to_session,
        .has_scene = o->to_scene != NULL,
        .scene = hgp_str_make(o->to_scene ? o->to_scene : "")};
    return call(cli, HGP_T_message_send, &m, HGP_T_ok, NULL, err);
}

static enum hg_status do_kick(struct hg_cli *cli, struct hg_error *err)
{
    const struct hg_cli_options *o = cli->options;
    struct hgp_kick m = {.reason = hgp_str_make(o->reason ? o->reason : ""),
        .has_block_s = o->has_block,
        .block_s = o->block};
    enum hg_status status = check_numbers(o, 0, err);
    for (uint32_t i = 0; i < o->arg_count && !status; i++) {
        m.session = strtoull(o->args[i], NULL, 10);
        status = call(cli, HGP_T_kick, &m, HGP_T_ok, NULL, err);
    }
    return status;
}

static enum hg_status do_drain(struct hg_cli *cli, struct hg_error *err)
{
    const struct hg_cli_options *o = cli->options;
    const struct hgp_drain_set m = {
        .deadline_ms = (uint32_t)((o->has_deadline ? o->deadline : 30) * 1000),
        .reason = hgp_str_make(o->reason ? o->reason : ""),
        .has_stay = o->stay,
        .stay = o->stay,
        .has_cancel = o->cancel,
        .cancel = o->cancel};
    return call(cli, HGP_T_drain_set, &m, HGP_T_ok, NULL, err);
}

enum hg_cli_exit hg_cli_message(const struct hg_cli_options *options)
{
    return hg_cli_at_daemon(options, do_message);
}

enum hg_cli_exit hg_cli_kick(const struct hg_cli_options *options)
{
    return hg_cli_at_daemon(options, do_kick);
}

enum hg_cli_exit hg_cli_drain(const struct hg_cli_options *options)
{
    return hg_cli_at_daemon(options, do_drain);
}

// ---- tickets ------------------------------------------------------------------------------------

static void print_ticket(const struct hg_cli *cli, const struct hgp_join_ticket *m)
{
    char scene[520];
    if (!cli->options->json) {
        printf("%.*s\n", (int)m->secret.size, m->secret.data);
        return;
    }
    json_t *out = json_object();
    snprintf(scene, sizeof scene, "%.*s", (int)m->scene.size, m->scene.size ? m->scene.data : "");
    json_object_set_new(out, "ticket", json_integer((json_int_t)m->ticket));
    json_object_set_new(out, "secret", json_stringn(m->secret.data, m->secret.size));
    json_object_set_new(out, "scene", json_string(scene));
    json_object_set_new(out, "role", json_string(hgp_enum_name("role", m->role)));
    json_object_set_new(out, "uses", json_integer(m->uses));
    json_object_set_new(out, "valid_s", json_integer(m->valid_s));
    hg_cli_print_json(out);
    json_decref(out);
}

static enum hg_status make_ticket(struct hg_cli *cli, struct hg_error *err)
{
    const struct hg_cli_options *o = cli->options;
    struct helio_message *answer = NULL;
    struct hgp_join_make m = {.has_scene = true,
        .scene = hgp_str_make(o->to_scene ? o->to_scene : ""),
        .has_role = true,
        .role = o->may && strcmp(o->may, "edit") == 0 ? HGP_role_EDIT : HGP_role_VIEW,
        .has_uses = o->has_uses,
        .uses = o->uses,
        .has_valid_s = o->has_valid,
        .valid_s = o->valid,
        .has_label = o->label != NULL,
        .label = hgp_str_make(o->label ? o->label : "")};
    if (!o->to_scene)
        return hg_error_set(err, HG_E_INVAL, "--scene", NULL, "is needed: the scene's name");
    enum hg_status status = call(cli, HGP_T_join_make, &m, HGP_T_join_ticket, &answer, err);
    if (!status)
        print_ticket(cli, &answer->body->join_ticket);
    helio_message_free(answer);
    return status;
}

static enum hg_status list_tickets(struct hg_cli *cli, struct hg_error *err)
{
    json_t *answer = NULL;
    enum hg_status status = hg_cli_query(cli, HGP_T_join_query, &answer, err);
    json_t *list = json_object_get(answer, "tickets");
    if (!status && cli->options->json)
        hg_cli_print_json(answer);
    else if (!status && json_array_size(list) > 0)
        hg_cli_print_table(list);
    else if (!status)
        printf("no tickets\n");
    json_decref(answer);
    return status;
}

static enum hg_status revoke_tickets(struct hg_cli *cli, struct hg_error *err)
{
    const struct hg_cli_options *o = cli->options;
    struct hgp_join_revoke m = {0};
    enum hg_status status = HG_OK;
    if (o->arg_count < 2)
        return hg_error_set(
            err, HG_E_INVAL, "tickets", NULL, "revoke takes the numbers of tickets, or all");
    if (strcmp(o->args[1], "all") == 0)
        return call(cli, HGP_T_join_revoke, &m, HGP_T_ok, NULL, err);
    status = check_numbers(o, 1, err);
    for (uint32_t i = 1; i < o->arg_count && !status; i++) {
        m.ticket = strtoull(o->args[i], NULL, 10);
        status = call(cli, HGP_T_join_revoke, &m, HGP_T_ok, NULL, err);
    }
    return status;
}

enum hg_cli_exit hg_cli_tickets(const struct hg_cli_options *options)
{
    static const struct {
        const char *verb;
        enum hg_status (*act)(struct hg_cli *cli, struct hg_error *err);
    } verbs[] = {{"list", list_tickets}, {"make", make_ticket}, {"revoke", revoke_tickets}};
    for (size_t i = 0; i < sizeof verbs / sizeof *verbs; i++)
        if (strcmp(options->args[0], verbs[i].verb) == 0)
            return hg_cli_at_daemon(options, verbs[i].act);
    struct hg_cli cli;
    struct hg_error err = {0};
    hg_cli_init(&cli, options);
    enum hg_status status =
        hg_error_set(&err, HG_E_INVAL, "tickets", NULL, "takes list, make or revoke");
    return hg_cli_end(&cli, HG_CLI_DOING_ARGUMENTS, status, &err);
}

// ---- sessions --follow --------------------------------------------------------------------------

// One line of JSON each time, until the connection ends or Ctrl-C.
enum hg_status hg_cli_follow_sessions(struct hg_cli *cli, struct hg_error *err)
{
    const struct hgp_sessions_watch m = {.interval_ms = (uint32_t)(cli->options->interval * 1000)};
    enum hg_status status = call(cli, HGP_T_sessions_watch, &m, HGP_T_ok, NULL, err);
    while (!status) {
        struct helio_message *message = NULL;
        status = helio_next(cli->h, &message, err);
        if (!status && message->type == HGP_T_statistics) {
            fwrite(message->body->statistics.text.data, 1, message->body->statistics.text.size,
                stdout);
            putchar('\n');
            if (fflush(stdout) != 0) // its reader has gone
                status = HG_E_CANCELLED;
        }
        helio_message_free(message);
        if (status == HG_E_AGAIN)
            status = helio_wait(cli->h, HELIO_NO_TIMEOUT, err);
    }
    return status;
}
