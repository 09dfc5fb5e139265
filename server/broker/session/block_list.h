// block_list.h - tokens and join tickets that an administrator has blocked for a while.
// Floor 6 (broker). Thread: the loop. Times are those of the wall clock, in seconds since 1970.
#ifndef HG_BROKER_BLOCK_LIST_H
#define HG_BROKER_BLOCK_LIST_H

#include "server/broker/state/state_record.h"

enum { HG_BLOCKS = 1024 };

struct hg_block {
    uint8_t hash[32]; // of the token or ticket
    uint64_t until_s; // 0 = unused
};

// Zero-initialised = none.
struct hg_block_list {
    struct hg_block items[HG_BLOCKS];
};

// Until when it is blocked; 0 = it is not.
uint64_t hg_block_until(const struct hg_block_list *list, const uint8_t hash[32], uint64_t now_s);
// In place of the one that ends first, where there are too many. Returns the log's position.
uint64_t hg_block_add(
    struct hg_block_list *list, struct hg_state_log *log, const uint8_t hash[32], uint64_t until_s);
void hg_block_record_all(const struct hg_block_list *list, struct hg_state_log *log);

#endif
