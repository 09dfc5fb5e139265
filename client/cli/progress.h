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
    uint64_t stage_ns, stage_done;             // when the stage first went on, how far it was then
    bool stage_waits;                          // it did not yet: stage_ns is when it was first seen
    uint32_t frames, frames_done, frames_made; // all to come; there; those of them made now
    uint64_t first_ns, frames_ns;              // taken by the first one made, which has to compile
                                               // shaders; by the others
    uint64_t frame_begin_ns;                   // of the one at hand
    uint32_t warnings;                         // printed and not printed
    uint32_t replaced;                         // workers that ended and were replaced
};

// "auto" (NULL too), "json" or "none".
void hg_cli_progress_init(struct hg_cli_progress *p, const char *mode);
void hg_cli_progress_update(
    struct hg_cli_progress *p, const char *stage, uint64_t done, uint64_t total);
// A step of the command begins; shown until the server names a stage itself.
void hg_cli_progress_stage(struct hg_cli_progress *p, const char *stage);
// So many frames are to come; one of them is there (made in `took_ns`, 0 = it was there before).
void hg_cli_progress_frames(struct hg_cli_progress *p, uint32_t count);
void hg_cli_progress_frame(struct hg_cli_progress *p, uint64_t took_ns);
// Estimated seconds until the command is done; negative = unknown.
double hg_cli_progress_left(const struct hg_cli_progress *p, uint64_t now_ns);
// Says how many warnings were left out. Call once, at the end.
void hg_cli_progress_finish(struct hg_cli_progress *p);
// Removes an open progress line, before anything else is printed.
void hg_cli_progress_clear(struct hg_cli_progress *p);

// Handlers of libhelio; user is the struct above.
void hg_cli_on_tick(void *user);
void hg_cli_on_progress(void *user, const struct hgp_progress *progress);
void hg_cli_on_notice(void *user, const struct hgp_notice *notice);

#endif
