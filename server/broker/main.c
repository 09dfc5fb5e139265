// main.c - heliod: serves scenes to clients. Its options are in options.def.
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/sha256.h"
#include "server/broker/broker.h"
#include "server/broker/config_check.h"
#include "server/broker/metrics/metrics.h"

enum { EXIT_CONFIG = 2, EXIT_START = 4 };

static int complain(const struct hg_error *err)
{
    char text[700];
    hg_error_format(err, text, sizeof text);
    fprintf(stderr, "heliod: %s\n", text);
    return EXIT_CONFIG;
}

static int check(const struct hg_options *options)
{
    struct hg_error err = {0};
    if (hg_config_check(options, &err) || hg_config_check_start(options, &err))
        return complain(&err);
    puts("the configuration is good");
    return 0;
}

// The worker describes its device; its output and exit code are ours.
static int device_info(const struct hg_options *options)
{
    char path[4096];
    if (!hg_worker_process_find(options, path, sizeof path)) {
        fprintf(stderr, "heliod: %s: the worker's program is not there\n", path);
        return EXIT_START;
    }
    char *arguments[] = {path, (char *)"--device-info", options->device ? (char *)"--device" : NULL,
        options->device, NULL};
    execv(path, arguments);
    fprintf(stderr, "heliod: %s: %s\n", path, strerror(errno));
    return EXIT_START;
}

// The first line of standard input, so that the token stands in no list of processes.
static int hash_token(void)
{
    char token[512], hex[HG_SHA256_HEX];
    uint8_t hash[32];
    size_t length = fgets(token, sizeof token, stdin) ? strcspn(token, "\r\n") : 0;
    if (length < HG_TOKEN_MIN || length > HG_TOKEN_MAX ||
        hg_token_hash((struct hgp_str){token, (uint32_t)length}, hash)) {
        fprintf(stderr, "heliod: --hash-token: expected a token of %d to %d characters\n",
            HG_TOKEN_MIN, HG_TOKEN_MAX);
        return EXIT_CONFIG;
    }
    hg_sha256_hex(hash, hex);
    printf("sha256:%s\n", hex);
    return 0;
}

static int act(struct hg_options *options, int argc, char *const *argv)
{
    switch (options->action) {
    case HG_OPTIONS_HELP:
        hg_options_print_help(stdout);
        return 0;
    case HG_OPTIONS_VERSION:
        puts("heliod " HELIO_VERSION);
        return 0;
    case HG_OPTIONS_DOCS:
        if (strcmp(options->docs, "man") == 0)
            hg_options_print_man(stdout);
        else if (strcmp(options->docs, "metrics") == 0)
            hg_metrics_print_docs(stdout);
        else
            hg_options_print_markdown(stdout);
        return 0;
    case HG_OPTIONS_CHECK:
        return check(options);
    case HG_OPTIONS_HASH_TOKEN:
        return hash_token();
    case HG_OPTIONS_DEVICE_INFO:
        return device_info(options);
    default:
        return hg_broker_run(options, argc, argv);
    }
}

int main(int argc, char **argv)
{
    struct hg_options options;
    struct hg_error err = {0};
    hg_log_set_sink(hg_log_sink_logfmt, (void *)(intptr_t)STDERR_FILENO);
    if (hg_options_parse(argc, argv, &options, &err))
        return complain(&err);
    if (options.log && hg_log_configure(options.log, &err)) {
        hg_options_finish(&options);
        return complain(&err);
    }
    int code = act(&options, argc, argv);
    hg_options_finish(&options);
    return code;
}
