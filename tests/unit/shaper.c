// shaper.c - the token bucket and the proxy of tests/support/shaper.h.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "base/clock.h"
#include "tests/support/folder.h"
#include "tests/support/shaper.h"

#define SECOND_NS 1000000000u
enum { PIECE = 1000, SENT_BYTES = 100000 };

// How many pieces pass within a time, asked every `step_ns`.
static uint32_t passed(struct shaper_bucket *b, uint64_t from_ns, uint64_t ns, uint64_t step_ns)
{
    uint32_t count = 0;
    for (uint64_t t = from_ns; t < from_ns + ns; t += step_ns)
        while (shaper_bucket_take(b, PIECE, t))
            count++;
    return count;
}

static void test_a_bucket_passes_its_rate_and_no_more_than_a_burst_at_once(void **state)
{
    (void)state;
    struct shaper_bucket b;
    shaper_bucket_init(&b, 50000, 4000, 7);
    assert_int_equal(passed(&b, 7, 1, 1), 4); // the burst
    assert_in_range(passed(&b, 8, SECOND_NS, 1000000), 49, 50);
    assert_int_equal(passed(&b, 8 + 10 * (uint64_t)SECOND_NS, 1, 1), 4); // it does not save up
}

static void test_a_bucket_says_how_long_to_wait(void **state)
{
    (void)state;
    struct shaper_bucket b;
    shaper_bucket_init(&b, 1000, 1000, 0);
    assert_true(shaper_bucket_take(&b, PIECE, 0));
    const uint64_t wait_ns = shaper_bucket_wait_ns(&b, PIECE, 0);
    assert_in_range(wait_ns, SECOND_NS, SECOND_NS + 2);
    assert_false(shaper_bucket_take(&b, PIECE, wait_ns - 1000));
    assert_true(shaper_bucket_take(&b, PIECE, wait_ns));
}

static void test_a_change_of_the_rate_counts_from_then_on(void **state)
{
    (void)state;
    struct shaper_bucket b;
    shaper_bucket_init(&b, 100000, 1000, 0);
    assert_true(shaper_bucket_take(&b, PIECE, 0));
    shaper_bucket_set_rate(&b, 0, 0); // a stall
    assert_true(shaper_bucket_wait_ns(&b, PIECE, SECOND_NS) == UINT64_MAX);
    assert_int_equal(passed(&b, 0, SECOND_NS, 1000000), 0);
    shaper_bucket_set_rate(&b, 20000, SECOND_NS); // nothing was saved up in it
    assert_in_range(passed(&b, SECOND_NS, SECOND_NS, 1000000), 19, 20);
}

static void test_a_piece_above_the_burst_passes_and_is_paid_for(void **state)
{
    (void)state;
    struct shaper_bucket b;
    shaper_bucket_init(&b, 1000, 500, 0);
    assert_true(shaper_bucket_take(&b, PIECE, 0));
    assert_in_range(shaper_bucket_wait_ns(&b, 500, 0), SECOND_NS, SECOND_NS + 2);
}

// ---- the proxy ----------------------------------------------------------------------------------

static int listen_at(const char *path)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const int fd = socket(AF_UNIX, SOCK_STREAM, 0);
    snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    assert_int_equal(bind(fd, (struct sockaddr *)&address, sizeof address), 0);
    assert_int_equal(listen(fd, 1), 0);
    return fd;
}

static int connect_to(int port)
{
    const struct sockaddr_in address = {.sin_family = AF_INET,
        .sin_port = htons((uint16_t)port),
        .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    const int fd = socket(AF_INET, SOCK_STREAM, 0);
    assert_int_equal(connect(fd, (const struct sockaddr *)&address, sizeof address), 0);
    return fd;
}

static void read_all(int fd, uint8_t *to, size_t size)
{
    for (size_t done = 0; done < size;) {
        const ssize_t n = recv(fd, to + done, size - done, 0);
        assert_true(n > 0);
        done += (size_t)n;
    }
}

// Everything comes out, in order, and not sooner than the rate and the delay allow.
static void test_the_proxy_delays_and_keeps_the_order(void **state)
{
    (void)state;
    static uint8_t out[SENT_BYTES], in[SENT_BYTES];
    char folder[TEST_FOLDER_MAX], path[TEST_FOLDER_MAX + 8];
    struct shaper s;
    const struct shaper_step steps[] = {{0, 1e6}};
    assert_true(test_folder_make(folder, "shaper"));
    snprintf(path, sizeof path, "%s/sock", folder);
    const int listener = listen_at(path);
    assert_true(shaper_start(&s, path,
        &(struct shaper_options){
            .delay_ns = 20000000, .jitter_ns = 5000000, .steps = steps, .step_count = 1}));
    const int client = connect_to(s.port), server = accept(listener, NULL, NULL);
    for (size_t i = 0; i < sizeof out; i++)
        out[i] = (uint8_t)(i * 7 + i / 251);
    const uint64_t begin_ns = hg_clock_now_ns();
    assert_int_equal(send(server, out, sizeof out, 0), sizeof out);
    read_all(client, in, sizeof in);
    const uint64_t took_ns = hg_clock_now_ns() - begin_ns;
    assert_memory_equal(in, out, sizeof in);
    assert_true(took_ns >= 110000000); // 100 kB at 1 MB/s less a burst, and the delay
    assert_int_equal(send(client, out, 1000, 0), 1000);
    read_all(server, in, 1000);
    assert_memory_equal(in, out, 1000);
    assert_true(atomic_load(&s.down_bytes) == sizeof out);
    close(server); // the end passes, too
    assert_int_equal(recv(client, in, 1, 0), 0);
    close(client);
    shaper_stop(&s);
    close(listener);
    assert_true(test_folder_remove(folder));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_bucket_passes_its_rate_and_no_more_than_a_burst_at_once),
        cmocka_unit_test(test_a_bucket_says_how_long_to_wait),
        cmocka_unit_test(test_a_change_of_the_rate_counts_from_then_on),
        cmocka_unit_test(test_a_piece_above_the_burst_passes_and_is_paid_for),
        cmocka_unit_test(test_the_proxy_delays_and_keeps_the_order),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
