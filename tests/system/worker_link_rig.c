// worker_link_rig.c - see worker_link_rig.h.
#include "tests/system/worker_link_rig.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <errno.h>
#include <poll.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

extern char **environ;

int link_start_with(void **state, const char *const *options)
{
    struct rig *rig = calloc(1, sizeof *rig);
    int pair[2];
    const char *build = getenv("HELIO_BUILD_DIR");
    assert_non_null(build);
    snprintf(rig->path, sizeof rig->path, "%s/libexec/helio-worker", build);
    assert_true(test_folder_make(rig->root, "worker"));
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair), 0);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, pair[1], 3);
    char *argv[24] = {rig->path, "--fd", "3", "--asset-root", rig->root, "--log", "warn"};
    for (int i = 0; options[i]; i++)
        argv[7 + i] = (char *)(uintptr_t)options[i];
    assert_int_equal(posix_spawn(&rig->pid, rig->path, &actions, NULL, argv, environ), 0);
    posix_spawn_file_actions_destroy(&actions);
    close(pair[1]);
    rig->fd = pair[0];
    *state = rig;
    return 0;
}

int link_start(void **state)
{
    return link_start_with(state, (const char *[]){NULL});
}

char *link_cache_folder(char *path, size_t size)
{
    snprintf(path, size, "%s/tests", getenv("HELIO_BUILD_DIR"));
    return path;
}

// With a folder for what is large; on a disk, where the build is on one.
int link_start_with_cache(void **state)
{
    char folder[4200];
    return link_start_with(
        state, (const char *[]){"--cache-dir", link_cache_folder(folder, sizeof folder), NULL});
}

int link_start_with_limit(void **state)
{
    return link_start_with(state, (const char *[]){"--memory-limit", "1024", NULL});
}

static void forget_answer(struct rig *rig)
{
    free(rig->payload);
    rig->payload = NULL;
    hg_arena_finish(&rig->arena);
}

int link_stop(void **state)
{
    struct rig *rig = *state;
    int how;
    forget_answer(rig);
    close(rig->fd);
    // Closing the link is the order to end; the worker leaves cleanly.
    assert_int_equal(waitpid(rig->pid, &how, 0), rig->pid);
    assert_true(WIFEXITED(how));
    assert_int_equal(WEXITSTATUS(how), 0);
    assert_true(test_folder_remove(rig->root));
    free(rig);
    return 0;
}

int link_detach(void **state)
{
    for (uint32_t channel = 1; channel <= 3; channel++)
        link_ask(*state, channel, HGP_T_session_detach, &(struct hgp_session_detach){0});
    return 0;
}

void link_write(int fd, const void *data, size_t size)
{
    for (size_t done = 0; done < size;) {
        ssize_t n = send(fd, (const uint8_t *)data + done, size - done, MSG_NOSIGNAL);
        assert_true(n > 0 || errno == EINTR);
        done += n > 0 ? (size_t)n : 0;
    }
}

static void read_all(int fd, void *data, size_t size)
{
    for (size_t done = 0; done < size;) {
        struct pollfd p = {.fd = fd, .events = POLLIN};
        assert_int_equal(poll(&p, 1, ANSWER_TIMEOUT_MS), 1);
        ssize_t n = recv(fd, (uint8_t *)data + done, size - done, 0);
        assert_true(n > 0);
        done += (size_t)n;
    }
}

uint32_t link_ask(struct rig *rig, uint32_t channel, enum hgp_type type, const void *message)
{
    struct hg_writer w = {0};
    uint32_t request = ++rig->next_request;
    assert_int_equal(hgp_encode(&w, HGP_VERSION_MAX, (struct hgp_envelope){type, request, channel},
                         message, NULL),
        HG_OK);
    link_write(rig->fd, w.data, w.size);
    hg_writer_finish(&w);
    return request;
}

void link_read(struct rig *rig)
{
    uint8_t bytes[HGP_HEADER_BYTES];
    forget_answer(rig);
    read_all(rig->fd, bytes, sizeof bytes);
    assert_int_equal(hgp_header_decode(bytes, sizeof bytes, 1 << 28, &rig->header), HG_OK);
    rig->payload = malloc(rig->header.length + 1);
    read_all(rig->fd, rig->payload, rig->header.length);
    assert_int_equal(
        hgp_decode(HGP_VERSION_MAX, rig->header.type,
            hg_reader_make(rig->payload, rig->header.length), &rig->arena, &rig->message, NULL),
        HG_OK);
    if (rig->header.type != HGP_T_limited)
        return;
    rig->limited = rig->message.limited;
    snprintf(rig->limit, sizeof rig->limit, "%.*s", (int)rig->limited.limit.size,
        rig->limited.limit.data);
}

// Reads until the final answer of `request`; pulses, progress and notices pass by.
void link_expect(struct rig *rig, uint32_t request, enum hgp_type type)
{
    for (;;) {
        link_read(rig);
        if (rig->header.request == request && rig->header.type != HGP_T_progress &&
            rig->header.type != HGP_T_notice)
            break;
    }
    if (rig->header.type != type)
        fail_msg("message 0x%04x instead of 0x%04x: %.*s", rig->header.type, type,
            rig->header.type == HGP_T_error ? (int)rig->message.error.reason.size : 0,
            rig->message.error.reason.data);
}

void link_expect_error(struct rig *rig, uint32_t request, enum hg_status code, const char *where)
{
    link_expect(rig, request, HGP_T_error);
    assert_int_equal(rig->message.error.code, code);
    if (where) {
        assert_int_equal(rig->message.error.where.size, strlen(where));
        assert_memory_equal(rig->message.error.where.data, where, strlen(where));
    }
}

void link_attach(struct rig *rig, uint32_t channel, const char *scene)
{
    link_expect(rig,
        link_ask(rig, channel, HGP_T_session_attach,
            &(struct hgp_session_attach){.session = channel,
                .role = HGP_role_EDIT,
                .scene = hgp_str_make(scene),
                .first_id = FIRST_ID * channel,
                .id_count = ID_COUNT,
                .max_pixels = 1 << 24}),
        HGP_T_ok);
}
