// compare.c - helio compare: two image files, one number.
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/file.h"
#include "client/cli/cli.h"

static enum hg_status check(const struct hg_cli_options *o, struct hg_error *err)
{
    if (o->has_fail_below && o->has_fail_above)
        return hg_error_set(
            err, HG_E_INVAL, "--fail-below", NULL, "cannot be combined with --fail-above");
    return o->diff ? hg_cli_check_output(o->diff, err) : HG_OK;
}

static enum hg_status compare_all(
    struct hg_cli *cli, enum hg_cli_doing *doing, double *value, struct hg_error *err)
{
    const struct hg_cli_options *o = cli->options;
    struct hg_cli_comparison c = {.want_diff = o->has_diff};
    struct hg_cli_bytes *files[2] = {&c.a, &c.b};
    uint32_t metric = HGP_metric_PSNR;
    if (o->has_metric)
        hgp_enum_value("metric", o->metric, &metric);
    c.metric = (enum hgp_metric)metric;
    *doing = HG_CLI_DOING_ARGUMENTS;
    enum hg_status status = check(o, err);
    for (int i = 0; !status && i < 2; i++) {
        *doing = HG_CLI_DOING_INPUT;
        status =
            hg_file_read(o->args[i], HG_CLI_IMAGE_BYTES, &files[i]->data, &files[i]->size, err);
    }
    if (!status) {
        *doing = HG_CLI_DOING_CONNECT;
        status = hg_cli_connect(cli, NULL, NULL, false, err);
    }
    if (!status) {
        *doing = HG_CLI_DOING_INPUT;
        status = hg_cli_compare(cli, &c, err);
    }
    if (!status && o->diff) {
        *doing = HG_CLI_DOING_OUTPUT;
        status = hg_cli_write_output(o->diff, c.diff.data, c.diff.size, err);
    }
    *value = c.value;
    hg_free(c.a.data);
    hg_free(c.b.data);
    hg_free(c.diff.data);
    return status;
}

enum hg_cli_exit hg_cli_compare_command(const struct hg_cli_options *options)
{
    struct hg_cli cli;
    struct hg_error err = {0};
    enum hg_cli_doing doing;
    double value;
    hg_cli_init(&cli, options);
    enum hg_status status = compare_all(&cli, &doing, &value, &err);
    enum hg_cli_exit code = status ? hg_cli_report(&cli, doing, &err) : HG_CLI_EXIT_OK;
    if (!status) {
        fprintf(options->diff && hg_cli_is_stdout(options->diff) ? stderr : stdout, "%s %.6g\n",
            options->metric ? options->metric : "psnr", value);
        if (options->has_fail_below && value < options->fail_below)
            code = HG_CLI_EXIT_FAILED;
        if (options->has_fail_above && value > options->fail_above)
            code = HG_CLI_EXIT_FAILED;
        if (code == HG_CLI_EXIT_FAILED)
            fprintf(stderr, "helio: %s and %s differ: %.6g is %s %.6g\n", options->args[0],
                options->args[1], value, options->has_fail_below ? "below" : "above",
                options->has_fail_below ? options->fail_below : options->fail_above);
    }
    hg_cli_finish(&cli);
    return code;
}
