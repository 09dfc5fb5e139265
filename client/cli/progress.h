// progress.h - progress and notices on the error stream.
// Floor 6 (client). One thread.
#ifndef HG_CLIENT_CLI_PROGRESS_H
#define HG_CLIENT_CLI_PROGRESS_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol/hgp.h"

enum hg_cli_progress_mode { HG_CLI_PROGRESS_NONE, HG_CLI_PROGRESS_LINE, HG_CLI_PROGRESS_JSON };

struct hg_cli_progress {
    enum hg_cli_progress_mode mode;
    uint64_t begin_ns, shown_ns; // a line appears after a second, at most ten times a second
    bool line_open;              // the cursor stands behind a progress line
    char prefix[64];             // "frame 3 of 10"; may be empty
    char stage[72];              // the newest stage and how far it is
    uint64_t done, total;
    uint32_t warnings; // printed and not printed
};

// "auto" (NULL too), "json" or "none".
void hg_cli_progress_init(struct hg_cli_progress *p, const char *mode);
void hg_cli_progress_update(
    struct hg_cli_progress *p, const char *stage, uint64_t done, uint64_t total);
// A step of the command begins; shown until the server names a stage itself.
void hg_cli_progress_stage(struct hg_cli_progress *p, const char *stage);
// Says how many warnings were left out. Call once, at the end.
void hg_cli_progress_finish(struct hg_cli_progress *p);
// Removes an open progress line, before anything else is printed.
void hg_cli_progress_clear(struct hg_cli_progress *p);

// Handlers of libhelio; user is the struct above.
void hg_cli_on_tick(void *user);
void hg_cli_on_progress(void *user, const struct hgp_progress *progress);
void hg_cli_on_notice(void *user, const struct hgp_notice *notice);

#endif
