// help.h - texts generated from the option table: --help, man pages, shell completions.
// Floor 6 (client). Each writes to a stream.
#ifndef HG_CLIENT_CLI_HELP_H
#define HG_CLIENT_CLI_HELP_H

#include <stdio.h>

#include "client/cli/options.h"

void hg_cli_help_program(FILE *out);
void hg_cli_help_command(FILE *out, const struct hg_cli_command_row *command);
// helio.1 with command NULL, else helio-<command>.1.
void hg_cli_man(FILE *out, const struct hg_cli_command_row *command);
void hg_cli_completion_bash(FILE *out);
void hg_cli_completion_zsh(FILE *out);

// Exit codes with their meaning, in order; ends with a NULL text.
struct hg_cli_exit_row {
    int code;
    const char *text;
};
extern const struct hg_cli_exit_row hg_cli_exit_rows[];

#endif
