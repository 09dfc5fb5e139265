// web.h - what HTTP serves, put together: files, statistics, options.
// Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_WEB_H
#define HG_BROKER_WEB_H

#include "server/broker/http/http_answer.h"
#include "server/broker/session/session_state.h"

// Reads the files. The errors of hg_web_files_read.
enum hg_status hg_web_open(struct hg_web *web, const struct hg_options *options,
    struct hg_session_table *sessions, struct hg_error *err) HG_MUST_CHECK;

#endif
