// progress.h - progress, notices and results on the error stream: lines for people, or one JSON
// object a line. Floor 6 (client). One thread.
#ifndef HG_CLIENT_CLI_PROGRESS_H
#define HG_CLIENT_CLI_PROGRESS_H

#include <stdbool.h>
#include <stdint.h>

#include "base/status.h"
#include "protocol/hgp.h"

enum hg_cli_progress_mode { HG_CLI_PROGRESS_NONE, HG_CLI_PROGRESS_LINE, HG_CLI_PROGRESS_JSON };

struct hg_cli_progress {
    enum hg_cli_progress_mode mode;
    uint64_t begin_ns, shown_ns; // a line appears after a second, at most ten times a second
    bool quiet, verbose;         // nothing but errors; every warning
    bool line_open;              // the cursor stands behind a progress line
    int32_t frame;               // number of the current frame
    uint32_t index;              // its place from 1; 0: of none
    char stage[72];              // the newest stage and how far it is
    uint64_t done, total;
    uint64_t stage_ns, stage_done;             // when the stage first went on, how far it was then
    bool stage_waits;                          // it did not yet: stage_ns is when it was first seen
    uint32_t frames, frames_done, frames_made; // all to come; there; those of them made now
    uint64_t first_ns, frames_ns;              // taken by the first one made, which has to compile
                                               // shaders; by the others
    uint64_t frame_begin_ns;                   // of the current one
    uint32_t warnings, warnings_said;          // all of them; those that were printed or counted
    char first_warning[960];                   // of those that were not said yet
    uint32_t replaced;                         // workers that ended and were replaced
    struct {
        uint32_t written, skipped;
    } outputs;
};

// "auto" (NULL too), "json" or "none".
void hg_cli_progress_init(struct hg_cli_progress *p, const char *mode);
void hg_cli_progress_update(
    struct hg_cli_progress *p, const char *stage, uint64_t done, uint64_t total);
// A step of the command begins; shown until the server names a stage itself.
void hg_cli_progress_stage(struct hg_cli_progress *p, const char *stage);
// So many frames are to come.
void hg_cli_progress_frames(struct hg_cli_progress *p, uint32_t count);
// The frame of that number, place `index` from 1, is next.
void hg_cli_progress_begin_frame(struct hg_cli_progress *p, int32_t frame, uint32_t index);
// It is there: made in `took_ns`, 0 = it was there before.
void hg_cli_progress_frame(struct hg_cli_progress *p, uint64_t took_ns);
// An output was written, or (took_ns 0) left as it was. An event of the JSON stream alone.
void hg_cli_progress_output(struct hg_cli_progress *p, const char *path, uint64_t took_ns);
// Estimated seconds until the command is done; negative = unknown.
double hg_cli_progress_left(const struct hg_cli_progress *p, uint64_t now_ns);
// Says the warnings since the last call in one line: the only one, or the first and how many there
// are.
void hg_cli_progress_warnings(struct hg_cli_progress *p);
// The end of the command: the last event of the JSON stream.
void hg_cli_progress_end(struct hg_cli_progress *p, int exit_code);
// A remark ("helio: text") or an event of the JSON stream; nothing with --quiet.
void hg_cli_progress_say(struct hg_cli_progress *p, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
// A line as it is, or such an event; with --quiet too.
void hg_cli_progress_print(struct hg_cli_progress *p, const char *text);
// The same for the error that ends the command, which is said in any case. `what` and `where` may
// be empty.
void hg_cli_progress_error(struct hg_cli_progress *p, const struct hg_error *err, const char *text);
// Removes an open progress line, before anything else is printed.
void hg_cli_progress_clear(struct hg_cli_progress *p);

// Handlers of libhelio; user is the struct above.
void hg_cli_on_tick(void *user);
void hg_cli_on_progress(void *user, const struct hgp_progress *progress);
void hg_cli_on_notice(void *user, const struct hgp_notice *notice);
void hg_cli_on_message(void *user, const struct hgp_message *message);
void hg_cli_on_idle(void *user, const struct hgp_idle_warning *warning);

#endif
