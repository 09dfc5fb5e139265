#include "server/broker/session/pixel_rate.h"

#include <string.h>

#include "base/alloc.h"

struct hg_pixel_account *hg_pixel_account_ref(
    struct hg_pixel_accounts *accounts, const uint8_t *key, uint64_t now_ns)
{
    struct hg_pixel_account *it = accounts->first;
    while (it && !(it->has_key == (key != NULL) && (!key || memcmp(it->key, key, 32) == 0)))
        it = it->next;
    if (!it) {
        it = hg_calloc(1, sizeof *it);
        if (!it)
            return NULL;
        it->has_key = key != NULL;
        if (key)
            memcpy(it->key, key, sizeof it->key);
        it->bucket = (struct hg_pixel_bucket){.since_ns = now_ns};
        it->next = accounts->first;
        accounts->first = it;
    }
    it->refs++;
    return it;
}

void hg_pixel_account_unref(struct hg_pixel_accounts *accounts, struct hg_pixel_account *account)
{
    struct hg_pixel_account **link = &accounts->first;
    if (!account || --account->refs)
        return;
    while (*link != account)
        link = &(*link)->next;
    *link = account->next;
    hg_free(account);
}

static uint64_t wait_ns(struct hg_pixel_bucket *b, uint32_t rate, uint64_t now_ns)
{
    if (!rate) {
        *b = (struct hg_pixel_bucket){.since_ns = now_ns};
        return 0;
    }
    b->level += (double)(now_ns - b->since_ns) * 1e-9 * rate;
    b->since_ns = now_ns;
    if (b->level > rate)
        b->level = rate;
    return b->level >= 0 ? 0 : 1 + (uint64_t)(-b->level / rate * 1e9);
}

uint64_t hg_pixel_wait_ns(struct hg_pixel_accounts *accounts, struct hg_pixel_account *account,
    const struct hg_pixel_limits *limits, uint64_t now_ns, const char **limit)
{
    uint64_t own = account ? wait_ns(&account->bucket, limits->own, now_ns) : 0;
    uint64_t all = wait_ns(&accounts->all, limits->all, now_ns);
    *limit = own >= all ? limits->own_name : "pixel-rate-total";
    return own > all ? own : all;
}

void hg_pixel_take(
    struct hg_pixel_accounts *accounts, struct hg_pixel_account *account, uint64_t pixels)
{
    if (account)
        account->bucket.level -= (double)pixels;
    accounts->all.level -= (double)pixels;
}
