// frame_list.h - lists of frames as they are written for --frames: "1,3,5-9x2,-2".
// Floor 6 (client). Thread: any; no shared state.
//
//   list   = item { "," item }                    blanks beside the comma do not count
//   item   = number | range
//   range  = number ("-" | "..") number [ ("x" | ":") step ]
//   number = an optional "-" and digits; step >= 1
//
// A range whose second number is the lower one descends: 5-1 is 5,4,3,2,1. A frame named again is
// kept once, at its first place.
#ifndef HG_CLIENT_CLI_RENDER_FRAME_LIST_H
#define HG_CLIENT_CLI_RENDER_FRAME_LIST_H

#include "base/status.h"

enum {
    HG_FRAME_RANGES_MAX = 256,
    HG_FRAME_LIST_MAX = 1000000, // frames of a list
    HG_FRAME_NUMBER_MAX = 99999999,
};

struct hg_frame_range {
    int32_t first, last; // last is one of its frames
    int32_t step;        // < 0: descending; never 0
};

struct hg_frame_ranges {
    struct hg_frame_range items[HG_FRAME_RANGES_MAX];
    uint32_t count;
};

// Adds the ranges of a list to those that *out has; zeroed: none. On error it has none.
// HG_E_INVAL: err->reason names the character (from 1) that does not fit.
enum hg_status hg_frame_ranges_parse(const char *what, const char *text,
    struct hg_frame_ranges *out, struct hg_error *err) HG_MUST_CHECK;

// The frames of all ranges, each once. *numbers is freed with hg_free. HG_E_NOMEM.
enum hg_status hg_frame_ranges_list(const struct hg_frame_ranges *ranges, int32_t **numbers,
    uint32_t *count, struct hg_error *err) HG_MUST_CHECK;

// The frames as text, as short as ranges make it: "1-9x2,12". Cut to a whole item and ",..." where
// it does not fit; size >= 64.
void hg_frame_list_text(const int32_t *numbers, uint32_t count, char *dst, size_t size);

#endif
