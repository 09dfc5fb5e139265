// run_replay.c - helio run --replay: sends a recording again, waits where it waited for settled
// frames, and compares their hashes.
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "client/cli/run/run.h"

static const uint64_t second_ns = 1000000000;
// A settled frame of what the view was before may still be under way: so long the right one is
// waited for behind a wrong one.
static const uint64_t late_ns = 2 * UINT64_C(1000000000);

struct replay {
    struct hg_cli cli;
    const struct hg_cli_options *o;
    struct hg_recording file;
    struct hg_cli_texts files; // that the private worker reads
    struct hg_arena arena;     // of their names, and of messages
    enum hg_cli_doing doing;
    uint64_t begin_ns;
    struct hg_record_settled seen[HG_CLI_VIEWS_MAX]; // newest settled frame by view; view 0: none
    bool subscribed[HG_CLI_VIEWS_MAX], names[HG_CLI_VIEWS_MAX];
    uint32_t answer;        // request whose answer came; 0: none
    uint32_t sent, settled; // messages; frames that were compared
    uint32_t differ;
};

// ---- before anything is sent -------------------------------------------------------------------

static enum hg_status decode(
    struct replay *r, const struct hg_record *record, union hgp_any *out, struct hg_error *err)
{
    const struct hgp_header *h = &record->sent.header;
    struct hgp_fault fault = {0};
    const enum hg_status status = hgp_decode(HGP_VERSION_MAX, h->type,
        hg_reader_make(record->sent.payload, h->length), &r->arena, out, &fault);
    const struct hgp_message_info *info = hgp_find(h->type);
    return status ? hg_error_set(err, HG_E_FORMAT, r->o->replay, info ? info->name : "message",
                        "%s", fault.reason[0] ? fault.reason : "is malformed")
                  : HG_OK;
}

// A path that the recording names, for the private worker's folders.
static enum hg_status note_path(struct replay *r, const struct hgp_str *path, struct hg_error *err)
{
    if (path->size == 0 || path->data[0] != '/' || r->files.count == HG_CLI_TEXTS_MAX)
        return HG_OK;
    char *copy = hg_arena_strndup(&r->arena, path->data, path->size);
    if (!copy)
        return hg_error_set(err, HG_E_NOMEM, r->o->replay, NULL, "no memory");
    r->files.items[r->files.count++] = copy;
    return HG_OK;
}

static enum hg_status check_record(
    struct replay *r, const struct hg_record *record, struct hg_error *err)
{
    union hgp_any message = {0};
    if (record->kind != HG_RECORD_SENT)
        return HG_OK;
    enum hg_status status = decode(r, record, &message, err);
    if (!status && record->sent.header.type == HGP_T_asset_load)
        status = note_path(r, &message.asset_load.path, err);
    if (!status && record->sent.header.type == HGP_T_environment_set &&
        message.environment_set.has_path)
        status = note_path(r, &message.environment_set.path, err);
    return status;
}

// The whole file is looked through before its first message is sent.
static enum hg_status check(struct replay *r, struct hg_error *err)
{
    struct hg_record record;
    enum hg_status status = hg_recording_next(&r->file, &record, err);
    if (!status && record.kind != HG_RECORD_SCENE)
        status =
            hg_error_set(err, HG_E_FORMAT, r->o->replay, "byte 8", "does not begin with a scene");
    while (!status) {
        status = check_record(r, &record, err);
        if (!status)
            status = hg_recording_next(&r->file, &record, err);
    }
    hg_recording_rewind(&r->file);
    return status == HG_E_CLOSED ? HG_OK : status;
}

// ---- what comes --------------------------------------------------------------------------------

static bool is_view(uint32_t view)
{
    return view >= 1 && view <= HG_CLI_VIEWS_MAX;
}

static enum hg_status take_frame(
    struct replay *r, const struct helio_message *m, struct hg_error *err)
{
    uint32_t request;
    const struct hgp_frame *frame = &m->body->frame;
    const struct hgp_credit credit = {.view = frame->view, .frames = 1};
    if (!is_view(frame->view))
        return HG_OK;
    if (frame->settled && frame->has_hash) {
        struct hg_record_settled *seen = &r->seen[frame->view - 1];
        *seen =
            (struct hg_record_settled){frame->view, frame->input_seq, frame->scene_revision, {0}};
        memcpy(seen->hash, frame->hash, sizeof seen->hash);
    }
    if (m->request != 0 || !r->subscribed[frame->view - 1])
        return HG_OK;
    if (r->names[frame->view - 1])
        return helio_taken(r->cli.h, m, err);
    return helio_send(r->cli.h, HGP_T_credit, &credit, &request, err);
}

static enum hg_status take_message(
    struct replay *r, const struct helio_message *m, struct hg_error *err)
{
    if (m->type == HGP_T_error)
        return hg_cli_error_of(&m->body->error, err);
    if (m->type == HGP_T_notice)
        hg_cli_on_notice(&r->cli.progress, &m->body->notice);
    else if (m->type == HGP_T_progress)
        hg_cli_on_progress(&r->cli.progress, &m->body->progress);
    else if (m->request != 0)
        r->answer = m->request;
    return m->type == HGP_T_frame ? take_frame(r, m, err) : HG_OK;
}

// Everything that came, in its order, up to the answer of `request` (0: all of it).
static enum hg_status take_all(struct replay *r, uint32_t request, struct hg_error *err)
{
    struct helio_message *m;
    enum hg_status status = HG_OK;
    while (!status && (request == 0 || r->answer != request)) {
        status = helio_next(r->cli.h, &m, err);
        if (status)
            break;
        status = take_message(r, m, err);
        helio_message_free(m);
    }
    return status == HG_E_AGAIN ? HG_OK : status;
}

static enum hg_status wait_some(struct replay *r, uint64_t until_ns, struct hg_error *err)
{
    const uint64_t now_ns = hg_clock_now_ns();
    if (now_ns >= until_ns)
        return HG_E_TIMEOUT;
    enum hg_status status = helio_wait(r->cli.h, until_ns - now_ns, err);
    if (hg_cli_is_stopped())
        return hg_error_set(err, HG_E_CANCELLED, r->o->replay, NULL, "interrupted");
    return status;
}

static uint64_t deadline(const struct replay *r)
{
    const double s = r->o->has_timeout ? r->o->timeout : 3600;
    return hg_clock_now_ns() + (uint64_t)(s * (double)second_ns);
}

// ---- steps -------------------------------------------------------------------------------------

static enum hg_status open_scene(
    struct replay *r, const struct hg_record *record, struct hg_error *err)
{
    char name[129];
    snprintf(name, sizeof name, "%.*s", (int)record->scene.name.size,
        record->scene.name.data ? record->scene.name.data : "");
    hg_cli_disconnect(&r->cli);
    memset(r->seen, 0, sizeof r->seen);
    memset(r->subscribed, 0, sizeof r->subscribed);
    memset(r->names, 0, sizeof r->names);
    r->doing = HG_CLI_DOING_CONNECT;
    r->cli.scene_name = name;
    enum hg_status status = hg_cli_connect(&r->cli, r->o->connect, &r->files, false, err);
    r->cli.scene_name = NULL;
    if (!status)
        status = helio_scene_open(r->cli.h, name, &r->cli.scene, err);
    if (status || r->cli.scene.first_id == record->scene.first_id)
        return status;
    return hg_error_set(err, HG_E_STATE, r->o->replay, NULL,
        "the recording's session had the ids from %u on, this one has those from %u on: replay it "
        "in a scene that no other session holds",
        record->scene.first_id, r->cli.scene.first_id);
}

// Messages of the session itself, and those that the replay sends on its own.
static bool is_left_out(enum hgp_type type)
{
    return type == HGP_T_scene_open || type == HGP_T_scene_close || type == HGP_T_credit ||
           type == HGP_T_ping || type == HGP_T_pong || type == HGP_T_keep || type == HGP_T_bye ||
           type == HGP_T_resume || type == HGP_T_taken;
}

// What decides how credit is given.
static void note_view(struct replay *r, enum hgp_type type, const union hgp_any *m)
{
    if (type == HGP_T_subscribe && is_view(m->subscribe.view))
        r->subscribed[m->subscribe.view - 1] = m->subscribe.credit_frames > 0;
    if (type == HGP_T_view_set && is_view(m->view_set.view) && m->view_set.has_names)
        r->names[m->view_set.view - 1] = m->view_set.names > 0;
}

// Cameras and requests for frames go on at once; all else is waited for, so that a settled frame
// that comes later shows it.
static enum hg_status send(struct replay *r, const struct hg_record *record, struct hg_error *err)
{
    const enum hgp_type type = (enum hgp_type)record->sent.header.type;
    union hgp_any message = {0};
    uint32_t request;
    if (is_left_out(type))
        return HG_OK;
    enum hg_status status = decode(r, record, &message, err);
    if (!status)
        status = helio_send(r->cli.h, type, &message, &request, err);
    while (!status && type != HGP_T_view_camera && type != HGP_T_frame_request &&
           r->answer != request) {
        status = take_all(r, request, err);
        if (!status && r->answer != request)
            status = wait_some(r, deadline(r), err);
    }
    r->sent++;
    if (!status)
        note_view(r, type, &message);
    if (!status && type != HGP_T_view_camera && type != HGP_T_frame_request)
        memset(r->seen, 0, sizeof r->seen); // they show what was before
    return status;
}

static void say_difference(struct replay *r, const struct hg_record_settled *wanted)
{
    char line[300];
    snprintf(line, sizeof line, "%.200s: view %u, input %llu, revision %llu: another hash",
        r->o->replay, wanted->view, (unsigned long long)wanted->input_seq,
        (unsigned long long)wanted->revision);
    hg_cli_progress_print(&r->cli.progress, line);
}

static enum hg_status compare(
    struct replay *r, const struct hg_record_settled *wanted, struct hg_error *err)
{
    uint64_t until_ns = deadline(r);
    bool wrong = false;
    r->doing = HG_CLI_DOING_RENDER;
    if (!is_view(wanted->view))
        return HG_OK;
    r->settled++;
    for (;;) {
        const struct hg_record_settled *seen = &r->seen[wanted->view - 1];
        enum hg_status status = take_all(r, 0, err);
        if (status)
            return status;
        const bool same_place = seen->view && seen->input_seq == wanted->input_seq &&
                                seen->revision == wanted->revision;
        if (same_place && memcmp(seen->hash, wanted->hash, sizeof seen->hash) == 0)
            return HG_OK;
        if (same_place && !wrong)
            until_ns = hg_clock_now_ns() + late_ns;
        wrong |= same_place;
        status = wait_some(r, until_ns, err);
        if (status != HG_E_TIMEOUT && status)
            return status;
        if (hg_clock_now_ns() < until_ns)
            continue;
        if (!wrong)
            return hg_error_set(err, HG_E_TIMEOUT, r->o->replay, NULL,
                "no settled frame of view %u came in time", wanted->view);
        r->differ++;
        say_difference(r, wanted);
        return HG_OK;
    }
}

static enum hg_status do_record(
    struct replay *r, const struct hg_record *record, struct hg_error *err)
{
    const bool paced = r->o->pace && strcmp(r->o->pace, "recorded") == 0;
    enum hg_status status = HG_OK;
    while (paced && !status && record->kind == HG_RECORD_SENT && r->cli.h &&
           hg_clock_now_ns() < r->begin_ns + record->time_ns) {
        status = wait_some(r, r->begin_ns + record->time_ns, err);
        status = status == HG_E_TIMEOUT || !status ? take_all(r, 0, err) : status;
    }
    if (status)
        return status;
    switch (record->kind) {
    case HG_RECORD_SCENE:
        return open_scene(r, record, err);
    case HG_RECORD_SENT:
        r->doing = HG_CLI_DOING_INPUT;
        return send(r, record, err);
    case HG_RECORD_SETTLED:
        return compare(r, &record->settled, err);
    }
    return HG_OK;
}

// ---- the command -------------------------------------------------------------------------------

static enum hg_status check_options(const struct hg_cli_options *o, struct hg_error *err)
{
    const char *with = o->arg_count > 0       ? o->args[0]
                       : o->record            ? "--record"
                       : o->junit             ? "--junit"
                       : o->report            ? "--report"
                       : o->update_references ? "--update-references"
                                              : NULL;
    return with
               ? hg_error_set(err, HG_E_INVAL, "--replay", NULL, "cannot be combined with %s", with)
               : HG_OK;
}

static enum hg_status replay_all(struct replay *r, struct hg_error *err)
{
    struct hg_record record;
    r->doing = HG_CLI_DOING_ARGUMENTS;
    enum hg_status status = check_options(r->o, err);
    if (status)
        return status;
    r->doing = HG_CLI_DOING_INPUT;
    status = hg_recording_open(r->o->replay, &r->file, err);
    if (!status)
        status = check(r, err);
    r->begin_ns = hg_clock_now_ns();
    while (!status) {
        status = hg_recording_next(&r->file, &record, err);
        if (!status)
            status = do_record(r, &record, err);
    }
    return status == HG_E_CLOSED && r->file.at == r->file.size ? HG_OK : status;
}

enum hg_cli_exit hg_cli_run_replay(const struct hg_cli_options *options)
{
    struct hg_error err = {0};
    struct replay *r = hg_calloc(1, sizeof *r);
    if (!r)
        return HG_CLI_EXIT_LIMIT;
    r->o = options;
    hg_cli_init(&r->cli, options);
    const enum hg_status status = replay_all(r, &err);
    enum hg_cli_exit code = status ? hg_cli_report(&r->cli, r->doing, &err) : HG_CLI_EXIT_OK;
    if (!status && r->differ > 0)
        code = HG_CLI_EXIT_FAILED;
    hg_cli_progress_clear(&r->cli.progress);
    if (!status)
        printf("%s: %u messages sent, %u settled frames, %u differ\n", options->replay, r->sent,
            r->settled, r->differ);
    hg_cli_finish(&r->cli, code);
    hg_recording_close(&r->file);
    hg_arena_finish(&r->arena);
    hg_free(r);
    return code;
}
