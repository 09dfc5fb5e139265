#include "client/cli/help.h"

#include <string.h>

const struct hg_cli_exit_row hg_cli_exit_rows[] = {
    {0, "done"},
    {1, "a comparison or expectation failed"},
    {2, "wrong usage"},
    {3, "bad input file"},
    {4, "daemon unreachable, or the connection was lost"},
    {5, "not allowed: the token, the role, the asset roots or file permissions refuse it"},
    {6, "a limit, quota, budget, memory or the disk refused it"},
    {7, "rendering failed, or the worker died: trying again may help"},
    {8, "stopped early; what was written is complete"},
    {9, "this device, driver or build cannot do what was asked: trying again does not help"},
    {0, NULL},
};

// What stands behind an option's name.
static const char *argument_of(
    const struct hg_cli_option_row *row, char choices[HG_CLI_CHOICES_BYTES])
{
    if (row->kind != HG_CLI_KIND_CHOICE)
        return row->argument;
    hg_cli_option_choices(row, choices);
    return choices;
}

// Prints words wrapped at 80 columns, every line but the first indented.
static void print_wrapped(FILE *out, const char *text, size_t indent, size_t column)
{
    bool first = true;
    while (*text) {
        size_t n = strcspn(text, " ");
        if (!first && column + n + 1 > 80) {
            fprintf(out, "\n%*s", (int)indent, "");
            column = indent;
            first = true;
        }
        fprintf(out, "%s%.*s", first ? "" : " ", (int)n, text);
        column += n + !first;
        first = false;
        text += n + (text[n] == ' ');
    }
    fputc('\n', out);
}

void hg_cli_help_program(FILE *out)
{
    fprintf(out, "usage: helio COMMAND [OPTION...] [ARGUMENT...]\n\n"
                 "Renders 3D scenes, here or on a Heliograph daemon.\n\ncommands:\n");
    for (int i = 0; i < HG_CLI_COMMAND_COUNT; i++)
        fprintf(out, "  %-12s%s\n", hg_cli_commands[i].name, hg_cli_commands[i].summary);
    fprintf(out, "\n`helio COMMAND --help` lists a command's options; `helio --version` prints the "
                 "version.\n\nexit codes:\n");
    for (const struct hg_cli_exit_row *row = hg_cli_exit_rows; row->text; row++) {
        fprintf(out, "  %d  ", row->code);
        print_wrapped(out, row->text, 5, 5);
    }
}

enum { FLAT_OPTIONS = 16 }; // of a command with more, options are listed by group

static bool is_grouped(const struct hg_cli_command_row *command)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < hg_cli_option_count; i++)
        count += (hg_cli_option_rows[i].commands & command->command) != 0;
    return count > FLAT_OPTIONS;
}

// The options of a command in the order of its help: by group where it has many, else as in the
// table.
struct option_walk {
    const struct hg_cli_command_row *command;
    bool grouped;
    uint32_t at;
    uint32_t group; // of the newest option; HG_CLI_GROUP_COUNT: none yet
    bool begins;    // it is the first one of its group
};

static struct option_walk walk_options(const struct hg_cli_command_row *command)
{
    return (struct option_walk){
        .command = command, .grouped = is_grouped(command), .group = HG_CLI_GROUP_COUNT};
}

static const struct hg_cli_option_row *next_option(struct option_walk *w)
{
    const uint32_t rounds = w->grouped ? HG_CLI_GROUP_COUNT : 1;
    while (w->at < rounds * hg_cli_option_count) {
        const uint32_t i = w->at % hg_cli_option_count, group = w->at / hg_cli_option_count;
        const struct hg_cli_option_row *row = &hg_cli_option_rows[i];
        w->at++;
        if (!(row->commands & w->command->command) ||
            (w->grouped && hg_cli_option_group(i) != group))
            continue;
        w->begins = w->grouped && w->group != group;
        w->group = group;
        return row;
    }
    return NULL;
}

static void print_option(FILE *out, const struct hg_cli_option_row *row)
{
    char left[HG_CLI_CHOICES_BYTES + 64], letter[8] = "    ", choices[HG_CLI_CHOICES_BYTES];
    char text[HG_CLI_OPTION_TEXT_BYTES];
    if (row->letter)
        snprintf(letter, sizeof letter, "-%c, ", row->letter);
    const char *argument = argument_of(row, choices);
    int n = snprintf(
        left, sizeof left, "  %s--%s%s%s", letter, row->name, *argument ? " " : "", argument);
    fprintf(out, "%s", left);
    if (n > 28)
        fprintf(out, "\n%*s", 30, "");
    else
        fprintf(out, "%*s", 30 - n, "");
    hg_cli_option_text(row, text);
    print_wrapped(out, text, 30, 30);
}

void hg_cli_help_command(FILE *out, const struct hg_cli_command_row *command)
{
    fprintf(out, "usage: helio %s %s%s[OPTION...]\n\n", command->name, command->arguments,
        *command->arguments ? " " : "");
    print_wrapped(out, command->description, 0, 0);
    struct option_walk walk = walk_options(command);
    fputs(walk.grouped ? "" : "\noptions:\n", out);
    const struct hg_cli_option_row *row;
    while ((row = next_option(&walk))) {
        if (walk.begins)
            fprintf(out, "\n%s:\n", hg_cli_group_titles[walk.group]);
        print_option(out, row);
    }
    fprintf(out, "%s      --help                  print this\n", walk.grouped ? "\n" : "");
}

// ---- man pages ---------------------------------------------------------------------------------

// Text of man(7): backslashes and hyphens escaped, no control line by accident.
static void man_text(FILE *out, const char *text)
{
    if (*text == '.' || *text == '\'')
        fputs("\\&", out);
    for (; *text; text++) {
        if (*text == '-')
            fputs("\\-", out);
        else if (*text == '\\')
            fputs("\\e", out);
        else
            fputc(*text, out);
    }
}

// Running text: one sentence a line, as manual pages like it, and no long lines.
static void man_paragraph(FILE *out, const char *text)
{
    size_t column = 0;
    while (*text) {
        char word[128];
        size_t n = strcspn(text, " ");
        snprintf(word, sizeof word, "%.*s", (int)n, text);
        size_t width = n;
        for (const char *c = word; *c; c++)
            width += *c == '-';
        if (column && column + 1 + width > 78) {
            fputc('\n', out);
            column = 0;
        }
        fputs(column ? " " : "", out);
        man_text(out, word);
        column += width + 1;
        text += n + (text[n] == ' ');
        if (n && word[strlen(word) - 1] == '.' && *text) {
            fputc('\n', out);
            column = 0;
        }
    }
    fputc('\n', out);
}

static void man_exit_codes(FILE *out)
{
    fprintf(out, ".SH EXIT STATUS\n");
    for (const struct hg_cli_exit_row *row = hg_cli_exit_rows; row->text; row++) {
        fprintf(out, ".TP\n.B %d\n", row->code);
        man_text(out, row->text);
        fputc('\n', out);
    }
}

static void man_option(FILE *out, const struct hg_cli_option_row *row)
{
    fprintf(out, ".TP\n");
    if (row->letter)
        fprintf(out, "\\fB\\-%c\\fR, ", row->letter);
    fprintf(out, "\\fB\\-\\-");
    man_text(out, row->name);
    char choices[HG_CLI_CHOICES_BYTES], text[HG_CLI_OPTION_TEXT_BYTES];
    const char *argument = argument_of(row, choices);
    fprintf(out, "\\fR%s", *argument ? " \\fI" : "");
    man_text(out, argument);
    fprintf(out, "%s\n", *argument ? "\\fR" : "");
    hg_cli_option_text(row, text);
    strncat(text, ".", sizeof text - strlen(text) - 1);
    man_paragraph(out, text);
}

static void man_options(FILE *out, const struct hg_cli_command_row *command)
{
    struct option_walk walk = walk_options(command);
    const struct hg_cli_option_row *row;
    fprintf(out, ".SH OPTIONS\n");
    while ((row = next_option(&walk))) {
        if (walk.begins)
            fprintf(out, ".SS %s\n", hg_cli_group_titles[walk.group]);
        man_option(out, row);
    }
    fprintf(out, ".TP\n\\fB\\-h\\fR, \\fB\\-\\-help\\fR\nprint a summary of the options.\n");
}

static void man_environment(FILE *out)
{
    static const char *const rows[][2] = {
        {"HELIO_TOKEN", "token for the daemon, when neither --token nor --token-file is given."},
        {"HELIO_WORKER",
            "program of the private worker, instead of ../libexec/helio-worker beside helio."},
        {"HELIO_LOADER", "program in which the private worker reads foreign formats, instead of "
                         "../libexec/helio-loader beside it."},
        {"HELIO_BENCH",
            "program of the benchmarks, instead of ../libexec/helio-bench beside helio."},
        {"XDG_CACHE_HOME", "folder of caches; default ~/.cache."},
    };
    fprintf(out, ".SH ENVIRONMENT\n");
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        fprintf(out, ".TP\n.B %s\n", rows[i][0]);
        man_paragraph(out, rows[i][1]);
    }
}

// Keys and pointer of the window.
static void man_keys(FILE *out)
{
    static const char *const rows[][2] = {
#define HG_VIEW_POINTER(what, doc)                {what, doc},
#define HG_VIEW_KEY(action, key, code, name, doc) {key, doc},
#define HG_VIEW_PANEL(what, doc)                  {what " in a panel", doc},
#define HG_VIEW_PAD(what, doc)                    {what " of a gamepad", doc},
#include "client/view/keys.def"
    };
    fprintf(out, ".SH KEYS\n");
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char text[160];
        snprintf(text, sizeof text, "%s.", rows[i][1]);
        fprintf(out, ".TP\n\\fB");
        man_text(out, rows[i][0]);
        fprintf(out, "\\fR\n");
        man_paragraph(out, text);
    }
}

void hg_cli_man(FILE *out, const struct hg_cli_command_row *command)
{
    fprintf(out, ".\\\" Generated by \"helio \\-\\-generate\"; do not edit.\n");
    if (!command) {
        fprintf(out, ".TH HELIO 1 2026-11-21 \"Heliograph " HELIO_VERSION "\"\n"
                     ".SH NAME\nhelio \\- render 3D scenes, here or on a Heliograph daemon\n"
                     ".SH SYNOPSIS\n.B helio\n.I COMMAND\n[\\fIOPTION\\fR...] "
                     "[\\fIARGUMENT\\fR...]\n.SH COMMANDS\n");
        for (int i = 0; i < HG_CLI_COMMAND_COUNT; i++)
            fprintf(out, ".TP\n.BR helio\\-%s (1)\n%s.\n", hg_cli_commands[i].name,
                hg_cli_commands[i].summary);
        man_environment(out);
        man_exit_codes(out);
        return;
    }
    char upper[32];
    snprintf(upper, sizeof upper, "%s", command->name);
    for (char *c = upper; *c; c++)
        *c = (char)(*c >= 'a' && *c <= 'z' ? *c - 'a' + 'A' : *c);
    fprintf(out, ".TH HELIO\\-%s 1 2026-11-21 \"Heliograph " HELIO_VERSION "\"\n.SH NAME\n", upper);
    fprintf(out, "helio\\-%s \\- %s\n.SH SYNOPSIS\n.B helio %s\n", command->name, command->summary,
        command->name);
    if (*command->arguments) {
        fprintf(out, ".I ");
        man_text(out, command->arguments);
        fputc('\n', out);
    }
    fprintf(out, "[\\fIOPTION\\fR...]\n.SH DESCRIPTION\n");
    man_paragraph(out, command->description);
    man_options(out, command);
    if (command->command == HG_CLI_WINDOW)
        man_keys(out);
    man_exit_codes(out);
    fprintf(out, ".SH SEE ALSO\n.BR helio (1)\n");
}

// ---- completions -------------------------------------------------------------------------------

void hg_cli_completion_bash(FILE *out)
{
    fprintf(out, "# bash completion for helio. Generated by \"helio --generate\"; do not edit.\n"
                 "_helio()\n{\n"
                 "    local cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD-1]}\n"
                 "    COMPREPLY=()\n"
                 "    if [ \"$COMP_CWORD\" -eq 1 ]; then\n"
                 "        COMPREPLY=($(compgen -W '");
    for (int i = 0; i < HG_CLI_COMMAND_COUNT; i++)
        fprintf(out, "%s ", hg_cli_commands[i].name);
    fprintf(out, "--help --version' -- \"$cur\"))\n        return\n    fi\n"
                 "    case \"${COMP_WORDS[1]} $prev\" in\n");
    for (int c = 0; c < HG_CLI_COMMAND_COUNT; c++)
        for (uint32_t i = 0; i < hg_cli_option_count; i++) {
            const struct hg_cli_option_row *row = &hg_cli_option_rows[i];
            if (!(row->commands & hg_cli_commands[c].command) || row->kind != HG_CLI_KIND_CHOICE)
                continue;
            char words[HG_CLI_CHOICES_BYTES];
            hg_cli_option_choices(row, words);
            for (char *p = words; *p; p++)
                *p = *p == '|' ? ' ' : *p;
            fprintf(out, "    '%s --%s') COMPREPLY=($(compgen -W '%s' -- \"$cur\")); return ;;\n",
                hg_cli_commands[c].name, row->name, words);
        }
    fprintf(out, "    esac\n    local options=--help\n    case \"${COMP_WORDS[1]}\" in\n");
    for (int c = 0; c < HG_CLI_COMMAND_COUNT; c++) {
        fprintf(out, "    %s) options='", hg_cli_commands[c].name);
        for (uint32_t i = 0; i < hg_cli_option_count; i++)
            if (hg_cli_option_rows[i].commands & hg_cli_commands[c].command)
                fprintf(out, "--%s ", hg_cli_option_rows[i].name);
        fprintf(out, "--help' ;;\n");
    }
    fprintf(out, "    esac\n    case \"$cur\" in\n"
                 "    -*) COMPREPLY=($(compgen -W \"$options\" -- \"$cur\")) ;;\n"
                 "    *) compopt -o filenames; COMPREPLY=($(compgen -f -- \"$cur\")) ;;\n"
                 "    esac\n}\ncomplete -F _helio helio\n");
}

// Text inside a single-quoted _arguments specification.
static void zsh_text(FILE *out, const char *text)
{
    for (; *text; text++) {
        if (*text == '\'')
            fputs("'\\''", out);
        else if (strchr("[]:\\", *text))
            fprintf(out, "\\%c", *text);
        else
            fputc(*text, out);
    }
}

static void zsh_action(FILE *out, const struct hg_cli_option_row *row)
{
    char choices[HG_CLI_CHOICES_BYTES];
    if (row->kind == HG_CLI_KIND_FLAG)
        return;
    fputc(':', out);
    zsh_text(out, row->argument);
    fputc(':', out);
    if (row->kind == HG_CLI_KIND_FILE)
        fputs("_files", out);
    if (row->kind == HG_CLI_KIND_FOLDER)
        fputs("_files -/", out);
    if (row->kind != HG_CLI_KIND_CHOICE)
        return;
    fputc('(', out);
    hg_cli_option_choices(row, choices);
    for (const char *c = choices; *c; c++)
        fputc(*c == '|' ? ' ' : *c, out);
    fputc(')', out);
}

void hg_cli_completion_zsh(FILE *out)
{
    fprintf(out, "#compdef helio\n# Generated by \"helio --generate\"; do not edit.\n"
                 "_helio() {\n    local -a commands\n    commands=(\n");
    for (int i = 0; i < HG_CLI_COMMAND_COUNT; i++)
        fprintf(out, "        '%s:%s'\n", hg_cli_commands[i].name, hg_cli_commands[i].summary);
    fprintf(out, "    )\n    if (( CURRENT == 2 )); then\n"
                 "        _describe command commands\n        return\n    fi\n"
                 "    local command=$words[2]\n    shift words\n    (( CURRENT-- ))\n"
                 "    case $command in\n");
    for (int c = 0; c < HG_CLI_COMMAND_COUNT; c++) {
        fprintf(out, "    %s)\n        _arguments \\\n", hg_cli_commands[c].name);
        for (uint32_t i = 0; i < hg_cli_option_count; i++) {
            const struct hg_cli_option_row *row = &hg_cli_option_rows[i];
            if (!(row->commands & hg_cli_commands[c].command))
                continue;
            fprintf(out, "            '--%s[", row->name);
            char text[HG_CLI_OPTION_TEXT_BYTES];
            hg_cli_option_text(row, text);
            zsh_text(out, text);
            fputc(']', out);
            zsh_action(out, row);
            fputs("' \\\n", out);
        }
        fprintf(out, "            '--help[print the options]' \\\n            '*:file:_files'\n"
                     "        ;;\n");
    }
    fprintf(out, "    esac\n}\n_helio \"$@\"\n");
}
