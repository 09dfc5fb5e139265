#include "server/broker/notify.h"

#include <fcntl.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

enum { FIRST_SOCKET = 3, MAX_SOCKETS = 64 };

void hg_notify_send(const char *fmt, ...)
{
    const char *path = getenv("NOTIFY_SOCKET");
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    if (!path || (path[0] != '/' && path[0] != '@') || strlen(path) >= sizeof address.sun_path)
        return;
    char text[512];
    va_list args;
    va_start(args, fmt);
    int length = vsnprintf(text, sizeof text, fmt, args);
    va_end(args);
    if (length < 0)
        return;
    memcpy(address.sun_path, path, strlen(path));
    if (path[0] == '@')
        address.sun_path[0] = 0; // abstract name
    socklen_t size = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + strlen(path));
    int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0)
        return;
    size_t bytes = (size_t)length < sizeof text ? (size_t)length : sizeof text - 1;
    ssize_t sent = sendto(fd, text, bytes, MSG_NOSIGNAL, (const struct sockaddr *)&address, size);
    (void)sent; // a manager that does not listen is not our trouble
    close(fd);
}

// True when the variable is unset or names this process.
static bool is_for_us(const char *variable)
{
    const char *pid = getenv(variable);
    return !pid || strtol(pid, NULL, 10) == (long)getpid();
}

uint64_t hg_notify_watchdog_ns(void)
{
    const char *usec = getenv("WATCHDOG_USEC");
    if (!usec || !is_for_us("WATCHDOG_PID"))
        return 0;
    return strtoull(usec, NULL, 10) * 1000 / 2;
}

// Bits of those of the names, with colons between them, that are "tls".
static uint64_t named_tls(const char *names, int count)
{
    uint64_t bits = 0;
    for (int i = 0; i < count && names; i++) {
        const size_t length = strcspn(names, ":");
        bits |= length == 3 && strncmp(names, "tls", 3) == 0 ? UINT64_C(1) << i : 0;
        names = names[length] ? names + length + 1 : NULL;
    }
    return bits;
}

int hg_notify_take_sockets(uint64_t *tls)
{
    const char *count_text = getenv("LISTEN_FDS");
    int count = 0;
    if (count_text && getenv("LISTEN_PID") && is_for_us("LISTEN_PID"))
        count = (int)strtol(count_text, NULL, 10);
    if (count < 0 || count > MAX_SOCKETS)
        count = 0;
    for (int i = 0; i < count; i++) {
        fcntl(FIRST_SOCKET + i, F_SETFD, FD_CLOEXEC);
        fcntl(FIRST_SOCKET + i, F_SETFL, O_NONBLOCK | fcntl(FIRST_SOCKET + i, F_GETFL));
    }
    *tls = named_tls(getenv("LISTEN_FDNAMES"), count);
    unsetenv("LISTEN_FDS");
    unsetenv("LISTEN_PID");
    unsetenv("LISTEN_FDNAMES");
    return count;
}
