// json.h - JSON reports, written to a growing buffer. Floor 0. Thread: that of the writer.
#ifndef HG_BASE_JSON_H
#define HG_BASE_JSON_H

#include "base/bytes.h"

void hg_json_put(struct hg_writer *w, const char *fmt, ...) HG_PRINTF(2, 3);
// In quotes, escaped.
void hg_json_string(struct hg_writer *w, const char *text);
// Terminates and hands the text over (freed with hg_free). HG_E_NOMEM when a write failed.
enum hg_status hg_json_take(struct hg_writer *w, char **text) HG_MUST_CHECK;

#endif
