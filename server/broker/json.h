// json.h - JSON text, written piece by piece: what stands between values is the caller's.
// Floor 6 (broker). Thread: any.
#ifndef HG_BROKER_JSON_H
#define HG_BROKER_JSON_H

#include "base/bytes.h"

void hg_json_put(struct hg_writer *w, const char *text); // as it is
// A string in quotes, escaped; bytes of UTF-8 stay as they are.
void hg_json_put_string(struct hg_writer *w, const char *text);
// `key` comes with what stands before it: ",\"x\":" .
void hg_json_put_text(struct hg_writer *w, const char *key, const char *value);
void hg_json_put_number(struct hg_writer *w, const char *key, uint64_t value);

#endif
