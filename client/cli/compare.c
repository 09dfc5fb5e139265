// compare.c - helio compare: two image files, a number for each metric.
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/file.h"
#include "client/cli/cli.h"

static const char *const metric_names[] = {"psnr", "ssim", "flip", "rmse", "max"};

enum { METRICS_MOST = sizeof metric_names / sizeof *metric_names };

struct metric {
    uint32_t id;
    const char *name;
    double value;
    bool has_below, has_above;
    double below, above;
};

struct comparison {
    struct hg_cli cli;
    enum hg_cli_doing doing;
    struct metric metrics[METRICS_MOST];
    uint32_t count;
    struct hg_cli_bytes a, b, mask, diff;
};

// ---- arguments ---------------------------------------------------------------------------------

static struct metric *find_metric(struct comparison *c, const char *name, size_t length)
{
    for (uint32_t i = 0; i < c->count; i++)
        if (strlen(c->metrics[i].name) == length && memcmp(c->metrics[i].name, name, length) == 0)
            return &c->metrics[i];
    return NULL;
}

static enum hg_status add_metric(
    struct comparison *c, const char *name, size_t length, struct hg_error *err)
{
    if (find_metric(c, name, length))
        return HG_OK;
    for (int i = 0; i < METRICS_MOST; i++) {
        struct metric m = {.name = metric_names[i]};
        if (strlen(m.name) != length || memcmp(m.name, name, length) != 0)
            continue;
        hgp_enum_value("metric", m.name, &m.id);
        c->metrics[c->count++] = m;
        return HG_OK;
    }
    return hg_error_set(err, HG_E_INVAL, "--metric", NULL,
        "'%.*s' is none of psnr ssim flip rmse max all", (int)length, name);
}

static enum hg_status add_metrics(struct comparison *c, const char *list, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    if (strcmp(list, "all") == 0) {
        for (int i = 0; i < METRICS_MOST && !status; i++)
            status = add_metric(c, metric_names[i], strlen(metric_names[i]), err);
        return status;
    }
    for (const char *at = list; !status; at++) {
        const size_t length = strcspn(at, ",");
        status = add_metric(c, at, length, err);
        at += length;
        if (!*at)
            break;
    }
    return status;
}

// "METRIC=N", or N where there is one metric.
static enum hg_status take_bound(
    struct comparison *c, const char *option, const char *text, bool is_below, struct hg_error *err)
{
    double number;
    const char *equals = strchr(text, '=');
    struct metric *m = equals          ? find_metric(c, text, (size_t)(equals - text))
                       : c->count == 1 ? &c->metrics[0]
                                       : NULL;
    if (!m)
        return hg_error_set(err, HG_E_INVAL, option, NULL,
            equals ? "'%s' names no metric that is measured" : "'%s': name the metric, METRIC=N",
            text);
    enum hg_status status =
        hg_cli_parse_number(option, equals ? equals + 1 : text, -1e300, 1e300, &number, err);
    if (status)
        return status;
    *(is_below ? &m->below : &m->above) = number;
    *(is_below ? &m->has_below : &m->has_above) = true;
    return HG_OK;
}

static enum hg_status read_arguments(struct comparison *c, struct hg_error *err)
{
    const struct hg_cli_options *o = c->cli.options;
    enum hg_status status = o->metric.count ? HG_OK : add_metrics(c, "psnr", err);
    for (uint32_t i = 0; i < o->metric.count && !status; i++)
        status = add_metrics(c, o->metric.items[i], err);
    for (uint32_t i = 0; i < o->fail_below.count && !status; i++)
        status = take_bound(c, "--fail-below", o->fail_below.items[i], true, err);
    for (uint32_t i = 0; i < o->fail_above.count && !status; i++)
        status = take_bound(c, "--fail-above", o->fail_above.items[i], false, err);
    return !status && o->diff ? hg_cli_check_output(o->diff, err) : status;
}

// ---- comparing ---------------------------------------------------------------------------------

static enum hg_status read_files(struct comparison *c, struct hg_error *err)
{
    const struct hg_cli_options *o = c->cli.options;
    const char *const paths[] = {o->args[0], o->args[1], o->mask};
    struct hg_cli_bytes *const files[] = {&c->a, &c->b, &c->mask};
    enum hg_status status = HG_OK;
    for (int i = 0; i < 3 && !status; i++)
        if (paths[i])
            status =
                hg_file_read(paths[i], HG_CLI_IMAGE_BYTES, &files[i]->data, &files[i]->size, err);
    return status;
}

static enum hg_status measure(struct comparison *c, uint32_t i, struct hg_error *err)
{
    struct hg_cli_comparison one = {.metric = (enum hgp_metric)c->metrics[i].id,
        .a = c->a,
        .b = c->b,
        .mask = c->mask,
        .want_diff = i == 0 && c->cli.options->has_diff};
    enum hg_status status = hg_cli_compare(&c->cli, &one, err);
    c->metrics[i].value = one.value;
    if (i == 0)
        c->diff = one.diff;
    return status;
}

static enum hg_status compare_all(struct comparison *c, struct hg_error *err)
{
    const char *diff = c->cli.options->diff;
    c->doing = HG_CLI_DOING_ARGUMENTS;
    enum hg_status status = read_arguments(c, err);
    if (status)
        return status;
    c->doing = HG_CLI_DOING_INPUT;
    status = read_files(c, err);
    if (status)
        return status;
    c->doing = HG_CLI_DOING_CONNECT;
    status = hg_cli_connect(&c->cli, NULL, NULL, false, err);
    if (status)
        return status;
    c->doing = HG_CLI_DOING_INPUT;
    for (uint32_t i = 0; i < c->count && !status; i++)
        status = measure(c, i, err);
    if (status || !diff)
        return status;
    c->doing = HG_CLI_DOING_OUTPUT;
    return hg_cli_write_output(diff, c->diff.data, c->diff.size, err);
}

// Prints the values. False: one of them is on the wrong side of its bound.
static bool print_values(const struct comparison *c)
{
    const struct hg_cli_options *o = c->cli.options;
    FILE *out = o->diff && hg_cli_is_stdout(o->diff) ? stderr : stdout;
    bool holds = true;
    for (uint32_t i = 0; i < c->count; i++) {
        const struct metric *m = &c->metrics[i];
        const bool below = m->has_below && m->value < m->below;
        const bool above = m->has_above && m->value > m->above;
        fprintf(out, "%s %.6g\n", m->name, m->value);
        if (below || above)
            fprintf(stderr, "helio: %s and %s differ: %s %.6g is %s %.6g\n", o->args[0], o->args[1],
                m->name, m->value, below ? "below" : "above", below ? m->below : m->above);
        holds = holds && !below && !above;
    }
    return holds;
}

enum hg_cli_exit hg_cli_compare_command(const struct hg_cli_options *options)
{
    struct comparison c = {0};
    struct hg_error err = {0};
    hg_cli_init(&c.cli, options);
    enum hg_status status = compare_all(&c, &err);
    enum hg_cli_exit code = status             ? hg_cli_report(&c.cli, c.doing, &err)
                            : print_values(&c) ? HG_CLI_EXIT_OK
                                               : HG_CLI_EXIT_FAILED;
    hg_free(c.a.data);
    hg_free(c.b.data);
    hg_free(c.mask.data);
    hg_free(c.diff.data);
    hg_cli_finish(&c.cli, code);
    return code;
}
