// false_loader.c - a loader in hostile hands: whatever it answers, and however it breaks the rules,
// a load ends with an error. This program is the loader, too: it is started again in its place.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/clock.h"
#include "renderer/scene/load.h"
#include "server/loader/loader_client.h"
#include "server/loader/wire.h"

enum { LINK_FD = 3 };

// ---- the loader --------------------------------------------------------------------------------

static void send_socket(int fd)
{
    struct loader_spawned answer = {0};
    _Alignas(struct cmsghdr) char control[CMSG_SPACE(sizeof(int))] = {0};
    struct iovec part = {&answer, sizeof answer};
    struct msghdr message = {.msg_iov = &part,
        .msg_iovlen = 1,
        .msg_control = control,
        .msg_controllen = sizeof control};
    struct cmsghdr *head = CMSG_FIRSTHDR(&message);
    head->cmsg_level = SOL_SOCKET;
    head->cmsg_type = SCM_RIGHTS;
    head->cmsg_len = CMSG_LEN(sizeof(int));
    memcpy(CMSG_DATA(head), &fd, sizeof fd);
    (void)!sendmsg(LINK_FD, &message, MSG_NOSIGNAL);
}

// The request's name says what is done to the result, and what is answered.
static void lie(int fd, const char *name, int result)
{
    struct loader_reply reply = {0};
    uint8_t noise[4096];
    for (size_t i = 0; i < sizeof noise; i++)
        noise[i] = (uint8_t)(i * 167 + 13);
    if (strstr(name, "noise") || strstr(name, "longer"))
        (void)!write(result, noise, sizeof noise);
    reply.size = strstr(name, "noise") ? sizeof noise : strstr(name, "longer") ? UINT64_MAX : 0;
    if (strstr(name, "mapped")) { // which it could still write to
        reply.size = sizeof noise;
        if (ftruncate(result, sizeof noise) == 0)
            (void)mmap(NULL, sizeof noise, PROT_READ | PROT_WRITE, MAP_SHARED, result, 0);
    }
    if (strstr(name, "words")) { // without an end, of no language, of no status
        reply.status = 0xffffffff;
        memset(&reply.err, 0xfe, sizeof reply.err);
    }
    if (strstr(name, "ended")) {
        reply.ended = true;
        reply.how = -1;
    }
    if (strstr(name, "silent"))
        return;
    (void)!send(fd, &reply, strstr(name, "short") ? 3 : sizeof reply, MSG_NOSIGNAL);
}

static void serve(int fd)
{
    static struct loader_request request;
    _Alignas(struct cmsghdr) char control[CMSG_SPACE(2 * sizeof(int))];
    struct iovec part = {&request, sizeof request};
    struct msghdr message = {.msg_iov = &part,
        .msg_iovlen = 1,
        .msg_control = control,
        .msg_controllen = sizeof control};
    int fds[2] = {-1, -1};
    if (recvmsg(fd, &message, 0) <= 0)
        return;
    const struct cmsghdr *head = CMSG_FIRSTHDR(&message);
    if (head && head->cmsg_len == CMSG_LEN(sizeof fds))
        memcpy(fds, CMSG_DATA(head), sizeof fds);
    if (strstr(request.name, "gone"))
        close(fd);
    else
        lie(fd, request.name, fds[1]);
}

static int be_a_loader(void)
{
    char byte;
    int pair[2];
    while (recv(LINK_FD, &byte, 1, 0) == 1) {
        if (socketpair(AF_UNIX, SOCK_SEQPACKET, 0, pair) != 0)
            return 1;
        send_socket(pair[0]);
        close(pair[0]);
        serve(pair[1]); // which stays open unless it was closed
    }
    return 0;
}

// ---- the worker's side -------------------------------------------------------------------------

static enum hg_status give(
    void *user, const char *uri, uint64_t limit_bytes, struct hg_refbuf **out, struct hg_error *err)
{
    (void)limit_bytes;
    *out = strcmp(uri, user) == 0 ? hg_refbuf_create(100) : NULL;
    return *out ? HG_OK : hg_error_set(err, HG_E_NOTFOUND, uri, NULL, "there is no other file");
}

static void refused(const char *name, enum hg_status code, const char *reason)
{
    struct hg_asset *asset;
    struct hg_error err = {0};
    const enum hg_status status = hg_load_asset(&(struct hg_load_params){.path = name,
                                                    .asset_number = 1,
                                                    .scene_index = -1,
                                                    .fetch = give,
                                                    .fetch_user = (void *)(uintptr_t)name},
        &asset, &err);
    if (status != code || !strstr(err.reason, reason))
        fail_msg("%s: %s: %s", name, hg_status_name(status), err.reason);
    assert_null(asset);
    assert_string_equal(err.what, name);
}

static int become_the_loader(void **state)
{
    (void)state;
    char self[4096];
    const ssize_t n = readlink("/proc/self/exe", self, sizeof self - 1);
    assert_true(n > 0);
    self[n] = 0;
    return setenv("HELIO_LOADER", self, 1);
}

// A worker that ends without a file of a foreign format never starts helio-loader, which would load
// its libraries: the process that waited for it ends as one that cannot.
static void test_not_asked(void **state)
{
    (void)state;
    int how;
    const pid_t worker = fork();
    if (worker == 0) {
        struct hg_error err = {0};
        const struct loader_options options = {.sandbox = "off"};
        if (hg_loader_start(&options, &err) != HG_OK || close_range(LINK_FD, ~0u, 0) != 0)
            _exit(2);
        _exit(wait(&how) > 0 && WIFEXITED(how) && WEXITSTATUS(how) == 1 ? 0 : 3);
    }
    assert_true(worker > 0 && waitpid(worker, &how, 0) == worker);
    assert_true(WIFEXITED(how));
    assert_int_equal(WEXITSTATUS(how), 0);
}

static void test_lies(void **state)
{
    (void)state;
    struct hg_error err = {0};
    const struct loader_options options = {.timeout_s = 0.3, .sandbox = "off"};
    assert_int_equal(hg_loader_start(&options, &err), HG_OK);
    refused("empty.dae", HG_E_FORMAT, "unsound");
    refused("noise.dae", HG_E_FORMAT, "unsound");
    refused("longer.dae", HG_E_FORMAT, "broke the rules");
    refused("mapped.fbx", HG_E_FORMAT, "broke the rules");
    refused("words.fbx", HG_E_FORMAT, "?");
    refused("short.fbx", HG_E_FORMAT, "crashed");
    refused("ended.fbx", HG_E_FORMAT, "crashed");
    refused("gone.fbx", HG_E_FORMAT, "crashed");
    refused("silent.fbx", HG_E_LIMIT, "0.3 s");
    static const _Atomic bool stop = true; // nobody waits any more
    hg_isolate_watch(&stop);
    refused("silent.fbx", HG_E_CANCELLED, "cancelled");
    hg_isolate_watch(NULL);
}

int main(int argc, char **argv)
{
    if (argc > 1 && strcmp(argv[1], "--cpu") == 0)
        return be_a_loader();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_not_asked), cmocka_unit_test(test_lies)};
    return cmocka_run_group_tests_name("attack_false_loader", tests, become_the_loader, NULL);
}
