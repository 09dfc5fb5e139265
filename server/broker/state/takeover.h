// takeover.h - SIGUSR2: the program as it is on the disk now takes the place of this one, in the
// same process, without a session or a worker noticing. Floor 6 (broker). Thread: the loop.
//
// The new program checks its configuration first, as a process of its own. Then nothing more is
// read from clients until what is under way has ended; after drain-timeout requests other than
// edits are answered with CANCELLED, and after as long again everything goes on as it was.
#ifndef HG_BROKER_TAKEOVER_H
#define HG_BROKER_TAKEOVER_H

#include "server/broker/storage/cache_folder.h"
#include "server/broker/state/handover.h"

struct hg_takeover {
    struct hg_handover all; // what is handed over
    struct hg_loop *loop;
    struct hg_audit *audit;
    struct hg_launcher *launcher;  // goes along
    struct hg_cache_folder *cache; // likewise
    struct hg_state_log **state;   // NULL: there is no log
    struct hg_source *state_news;
    int argc;
    char *const *argv;
    pid_t check_pid;      // of the new program, which checks its configuration; 0 = none
    uint64_t deadline_ns; // until then what is under way may end; 0 = no takeover is coming
    bool hurried;
    int inherited_fd; // what the program before has left; -1 = nothing
    uint32_t inherited_links;
};

// In the new program, first: what there is to inherit. Of the options that what was inherited
// depends on, isolation and cache-dir, `options` gets those of the program before. HG_E_NOMEM.
enum hg_status hg_takeover_find(
    struct hg_takeover *t, struct hg_options *options, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_takeover_inherit(struct hg_takeover *t, struct hg_error *err) HG_MUST_CHECK;
void hg_takeover_begin(struct hg_takeover *t);
void hg_takeover_checked(struct hg_takeover *t, int status); // check_pid has ended
void hg_takeover_step(
    struct hg_takeover *t); // while deadline_ns is not 0; does not return at the end
void hg_takeover_stop(struct hg_takeover *t); // none is coming any more

#endif
