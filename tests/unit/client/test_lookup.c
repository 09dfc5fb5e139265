// A resolver that does not answer: libhelio waits for nothing but what it says it waits for.
#include <dlfcn.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <semaphore.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/clock.h"
#include "client/include/helio/helio.h"

static const uint64_t SECOND = 1000000000;
static sem_t answer;
static _Atomic int asked, answered;

// In place of the system's: "slow.test" is this machine, once `answer` is posted; "none.test" is
// unknown.
int getaddrinfo(
    const char *node, const char *service, const struct addrinfo *hints, struct addrinfo **out)
{
    int (*real)(const char *, const char *, const struct addrinfo *, struct addrinfo **);
    *(void **)&real = dlsym(RTLD_NEXT, "getaddrinfo");
    if (hints->ai_flags & AI_NUMERICHOST || strstr(node, ".test") == NULL)
        return real(node, service, hints, out);
    if (strcmp(node, "none.test") == 0)
        return EAI_NONAME;
    asked++;
    sem_wait(&answer);
    const int failed = real("127.0.0.1", service, hints, out);
    answered++;
    return failed;
}

static int listen_here(unsigned *port)
{
    struct sockaddr_in here = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof here;
    int fd = socket(AF_INET, SOCK_STREAM, 0);
    assert_int_equal(bind(fd, (struct sockaddr *)&here, size), 0);
    assert_int_equal(listen(fd, 4), 0);
    assert_int_equal(getsockname(fd, (struct sockaddr *)&here, &size), 0);
    *port = ntohs(here.sin_port);
    return fd;
}

static enum helio_state state_of(const struct helio *h)
{
    struct helio_info info;
    helio_get_info(h, &info);
    return info.state;
}

static void wait_for(_Atomic int *count, int least)
{
    while (*count < least)
        hg_clock_sleep_ns(1000000);
}

static void test_a_look_up_does_not_block(void **state)
{
    (void)state;
    unsigned port;
    char url[64], first[8] = "";
    struct helio *h;
    struct hg_error err = {0};
    int fd = listen_here(&port);
    snprintf(url, sizeof url, "tcp:slow.test:%u", port);
    const int before = asked;
    assert_int_equal(helio_start(&(struct helio_options){.url = url}, &h, &err), HG_OK);
    wait_for(&asked, before + 1);
    assert_int_equal(helio_process(h, &err), HG_OK);
    assert_int_equal(helio_wait(h, SECOND / 20, &err), HG_E_TIMEOUT);
    assert_int_equal(state_of(h), HELIO_CONNECTING);
    struct pollfd p = {.fd = helio_fd(h), .events = POLLIN};
    assert_int_equal(poll(&p, 1, 0), 0);
    sem_post(&answer);
    assert_int_equal(poll(&p, 1, 60000), 1); // who polls sees that it is done
    while (state_of(h) == HELIO_CONNECTING)
        assert_int_equal(helio_wait(h, 60 * SECOND, &err), HG_OK);
    assert_int_equal(helio_flush(h, &err), HG_OK);
    int peer = accept(fd, NULL, NULL);
    assert_int_equal(recv(peer, first, 3, MSG_WAITALL), 3);
    assert_string_equal(first, "HGP");
    helio_destroy(h);
    close(peer);
    close(fd);
}

static void test_connecting_ends_in_time(void **state)
{
    (void)state;
    struct helio *h;
    struct hg_error err = {0};
    const struct helio_options options = {.url = "wss://slow.test", .timeout_ns = SECOND / 10};
    const int before = answered;
    assert_int_equal(helio_connect(&options, &h, &err), HG_E_TIMEOUT);
    assert_null(h);
    assert_int_equal(answered, before); // the thread still waits, for nothing
    sem_post(&answer);
    wait_for(&answered, before + 1);
}

static void test_unknown_hosts_are_told(void **state)
{
    (void)state;
    static const struct {
        const char *url;
        enum hg_status status;
    } rows[] = {{"tcp:none.test:7400", HG_E_CLOSED}, {"wss://none.test", HG_E_CLOSED},
        {"tcp:127.0.0.1:no-such-port", HG_E_INVAL}, {"tcp:none.test:no-such-port", HG_E_INVAL}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct helio *h;
        struct hg_error err = {0};
        assert_int_equal(
            helio_connect(&(struct helio_options){.url = rows[i].url}, &h, &err), rows[i].status);
        assert_string_equal(err.what, rows[i].url);
        assert_non_null(strstr(err.reason, "cannot find the host"));
    }
}

// No thread, and refused at once.
static void test_addresses_need_no_look_up(void **state)
{
    (void)state;
    unsigned port;
    char url[64];
    struct helio *h;
    struct hg_error err = {0};
    int fd = listen_here(&port);
    snprintf(url, sizeof url, "tcp://127.0.0.1:%u", port);
    assert_int_equal(helio_start(&(struct helio_options){.url = url}, &h, &err), HG_OK);
    struct sockaddr_storage there;
    socklen_t size = sizeof there;
    struct pollfd p = {.fd = helio_fd(h), .events = POLLOUT};
    assert_int_equal(poll(&p, 1, 60000), 1);
    assert_int_equal(getpeername(helio_fd(h), (struct sockaddr *)&there, &size), 0);
    helio_destroy(h);
    close(fd);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_look_up_does_not_block),
        cmocka_unit_test(test_connecting_ends_in_time),
        cmocka_unit_test(test_unknown_hosts_are_told),
        cmocka_unit_test(test_addresses_need_no_look_up),
    };
    sem_init(&answer, 0, 0);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
