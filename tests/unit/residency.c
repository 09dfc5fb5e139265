// residency.c - slots, least recent use and priorities against a plain model: arrays that are
// searched from end to end.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "renderer/residency/residency.h"

#define KEYS       64
#define HYSTERESIS 3
#define PATIENCE   2
#define REQUESTS   12

enum model_state { ABSENT, REQUESTED, IN_FLIGHT, RESIDENT };

struct item {
    enum model_state state;
    uint32_t frame, pins, slot;
    uint64_t order; // of uses: later is larger
    float priority;
};

struct model {
    struct hg_residency *r;
    struct item items[KEYS];
    uint32_t slots, frame, random;
    uint64_t clock;
};

static uint32_t draw(struct model *m, uint32_t below)
{
    m->random = m->random * 1664525u + 1013904223u;
    return (m->random >> 8) % below;
}

static uint32_t count(const struct model *m, enum model_state state)
{
    uint32_t n = 0;
    for (int i = 0; i < KEYS; i++)
        n += m->items[i].state == state;
    return n;
}

static void touch(struct model *m, struct item *item)
{
    if (item->frame != m->frame || item->order == 0)
        item->order = ++m->clock;
    item->frame = m->frame;
}

// --- the same step in both
// ------------------------------------------------------------------------

static void tick(struct model *m)
{
    hg_residency_tick(m->r);
    m->frame++;
    for (int i = 0; i < KEYS; i++)
        if (m->items[i].state == REQUESTED && m->frame - m->items[i].frame > PATIENCE)
            m->items[i].state = ABSENT;
}

// Keys are numbered from 100, so that a key is never a slot by chance.
static void request(struct model *m)
{
    const uint32_t k = draw(m, KEYS);
    const float priority = (float)draw(m, 8);
    struct item *item = &m->items[k];
    bool accepted = false;
    if (item->state == REQUESTED) {
        if (item->frame != m->frame || priority > item->priority)
            item->priority = priority;
        item->frame = m->frame;
        accepted = true;
    } else if (item->state == ABSENT) {
        if (count(m, REQUESTED) + count(m, IN_FLIGHT) == REQUESTS) {
            struct item *worst = NULL; // least priority; of equal ones the largest key
            for (int i = 0; i < KEYS; i++)
                if (m->items[i].state == REQUESTED &&
                    (worst == NULL || m->items[i].priority <= worst->priority))
                    worst = &m->items[i];
            if (worst != NULL &&
                (priority > worst->priority || (priority == worst->priority && item < worst))) {
                worst->state = ABSENT;
                accepted = true;
            }
        } else {
            accepted = true;
        }
        if (accepted)
            *item = (struct item){.state = REQUESTED, .frame = m->frame, .priority = priority};
    }
    assert_int_equal(hg_residency_request(m->r, 100 + k, priority), accepted);
}

static void next(struct model *m)
{
    struct item *best = NULL;
    for (int i = 0; i < KEYS; i++)
        if (m->items[i].state == REQUESTED &&
            (best == NULL || m->items[i].priority > best->priority))
            best = &m->items[i];
    uint64_t key;
    float priority;
    assert_int_equal(hg_residency_next(m->r, &key, &priority), best != NULL);
    assert_int_equal(key, best != NULL ? 100 + (uint64_t)(best - m->items) : HG_RESIDENCY_NO_KEY);
    if (best != NULL) {
        assert_true(priority == best->priority);
        best->state = IN_FLIGHT;
    }
}

static bool may_go(const struct model *m, const struct item *item, enum hg_residency_force force)
{
    static const uint32_t ages[] = {[HG_RESIDENCY_GENTLE] = HYSTERESIS, [HG_RESIDENCY_UNUSED] = 0};
    return item->state == RESIDENT && item->pins == 0 &&
           (force == HG_RESIDENCY_ANY || m->frame - item->frame > ages[force]);
}

static void place(struct model *m)
{
    const uint32_t k = draw(m, KEYS);
    const enum hg_residency_force force = (enum hg_residency_force)draw(m, 3);
    struct item *item = &m->items[k], *victim = NULL;
    const bool resident = item->state == RESIDENT;
    const bool full = count(m, RESIDENT) == m->slots;
    for (int i = 0; i < KEYS; i++)
        if (may_go(m, &m->items[i], force) && (victim == NULL || m->items[i].order < victim->order))
            victim = &m->items[i];
    const bool fits = resident || !full || victim != NULL;
    uint32_t slot;
    uint64_t evicted;
    assert_int_equal(
        hg_residency_place(m->r, 100 + k, force, &slot, &evicted), fits ? HG_OK : HG_E_AGAIN);
    if (resident || !full || !fits)
        victim = NULL;
    assert_int_equal(
        evicted, victim != NULL ? 100 + (uint64_t)(victim - m->items) : HG_RESIDENCY_NO_KEY);
    if (!fits) {
        assert_int_equal(slot, HG_RESIDENCY_NONE);
        return;
    }
    assert_true(slot < m->slots);
    if (victim != NULL)
        *victim = (struct item){0};
    if (!resident)
        *item = (struct item){.state = RESIDENT, .slot = slot, .frame = m->frame};
    assert_int_equal(item->slot, slot);
    touch(m, item);
}

static void use_pin_remove(struct model *m)
{
    struct item *item = &m->items[draw(m, KEYS)];
    if (item->state == IN_FLIGHT && draw(m, 2) == 0) {
        if (draw(m, 2) == 0) {
            hg_residency_cancel(m->r, 100 + (uint64_t)(item - m->items));
            *item = (struct item){0};
        } else { // with the frame and the priority of its request
            hg_residency_put_back(m->r, 100 + (uint64_t)(item - m->items));
            item->state = REQUESTED;
        }
    }
    if (item->state != RESIDENT)
        return;
    switch (draw(m, 12)) {
    case 0:
        hg_residency_pin(m->r, item->slot);
        item->pins++;
        break;
    case 1:
    case 2:
        hg_residency_unpin(m->r, item->slot);
        if (item->pins > 0 && --item->pins == 0) {
            item->frame = m->frame;
            item->order = ++m->clock;
        }
        break;
    case 3:
        hg_residency_remove(m->r, item->slot);
        *item = (struct item){0};
        break;
    default:
        hg_residency_use(m->r, item->slot);
        touch(m, item);
    }
}

static void compare(const struct model *m)
{
    struct hg_residency_stats stats;
    hg_residency_stats(m->r, &stats);
    assert_int_equal(stats.slots, m->slots);
    assert_int_equal(stats.resident, count(m, RESIDENT));
    assert_int_equal(stats.requested, count(m, REQUESTED));
    assert_int_equal(stats.in_flight, count(m, IN_FLIGHT));
    uint32_t pinned = 0, free_slots = m->slots - count(m, RESIDENT), old = free_slots;
    for (uint32_t k = 0; k < KEYS; k++) {
        const struct item *item = &m->items[k];
        const bool resident = item->state == RESIDENT;
        assert_int_equal(
            hg_residency_find(m->r, 100 + k), resident ? item->slot : HG_RESIDENCY_NONE);
        assert_int_equal(hg_residency_is_in_flight(m->r, 100 + k), item->state == IN_FLIGHT);
        if (!resident)
            continue;
        assert_int_equal(hg_residency_item(m->r, item->slot), 100 + k);
        assert_int_equal(hg_residency_age(m->r, item->slot), m->frame - item->frame);
        pinned += item->pins > 0;
        old += may_go(m, item, HG_RESIDENCY_GENTLE);
    }
    assert_int_equal(stats.pinned, pinned);
    assert_int_equal(hg_residency_available(m->r, HG_RESIDENCY_GENTLE), old);
}

static void resize(struct model *m)
{
    if (draw(m, 60) != 0)
        return;
    uint32_t slots = draw(m, 24);
    for (int i = 0; i < KEYS; i++)
        if (m->items[i].state == RESIDENT && slots <= m->items[i].slot)
            slots = m->items[i].slot + 1;
    assert_int_equal(hg_residency_resize(m->r, slots), HG_OK);
    m->slots = slots;
}

static void test_like_a_model(void **state)
{
    (void)state;
    for (uint32_t seed = 1; seed <= 40; seed++) {
        struct model m = {.slots = seed % 20, .random = seed};
        const struct hg_residency_params params = {
            .slots = m.slots, .requests = REQUESTS, .hysteresis = HYSTERESIS, .patience = PATIENCE};
        assert_int_equal(hg_residency_create(&params, &m.r), HG_OK);
        for (int i = 0; i < 3000; i++) {
            switch (draw(&m, 8)) {
            case 0:
                tick(&m);
                break;
            case 1:
                next(&m);
                break;
            case 2:
                place(&m);
                break;
            case 3:
            case 4:
                use_pin_remove(&m);
                break;
            default:
                request(&m);
            }
            resize(&m);
            compare(&m);
        }
        hg_residency_destroy(m.r);
    }
}

// A working set that is larger than the slots does not chase itself: what is in use stays.
static void test_no_thrashing(void **state)
{
    (void)state;
    struct hg_residency *r;
    const struct hg_residency_params params = {.slots = 100, .hysteresis = 15};
    assert_int_equal(hg_residency_create(&params, &r), HG_OK);
    uint32_t evicted = 0, refused = 0;
    for (int frame = 0; frame < 200; frame++) {
        hg_residency_tick(r);
        for (uint64_t key = 0; key < 150; key++) {
            const uint32_t slot = hg_residency_find(r, key);
            if (slot != HG_RESIDENCY_NONE)
                hg_residency_use(r, slot);
            else
                hg_residency_request(r, key, 1.0f);
        }
        uint64_t key, old;
        float priority;
        while (hg_residency_next(r, &key, &priority)) {
            uint32_t slot;
            if (hg_residency_place(r, key, HG_RESIDENCY_GENTLE, &slot, &old) != HG_OK) {
                hg_residency_cancel(r, key);
                refused++;
            } else {
                evicted += old != HG_RESIDENCY_NO_KEY;
            }
        }
    }
    assert_int_equal(evicted, 0);
    assert_true(refused > 0);
    for (uint64_t key = 0; key < 100; key++) // the view turns away from some of them
        if (key % 2 == 0)
            hg_residency_use(r, hg_residency_find(r, key));
    for (int frame = 0; frame < 16; frame++)
        hg_residency_tick(r);
    assert_int_equal(hg_residency_available(r, HG_RESIDENCY_GENTLE), 100);
    hg_residency_destroy(r);
}

static void test_memory_failures(void **state)
{
    (void)state;
    const struct hg_residency_params params = {.slots = 10, .requests = 10};
    struct hg_residency *r = NULL;
    enum hg_status status = HG_E_NOMEM;
    uint64_t n = 0;
    while (status != HG_OK) {
        hg_alloc_fail_at(++n);
        status = hg_residency_create(&params, &r);
        hg_alloc_fail_at(0);
        assert_true(status == HG_OK ? r != NULL : r == NULL);
    }
    assert_true(n > 4);
    uint32_t slot;
    uint64_t evicted;
    assert_int_equal(hg_residency_place(r, 7, HG_RESIDENCY_GENTLE, &slot, &evicted), HG_OK);
    for (n = 1; n <= 4; n++) {
        hg_alloc_fail_at(n);
        assert_int_equal(hg_residency_resize(r, 100), HG_E_NOMEM);
        hg_alloc_fail_at(0);
        assert_int_equal(hg_residency_find(r, 7), slot);
    }
    assert_int_equal(hg_residency_resize(r, 100), HG_OK);
    assert_int_equal(hg_residency_find(r, 7), slot);
    assert_int_equal(hg_residency_available(r, HG_RESIDENCY_GENTLE), 99);
    hg_residency_destroy(r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_like_a_model),
        cmocka_unit_test(test_no_thrashing), cmocka_unit_test(test_memory_failures)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
