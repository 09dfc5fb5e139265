// metrics.h - the daemon's statistics as Prometheus reads them, and whether it is ready.
// Floor 6 (broker). Thread: the loop.
// Format: Prometheus text exposition 0.0.4.
#ifndef HG_BROKER_METRICS_H
#define HG_BROKER_METRICS_H

#include "server/broker/session/session_state.h"

// Appends all metrics; a failure shows in w->failed.
void hg_metrics_write(const struct hg_session_table *t, struct hg_writer *w);
// Why no session would be taken now, as a line; NULL: one would.
const char *hg_metrics_unready(const struct hg_session_table *t);
// The table of all metrics (docs/metrics.md).
void hg_metrics_print_docs(FILE *file);

#endif
