// json.h - JSON text, written to a growing buffer. Floor 0. Thread: that of the writer.
//
// The caller writes what stands between values: brackets, commas, keys. Errors stay in the writer
// (w->failed) until hg_json_take.
#ifndef HG_BASE_JSON_H
#define HG_BASE_JSON_H

#include "base/bytes.h"

// Formatted, not escaped; at most 1,023 bytes, else the writer fails.
void hg_json_put(struct hg_writer *w, const char *fmt, ...) HG_PRINTF(2, 3);
// A string of any length in quotes, escaped; bytes of UTF-8 stay as they are.
void hg_json_string(struct hg_writer *w, const char *text);
// A member. `key` comes with what stands before and after it: ",\"x\":".
void hg_json_put_text(struct hg_writer *w, const char *key, const char *value);
void hg_json_put_number(struct hg_writer *w, const char *key, uint64_t value);
// Terminates and hands the text over (freed with hg_free). HG_E_NOMEM when a write failed.
enum hg_status hg_json_take(struct hg_writer *w, char **text) HG_MUST_CHECK;

#endif
