#include "tests/support/folder.h"
#include "tests/unit/client/harness.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <cmocka.h>

#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

extern char **environ;

void harness_begin(struct harness *h)
{
    *h = (struct harness){0};
    assert_true(test_folder_make(h->folder, "client"));
    setenv("HELIO", HELIO_PROGRAM, 1);
    setenv("PEER", FAKE_PEER, 1);
    setenv("HELIO_WORKER", FAKE_PEER, 1);
    setenv("HELIO_BENCH", FAKE_BENCH, 1);
    setenv("XDG_CACHE_HOME", h->folder, 1);
    unsetenv("HELIO_TOKEN");
    unsetenv("FAKE");
}

static void stop_server(struct harness *h)
{
    if (!h->server_pid)
        return;
    kill(h->server_pid, SIGKILL);
    waitpid(h->server_pid, NULL, 0);
    h->server_pid = 0;
}

void harness_end(struct harness *h)
{
    stop_server(h);
    assert_true(test_folder_remove(h->folder));
}

int harness_run(struct harness *h, const char *fmt, ...)
{
    char text[4096], command[4400];
    va_list args;
    va_start(args, fmt);
    vsnprintf(text, sizeof text, fmt, args);
    va_end(args);
    snprintf(command, sizeof command, "cd '%s' && { %s ; } </dev/null 2>&1", h->folder, text);
    FILE *out = popen(command, "r");
    assert_non_null(out);
    size_t n = fread(h->output, 1, sizeof h->output - 1, out);
    h->output[n] = 0;
    int how = pclose(out);
    return WIFEXITED(how) ? WEXITSTATUS(how) : 1000 + WTERMSIG(how);
}

void harness_serve(struct harness *h, const char *fake)
{
    char path[96], ready[16];
    int pipe_fd[2];
    pid_t pid;
    posix_spawn_file_actions_t actions;
    stop_server(h);
    snprintf(path, sizeof path, "%s/sock", h->folder);
    setenv("FAKE", fake, 1);
    assert_int_equal(pipe(pipe_fd), 0);
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, pipe_fd[1], 1);
    posix_spawn_file_actions_addchdir_np(&actions, h->folder);
    posix_spawn_file_actions_addclose(&actions, pipe_fd[0]);
    char *argv[] = {FAKE_PEER, "--listen", path, NULL};
    assert_int_equal(posix_spawn(&pid, FAKE_PEER, &actions, NULL, argv, environ), 0);
    posix_spawn_file_actions_destroy(&actions);
    close(pipe_fd[1]);
    assert_true(read(pipe_fd[0], ready, sizeof ready) > 0);
    close(pipe_fd[0]);
    h->server_pid = pid;
    unsetenv("FAKE");
}

void harness_write(const struct harness *h, const char *name, const void *data, size_t size)
{
    char path[160];
    snprintf(path, sizeof path, "%s/%s", h->folder, name);
    FILE *out = fopen(path, "wb");
    assert_non_null(out);
    assert_int_equal(fwrite(data, 1, size, out), size);
    assert_int_equal(fclose(out), 0);
}

bool harness_read(struct harness *h, const char *name)
{
    char path[160];
    snprintf(path, sizeof path, "%s/%s", h->folder, name);
    FILE *in = fopen(path, "rb");
    size_t n = in ? fread(h->output, 1, sizeof h->output - 1, in) : 0;
    h->output[n] = 0;
    if (in)
        fclose(in);
    return in != NULL;
}
