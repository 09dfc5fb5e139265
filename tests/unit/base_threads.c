// queue.h, jobs.h, clock.h, and reference counts between threads.
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <poll.h>
#include <pthread.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/jobs.h"
#include "base/queue.h"
#include "base/refbuf.h"

static int items[100];

static bool is_readable(int fd)
{
    struct pollfd p = {.fd = fd, .events = POLLIN};
    return poll(&p, 1, 0) == 1;
}

// ---- queue.h -----------------------------------------------------------------------------------

static void test_queue_order_and_event(void **state)
{
    (void)state;
    struct hg_queue q;
    assert_int_equal(hg_queue_init(&q, 3), HG_OK);
    assert_false(is_readable(q.event_fd));
    assert_null(hg_queue_try_pop(&q));
    // Round the ring several times.
    for (int i = 0; i < 30; i += 3) {
        for (int n = 0; n < 3; n++)
            assert_int_equal(hg_queue_push(&q, &items[i + n]), HG_OK);
        assert_int_equal(hg_queue_push(&q, &items[99]), HG_E_AGAIN);
        for (int n = 0; n < 3; n++) {
            assert_true(is_readable(q.event_fd)); // as long as an item is inside
            assert_ptr_equal(hg_queue_try_pop(&q), &items[i + n]);
        }
        assert_false(is_readable(q.event_fd));
    }
    hg_queue_finish(&q);
    hg_queue_finish(&q);
    struct hg_queue zeroed = {0};
    hg_queue_finish(&zeroed);
}

static void test_queue_close(void **state)
{
    (void)state;
    struct hg_queue q;
    assert_int_equal(hg_queue_init(&q, 2), HG_OK);
    assert_int_equal(hg_queue_push(&q, &items[0]), HG_OK);
    hg_queue_close(&q);
    assert_int_equal(hg_queue_push(&q, &items[1]), HG_E_CLOSED);
    assert_ptr_equal(hg_queue_pop(&q, UINT64_MAX), &items[0]); // what was inside stays
    assert_null(hg_queue_pop(&q, UINT64_MAX));                 // and nothing waits for more
    hg_queue_finish(&q);
}

static void test_queue_timeout(void **state)
{
    (void)state;
    struct hg_queue q;
    assert_int_equal(hg_queue_init(&q, 1), HG_OK);
    uint64_t begin = hg_clock_now_ns();
    assert_null(hg_queue_pop(&q, 20000000));
    assert_true(hg_clock_now_ns() - begin >= 20000000);
    assert_null(hg_queue_pop(&q, 0));
    hg_queue_finish(&q);
    hg_alloc_fail_at(1);
    assert_int_equal(hg_queue_init(&q, 1), HG_E_NOMEM);
    hg_alloc_fail_at(0);
    hg_queue_finish(&q);
}

enum { PER_PRODUCER = 5000, PRODUCERS = 3 };

static void *produce(void *arg)
{
    struct hg_queue *q = arg;
    for (uintptr_t i = 1; i <= PER_PRODUCER; i++)
        while (hg_queue_push(q, (void *)i) == HG_E_AGAIN)
            hg_clock_sleep_ns(1000);
    return NULL;
}

static void *consume(void *arg)
{
    struct hg_queue *q = arg;
    uintptr_t sum = 0;
    for (void *item; (item = hg_queue_pop(q, UINT64_MAX));)
        sum += (uintptr_t)item;
    return (void *)sum;
}

static void test_queue_between_threads(void **state)
{
    (void)state;
    struct hg_queue q;
    pthread_t producers[PRODUCERS], consumers[2];
    uintptr_t sum = 0;
    assert_int_equal(hg_queue_init(&q, 7), HG_OK);
    for (int i = 0; i < 2; i++)
        assert_int_equal(pthread_create(&consumers[i], NULL, consume, &q), 0);
    for (int i = 0; i < PRODUCERS; i++)
        assert_int_equal(pthread_create(&producers[i], NULL, produce, &q), 0);
    for (int i = 0; i < PRODUCERS; i++)
        pthread_join(producers[i], NULL);
    hg_queue_close(&q);
    for (int i = 0; i < 2; i++) {
        void *part;
        pthread_join(consumers[i], &part);
        sum += (uintptr_t)part;
    }
    assert_int_equal(sum, PRODUCERS * (PER_PRODUCER * (PER_PRODUCER + 1) / 2));
    hg_queue_finish(&q);
}

// ---- jobs.h ------------------------------------------------------------------------------------

enum { MANY = 20000 };

struct marks {
    struct hg_jobs *jobs;
    _Atomic unsigned seen[MANY];
};

static struct marks marks;

static void mark(void *user, size_t index)
{
    struct marks *m = user;
    atomic_fetch_add(&m->seen[index], 1);
}

static void assert_marks(size_t count, unsigned times)
{
    for (size_t i = 0; i < MANY; i++) {
        assert_int_equal(atomic_load(&marks.seen[i]), i < count ? times : 0);
        atomic_store(&marks.seen[i], 0);
    }
}

static void test_jobs_every_index_once(void **state)
{
    (void)state;
    for (unsigned threads = 1; threads <= 4; threads++) {
        struct hg_jobs *jobs = hg_jobs_create(threads);
        assert_non_null(jobs);
        assert_int_equal(hg_jobs_threads(jobs), threads);
        static const size_t counts[] = {0, 1, 2, 3, 100, MANY};
        for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
            hg_jobs_for(jobs, counts[i], mark, &marks);
            assert_marks(counts[i], 1);
        }
        hg_jobs_destroy(jobs);
    }
    struct hg_jobs *jobs = hg_jobs_create(0);
    assert_non_null(jobs);
    assert_true(hg_jobs_threads(jobs) >= 1);
    hg_jobs_destroy(jobs);
    hg_jobs_destroy(NULL);
}

struct slice {
    struct marks *marks;
    size_t base;
};

static void mark_in_slice(void *user, size_t index)
{
    const struct slice *s = user;
    atomic_fetch_add(&s->marks->seen[s->base + index], 1);
}

static void run_slice(void *user, size_t index)
{
    struct marks *m = user;
    struct slice s = {m, index * 100};
    hg_jobs_for(m->jobs, 100, mark_in_slice, &s);
}

static void test_jobs_nested(void **state)
{
    (void)state;
    for (unsigned threads = 1; threads <= 4; threads++) {
        marks.jobs = hg_jobs_create(threads);
        assert_non_null(marks.jobs);
        hg_jobs_for(marks.jobs, MANY / 100, run_slice, &marks);
        assert_marks(MANY, 1);
        hg_jobs_destroy(marks.jobs);
    }
}

static void *call_jobs(void *arg)
{
    (void)arg;
    for (int i = 0; i < 20; i++)
        hg_jobs_for(marks.jobs, 500, mark, &marks);
    return NULL;
}

static void test_jobs_from_many_threads(void **state)
{
    (void)state;
    pthread_t callers[4];
    marks.jobs = hg_jobs_create(3);
    assert_non_null(marks.jobs);
    for (int i = 0; i < 4; i++)
        assert_int_equal(pthread_create(&callers[i], NULL, call_jobs, NULL), 0);
    for (int i = 0; i < 4; i++)
        pthread_join(callers[i], NULL);
    assert_marks(500, 4 * 20);
    hg_jobs_destroy(marks.jobs);
}

// ---- clock.h, refbuf.h -------------------------------------------------------------------------

static void test_clock(void **state)
{
    (void)state;
    uint64_t last = hg_clock_now_ns();
    assert_true(last != 0);
    for (int i = 0; i < 1000; i++) {
        uint64_t now = hg_clock_now_ns();
        assert_true(now >= last);
        last = now;
    }
    hg_clock_sleep_ns(5000000);
    assert_true(hg_clock_now_ns() - last >= 5000000);
    assert_true(hg_clock_wall_ns() > UINT64_C(1600000000) * 1000000000); // after 2020
}

static void *drop_refs(void *arg)
{
    for (int i = 0; i < 10000; i++)
        hg_refbuf_unref(hg_refbuf_ref(arg));
    hg_refbuf_unref(arg);
    return NULL;
}

static void test_refbuf_between_threads(void **state)
{
    (void)state;
    pthread_t threads[3];
    struct hg_refbuf *buf = hg_refbuf_create(64);
    assert_non_null(buf);
    for (int i = 0; i < 3; i++)
        assert_int_equal(pthread_create(&threads[i], NULL, drop_refs, hg_refbuf_ref(buf)), 0);
    for (int i = 0; i < 3; i++)
        pthread_join(threads[i], NULL);
    assert_int_equal(atomic_load(&buf->refs), 1);
    hg_refbuf_unref(buf);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_queue_order_and_event),
        cmocka_unit_test(test_queue_close),
        cmocka_unit_test(test_queue_timeout),
        cmocka_unit_test(test_queue_between_threads),
        cmocka_unit_test(test_jobs_every_index_once),
        cmocka_unit_test(test_jobs_nested),
        cmocka_unit_test(test_jobs_from_many_threads),
        cmocka_unit_test(test_clock),
        cmocka_unit_test(test_refbuf_between_threads),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
