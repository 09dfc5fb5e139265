#include "tests/system/fake_tripwires.h"

#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "base/clock.h"

bool fake_trip(const char *kind, const char *name, bool stays)
{
    const char *folder = getenv("HELIO_FAKE_DIR");
    char path[1024];
    if (!folder)
        return false;
    snprintf(path, sizeof path, "%s/%s.%s", folder, kind, name);
    return stays ? access(path, F_OK) == 0 : unlink(path) == 0;
}

void fake_note(const char *name, const void *text, size_t size)
{
    const char *folder = getenv("HELIO_FAKE_DIR");
    char path[1024];
    if (!folder)
        return;
    snprintf(path, sizeof path, "%s/%s", folder, name);
    int fd = open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
    if (fd < 0)
        return;
    if (write(fd, text, size) != (ssize_t)size)
        fprintf(stderr, "fake_worker: cannot write %s\n", path);
    close(fd);
}

void fake_trip_message(struct fake_trip *t, const struct hgp_header *header)
{
    const char *name = hgp_find(header->type)->name;
    char count[128];
    snprintf(count, sizeof count, "count.%s", name);
    fake_note(count, ".", 1);
    if (fake_trip("die", name, false) || fake_trip("kill", name, true))
        kill(getpid(), SIGKILL);
    if (fake_trip("hang", name, false))
        t->hung = true;
    if (fake_trip("busy", name, false))
        t->busy_since_ns = hg_clock_now_ns();
}

bool fake_trip_sticks(struct fake_trip *t, const struct hgp_header *header)
{
    if (!fake_trip("stuck", hgp_find(header->type)->name, true))
        return false;
    t->busy = (struct hgp_busy){.channel = header->channel, .request = header->request};
    t->busy_since_ns = hg_clock_now_ns();
    return true;
}
