// main.c - the program `helio`: finds the command and runs it.
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "client/cli/cli.h"
#include "client/cli/help.h"

static enum hg_cli_exit (*const run_command[HG_CLI_COMMAND_COUNT])(
    const struct hg_cli_options *) = {
    [HG_CLI_INDEX_RENDER] = hg_cli_render,
    [HG_CLI_INDEX_INFO] = hg_cli_info,
    [HG_CLI_INDEX_COMPARE] = hg_cli_compare_command,
    [HG_CLI_INDEX_RUN] = hg_cli_run,
    [HG_CLI_INDEX_WINDOW] = hg_cli_window,
    [HG_CLI_INDEX_BAKE] = hg_cli_bake,
    [HG_CLI_INDEX_CACHE] = hg_cli_cache,
    [HG_CLI_INDEX_BENCH] = hg_cli_bench,
    [HG_CLI_INDEX_SERVE] = hg_cli_serve,
    [HG_CLI_INDEX_PING] = hg_cli_ping,
    [HG_CLI_INDEX_STATS] = hg_cli_stats_command,
    [HG_CLI_INDEX_QUARANTINE] = hg_cli_quarantine,
    [HG_CLI_INDEX_SESSIONS] = hg_cli_sessions,
    [HG_CLI_INDEX_MESSAGE] = hg_cli_message,
    [HG_CLI_INDEX_KICK] = hg_cli_kick,
    [HG_CLI_INDEX_DRAIN] = hg_cli_drain,
    [HG_CLI_INDEX_TICKETS] = hg_cli_tickets,
};

// helio --generate NAME: "helio.1", "helio-render.1", "helio.bash" or "_helio" to the standard
// output. Used by the build; the results are kept in client/man and client/completion.
static int generate(const char *name)
{
    if (strcmp(name, "helio.1") == 0)
        return hg_cli_man(stdout, NULL), HG_CLI_EXIT_OK;
    if (strcmp(name, "helio.bash") == 0)
        return hg_cli_completion_bash(stdout), HG_CLI_EXIT_OK;
    if (strcmp(name, "_helio") == 0)
        return hg_cli_completion_zsh(stdout), HG_CLI_EXIT_OK;
    for (int i = 0; i < HG_CLI_COMMAND_COUNT; i++) {
        char page[64];
        snprintf(page, sizeof page, "helio-%s.1", hg_cli_commands[i].name);
        if (strcmp(name, page) == 0)
            return hg_cli_man(stdout, &hg_cli_commands[i]), HG_CLI_EXIT_OK;
    }
    fprintf(stderr, "helio: %s: nothing of that name is generated\n", name);
    return HG_CLI_EXIT_USAGE;
}

// Where standard streams are closed, sockets and files would get their numbers, and what is said.
static void open_streams(void)
{
    int fd = open("/dev/null", O_RDWR);
    while (fd >= 0 && fd <= STDERR_FILENO)
        fd = open("/dev/null", O_RDWR);
    if (fd > STDERR_FILENO)
        close(fd);
}

// A command line that is wrong has no options yet, but what reads JSON has asked for it.
static const char *progress_of(int argc, char **argv)
{
    const char *mode = NULL;
    for (int i = 1; i < argc; i++) {
        if (strncmp(argv[i], "--progress=", 11) == 0)
            mode = argv[i] + 11;
        else if (strcmp(argv[i], "--progress") == 0 && i + 1 < argc)
            mode = argv[i + 1];
    }
    return mode && strcmp(mode, "json") == 0 ? "json" : "none";
}

static int refuse(int argc, char **argv, const struct hg_error *err)
{
    struct hg_cli cli = {0};
    hg_cli_progress_init(&cli.progress, progress_of(argc, argv));
    const enum hg_cli_exit code = hg_cli_report(&cli, HG_CLI_DOING_ARGUMENTS, err);
    if (strcmp(err->what, "--time") == 0)
        hg_cli_progress_say(
            &cli.progress, "--time limits the rendering; --at S poses the animations");
    hg_cli_progress_end(&cli.progress, (int)code);
    return code;
}

// helio help COMMAND; -1: it is another command line.
static int help_command(int argc, char **argv)
{
    for (int i = 0; argc == 3 && strcmp(argv[1], "help") == 0 && i < HG_CLI_COMMAND_COUNT; i++)
        if (strcmp(argv[2], hg_cli_commands[i].name) == 0)
            return hg_cli_help_command(stdout, &hg_cli_commands[i]), HG_CLI_EXIT_OK;
    return -1;
}

int main(int argc, char **argv)
{
    open_streams();
    if (argc == 2 && (strcmp(argv[1], "--help") == 0 || strcmp(argv[1], "-h") == 0 ||
                         strcmp(argv[1], "help") == 0))
        return hg_cli_help_program(stdout), HG_CLI_EXIT_OK;
    if (argc == 2 && strcmp(argv[1], "--version") == 0)
        return printf("helio %s\n", helio_version()), HG_CLI_EXIT_OK;
    if (argc == 3 && strcmp(argv[1], "--generate") == 0)
        return generate(argv[2]);
    static struct hg_cli_options options;
    struct hg_error err = {0};
    const int helped = help_command(argc, argv);
    if (helped >= 0)
        return helped;
    if (hg_cli_parse(argc, (const char *const *)argv, &options, &err))
        return refuse(argc, argv, &err);
    int index = __builtin_ctz((unsigned)options.command);
    if (options.help)
        return hg_cli_help_command(stdout, &hg_cli_commands[index]), HG_CLI_EXIT_OK;
    return run_command[index](&options);
}
