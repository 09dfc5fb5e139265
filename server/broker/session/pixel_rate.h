// pixel_rate.h - how many pixels of frames a token, and all of them, may have per second.
// Floor 6 (broker). Thread: the loop.
//
// Token buckets that hold what a second gives. A frame is taken out when it has come; while a
// bucket is empty, nothing that renders is begun. So frames of any size have the rate in the mean.
#ifndef HG_BROKER_PIXEL_RATE_H
#define HG_BROKER_PIXEL_RATE_H

#include <stdbool.h>
#include <stdint.h>

struct hg_pixel_bucket {
    double level;      // pixels that may be rendered now; below 0: that were too many
    uint64_t since_ns; // when that was counted
};

// Of one token, join ticket, or the daemon's own user.
struct hg_pixel_account {
    struct hg_pixel_account *next;
    uint8_t key[32];
    bool has_key; // false: the daemon's own user
    uint32_t refs;
    struct hg_pixel_bucket bucket;
};

// Zero-initialised = none.
struct hg_pixel_accounts {
    struct hg_pixel_account *first;
    struct hg_pixel_bucket all;
};

struct hg_pixel_limits {
    uint32_t own, all;    // pixels per second; 0 = no limit
    const char *own_name; // what sets `own`
};

// Found by its key (NULL: the daemon's own user), or made. NULL: no memory.
struct hg_pixel_account *hg_pixel_account_ref(
    struct hg_pixel_accounts *accounts, const uint8_t *key, uint64_t now_ns);
void hg_pixel_account_unref(struct hg_pixel_accounts *accounts, struct hg_pixel_account *account);
// How long until something may be rendered; 0 = now. *limit: the option that says so.
uint64_t hg_pixel_wait_ns(struct hg_pixel_accounts *accounts, struct hg_pixel_account *account,
    const struct hg_pixel_limits *limits, uint64_t now_ns, const char **limit);
void hg_pixel_take(
    struct hg_pixel_accounts *accounts, struct hg_pixel_account *account, uint64_t pixels);

#endif
