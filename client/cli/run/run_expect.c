// run_expect.c - helio run: expectations.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/file.h"
#include "client/cli/run/run.h"

// What an expectation found; not finding it at all is a status.
struct sight {
    bool holds, updated;
    char seen[256];
};

bool hg_cli_run_is_expectation(const struct hg_cli_step *s)
{
    return s->kind == HG_CLI_STEP_EXPECT_IMAGE || s->kind == HG_CLI_STEP_EXPECT_STAT ||
           s->kind == HG_CLI_STEP_EXPECT_PICK || s->kind == HG_CLI_STEP_EXPECT_SEEN ||
           s->kind == HG_CLI_STEP_EXPECT_DISTANCE || s->kind == HG_CLI_STEP_EXPECT_HASH;
}

// ---- pictures ----------------------------------------------------------------------------------

static struct hg_cli_bytes frame_bytes(struct hg_cli_run *r)
{
    const struct hgp_bytes data = hg_cli_run_now(r)->frame->body->frame.data;
    return (struct hg_cli_bytes){(uint8_t *)(uintptr_t)data.data, data.size};
}

static enum hg_status compare(struct hg_cli_run *r, const struct hg_cli_step *s, bool want_diff,
    struct hg_cli_comparison *c, struct hg_error *err)
{
    *c = (struct hg_cli_comparison){
        .metric = s->metric, .a = frame_bytes(r), .want_diff = want_diff};
    enum hg_status status = hg_file_read(s->path, HG_CLI_IMAGE_BYTES, &c->b.data, &c->b.size, err);
    if (!status && s->mask)
        status = hg_file_read(s->mask, HG_CLI_IMAGE_BYTES, &c->mask.data, &c->mask.size, err);
    return status ? status : hg_cli_compare(&r->cli, c, err);
}

static void comparison_finish(struct hg_cli_comparison *c)
{
    hg_free(c->b.data);
    hg_free(c->mask.data);
    hg_free(c->diff.data);
    *c = (struct hg_cli_comparison){0};
}

// The newest frame takes the place of the reference, in the format of its name.
static enum hg_status update_reference(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct hg_error *err)
{
    struct hg_cli_format format;
    enum hg_status status = hg_cli_format_of(s->path, NULL, &format, err);
    if (status)
        return status;
    if (hg_cli_run_now(r)->frame->body->frame.encoding != format.encoding)
        status = hg_cli_run_take(r, &format, false, err);
    if (status)
        return status;
    const struct hg_cli_bytes file = frame_bytes(r);
    r->doing = HG_CLI_DOING_OUTPUT;
    return hg_file_write_atomic(format.path, file.data, file.size, err);
}

static enum hg_status see_image(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct sight *sight, struct hg_error *err)
{
    struct hg_cli_comparison c;
    enum hg_status status = compare(r, s, false, &c, err);
    const bool missing = status == HG_E_NOTFOUND;
    if (!status) {
        sight->holds = hg_cli_op_holds(s->op, c.value, s->number);
        snprintf(sight->seen, sizeof sight->seen, "%.6g", c.value);
    }
    comparison_finish(&c);
    if (!r->o->update_references || (status ? !missing : sight->holds))
        return status;
    status = update_reference(r, s, err);
    sight->updated = sight->holds = !status;
    return status;
}

// ---- files of the report -----------------------------------------------------------------------

// Names of the files of one expectation, below the report's folder.
struct picture_names {
    char picture[64], reference[64], difference[64];
};

static const char *frame_ending(const struct hgp_frame *frame)
{
    switch (frame->encoding) {
    case HGP_encoding_JPEG:
        return "jpg";
    case HGP_encoding_EXR_HALF:
    case HGP_encoding_EXR_FLOAT:
        return "exr";
    default:
        return "png";
    }
}

static const char *reference_ending(const char *path)
{
    static const char *const known[] = {"png", "jpg", "jpeg", "exr"};
    const char *dot = strrchr(path, '.');
    for (size_t i = 0; dot && i < sizeof known / sizeof *known; i++)
        if (strcasecmp(dot + 1, known[i]) == 0)
            return known[i];
    return "png";
}

static enum hg_status write_picture(
    struct hg_cli_run *r, const char *name, struct hg_cli_bytes bytes, struct hg_error *err)
{
    char path[4200];
    if (snprintf(path, sizeof path, "%s/%s", r->o->report, name) >= (int)sizeof path)
        return hg_error_set(err, HG_E_INVAL, "--report", NULL, "the name is too long");
    return hg_file_write_atomic(path, bytes.data, bytes.size, err);
}

// Picture, reference and their difference, beside the report.
static enum hg_status write_pictures(struct hg_cli_run *r, const struct hg_cli_step *s,
    struct picture_names *names, struct hg_error *err)
{
    struct hg_cli_comparison c;
    const size_t number = r->report->count + 1;
    const struct hgp_frame *frame = &hg_cli_run_now(r)->frame->body->frame;
    snprintf(
        names->picture, sizeof names->picture, "%04zu-picture.%s", number, frame_ending(frame));
    enum hg_status status = write_picture(r, names->picture, frame_bytes(r), err);
    if (status)
        return status;
    struct hg_error ignored;
    if (compare(r, s, true, &c, &ignored) == HG_OK) {
        snprintf(names->difference, sizeof names->difference, "%04zu-difference.png", number);
        status = write_picture(r, names->difference, c.diff, err);
    }
    if (!status && c.b.data) {
        snprintf(names->reference, sizeof names->reference, "%04zu-reference.%s", number,
            reference_ending(s->path));
        status = write_picture(r, names->reference, c.b, err);
    }
    comparison_finish(&c);
    return status;
}

// ---- statistics --------------------------------------------------------------------------------

// "a.b.c" as one key, or as a path of keys; numbers index arrays.
static json_t *find_key(json_t *object, const char *key)
{
    json_t *whole = json_object_get(object, key);
    if (whole || !object)
        return whole;
    char part[128];
    size_t n = strcspn(key, ".");
    if (n >= sizeof part)
        return NULL;
    snprintf(part, sizeof part, "%.*s", (int)n, key);
    json_t *child = json_is_array(object) ? json_array_get(object, strtoul(part, NULL, 10))
                                          : json_object_get(object, part);
    return key[n] ? find_key(child, key + n + 1) : child;
}

// The worker's statistics, with the provenance of the newest frame and the client's own times.
static enum hg_status all_stats(struct hg_cli_run *r, json_t **out, struct hg_error *err)
{
    enum hg_status status = hg_cli_stats(&r->cli, out, err);
    if (status)
        return status;
    const struct hg_cli_client_stats client = {.load_ns = r->load_ns,
        .first_frame_ns = r->first_frame_ns,
        .fitted = hg_cli_run_now(r)->fitted};
    json_t *frame =
        hg_cli_frame_json(&hg_cli_run_now(r)->frame->body->frame, "", hg_cli_run_now(r)->frame_ns);
    status = hg_cli_stats_complete(*out, &r->cli, frame, &client, err);
    json_decref(frame);
    if (!status)
        return HG_OK;
    json_decref(*out);
    *out = NULL;
    return status;
}

// Numbers and booleans compare as numbers (true is 1), texts as texts.
static void see_value(const json_t *value, const struct hg_cli_step *s, struct sight *sight)
{
    if (json_is_number(value)) {
        sight->holds = hg_cli_op_holds(s->op, json_number_value(value), s->number);
        snprintf(sight->seen, sizeof sight->seen, "%.9g", json_number_value(value));
    } else if (json_is_boolean(value)) {
        sight->holds = hg_cli_op_holds(s->op, json_is_true(value), s->number);
        snprintf(sight->seen, sizeof sight->seen, "%s", json_is_true(value) ? "true" : "false");
    } else if (json_is_string(value)) {
        const bool same = strcmp(json_string_value(value), s->value) == 0;
        sight->holds = s->op == HG_CLI_OP_EQ ? same : s->op == HG_CLI_OP_NE && !same;
        snprintf(sight->seen, sizeof sight->seen, "%s", json_string_value(value));
    } else {
        snprintf(sight->seen, sizeof sight->seen, "%s",
            value ? "neither a number nor a text" : "no such key");
    }
}

static enum hg_status see_stat(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct sight *sight, struct hg_error *err)
{
    json_t *stats;
    enum hg_status status = all_stats(r, &stats, err);
    if (status)
        return status;
    see_value(find_key(stats, s->name), s, sight);
    json_decref(stats);
    return HG_OK;
}

// ---- picks and hashes --------------------------------------------------------------------------

static enum hg_status see_pick(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct sight *sight, struct hg_error *err)
{
    struct hgp_pick pick = {.view = r->cli.view, .x = s->x, .y = s->y};
    struct helio_message *answer;
    uint64_t wanted = 0;
    enum hg_status status = s->name ? hg_cli_find_node(&r->cli, s->name, &wanted, err) : HG_OK;
    if (status)
        return status;
    status = helio_call_for(r->cli.h, HGP_T_pick, &pick, HGP_T_picked, &answer, err);
    if (status)
        return status;
    const struct hgp_picked *got = &answer->body->picked;
    sight->holds = s->name ? got->hit && got->node == wanted : !got->hit;
    if (got->hit)
        snprintf(sight->seen, sizeof sight->seen, "node %u:%u",
            (unsigned)(got->node >> 32) - r->cli.scene.first_id + 1, (unsigned)got->node);
    else
        snprintf(sight->seen, sizeof sight->seen, "nothing");
    helio_message_free(answer);
    return HG_OK;
}

static enum hg_status see_box(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct sight *sight, struct hg_error *err)
{
    uint32_t pixels;
    const enum hg_status status = hg_cli_run_seen(r, s, &pixels, err);
    sight->holds = !status && hg_cli_op_holds(s->op, pixels, s->number);
    snprintf(sight->seen, sizeof sight->seen, "%u pixels", pixels);
    return status;
}

static enum hg_status see_distance(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct sight *sight, struct hg_error *err)
{
    bool hit;
    double distance = 0;
    const enum hg_status status = hg_cli_run_distance(r, s, &hit, &distance, err);
    sight->holds = !status && hit && hg_cli_op_holds(s->op, distance, s->number);
    if (hit)
        snprintf(sight->seen, sizeof sight->seen, "%.9g m", distance);
    else
        snprintf(sight->seen, sizeof sight->seen, "nothing at one of the pixels");
    return status;
}

static enum hg_status see_hash(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct sight *sight)
{
    const struct hgp_frame *frame = &hg_cli_run_now(r)->frame->body->frame;
    char hex[65] = "no hash: the frame is not settled and lossless";
    for (int i = 0; frame->has_hash && i < 32; i++)
        snprintf(hex + 2 * i, 3, "%02x", frame->hash[i]);
    sight->holds = strcmp(hex, s->name) == 0;
    snprintf(sight->seen, sizeof sight->seen, "%s", hex);
    return HG_OK;
}

// ---- all ---------------------------------------------------------------------------------------

static enum hg_status see(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct sight *sight, struct hg_error *err)
{
    r->doing = HG_CLI_DOING_RENDER;
    if (hg_cli_run_now(r)->dirty || !hg_cli_run_now(r)->frame) {
        enum hg_status status = hg_cli_run_take(r, &hg_cli_run_png, false, err);
        if (status)
            return status;
    }
    switch (s->kind) {
    case HG_CLI_STEP_EXPECT_IMAGE:
        return see_image(r, s, sight, err);
    case HG_CLI_STEP_EXPECT_STAT:
        return see_stat(r, s, sight, err);
    case HG_CLI_STEP_EXPECT_PICK:
        return see_pick(r, s, sight, err);
    case HG_CLI_STEP_EXPECT_SEEN:
        return see_box(r, s, sight, err);
    case HG_CLI_STEP_EXPECT_DISTANCE:
        return see_distance(r, s, sight, err);
    default:
        return see_hash(r, s, sight);
    }
}

static bool is_connection_lost(struct hg_cli_run *r)
{
    struct helio_info info = {.state = HELIO_CLOSED};
    if (r->cli.h)
        helio_get_info(r->cli.h, &info);
    return info.state == HELIO_CLOSED || hg_cli_is_stopped();
}

static void say(struct hg_cli_run *r, const char *message)
{
    char clean[1024];
    hg_cli_clean(clean, sizeof clean, message, strlen(message));
    hg_cli_progress_print(&r->cli.progress, clean);
}

static enum hg_status add_case(struct hg_cli_run *r, const struct hg_cli_step *s,
    const struct sight *sight, const char *message, uint64_t took_ns, struct hg_error *err)
{
    char name[300];
    struct picture_names names = {0};
    struct hg_cli_case c = {.verdict = sight->updated ? HG_CLI_UPDATED
                                       : sight->holds ? HG_CLI_PASSED
                                                      : HG_CLI_DIFFERS,
        .name = name,
        .message = message,
        .took_ns = took_ns};
    snprintf(name, sizeof name, "line %u: %.256s", s->line, s->text);
    if (r->o->report && c.verdict == HG_CLI_DIFFERS && s->kind == HG_CLI_STEP_EXPECT_IMAGE &&
        hg_cli_run_now(r)->frame) {
        r->doing = HG_CLI_DOING_OUTPUT;
        enum hg_status status = write_pictures(r, s, &names, err);
        if (status)
            return status;
        c.pictures = (struct hg_cli_pictures){names.picture[0] ? names.picture : NULL,
            names.reference[0] ? names.reference : NULL,
            names.difference[0] ? names.difference : NULL};
    }
    return hg_cli_report_add(r->report, &c)
               ? hg_error_set(err, HG_E_NOMEM, "report", NULL, "no memory")
               : HG_OK;
}

enum hg_status hg_cli_run_expect(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct hg_error *err)
{
    char message[1024], reason[400];
    struct sight sight = {0};
    uint64_t begin = hg_clock_now_ns();
    enum hg_status status = see(r, s, &sight, err);
    if (status && is_connection_lost(r))
        return status;
    if (status)
        hg_error_format(err, reason, sizeof reason);
    snprintf(message, sizeof message, "%.200s:%u: expected: %.200s; seen: %s", s->file, s->line,
        s->text, status ? reason : sight.seen);
    if (sight.updated) {
        snprintf(message, sizeof message, "%.200s:%u: %.200s: reference replaced", s->file, s->line,
            s->path);
        say(r, message);
    } else if (!sight.holds) {
        say(r, message);
    }
    return add_case(r, s, &sight, message, hg_clock_now_ns() - begin, err);
}
